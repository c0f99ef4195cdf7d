"""The passport of an engine: which named law its contacts follow, kept per version and settings."""

from __future__ import annotations

import hashlib
import json
import shlex
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from dembench.atomic import write_json, write_text
from dembench.initial.cache import cache_directory
from dembench.runs.directory import RunRecord
from dembench.scene.base import Model
from dembench.verification.laws import LAWS, SCENE_LAW
from dembench.verification.passport.measure import (
    distances,
    friction,
    motion_of,
    nearest,
    pairs,
    restitution,
    scene,
    together,
)
from dembench.verification.passport.scenes import RESTITUTIONS, contact_time, of_family
from dembench.verification.rows import MEASURED

FILE = "passport.json"


class Passport(Model):
    """What was measured of the contacts of one engine.

    Attributes:
        version: Of this format.
        engine, engine_version: The engine.
        label: The engine with its settings as typed.
        settings: All its settings.
        law: Contact law that the engine says it computes; empty where it is the scene's own.
        date: Day of the run.
        fits: Name of the named law that fits best.
        fits_title: What that law is.
        distance: Distance to the law that fits best [-].
        scene_law: Name of the scene's law.
        scene_distance: Distance to the scene's law [-].
        distances: Distances to the named laws: by law, then by aspect [-].
        restitution: Restitution measured, by that of the pair law [-].
        friction: Effective friction in gross slip over that of the pair law, by the restitution of the pair law [-].
        run: Name of the run directory.
    """

    version: int = 1
    engine: str
    engine_version: str
    label: str
    settings: dict[str, Any]
    law: str
    date: str
    fits: str
    fits_title: str
    distance: float
    scene_law: str
    scene_distance: float
    distances: dict[str, dict[str, float]]
    restitution: dict[str, float]
    friction: dict[str, float]
    run: str

    def key(self) -> str:
        """Hash of what a passport is of: engine, version and settings."""
        text = json.dumps([self.engine, self.engine_version, self.settings], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def steps_per_contact(self) -> float | None:
        """Time steps of a contact that was measured [-]; None where the engine has no time step."""
        dt = self.settings.get("dt")
        return contact_time() / dt if isinstance(dt, int | float) and dt > 0 else None

    def speaks_for(self, engine: str, version: str, settings: Mapping[str, Any]) -> bool:
        """Whether it is of the same contacts as a run: its engine, version and settings that are words or switches.

        Settings that are numbers say how finely the engine computes, and many follow from the scene: tables have
        the steps per contact of both.
        """
        return (engine, version) == (self.engine, self.engine_version) and _kinds(settings) == _kinds(self.settings)


def passport(run: RunRecord) -> Passport | None:
    """The passport from a run of the scene of all pairs; None for another scene, and without a complete result.

    Raises:
        ValueError: The result does not hold what the scene asks for.
    """
    if run.spec.case != scene().name or run.status.state not in MEASURED or run.result is None:
        return None
    seen = motion_of(run.result)
    found = distances(seen)
    best = nearest(found)
    bounced, slid = restitution(pairs(), seen), friction(pairs(), seen) / pairs().friction
    names = [f"{e:g}" for e in RESTITUTIONS]
    return Passport(
        engine=run.spec.engine,
        engine_version=run.spec.engine_version,
        label=run.spec.label(),
        settings=run.spec.settings,
        law=run.spec.law,
        date=run.status.started[:10],
        fits=best.name,
        fits_title=best.title,
        distance=together(found[best.name]),
        scene_law=SCENE_LAW.name,
        scene_distance=together(found[SCENE_LAW.name]),
        distances={law.name: found[law.name] for law in LAWS},
        restitution=dict(zip(names, bounced[of_family("normal")].tolist(), strict=True)),
        friction=dict(zip(names, slid[of_family("sliding")].tolist(), strict=True)),
        run=run.name,
    )


def passports(runs: Sequence[RunRecord]) -> list[Passport]:
    """The passports of runs; one that cannot be made is left out with a warning."""
    found = []
    for run in runs:
        try:
            made = passport(run)
        except (ValueError, ArithmeticError, LookupError) as error:
            warnings.warn(f"{run.name}: no passport: {error}", stacklevel=2)
            continue
        if made is not None:
            found.append(made)
    return found


def keep(made: Sequence[Passport], directory: Path) -> Path:
    """Writes passports into one file of a directory, and each into the user's cache."""
    for one in made:
        _shelf().mkdir(parents=True, exist_ok=True)
        write_text(_shelf() / f"{one.engine}-{one.key()}.json", one.model_dump_json(indent=1) + "\n")
    path = directory / FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(path, [one.model_dump(mode="json") for one in made])
    return path


def kept(engine: str, version: str, settings: Mapping[str, Any]) -> Passport | None:
    """The passport in the user's cache that speaks for a run, the one of the latest day; None where there is none."""
    found = []
    for path in sorted(_shelf().glob("*.json")):
        try:
            one = Passport.model_validate_json(path.read_text())
        except (OSError, ValidationError) as error:
            warnings.warn(f"{path}: no readable passport: {error}", stacklevel=2)
            continue
        if one.speaks_for(engine, version, settings):
            found.append(one)
    return max(found, key=lambda one: one.date) if found else None


def command(choices: Iterable[tuple[str, Mapping[str, str]]]) -> str:
    """The command that measures the contact law of engines.

    Args:
        choices: Engines with their settings as typed; the time step is that of the passport's own scene.
    """
    typed: dict[str, None] = {}
    for engine, overrides in choices:
        words = ",".join(f"{name}={value}" for name, value in overrides.items() if name != "dt")
        typed[f"{engine}[{words}]" if words else engine] = None
    return shlex.join(["dembench", "passport", "--engines", ",".join(typed)])


def _shelf() -> Path:
    return cache_directory() / "passports"


def _kinds(settings: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in settings.items() if isinstance(value, str | bool)}
