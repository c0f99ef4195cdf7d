"""What breaking looks like: classes that are decided from recorded observables with stated thresholds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from dembench.runs.directory import RunRecord
from dembench.verification.rows import MEASURED

Class = Literal[
    "stable",
    "energy growth",
    "tunnelling",
    "lost particles",
    "not a number",
    "no rebound",
    "refused",
    "died",
]
CLASSES: tuple[Class, ...] = get_args(Class)
BROKEN = CLASSES[1:]
GROWTH = 1.1
"""Kinetic energy after an impact over that before it from which on there is energy growth [-]."""
LATTICE_GROWTH = 2.0
"""Kinetic energy of a lattice at rest over that of its disturbance from which on there is energy growth [-]."""
REBOUND = 0.1
"""Share of the speed of rebound below which bodies do not rebound [-]."""
MEANING: dict[Class, str] = {
    "stable": "none of the others",
    "energy growth": f"kinetic energy above {GROWTH:g} times that before an impact, {LATTICE_GROWTH:g} times the "
    "disturbance of a lattice",
    "tunnelling": "bodies have changed sides",
    "lost particles": "bodies are missing, or outside the domain",
    "not a number": "a position or velocity is not finite",
    "no rebound": f"bodies part with less than {REBOUND:g} of the speed of rebound, or not at all",
    "refused": "the engine does not start with this step",
    "died": "the engine ended otherwise before the end",
}


@dataclass(frozen=True)
class Outcome:
    """What came of one cell at one step.

    Attributes:
        kind: Its class.
        energy: Kinetic energy at the end over that of the start, the largest on record for lattices [-]; None where it
            was not recorded.
        error: Difference of the restitution to the scene's, the largest of the phases [-]; None where it has none.
    """

    kind: Class
    energy: float | None = None
    error: float | None = None


def of_impact(energy: float, swapped: bool, parting: float, expected: float, error: float | None = None) -> Outcome:
    """The outcome of bodies that meet on a line.

    Args:
        energy: Kinetic energy after it over that before it [-].
        swapped: Whether two bodies have changed sides.
        parting: Speed at which the outer ones part [m/s].
        expected: The same as it should be [m/s]; 0 where only the sign is known.
        error: Error of the restitution [-].
    """
    kind: Class = "stable"
    if not math.isfinite(energy + parting):
        return Outcome("not a number")
    if energy > GROWTH:
        kind = "energy growth"
    elif swapped:
        kind = "tunnelling"
    elif parting <= REBOUND * expected:
        kind = "no rebound"
    return Outcome(kind, energy, error)


def of_lattice(energy: float) -> Outcome:
    """The outcome of a lattice at rest whose kinetic energy [-] is that of its disturbance at the start."""
    if not math.isfinite(energy):
        return Outcome("not a number")
    return Outcome("energy growth" if energy > LATTICE_GROWTH else "stable", energy)


def of_run(record: RunRecord) -> Class | None:
    """The class of a run that gave no complete result; None for one that has its result, or was not carried out."""
    status = record.status
    if status.state in MEASURED or status.state not in ("failed", "timeout"):
        return None
    named: dict[str, Class] = {"nan": "not a number", "lost particles": "lost particles", "energy": "energy growth"}
    if status.reason in named:
        return named[status.reason]
    if status.reason == "engine error" and status.frames == 0 and status.time == 0:
        return "refused"
    return "tunnelling" if status.reason == "tunnelling" else "died"
