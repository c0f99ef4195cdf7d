"""Faults planted into runs: engines that read other numbers, and engines that are slow.

As a program, `planting.py DECK` is that of the in-tree engines with the slow ones in their place.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from dembench.engines import in_tree_program, registry
from dembench.engines.base import Phase
from dembench.engines.peclet import Peclet
from dembench.engines.peclet_hertz import PecletHertz
from dembench.scene import PairLaw, Scene

SLOWDOWN = 1.2

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
