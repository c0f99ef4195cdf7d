"""The soft-sphere stepper with full lists: a recorded loop over blocks of steps, until the lists must be built anew."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Scene
from dembench.solver.full_state import FullState
from dembench.solver.full_step import DRIFT, HALF_KICK, NO_KICK, full_kernels
from dembench.solver.guard import SolverError
from dembench.solver.pairs import PairTables
from dembench.solver.soft import SKIN, step_options

BIG_SKIN = 1.0
"""Gap up to which bodies are partners of a large body, in smallest diameters."""
BLOCK = 64
"""Steps of a recorded block, after each of which the device decides whether another one follows."""
THREADS = 256
"""Threads of a block on CUDA devices."""


class FullSpheres:
    """Steps a state with full lists with the Hertz-Mindlin law; the interface is that of `soft.SoftSpheres`.

    Attributes:
        kernels: Kernels that must be loaded before the first step.
    """

    def __init__(self, scene: Scene, state: FullState, dt: float, precision: str, midpoint: bool):
        self.state, self.dt = state, dt / state.units.time
        state.skin, state.big_skin = SKIN * state.diameter, BIG_SKIN * state.diameter
        self._step = full_kernels(step_options(scene, state, precision, midpoint))
        self._moves = state.walls.options.timed or state.walls.options.loads
        self.kernels = [self._step.begin, self._step.step, self._step.turn] + [self._step.step_big] * bool(
            state.big_rows
        )
        self.kernels += [self._step.move_walls] * self._moves
        tables, device = PairTables(scene, state.units, precision, state.lookup), state.device
        self._tables = [tables.pairs.to(device), tables.pair_columns, tables.walls.to(device), tables.wall_columns]
        self._gravity = wp.vec3d(*(g / state.units.acceleration for g in scene.gravity))
        self._flags = wp.zeros(BLOCK + 2, dtype=wp.int32, device=device)
        self._overlaps = wp.zeros(max(1, state.total), dtype=state.types.real, device=device)
        self._graphs: dict[tuple[int, int, int], Any] = {}
        # a pair that is not listed is at least a skin apart, so each of the two may use half of it
        self._limit = 0.5 * state.skin
        self._big_limit = state.big_skin - self._limit
        self._drifted = False
        self._clock = wp.zeros(4, dtype=wp.float64, device=device)
        self._blocks = wp.zeros(2, dtype=wp.int32, device=device)
        self._going = wp.zeros(1, dtype=wp.int32, device=device)
        self._built = 0.0

    def prepare(self, first: int = 0) -> None:
        """Builds the lists and evaluates the forces after `first` steps, without growth of the contact springs."""
        self._rebuild(first * self.dt)
        self._flags.zero_()
        self._set_clock(first)
        self._launch(0, NO_KICK, 0.0)

    def advance(self, n: int, first: int) -> int:
        """Makes up to n steps beyond the `first` that are made; returns how many.

        Raises:
            SolverError: A velocity is not finite.
        """
        state = self.state
        self._flags.zero_()
        if not self._drifted:
            inputs = [state.n, self.dt, self._gravity, self._limit, self._big_limit, state.reference]
            state.launch(self._step.begin, state.total, *inputs, state.bodies, self._flags)
        self._set_clock(first + 1)
        # the last step of all stands in a block that ends with it
        blocks = (n - 1) // BLOCK
        steps, end = (BLOCK, DRIFT) if blocks else (n, HALF_KICK)
        self._blocks.assign([0, blocks])
        self._going.fill_(1)
        wp.capture_launch(self._recorded(steps, end))
        flags = self._flags.numpy()
        if flags[-1]:
            raise SolverError("a velocity is not finite; the time step may be too large", reason="nan")
        stopped = np.flatnonzero(flags[: steps + 1])
        done = int(stopped[0]) if len(stopped) else 0
        if done % 2 or (not len(stopped) and steps % 2):
            wp.copy(state.bodies.kin, state.spare.kin)
            wp.copy(state.bodies.spin, state.spare.spin)
        done += int(self._blocks.numpy()[0]) * steps
        self._drifted = bool(len(stopped)) or end == DRIFT
        if len(stopped):
            self._rebuild((first + done + 1) * self.dt)
        return done

    def largest_overlap(self) -> float:
        """Largest overlap of two bodies met in any step [scene units]."""
        return float(self._overlaps.numpy().max())

    def counters(self) -> dict[str, float]:
        """Figures of this stepper beside those of the state."""
        return {"slots per particle": self.state.slots}

    def _rebuild(self, time: float) -> None:
        self.state.place_walls(time)
        self.state.rebuild()
        self._built = time

    def _set_clock(self, steps: int) -> None:
        """Tells the walls how many steps are made at the forces of the next launch."""
        self._clock.assign([steps, self.dt, self._built, self.state.wall_speed])

    def _recorded(self, steps: int, end: int) -> Any:
        """The graph of blocks of `steps` steps that end as `end` says, until all are made or the lists are left."""
        key = (steps, end, self.state.generation)
        if key not in self._graphs:
            self._graphs = {k: g for k, g in self._graphs.items() if k[2] == self.state.generation}
            with wp.ScopedCapture(device=self.state.device) as capture:
                wp.capture_while(self._going, lambda: self._block(steps, end))
            self._graphs[key] = capture.graph
        return self._graphs[key]

    def _block(self, steps: int, end: int) -> None:
        for s in range(steps):
            self._launch(s, end if s == steps - 1 else DRIFT, self.dt)
        self.state.launch(self._step.turn, 1, steps, self._flags, self._clock, self._blocks, self._going)

    def _launch(self, s: int, after: int, memory_dt: float) -> None:
        t = self.state
        if self._moves:
            outputs = [t.walls.record, self._flags]
            inputs = [s, self._clock, self._limit]
            wp.launch(self._step.move_walls, dim=1, inputs=inputs, outputs=outputs, device=t.device)
        ours, theirs = (t.spare, t.bodies) if s % 2 else (t.bodies, t.spare)
        for kernel, threads, limit in (
            (self._step.step, t.n, self._limit),
            (self._step.step_big, t.big_rows, self._big_limit),
        ):
            if not threads:
                continue
            inputs = [s, after, memory_dt, self.dt, self._gravity, t.n, t.total, t.walls.record, *self._tables]
            inputs += [limit, t.reference, ours, t.lists, theirs, self._overlaps, self._flags]
            if kernel is self._step.step:
                wp.launch(kernel, dim=threads, inputs=inputs, device=t.device, block_dim=THREADS)
            else:
                wp.launch_tiled(kernel, dim=threads, inputs=inputs, device=t.device, block_dim=THREADS)
