"""The impulse stepper: rigid rows, launched for many steps at a time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Scene, features
from dembench.solver.guard import SolverError
from dembench.solver.impulse.blocks import WINDOW
from dembench.solver.impulse.diagnosis import RowTable
from dembench.solver.impulse.rows import ImpulseOptions, limit_types, row_types
from dembench.solver.impulse.segments import END, FLAGS, OTHER, PER_SEGMENT, PER_THREAD, TRAVEL, Share
from dembench.solver.impulse.stabilization import search_types
from dembench.solver.impulse.step import impulse_kernel
from dembench.solver.inspection import Touching
from dembench.solver.lanes import LANES
from dembench.solver.pairs import PairTables
from dembench.solver.returns import BIG_OVERFLOW, NOT_FINITE, REBUILD
from dembench.solver.soft import unsupported_features
from dembench.solver.state import State

EVENT = 2.0
"""A pair that meets faster than this many g dt rebounds; a slower one rests."""
STILL = 0.02
"""Velocity sweeps end when no relative velocity changes by more than this fraction of the event speed."""
FAST = 8.0
"""A contact that slides or collides faster than this many g dt is flowing."""
SHARE = 0.01
"""Matter is at rest, and the stabilization on, where flowing contacts carry at most this fraction of the load."""
CALM = 0.003
"""The stabilization ends when a step of it changes velocities by less than this many g dt, root mean square."""
STABILIZATION_SWEEPS = 1000
"""Largest number of sweeps of the stabilization per step."""
MARGIN = 0.01
"""Rows are kept for gaps that stay below this at the end of the step, in smallest diameters."""
SLOP = 5e-5
"""Overlap that the position pass leaves, in smallest diameters."""
SKIN, SKIN_STEPS, SKIN_LIMIT = 0.1, 3, 0.4
"""Gap up to which pairs are listed: at least SKIN smallest diameters; room for SKIN_STEPS steps of the fastest body,
but for one step only where that is more than SKIN_LIMIT diameters: long lists cost more memory than rebuilds time."""
NEAR_SKIN = 0.03
"""Gap up to which listed pairs are tested in every step: at least this, in smallest diameters."""
ROOM = 1.25
"""Room for rows in blocks, over the number of listed pairs; rows beyond it are visited one by one."""
BIG_SKIN = 0.5
"""Gap up to which bodies are candidates of a large body, in smallest diameters and beyond one step of travel."""


class Impulses:
    """Steps a state with rigid contacts: projected Gauss-Seidel on velocities, then a position pass.

    Args:
        scene: Its pair laws give restitution and friction; stiffness is not used.
        state: With a part for each thread.
        dt: Time step [s].
        precision: "float32" or "float64".
        velocity_sweeps, position_sweeps: Largest number of sweeps of each kind per step.
        stabilization: Where matter is at rest, carry on after the sweeps until its weight is carried.

    Attributes:
        kernels: Kernels that must be loaded before the first step.
    """

    def __init__(
        self,
        scene: Scene,
        state: State,
        dt: float,
        precision: str,
        velocity_sweeps: int,
        position_sweeps: int,
        stabilization: bool = True,
    ):
        self.state, self.dt = state, dt / state.units.time
        self._options = ImpulseOptions(
            precision=precision,
            friction=state.needs.friction,
            pairs=state.lookup,
            walls=state.walls.options,
            bigs=state.big_rows > 0,
            stabilization=stabilization and state.needs.present.gravity,
            periodic=state.periodic,
            radii=state.needs.radii,
            threads=state.parts > 1,
        )
        self.kernels = [impulse_kernel(self._options)]
        self._rows, self._search = row_types(precision)(), search_types(precision)()
        self._tables = PairTables(scene, state.units, precision, state.lookup)
        gravity = [g / state.units.acceleration for g in scene.gravity]
        self._gravity = wp.vec3d(*gravity)
        self._fall = math.hypot(*gravity) * self.dt
        self._limits = self._limit(velocity_sweeps, position_sweeps, precision)
        self.expect(0.0)
        self._flags = wp.zeros(FLAGS + PER_SEGMENT * (state.parts + 1), dtype=wp.int32, device="cpu")
        self._travel = wp.zeros(TRAVEL + PER_THREAD * state.parts, dtype=wp.float64, device="cpu")
        self._base = np.zeros(state.parts + 1, dtype=int)
        self._steps = 0
        self._big_skin = BIG_SKIN * state.diameter

    def prepare(self, first: int = 0) -> None:
        """Builds the lists of the state after `first` steps."""
        self.relist(first)

    def advance(self, n: int, first: int) -> int:
        """Makes up to n steps beyond the `first` that are made; returns how many.

        Raises:
            SolverError: A velocity is not finite.
        """
        s, t = self.state, self._tables

        def one(part: int) -> None:
            inputs = [n, float(first), self.dt, self._gravity, s.walls.record, s.wall_speed]
            inputs += [t.pairs, t.pair_columns, t.walls, t.wall_columns, s.skin, self._big_skin]
            inputs += [s.base, s.wall_capacity, s.big_capacity, self._limits, s.pair_count, s.wall_count]
            outputs = [self._share(part), s.bodies, s.lists, self._rows, self._search, s.near_count]
            wp.launch(self.kernels[0], dim=1, device="cpu", inputs=inputs, outputs=outputs)

        s.each_part(one)
        flags = self._flags.numpy()
        done, reason = int(flags[2]), int(flags[3])
        self._steps += done
        if reason == NOT_FINITE:
            raise SolverError("a velocity is not finite", reason="nan")
        if reason == REBUILD:
            self.relist(first + done)
        elif reason == BIG_OVERFLOW:
            s.grow_big()
            self.relist(first + done)
        return done

    def _share(self, part: int) -> Any:
        s, share = self.state, Share()
        share.part, share.parts, share.n, share.total = part, s.parts, s.n, s.total
        share.begin, share.end = int(s.ranges_host[part]), int(s.ranges_host[part + 1])
        share.state, share.travel = self._flags, self._travel
        return share

    def _limit(self, velocity_sweeps: int, position_sweeps: int, precision: str) -> Any:
        d, limits = self.state.diameter, limit_types(precision)()
        limits.velocity_sweeps, limits.position_sweeps = velocity_sweeps, position_sweeps
        limits.stabilization_sweeps = STABILIZATION_SWEEPS
        limits.share = SHARE
        limits.margin, limits.slop, limits.near = MARGIN * d, SLOP * d, NEAR_SKIN * d
        return limits

    def expect(self, gain: float) -> None:
        """Forces from outside give bodies up to this speed in a step [scene units]: as with gravity, it is no event."""
        fall, limits = self._fall + gain, self._limits
        limits.event, limits.still = EVENT * fall, STILL * EVENT * fall
        limits.fast, limits.calm = FAST * fall, CALM * fall

    def largest_overlap(self) -> float:
        """Largest overlap that a step has left [scene units]."""
        return float(self._travel.numpy()[3])

    def contacts(self) -> Touching:
        """Contacts that carried load in the last step."""
        return self._table().touching(self.state.total, self.state.lists.wall_f.numpy(), self.dt)

    def counters(self) -> dict[str, float]:
        """Rows, collisions, sliding contacts and relative residual of the last step; mean sweeps per step.

        For the residual see `RowTable.residual`.
        """
        flags, steps, table = self._flags.numpy(), max(1, self._steps), self._table()
        return {
            "rows": int(flags[4]),
            "collisions": int(flags[7]),
            "sliding contacts": table.sliding(),
            "residual of the contact problem": table.residual(),
            "velocity sweeps per step": int(flags[5]) / steps,
            "stabilization sweeps per step": int(flags[8]) / steps,
            "position sweeps per step": int(flags[6]) / steps,
        }

    def _table(self) -> RowTable:
        segments = self._flags.numpy()[FLAGS:].reshape(-1, PER_SEGMENT)
        return RowTable.of(self._rows, [*zip(self._base, segments[:, END], strict=True)])

    def relist(self, steps: int) -> None:
        """Builds the lists of the state after some steps, with room for the next ones, and rows for all of them."""
        s = self.state
        s.place_walls(steps * self.dt)
        speed = np.linalg.norm(s.bodies.kin.numpy()[: s.total, 3:6], axis=1)
        reach = max(self.dt * float(speed[: s.n].max(initial=0)) + self._fall, self.dt * s.wall_speed)
        reach_big = self.dt * (float(speed[s.n :].max(initial=0)) + self._fall)
        if s.walls.options.meshes:
            reach = max(reach, reach_big)
        margin = MARGIN * s.diameter
        wanted = min(2 * SKIN_STEPS * reach + margin, SKIN_LIMIT * s.diameter)
        s.skin = max(SKIN * s.diameter, wanted, 2 * reach + margin)
        self._big_skin = BIG_SKIN * s.diameter + 2 * (reach + reach_big) + margin
        s.rebuild()
        self._travel.numpy()[[0, 1, 2]] = 0.0, -1.0, -1.0
        self._divide()

    def _divide(self) -> None:
        """Gives every segment the rows and places that the lists may ask for; there are no rows yet."""
        s, rows = self.state, self._rows
        listed, at_walls = s.pair_count.numpy().reshape(-1, 2), s.wall_count.numpy()
        pairs = np.append(listed[:, 0], listed[:, 1].sum() * self._options.threads)
        others = np.append(at_walls, s.big_capacity if s.big_rows else 0)
        blocks = (np.ceil(ROOM * pairs / LANES).astype(int) + WINDOW) * LANES
        places = np.stack([blocks, pairs + others], axis=1)
        self._allocate(int((pairs + others).sum()), int(places.sum()), int(at_walls.sum()))
        self._base = np.append(0, np.cumsum(pairs + others))[:-1]
        rows.base.assign(np.append(self._base, (pairs + others).sum()))
        rows.places.assign(np.append(0, np.cumsum(places))[:-1])
        rows.fixed.assign(s.total + np.append(0, np.cumsum(at_walls))[:-1])
        # rows of the old order must not be taken for those of the new one
        self._flags.numpy()[4] = 0
        segments = self._flags.numpy()[FLAGS:].reshape(-1, PER_SEGMENT)
        segments[:] = 0
        segments[:, [OTHER, END]] = self._base[:, None]

    def _allocate(self, contacts: int, places: int, walls: int) -> None:
        """Makes room for so many rows, places in blocks or outside, and walls in contact, where there is too little."""
        s, t, rows, search = self.state, self.state.types, self._rows, self._search
        bodies, parts = max(1, s.total), s.parts
        enough = rows.i is not None and len(rows.i) >= contacts + parts and len(rows.u) >= s.total + walls + parts
        if enough and len(rows.order) >= places and len(rows.x) >= s.total:
            return
        n, fixed = int(1.05 * contacts) + 64 + parts, int(1.2 * walls) + 64 + parts
        sizes = dict.fromkeys(("i", "j", "slot", "a", "b", "push", "apart"), n)
        sizes |= dict.fromkeys(("x", "mask", "stamp"), bodies) | dict.fromkeys(("u", "hit", "shift"), bodies + fixed)
        sizes |= {"order": int(1.05 * places), "blow": n if self._options.walls.loads else 1}
        sizes |= {"base": parts + 2, "places": 2 * parts + 2, "fixed": parts}
        kinds = {"a": t.vec8, "b": t.vec8, "u": t.vec8, "push": t.real, "apart": t.vec4, "shift": t.vec4}
        kinds |= {"blow": t.vec3, "x": wp.vec3d, "mask": wp.uint64}
        # the old arrays go first: both together would be the peak of the memory
        for wanted in (dict.fromkeys(sizes, 1), sizes):
            for name, size in wanted.items():
                setattr(rows, name, wp.zeros(size, dtype=kinds.get(name, wp.int32), device="cpu"))
        for nil in range(1, parts + 1):
            rows.i.numpy()[-nil] = rows.j.numpy()[-nil] = bodies + fixed - nil
        if not self._options.stabilization:
            n = bodies = 1
        for size_rows, size_bodies in ((1, 1), (n, bodies)):
            search.z, search.p = (wp.zeros(size_rows, dtype=t.vec4, device="cpu") for _ in range(2))
            search.u, search.du = (wp.zeros(size_bodies, dtype=t.vec8, device="cpu") for _ in range(2))


def unsupported(scene: Scene) -> list[str]:
    """What of a scene the impulse solver cannot do, one line each."""
    found = unsupported_features(scene)
    if features(scene).rolling_friction:
        found.append("rolling friction")
    return found
