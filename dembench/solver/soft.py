"""The soft-sphere stepper: launches the step kernel and rebuilds the lists when it asks for it."""

from __future__ import annotations

from typing import Any

import warp as wp

from dembench.scene import Rigid, Scene, WallForce, features
from dembench.solver.contacts import StepOptions
from dembench.solver.guard import SolverError
from dembench.solver.hertz import advance_kernel
from dembench.solver.inspection import Touching
from dembench.solver.laws import LawOptions
from dembench.solver.pairs import PairTables
from dembench.solver.periodic import unsupported_boxes
from dembench.solver.returns import BIG_OVERFLOW, DONE, NOT_FINITE, REBUILD
from dembench.solver.soft_contacts import touching
from dembench.solver.state import State

SKIN = 0.2
"""Gap up to which pairs are listed, in smallest diameters."""
NEAR_SKIN = 0.01
"""Gap up to which listed pairs are tested in every step, in smallest diameters."""
BIG_SKIN = 0.5
"""Gap up to which bodies are candidates of a large body, in smallest diameters."""


class SoftSpheres:
    """Steps a state with the Hertz-Mindlin law.

    Attributes:
        kernels: Kernels that must be loaded before the first step.
    """

    def __init__(self, scene: Scene, state: State, dt: float, precision: str, midpoint: bool):
        self.state, self.dt = state, dt / state.units.time
        state.skin = SKIN * state.diameter
        self._options = step_options(scene, state, precision, midpoint)
        self.kernels = [advance_kernel(self._options)]
        self._tables = PairTables(scene, state.units, precision, state.lookup)
        self._gravity = wp.vec3d(*(g / state.units.acceleration for g in scene.gravity))
        self._flags = wp.zeros(5, dtype=wp.int32, device="cpu")
        self._travel = wp.zeros(4 + 4 * state.parts, dtype=wp.float64, device="cpu")
        self._overlap = 0.0

    def prepare(self, first: int = 0) -> None:
        """Builds the lists and evaluates the forces after `first` steps, without growth of the contact springs."""
        self.relist(first)
        self.state.loads().zero_()
        flags = self._flags.numpy()
        flags[4] = 1
        # the forces of a step are those at its end
        self._launch(0, first - 1, 0.0)
        while flags[3] == BIG_OVERFLOW:
            self._grow_big()
            self._launch(0, first - 1, 0.0)

    def advance(self, n: int, first: int) -> int:
        """Makes up to n steps beyond the `first` that are made; returns how many.

        Raises:
            SolverError: A velocity is not finite.
        """
        self._launch(n, first, self.dt)
        flags = self._flags.numpy()
        done, reason = int(flags[2]), int(flags[3])
        if reason == NOT_FINITE:
            raise SolverError("a velocity is not finite; the time step may be too large", reason="nan")
        if reason == REBUILD:
            self.relist(first + done + 1)
        elif reason == BIG_OVERFLOW:
            self._grow_big()
        elif reason == DONE and done == 0:
            raise SolverError("the solver makes no progress")
        return done

    def largest_overlap(self) -> float:
        """Largest overlap of two bodies met in any step [scene units]."""
        return self._overlap

    def contacts(self) -> Touching:
        """Contacts of the present state."""
        return touching(self._options, self.state, self._tables, self.dt)

    def counters(self) -> dict[str, float]:
        """Figures of this stepper beside those of the state."""
        return {}

    def relist(self, steps: int) -> None:
        """Builds the lists of the state after some steps."""
        self.state.place_walls(steps * self.dt)
        self.state.rebuild()
        self._travel.numpy()[:3] = 0.0, -1.0, -1.0

    def _grow_big(self) -> None:
        self.state.grow_big()
        self._travel.numpy()[2] = -1.0

    def _launch(self, steps: int, first: int, memory_dt: float) -> None:
        s, t = self.state, self._tables

        def one(part: int) -> None:
            inputs = [part, s.parts, steps, float(first), memory_dt, self.dt, self._gravity, s.ranges, s.n, s.total]
            inputs += [s.walls.record, s.wall_speed, t.pairs, t.pair_columns, t.walls, t.wall_columns]
            inputs += [s.skin, NEAR_SKIN * s.diameter, BIG_SKIN * s.diameter]
            inputs += [s.base, s.wall_capacity, s.big_capacity, s.pair_count, s.wall_count]
            outputs = [s.bodies, s.lists, s.near_count, self._flags, self._travel]
            wp.launch(self.kernels[0], dim=1, device="cpu", inputs=inputs, outputs=outputs)

        s.each_part(one)
        self._overlap = max(self._overlap, float(self._travel.numpy()[7::4].max()))


def unsupported(scene: Scene) -> list[str]:
    """What of a scene the soft-sphere solver cannot do, one line each."""
    found = unsupported_features(scene)
    if isinstance(scene.law, Rigid):
        found.append(f"contact law {scene.law.kind}")
    return found


def unsupported_features(scene: Scene) -> list[str]:
    """Features that neither solver has, one line each."""
    has = features(scene)
    found = unsupported_boxes(scene)
    if has.shapes and has.rolling_friction:
        found.append("rolling friction of bodies that are no spheres")
    if has.shapes and has.periodic:
        found.append("periodic domains with bodies that are no spheres")
    if has.shapes and any(isinstance(seen, WallForce) for seen in scene.observables):
        found.append("wall forces of bodies that are no spheres")
    return found


def step_options(scene: Scene, state: State, precision: str, midpoint: bool) -> StepOptions:
    """What of the soft-sphere step a scene needs."""
    needs = state.needs
    return StepOptions(
        law=LawOptions.of(scene, needs, precision, midpoint),
        pairs=state.lookup,
        alike=state.alike(),
        walls=state.walls.options,
        bigs=state.big_rows > 0,
        periodic=state.periodic,
        rotation=needs.rotation,
        radii=needs.radii,
        threads=state.parts > 1,
    )


def load(device: str, *kernels: Any) -> None:
    """Compiles kernels for a device, or loads them from the cache."""
    target = wp.get_device(device)
    for kernel in kernels:
        kernel.module.load(target, 1 if target.is_cpu else 256)
