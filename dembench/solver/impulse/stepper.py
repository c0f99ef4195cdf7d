"""The impulse stepper: rigid rows, launched for many steps at a time."""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from dembench.scene import Scene, features
from dembench.solver.guard import SolverError
from dembench.solver.impulse.rows import ImpulseOptions, row_types
from dembench.solver.impulse.step import BIG_OVERFLOW, NOT_FINITE, REBUILD, impulse_kernel
from dembench.solver.pairs import PairTables, lookup_mode
from dembench.solver.soft import unsupported_features
from dembench.solver.state import State
from dembench.solver.walls.features import unsupported_walls

EVENT = 2.0
"""A pair that meets faster than this many g dt rebounds; a slower one rests."""
STILL = 0.02
"""Velocity sweeps end when no relative velocity changes by more than this fraction of the event speed."""
MARGIN = 0.01
"""Rows are kept for gaps that stay below this at the end of the step, in smallest diameters."""
SLOP = 5e-5
"""Overlap that the position pass leaves, in smallest diameters."""
SKIN, SKIN_STEPS, SKIN_LIMIT = 0.1, 3, 0.4
"""Gap up to which pairs are listed: at least SKIN smallest diameters; room for SKIN_STEPS steps of the fastest body,
but for one step only where that is more than SKIN_LIMIT diameters: long lists cost more memory than rebuilds time."""
NEAR_SKIN = 0.03
"""Gap up to which listed pairs are tested in every step: at least this, in smallest diameters."""
BIG_SKIN = 0.5
"""Gap up to which bodies are candidates of a large body, in smallest diameters and beyond one step of travel."""


class Impulses:
    """Steps a state with rigid contacts: projected Gauss-Seidel on velocities, then a position pass.

    Args:
        scene: Its pair laws give restitution and friction; stiffness is not used.
        state: With one part; the sweeps are serial.
        dt: Time step [s].
        precision: "float32" or "float64".
        velocity_sweeps, position_sweeps: Largest number of sweeps of each kind per step.
    """

    def __init__(
        self, scene: Scene, state: State, dt: float, precision: str, velocity_sweeps: int, position_sweeps: int
    ):
        has = features(scene)
        self.state, self.dt = state, dt / state.units.time
        self.velocity_sweeps, self.position_sweeps = velocity_sweeps, position_sweeps
        options = ImpulseOptions(
            precision=precision,
            friction=has.rotation,
            pairs=lookup_mode(scene),
            walls=state.walls.options,
            bigs=state.big_rows > 0,
        )
        self.kernels = [impulse_kernel(options)]
        self._rows = row_types(precision)()
        self._tables = PairTables(scene, state.units, precision)
        gravity = [g / state.units.acceleration for g in scene.gravity]
        self._gravity = wp.vec3d(*gravity)
        self._fall = math.hypot(*gravity) * self.dt
        self._flags = wp.zeros(8, dtype=wp.int32, device="cpu")
        self._travel = wp.zeros(5, dtype=wp.float64, device="cpu")
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
        s, t, d = self.state, self._tables, self.state.diameter
        inputs = [n, float(first), self.dt, self._gravity, s.n, s.total, s.walls.record, s.wall_speed]
        inputs += [
            t.pairs,
            t.pair_columns,
            t.walls,
            t.wall_columns,
            s.skin,
            NEAR_SKIN * d,
            self._big_skin,
            s.big_capacity,
        ]
        inputs += [len(self._rows.i), self.velocity_sweeps, self.position_sweeps]
        inputs += [EVENT * self._fall, STILL * EVENT * self._fall, MARGIN * d, SLOP * d, s.pair_count, s.wall_count]
        outputs = [s.bodies, s.lists, self._rows, s.near_count, self._flags, self._travel]
        wp.launch(self.kernels[0], dim=1, device="cpu", inputs=inputs, outputs=outputs)
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

    def largest_overlap(self) -> float:
        """Largest overlap that a step has left [scene units]."""
        return float(self._travel.numpy()[3])

    def counters(self) -> dict[str, float]:
        """Rows and collisions of the last step, mean sweeps per step."""
        flags, steps = self._flags.numpy(), max(1, self._steps)
        return {
            "rows": int(flags[4]),
            "collisions": int(flags[7]),
            "velocity sweeps per step": int(flags[5]) / steps,
            "position sweeps per step": int(flags[6]) / steps,
        }

    def relist(self, steps: int) -> None:
        """Builds the lists of the state after some steps, with room for the next ones, and rows for all of them."""
        s = self.state
        s.place_walls(steps * self.dt)
        speed = np.linalg.norm(s.bodies.kin.numpy()[: s.total, 3:6], axis=1)
        reach = max(self.dt * float(speed[: s.n].max(initial=0)) + self._fall, self.dt * s.wall_speed)
        reach_big = self.dt * (float(speed[s.n :].max(initial=0)) + self._fall)
        margin = MARGIN * s.diameter
        wanted = min(2 * SKIN_STEPS * reach + margin, SKIN_LIMIT * s.diameter)
        s.skin = max(SKIN * s.diameter, wanted, 2 * reach + margin)
        self._big_skin = BIG_SKIN * s.diameter + 2 * (reach + reach_big) + margin
        s.rebuild()
        self._travel.numpy()[[0, 1, 2]] = 0.0, -1.0, -1.0
        walls = int(s.wall_count.numpy()[0])
        contacts = int(s.pair_count.numpy()[0]) + walls + (s.big_capacity if s.big_rows else 0)
        if (
            self._rows.i is None
            or len(self._rows.i) < contacts
            or len(self._rows.u) < s.total + walls
            or len(self._rows.x) < s.total
        ):
            self._allocate(int(1.05 * contacts) + 64, int(1.2 * walls) + 64)

    def _allocate(self, n: int, walls: int) -> None:
        s, vec8 = self.state, self.state.types.vec8
        rows = self._rows
        # the old arrays go first: both together would be the peak of the memory
        for name, kind in (("i", wp.int32), ("j", wp.int32), ("slot", wp.int32), ("a", vec8), ("b", vec8), ("u", vec8)):
            setattr(rows, name, wp.zeros(1, dtype=kind, device="cpu"))
        rows.i, rows.j, rows.slot = (wp.zeros(n, dtype=wp.int32, device="cpu") for _ in range(3))
        rows.a, rows.b = (wp.zeros(n, dtype=vec8, device="cpu") for _ in range(2))
        rows.push = wp.zeros(n, dtype=s.types.real, device="cpu")
        rows.u = wp.zeros(s.total + walls, dtype=vec8, device="cpu")
        rows.hit = wp.zeros(s.total + walls, dtype=wp.int32, device="cpu")
        rows.x = wp.zeros(max(1, s.total), dtype=wp.vec3d, device="cpu")


def unsupported(scene: Scene) -> list[str]:
    """What of a scene the impulse solver cannot do, one line each."""
    found = unsupported_walls(scene) + unsupported_features(scene)
    if features(scene).rolling_friction:
        found.append("rolling friction")
    return found
