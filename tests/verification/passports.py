"""Passports for tests: what an engine would get that computes a named law to the bit."""

from __future__ import annotations

from dembench.verification import laws
from dembench.verification.passport import measure, record


def passport(engine: str, version: str, settings: dict[str, object], law: str) -> record.Passport:
    """The passport of an engine that computes the law of that name."""
    found = measure.distances(measure.predicted()[law])
    return record.Passport(
        engine=engine,
        engine_version=version,
        label=engine,
        settings=settings,
        law="",
        date="2026-01-01",
        fits=law,
        fits_title=next(known.title for known in laws.LAWS if known.name == law),
        distance=0.0,
        scene_law="hertz-mindlin",
        scene_distance=measure.together(found["hertz-mindlin"]),
        distances=found,
        restitution={},
        friction={},
        run="r",
    )
