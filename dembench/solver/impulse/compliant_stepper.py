"""The stepper of compliant rows: the soft-sphere law in an impulse solver, launched for many steps at a time."""

from __future__ import annotations

import numpy as np
import warp as wp

from dembench.scene import Rigid, Scene, features
from dembench.solver.body_arrays import BodyArrays
from dembench.solver.guard import SolverError
from dembench.solver.impulse.compliant_contacts import Segment, count_open, touching
from dembench.solver.impulse.compliant_rows import (
    FLAGS,
    PER_SEGMENT,
    PER_THREAD,
    TRAVEL,
    A,
    B,
    C,
    CompliantOptions,
    compliant_types,
)
from dembench.solver.impulse.compliant_step import compliant_kernel
from dembench.solver.inspection import Touching
from dembench.solver.lanes import LANES
from dembench.solver.laws import LawOptions
from dembench.solver.pairs import PairTables
from dembench.solver.returns import BIG_OVERFLOW, NOT_FINITE, REBUILD, ROW_OVERFLOW
from dembench.solver.soft import unsupported_features
from dembench.solver.state import State

SKIN, SKIN_SUBSTEPS, SKIN_LIMIT = 0.2, 24, 0.5
"""Gap up to which pairs are listed: at least SKIN smallest diameters; room for SKIN_SUBSTEPS substeps of the fastest
body, but not more than SKIN_LIMIT diameters for it: long lists cost more memory than rebuilds time."""
NEAR_SKIN = 0.03
"""Gap up to which listed pairs are tested in every substep: at least this, in smallest diameters."""
ROOM, MORE = 1.1, 8
"""Blocks of rows that there is room for where there was not enough: this part of what was needed, and so many more."""
BIG_SKIN = 0.5
"""Gap up to which bodies are candidates of a large body: at least this, in smallest diameters."""


