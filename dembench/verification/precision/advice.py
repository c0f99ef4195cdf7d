"""Which setting to take for a scene that was never swept: that of the nearest problem which was."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dembench.scene import Scene
from dembench.share import share
from dembench.verification.precision import knobs, store
from dembench.verification.precision.levels import Cheapest, cheapest_settings
from dembench.verification.precision.store import Problem, Sweep
from dembench.verification.precision.targets import problem_of

COLUMNS = ("engine", "error", "setting", "step here", "cost there")
FAR = 1.0
"""Distance of two problems beyond which the sweep of one says nothing about the other."""
WEIGHTS = {"features": 2.0, "softness": 1.0, "restitution": 0.5, "bodies": 0.1}
"""Weights of the parts of a distance: share of features that only one has, decades of softness, difference of the
coefficients of restitution, decades of bodies."""


@dataclass(frozen=True)
class Row:
    """What to take for one engine and level.

    Attributes:
        variant: The engine.
        level: Error that is reached.
        setting: Value of the knob, in words; empty where the level was not reached.
        dt: Time step that this means on the scene [s]; None where it is not known.
        cost: Loop time of the point in the sweep, in words.
        limit: Where the level was not reached: what stood in the way.
    """

    variant: str
    level: str
    setting: str
    dt: float | None
    cost: str
    limit: str

    def texts(self) -> tuple[str, ...]:
        """As a row of a table."""
        step = f"{self.dt:.3g} s" if self.dt is not None else "-"
        return (self.variant, self.level, self.setting or f"not reached: {self.limit}", step, self.cost)


@dataclass(frozen=True)
class Advice:
    """What was found.

    Attributes:
        scene: The scene as typed.
        sweep: The nearest sweep; None where none fits.
        path: Where it lies.
        distance: How far its problem is from the scene.
        why: What the two differ in, or why none fits.
        rows: What to take.
        notes: What to know.
    """

    scene: str
    sweep: Sweep | None
    path: Path | None
    distance: float
    why: str
    rows: tuple[Row, ...] = ()
    notes: tuple[str, ...] = field(default=())

    def sentence(self) -> str:
        """Where the advice comes from."""
        if self.sweep is None or self.path is None:
            return f"No advice for {self.scene}: {self.why}"
        return (
            f"From the sweep of {self.sweep.target} over {self.sweep.knob} ({self.path}, {self.sweep.made}): {self.why}"
        )

    def plain(self) -> dict[str, Any]:
        """As JSON data."""
        return {
            "scene": self.scene,
            "sweep": str(self.path) if self.path else None,
            "target": self.sweep.target if self.sweep else None,
            "distance": self.distance if math.isfinite(self.distance) else None,
            "why": self.why,
            "rows": [vars(row) for row in self.rows],
            "notes": list(self.notes),
        }


def advise(scene: Scene, name: str, directory: Path, engines: Sequence[str], makes: str) -> Advice:
    """Advice for a scene, from the sweeps in a directory and those that ship.

    Of equally near sweeps one of the time step comes first, then one in the directory.

    Args:
        scene: The scene.
        name: The problem in words.
        directory: Directory of sweeps.
        engines: Engines to advise on; empty for all that were swept.
        makes: Command that sweeps the scene itself.
    """
    known = store.find(directory) + store.find(_shipped())
    if not known:
        return Advice(name, None, None, math.inf, f"{directory} holds no sweep; `{makes}` makes one")
    here = problem_of(scene, name)
    ranked = sorted(
        ((*distance(here, one.problem), one.knob != knobs.DT, path, one) for path, one in known),
        key=lambda entry: (entry[0], entry[2]),
    )
    far, why, _, path, nearest = ranked[0]
    if far > FAR:
        why = f"the nearest sweep, {nearest.target} ({path}), is of another kind: {why}; `{makes}` makes one of its own"
        return Advice(name, None, None, far, why)
    rows = [
        _row(scene, nearest, one)
        for one in cheapest_settings(nearest)
        if not engines or one.variant.partition("[")[0] in engines
    ]
    return Advice(name, nearest, path, far, why or "the same kind of problem", tuple(rows), nearest.notes)


def distance(here: Problem, there: Problem) -> tuple[float, str]:
    """How far two problems are apart, and in what they differ, in words; infinite between different laws."""
    if here.law != there.law:
        return math.inf, f"its law is {there.law}, not {here.law}"
    own, other = set(here.features), set(there.features)
    apart = len(own ^ other) / max(1, len(own | other))
    softness = abs(math.log10(here.softness / there.softness)) if here.softness and there.softness else 0.0
    bodies = abs(math.log10(max(1, here.bodies) / max(1, there.bodies)))
    damped = abs(here.restitution - there.restitution)
    parts = {"features": apart, "softness": softness, "restitution": damped, "bodies": bodies}
    words = []
    if own ^ other:
        words.append(f"features {', '.join(sorted(own ^ other))} in one of them only")
    if softness > 0.3:
        words.append(f"expected overlaps {here.softness:.2g} of a radius here, {there.softness:.2g} there")
    if damped > 0.1:
        words.append(f"restitution {here.restitution:g} here, {there.restitution:g} there")
    if bodies > 0.5:
        words.append(f"{here.bodies} bodies here, {there.bodies} there")
    return sum(WEIGHTS[part] * value for part, value in parts.items()), "; ".join(words)


def _shipped() -> Path:
    """Directory of the sweeps that ship with the package; one that is not there holds none."""
    try:
        return share("data", "advice")
    except FileNotFoundError:
        return Path("data/advice")


def _row(scene: Scene, sweep: Sweep, one: Cheapest) -> Row:
    if one.point is None:
        return Row(one.variant, one.level, "", None, "", one.limit)
    setting = sweep.words(one.value) or "as it is"
    if one.point.law:
        setting += f"; another law: {one.point.law}"
    return Row(one.variant, one.level, setting, _step(scene, sweep, one), one.cost(), "")


def _step(scene: Scene, sweep: Sweep, one: Cheapest) -> float | None:
    """Time step on the scene: the factor of the sweep times the scene's step of the closed division [s]."""
    if sweep.knob != knobs.DT:
        return None
    return scene.fitted_step(scene.closed_step() * float(one.value))
