"""Steppers of scenes with shapes: soft-sphere law and impulses, one thread of the CPU, float64 throughout."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Scene, features
from dembench.solver.guard import SolverError
from dembench.solver.impulse.stepper import EVENT, MARGIN, SLOP, STILL
from dembench.solver.inspection import Touching
from dembench.solver.laws import LawOptions
from dembench.solver.pairs import PairTables
from dembench.solver.returns import CONTACT_OVERFLOW, NOT_FINITE, REBUILD
from dembench.solver.shapes.impulse import impulse_kernel
from dembench.solver.shapes.records import Contact, ShapeSet
from dembench.solver.shapes.rows import Row
from dembench.solver.shapes.soft import soft_kernel
from dembench.solver.state import State

SKIN = 0.2
"""Gap up to which bounding spheres are listed, in smallest diameters."""
SKIN_STEPS = 3
"""Steps of the fastest body that the lists of the impulse method hold at least."""


class _Stepper:
    """What both methods share: shapes, lists, and contacts that grow when a step needs more.

    Attributes:
        kernels: Kernels that must be loaded before the first step.
        shapes: The shapes and orientations of the bodies.
    """

    kernels: list[Any]

    def __init__(self, scene: Scene, state: State, dt: float):
        self.state, self.dt = state, dt / state.units.time
        self.shapes = ShapeSet(scene, state.units)
        self._tables = PairTables(scene, state.units, "float64", state.lookup)
        self._gravity = wp.vec3d(*(g / state.units.acceleration for g in scene.gravity))
        self._bodies = state.identity.numpy()[: state.total].copy()
        self._capacity = 256
        self._contacts = wp.zeros(2 * self._capacity, dtype=Contact, device="cpu")
        self._flags = wp.zeros(9, dtype=wp.int32, device="cpu")
        self._travel = wp.zeros(2, dtype=wp.float64, device="cpu")

    def advance(self, n: int, first: int) -> int:
        """Makes up to n steps beyond the `first` that are made; returns how many.

        Raises:
            SolverError: A velocity is not finite.
        """
        self._launch(n, first, self.dt)
        self._bodies = self.state.identity.numpy()[: self.state.total].copy()
        flags = self._flags.numpy()
        done, reason = int(flags[2]), int(flags[3])
        if reason == NOT_FINITE:
            raise SolverError("a velocity is not finite; the time step may be too large", reason="nan")
        if reason == REBUILD:
            self.relist(first + done + self._ahead)
        elif reason == CONTACT_OVERFLOW:
            self._grow()
        return done

    def largest_overlap(self) -> float:
        """Largest overlap of two bodies at a contact point, met in any step [scene units]."""
        return float(self._travel.numpy()[1])

    def counters(self) -> dict[str, float]:
        """Contact points of the last step."""
        return {"contact points": int(self._flags.numpy()[6])}

    def contacts(self) -> Touching:
        """The contact points of the last step that carry load, for those bodies that are still there."""
        side, count = int(self._flags.numpy()[5]), int(self._flags.numpy()[6])
        found = self._contacts.numpy()[side * self._capacity : side * self._capacity + count]
        place = np.full(self.state.limit + 1, -1)
        place[self.state.identity.numpy()[: self.state.total]] = np.arange(self.state.total)
        i = place[self._bodies[found["a"]]]
        j = np.where(found["b"] < 0, -1, place[self._bodies[found["b"]]])
        along = (found["force"] * found["n"]).sum(axis=1)
        kept = (i >= 0) & ((j >= 0) | (found["b"] < 0)) & (along != 0)
        found, i, j, along = found[kept], i[kept], j[kept], along[kept]
        return Touching(
            i=i,
            j=j,
            feature=found["feature"],
            normal=found["n"],
            overlap=-found["gap"],
            normal_force=along,
            tangential_force=found["force"] - along[:, None] * found["n"],
            energy=found["energy"],
            point=self.state.bodies.kin.numpy()[i, :3] + found["ra"],
        )

    def relist(self, steps: int) -> None:
        """Builds the lists of the state after some steps."""
        self.state.place_walls(steps * self.dt)
        self.state.rebuild()
        self._travel.numpy()[0] = 0.0

    def _grow(self) -> None:
        """Room for more contacts; those that stand there keep their places in their half."""
        capacity = int(1.5 * int(self._flags.numpy()[6])) + 64
        contacts = wp.zeros(2 * capacity, dtype=Contact, device="cpu")
        old, new = self._contacts.numpy(), contacts.numpy()
        for side in (0, 1):
            new[side * capacity : side * capacity + self._capacity] = old[
                side * self._capacity : (side + 1) * self._capacity
            ]
        self._contacts, self._capacity = contacts, capacity

    def _launch(self, steps: int, first: int, memory_dt: float) -> None:
        raise NotImplementedError


class SoftShapes(_Stepper):
    """Steps bodies of any shape with the scene's soft-sphere law.

    Args:
        scene: What is simulated.
        state: In float64, with one part.
        dt: Time step [s].
        law: Options of the law, in float64.
    """

    _ahead = 1
    """The lists that a step asks for are those at its end."""

    def __init__(self, scene: Scene, state: State, dt: float, law: LawOptions):
        super().__init__(scene, state, dt)
        state.skin = SKIN * state.diameter
        self.kernels = [soft_kernel(law, state.walls.options)]

    def prepare(self, first: int = 0) -> None:
        """Builds the lists and evaluates the forces after `first` steps, without growth of the contact springs."""
        self.relist(first)
        flags = self._flags.numpy()
        flags[4] = 1
        # the forces of a step are those at its end
        self._bodies = self.state.identity.numpy()[: self.state.total].copy()
        self._launch(0, first - 1, 0.0)
        while flags[3] == CONTACT_OVERFLOW:
            self._grow()
            self._launch(0, first - 1, 0.0)

    def _launch(self, steps: int, first: int, memory_dt: float) -> None:
        s, t = self.state, self._tables
        inputs = [steps, float(first), memory_dt, self.dt, self._gravity, s.total, s.identity]
        inputs += [s.walls.record, s.wall_speed, t.pairs, t.pair_columns, t.walls, t.wall_columns]
        inputs += [s.skin, self._capacity, s.pair_count, s.wall_count]
        outputs = [s.bodies, self.shapes.record, s.lists, self._contacts, self._flags, self._travel]
        wp.launch(self.kernels[0], dim=1, device="cpu", inputs=inputs, outputs=outputs)


class ImpulseShapes(_Stepper):
    """Steps bodies of any shape with rigid contacts: projected Gauss-Seidel on velocities, then a position pass.

    Args:
        scene: Its pair laws give restitution and friction; stiffness is not used.
        state: In float64, with one part.
        dt: Time step [s].
        velocity_sweeps, position_sweeps: Largest number of sweeps of each kind per step.
    """

    _ahead = 0
    """The lists that a step asks for are those at its start."""

    def __init__(self, scene: Scene, state: State, dt: float, velocity_sweeps: int, position_sweeps: int):
        super().__init__(scene, state, dt)
        self.kernels = [impulse_kernel(features(scene).friction, state.walls.options)]
        self.velocity_sweeps, self.position_sweeps = velocity_sweeps, position_sweeps
        self._fall = math.hypot(*self._gravity) * self.dt
        self._steps = 0
        self._rows = wp.zeros(self._capacity, dtype=Row, device="cpu")
        self._inertia = wp.zeros(max(1, state.total), dtype=wp.mat33d, device="cpu")
        self._start = wp.zeros(max(1, state.total), dtype=wp.vec3d, device="cpu")

    def prepare(self, first: int = 0) -> None:
        """Builds the lists of the state after `first` steps."""
        self.relist(first)

    def advance(self, n: int, first: int) -> int:
        """See `_Stepper.advance`."""
        done = super().advance(n, first)
        self._steps += done
        return done

    def counters(self) -> dict[str, float]:
        """Contact points of the last step, mean sweeps per step."""
        flags, steps = self._flags.numpy(), max(1, self._steps)
        return {
            **super().counters(),
            "velocity sweeps per step": int(flags[7]) / steps,
            "position sweeps per step": int(flags[8]) / steps,
        }

    def relist(self, steps: int) -> None:
        """Lists with room for the next steps at the present speeds."""
        s = self.state
        speed = np.linalg.norm(s.bodies.kin.numpy()[: s.total, 3:6], axis=1)
        reach = max(self.dt * float(speed.max(initial=0)) + self._fall * self.dt, self.dt * s.wall_speed)
        s.skin = max(SKIN * s.diameter, 2 * SKIN_STEPS * reach + MARGIN * s.diameter)
        super().relist(steps)

    def _grow(self) -> None:
        super()._grow()
        self._rows = wp.zeros(self._capacity, dtype=Row, device="cpu")

    def _launch(self, steps: int, first: int, memory_dt: float) -> None:
        s, t, d = self.state, self._tables, self.state.diameter
        inputs = [steps, float(first), self.dt, self._gravity, s.total, s.identity, s.walls.record, s.wall_speed]
        inputs += [t.pairs, t.pair_columns, t.walls, t.wall_columns, s.skin, self._capacity]
        inputs += [self.velocity_sweeps, self.position_sweeps]
        inputs += [EVENT * self._fall, STILL * EVENT * self._fall, MARGIN * d, SLOP * d, s.pair_count, s.wall_count]
        outputs = [s.bodies, self.shapes.record, s.lists, self._contacts, self._rows, self._inertia, self._start]
        wp.launch(self.kernels[0], dim=1, device="cpu", inputs=inputs, outputs=[*outputs, self._flags, self._travel])


def refuse_for_shapes(lists: str, threads: int) -> None:
    """Raises SolverError where the user asks for what scenes with shapes do not have."""
    if lists == "full":
        raise SolverError("lists 'full': scenes with shapes run on half lists and the CPU only; accepted is 'half'")
    if threads > 1:
        raise SolverError(f"threads {threads}: scenes with shapes run on one thread; accepted is 1")