class CompliantImpulses:
    """Steps a state with the scene's soft-sphere law in implicit rows, several substeps per step.

    Args:
        scene: Its law and pair laws.
        state: With a part for each thread.
        dt: Time step [s].
        precision: "float32" or "float64".
        substeps: Substeps per step; None chooses them by the stiffness of the contacts of each step.
        sweeps: Sweeps per substep.

    Attributes:
        driven: Whether the load of the bodies, force and torque, acts on them in every substep.
        kernels: Kernels that must be loaded before the first step.
    """

    def __init__(self, scene: Scene, state: State, dt: float, precision: str, substeps: int | None, sweeps: int):
        self.state, self.dt = state, dt / state.units.time
        self.substeps, self.sweeps = substeps or 0, sweeps
        self.driven = False
        self._options = options = compliant_options(scene, state, precision)
        self.kernels = [compliant_kernel(options)]
        self._rows = compliant_types(precision)()
        self._tables = PairTables(scene, state.units, precision, state.lookup)
        self._gravity = wp.vec3d(*(g / state.units.acceleration for g in scene.gravity))
        self._flags = wp.zeros(FLAGS + PER_SEGMENT * (state.parts + 1), dtype=wp.int32, device="cpu")
        self._travel = wp.zeros(TRAVEL + PER_THREAD * state.parts, dtype=wp.float64, device="cpu")
        self._steps = 0
        self._room = self._others = np.full(state.parts + 1, MORE)
        self._allocate()

    def prepare(self, first: int = 0) -> None:
        """Builds the lists of the state after `first` steps; springs grow again from the next substep on."""
        self._rebuild(first * self.dt)
        self._travel.numpy()[7] = 0.0

    def relist(self, first: int) -> None:
        """Builds the lists of the state after `first` steps."""
        self._rebuild(first * self.dt)

    def advance(self, n: int, first: int) -> int:
        """Makes up to n steps beyond the `first` that are made; returns how many.

        Raises:
            SolverError: A velocity is not finite.
        """
        s, t, d = self.state, self._tables, self.state.diameter

        def one(part: int) -> None:
            inputs = [part, s.parts, n, self.substeps, self.sweeps, int(self.driven), float(first), self.dt]
            inputs += [self._gravity, s.ranges, s.n, s.total]
            inputs += [s.walls.record, s.wall_speed, t.pairs, t.pair_columns, t.walls, t.wall_columns]
            inputs += [s.skin, NEAR_SKIN * d, BIG_SKIN * d, s.base, s.wall_capacity, s.big_capacity, self._row_base]
            inputs += [s.pair_count, s.wall_count]
            outputs = [s.bodies, s.lists, self._rows, s.near_count, self._flags, self._travel]
            wp.launch(self.kernels[0], dim=1, device="cpu", inputs=inputs, outputs=outputs)

        s.each_part(one)
        flags, travel = self._flags.numpy(), self._travel.numpy()
        done, reason, left = int(flags[2]), int(flags[3]), int(flags[5])
        self._steps += done
        if reason == NOT_FINITE:
            raise SolverError("a velocity is not finite", reason="nan")
        if reason == REBUILD:
            into = self.dt - left * travel[6] if left else 0.0
            self._rebuild((first + done) * self.dt + into)
        elif reason == BIG_OVERFLOW:
            s.grow_big()
            travel[2] = -1.0
        elif reason == ROW_OVERFLOW:
            other, end = flags[FLAGS:].reshape(-1, PER_SEGMENT).T
            self._room = (ROOM * (end - self._row_base.numpy()[:-1])).astype(int) + MORE
            self._others = (ROOM * (end - other)).astype(int) + MORE
            self._allocate()
        return done

    def largest_overlap(self) -> float:
        """Largest overlap at the start of a substep [scene units]."""
        return float(self._travel.numpy()[TRAVEL + PER_THREAD - 1 :: PER_THREAD].max())

    def counters(self) -> dict[str, float]:
        """Rows of the last substep; fewest, mean and most substeps of a step."""
        flags, travel = self._flags.numpy(), self._travel.numpy()
        return {
            "rows": count_open(self._segments(), self._rows),
            "fewest substeps of a step": int(flags[8]),
            "mean substeps of a step": float(travel[8]) / max(1, self._steps),
            "most substeps of a step": int(flags[9]),
        }

    def contacts(self) -> Touching:
        """Contacts with the forces of the last substep; none before the first step and after a change from outside."""
        made = float(self._travel.numpy()[7])
        return touching(self._options, self._segments(), self.state, self._rows, made)

    def _segments(self) -> list[Segment]:
        """Where the rows of the last substep stand."""
        begin, marks = self._row_base.numpy(), self._flags.numpy()[FLAGS:].reshape(-1, PER_SEGMENT)
        constants = self._rows.c_base.numpy() if self._options.shared else marks[:, 0]
        return [
            Segment(int(begin[k]), int(m[0]), int(m[1]), k < self.state.parts, int(constants[k]))
            for k, m in enumerate(marks)
        ]

    def _rebuild(self, time: float) -> None:
        """Lists with room for the next substeps at the present speeds, at a time [scene units]."""
        s, travel = self.state, self._travel.numpy()
        reach = float(travel[9])
        s.skin = max(SKIN * s.diameter, min(SKIN_SUBSTEPS * reach, SKIN_LIMIT * s.diameter), 4 * reach)
        s.place_walls(time)
        # rows refer to an order that is about to go, and a rebuild takes their memory
        for name in self._rows._cls.vars:
            setattr(self._rows, name, None)
        s.rebuild()
        travel[:3] = 0.0, -1.0, -1.0
        self._allocate()

    def _allocate(self) -> None:
        """Room for the blocks of rows of every segment; there are none yet."""
        s, rows, real = self.state, self._rows, self.state.types.real
        self._row_base = wp.array(np.append(0, np.cumsum(self._room)), dtype=wp.int32, device="cpu")
        blocks = constants = int(self._room.sum())
        rows.c_base = wp.zeros_like(self._row_base)
        if self._options.shared:
            rows.c_base.assign(np.append(1, 1 + np.cumsum(self._others)))
            constants = 1 + int(self._others.sum())
        fixed, lanes = s.total + s.parts, blocks * LANES
        rows.i, rows.j, rows.slot, rows.a, rows.b, rows.c, rows.u, rows.mask, rows.stamp = s.workspace.arrays(
            *((lanes, wp.int32) for _ in range(3)),
            *((n, real) for n in (A * lanes, B * lanes, C * constants * LANES)),
            (fixed, s.types.vec8),
            (fixed, wp.uint64),
            (fixed, wp.int32),
        )
        self._flags.numpy()[FLAGS:] = np.repeat(self._row_base.numpy()[:-1], PER_SEGMENT)


def compliant_options(scene: Scene, state: BodyArrays, precision: str) -> CompliantOptions:
    """What of the compliant step a scene needs."""
    return CompliantOptions(
        law=LawOptions.of(scene, state.needs, precision, midpoint=False),
        pairs=state.lookup,
        alike=state.alike(),
        walls=state.walls.options,
        bigs=state.big_rows > 0,
        periodic=state.periodic,
        rotation=state.needs.rotation,
        radii=state.needs.radii,
        threads=state.parts > 1,
    )


def unsupported(scene: Scene) -> list[str]:
    """What of a scene compliant rows cannot do, one line each."""
    found = unsupported_features(scene)
    has = features(scene)
    if has.rolling_friction:
        found.append("rolling friction")
    if has.shapes:
        found.append("compliant rows of bodies that are no spheres")
    if isinstance(scene.law, Rigid):
        found.append(f"contact law {scene.law.kind}: compliant rows need a stiffness")
    return found
