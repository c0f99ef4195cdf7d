"""The stability suite: stiff, extreme and degenerate scenes, with what must happen in each."""

from __future__ import annotations

from dembench.verification.checks import Suite
from dembench.verification.stability import (
    audits,
    chains,
    contrast,
    degenerate,
    fast_impacts,
    gas,
    limits,
    overlaps,
    statics,
    stick_slip,
    stiffness,
    walls,
)

SECTIONS = (
    stiffness,
    contrast,
    fast_impacts,
    overlaps,
    limits,
    gas,
    degenerate,
    statics,
    stick_slip,
    chains,
    walls,
    audits,
)

NOT_POSED = {
    "D11 with a limit of the speed": "no scene asks soft spheres to part slowly",
    "D19 with three whole layers at 1.3 sqrt(g/R)": "with mu = 0.8 Coulomb's law holds what lies within 1.1 d of "
    "the mantle",
    "D23": "a scene refuses numbers that are not finite, with the particle named, before any engine sees them",
    "D32": "spheres that roll on each other make an arch a mechanism, which no friction holds; the silo is a bulk case",
    "D25 with 1e7": "memory of the usual machine",
    "D38": "suite sanity, SP5",
    "D42, second half": "CPU against GPU needs a GPU",
}
"""Entries of the catalogue that no scene poses, with the reason."""


def suite() -> Suite:
    """The suite."""
    missing = "; ".join(f"{entry} ({why})" for entry, why in NOT_POSED.items())
    return Suite(
        name="stability",
        title="Stability: stiff, extreme and degenerate scenes",
        text="What must not happen: energy from nowhere, walls passed through, lost particles, numbers that are none. "
        "An engine that dies or refuses is an answer. Not posed: " + missing + ".",
        source="catalogue of stiff and extreme cases D1 to D42 of this project; the source of every number stands in "
        "its row",
        experiments=tuple(experiment for section in SECTIONS for experiment in section.experiments()),
    )
