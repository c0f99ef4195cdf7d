"""Faults planted into runs: scenes that answer to each of them, engines that read other numbers, engines that are slow.

As a program, `planting.py DECK` is that of the in-tree engines with the slow ones in their place.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from dembench.engines import in_tree_program, registry
from dembench.engines.base import Phase
from dembench.engines.peclet import Peclet
from dembench.engines.peclet_hertz import PecletHertz
from dembench.results import Result
from dembench.scene import (
    Bodies,
    Domain,
    HertzMindlin,
    Material,
    PairLaw,
    Plane,
    Scene,
    Snapshot,
    Species,
)
from dembench.verification.checks import Check, Suite, on_one_scene

SLOWDOWN = 1.2
RADIUS, DENSITY, YOUNG, POISSON = 1e-3, 2500.0, 1e7, 0.25
RESTITUTION, FRICTION, GRAVITY = 0.6, 0.3, 9.81
SPEED, SLIDE, DURATION = 0.5, 0.4, 0.02
MASS = 4 / 3 * math.pi * RADIUS**3 * DENSITY

Fault = Callable[[Scene], Scene]


def _pairs(scene: Scene, **factors: float) -> Scene:
    def changed(pair: PairLaw) -> PairLaw:
        return pair.model_copy(update={name: getattr(pair, name) * factor for name, factor in factors.items()})

    return scene.model_copy(update={"pair_laws": tuple(changed(pair) for pair in scene.pair_laws)})


def _stiffer(scene: Scene) -> Scene:
    materials = tuple(m.model_copy(update={"young": 1.05 * m.young}) for m in scene.materials)
    return scene.model_copy(update={"materials": materials})


FAULTS: dict[str, Fault] = {
    "g": lambda scene: scene.model_copy(update={"gravity": tuple(1.02 * g for g in scene.gravity)}),
    "e": lambda scene: _pairs(scene, restitution=0.98),
    "mu": lambda scene: _pairs(scene, friction=1.02),
    "E": _stiffer,
}
"""Errors of 2 % in g, e and mu and of 5 % in E."""
ANSWERS = {"g": "PL1", "e": "PL2", "mu": "PL3", "E": "PL4"}
"""The check that is made for each of them."""


# ---- a suite that answers


def scene() -> Scene:
    """A grain that falls (0), two that meet head-on (1, 2), one that slides (3), two elastic ones that meet (4, 5)."""
    gap = 1.01 * RADIUS
    return Scene(
        name="planted",
        law=HertzMindlin(),
        materials=(
            Material(name="dull", density=DENSITY, young=YOUNG, poisson=POISSON),
            Material(name="bright", density=DENSITY, young=YOUNG, poisson=POISSON),
        ),
        pair_laws=(
            PairLaw(a="dull", b="dull", restitution=RESTITUTION, friction=FRICTION),
            PairLaw(a="dull", b="bright", restitution=RESTITUTION, friction=FRICTION),
            PairLaw(a="bright", b="bright", restitution=1.0, friction=FRICTION),
        ),
        species=tuple(Species(name=name, material=name, radius=RADIUS) for name in ("dull", "bright")),
        walls=(Plane(name="floor", material="dull", point=(0, 0, 0), normal=(0, 0, 1)),),
        bodies=Bodies(
            position=[
                [0, 0, 0.02],
                [-gap, 0.01, 0.02],
                [gap, 0.01, 0.02],
                [0, 0.02, RADIUS],
                [-gap, 0.03, 0.02],
                [gap, 0.03, 0.02],
            ],
            velocity=[
                [0, 0, 0],
                [SPEED / 2, 0, 0],
                [-SPEED / 2, 0, 0],
                [SLIDE, 0, 0],
                [2 * SPEED, 0, 0],
                [-2 * SPEED, 0, 0],
            ],
            species=[0, 0, 0, 0, 1, 1],
        ),
        domain=Domain(lower=(-0.1, -0.1, -0.1), upper=(0.1, 0.1, 0.1)),
        gravity=(0, 0, -GRAVITY),
        duration=DURATION,
        time_step=1e-6,
        observables=(Snapshot(name="motion", times=(*(k * 2e-6 for k in range(61)), DURATION)),),
    )


def measure(result: Result) -> Mapping[str, float]:
    """Fall, restitution, loss of speed by friction, and largest overlap of the elastic pair on record."""
    seen = result.snapshots["motion"]
    first, last, velocity = seen.position[0, :, 2], seen.position[-1, :, 2], seen.velocity[-1, :, 0]
    apart = seen.position[:, 5, 0] - seen.position[:, 4, 0]
    return {
        "PL1": first[0] - last[0],
        "PL2": (velocity[2] - velocity[1]) / SPEED,
        "PL3": SLIDE - velocity[3],
        "PL4": 2 * RADIUS - float(apart.min()),
    }


def suite() -> Suite:
    """The suite of that scene."""
    modulus, reduced = YOUNG / (2 * (1 - POISSON**2)), RADIUS / 2
    deepest = (15 * (MASS / 2) * (4 * SPEED) ** 2 / (16 * math.sqrt(reduced) * modulus)) ** 0.4
    checks = (
        Check("PL1", "free fall", "m", GRAVITY * DURATION**2 / 2, 1e-5, "g t^2/2"),
        Check("PL2", "head-on restitution", "1", RESTITUTION, 0.04, "restitution that was set"),
        Check("PL3", "speed lost by sliding", "m/s", FRICTION * GRAVITY * DURATION, 1e-3, "Coulomb: mu g t"),
        Check("PL4", "deepest overlap of an elastic impact", "m", deepest, 0.03 * deepest, "Hertz"),
    )
    experiments = (on_one_scene("planted", "One scene for g, e, mu and E", scene, measure, checks),)
    return Suite("planted", "Planted faults", "", "closed forms", experiments)


# ---- engines that read other numbers, or take longer


def misreading(engine: type[Any], fault: Fault) -> Callable[..., list[Phase]]:
    """The `write` of an engine that puts another scene into the deck than it was given."""
    write = engine.write

    def written(self: Any, scene: Scene, settings: Any, directory: Path) -> list[Phase]:
        return list(write(self, fault(scene), settings, directory))

    return written


class _Slow:
    """A simulation whose steps take longer: CPU time is burnt after them."""

    def __init__(self, simulation: Any) -> None:
        self._simulation = simulation

    def __getattr__(self, name: str) -> Any:
        return getattr(self._simulation, name)

    def step(self, n: int = 1, progress: Callable[[int], None] | None = None) -> None:
        begin = time.process_time()
        self._simulation.step(n, progress)
        until = begin + SLOWDOWN * (time.process_time() - begin)
        while time.process_time() < until:
            pass


class _SlowProgram:
    def write(self, scene: Scene, settings: Any, directory: Path) -> list[Phase]:
        (phase,) = super().write(scene, settings, directory)  # type: ignore[misc]
        return [phase.model_copy(update={"command": (sys.executable, str(Path(__file__).resolve()), ".")})]

    def simulation(self, scene: Scene, settings: dict[str, Any]) -> Any:
        return _Slow(super().simulation(scene, settings))  # type: ignore[misc]


class SlowPeclet(_SlowProgram, Peclet):
    """The impulse solver, slowed down."""


class SlowPecletHertz(_SlowProgram, PecletHertz):
    """The soft-sphere solver, slowed down."""


SLOW = {"peclet": "planting:SlowPeclet", "peclet-hertz": "planting:SlowPecletHertz"}
"""The slow engines by the names of the others, whose place they take."""


if __name__ == "__main__":
    sys.modules["planting"] = sys.modules["__main__"]
    registry.BUILT_IN.update(SLOW)
    in_tree_program.main()
