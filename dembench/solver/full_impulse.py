"""The stepper of compliant rows on full lists: one recorded graph, whose loops end on the device."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Scene
from dembench.solver.full import THREADS
from dembench.solver.full_impulse_loops import (
    BIG_LIMIT,
    BLOCKS,
    BROKEN,
    BUILT,
    CLOCK,
    CONTROL,
    DONE,
    FASTEST,
    FEWEST,
    FIRST,
    LEFT,
    LIMIT,
    MADE,
    MOST,
    STALE,
    SUBSTEPS,
    SWEEPS_MADE,
    UNSOLVED,
    WALL_SPEED,
    WANTED,
    H,
    loop_kernels,
    vec4d,
)
from dembench.solver.full_impulse_rows import full_rows_type
from dembench.solver.full_impulse_step import substep_kernels
from dembench.solver.full_state import FullState
from dembench.solver.guard import SolverError
from dembench.solver.impulse.compliant_stepper import SKIN, SKIN_LIMIT, SKIN_SUBSTEPS, compliant_options
from dembench.solver.pairs import PairTables

RESIDUAL = 1e-2
"""Sweeps go on while one of them changes the impulses on a body by more than this part of their sum."""
SWEEPS = 64
"""Largest number of sweeps in a substep. Rows that are not solved by then go to and fro between the two sides of the
jump that the shear dashpot makes where a contact begins to slide."""
BIG_SKIN = 0.5
"""Gap up to which bodies are partners of a large body: at least this, in smallest diameters."""


class FullImpulses:
    """Steps a state with full lists with compliant rows; the interface is that of `CompliantImpulses`.

    Args:
        scene: Its law and pair laws.
        state: The bodies and their lists.
        dt: Time step [s].
        precision: "float32" or "float64".
        substeps: Substeps per step; None chooses them by the stiffness of the contacts of each step.
        sweeps: Largest number of sweeps in a substep.

    Attributes:
        kernels: Kernels that must be loaded before the first step.
    """

    def __init__(self, scene: Scene, state: FullState, dt: float, precision: str, substeps: int | None, sweeps: int):
        self.state, self.dt = state, dt / state.units.time
        self.substeps, self.sweeps = substeps or 0, sweeps
        options = compliant_options(scene, state, precision)
        self._loop, self._substep = loop_kernels(options), substep_kernels(options)
        unused = () if state.big_rows else ("open_big", "sweep_big", "finish_big")
        kernels = {**vars(self._loop), **vars(self._substep)}
        self.kernels = [kernel for name, kernel in kernels.items() if name not in unused]
        tables, device, total = PairTables(scene, state.units, precision, state.lookup), state.device, state.total
        self._tables = [tables.pairs.to(device), tables.pair_columns, tables.walls.to(device), tables.wall_columns]
        self._gravity = wp.vec3d(*(g / state.units.acceleration for g in scene.gravity))
        self._weight = float(np.linalg.norm(scene.gravity)) / state.units.acceleration
        self._rows = full_rows_type(precision)()
        self._control = wp.zeros(CONTROL, dtype=wp.int32, device=device)
        self._clock = wp.zeros(CLOCK, dtype=wp.float64, device=device)
        self._going, self._stepping, self._solving, self._changed = (
            wp.zeros(1, dtype=wp.int32, device=device) for _ in range(4)
        )
        self._needs = wp.zeros(max(1, total), dtype=vec4d, device=device)
        self._gathered = wp.zeros(BLOCKS, dtype=vec4d, device=device)
        self._overlaps = wp.zeros(max(1, total), dtype=state.types.real, device=device)
        self._behind, self._room, self._steps = 0, 0, 0
        self._graph: tuple[int, Any] | None = None

    def prepare(self, first: int = 0) -> None:
        """Builds the lists of the state after `first` steps; springs grow again from the next substep on."""
        self._rebuild(first * self.dt)
        self._tell(self._clock, {MADE: 0.0})

    def advance(self, n: int, first: int) -> int:
        """Makes up to n steps beyond the `first` that are made; returns how many.

        Raises:
            SolverError: A velocity is not finite.
        """
        self._tell(self._control, {STALE: 0, BROKEN: 0, DONE: 0, WANTED: n})
        self._tell(self._clock, {FIRST: float(first)})
        self._going.fill_(1)
        generation = self.state.generation
        if self._graph is None or self._graph[0] != generation:
            with wp.ScopedCapture(device=self.state.device) as capture:
                wp.capture_while(self._going, self._step)
            self._graph = generation, capture.graph
        wp.capture_launch(self._graph[1])
        control, clock = self._control.numpy(), self._clock.numpy()
        done = int(control[DONE])
        self._steps += done
        if control[BROKEN]:
            raise SolverError("a velocity is not finite", reason="nan")
        if control[STALE]:
            left = int(control[LEFT])
            self._rebuild((first + done) * self.dt + (self.dt - left * float(clock[H]) if left else 0.0))
        return done

    def largest_overlap(self) -> float:
        """Largest overlap of two bodies in the middle of a substep [scene units]."""
        return float(self._overlaps.numpy().max())

    def counters(self) -> dict[str, float]:
        """Substeps of a step and sweeps of a substep, and how many substeps ended unsolved; room of the lists."""
        control, clock = self._control.numpy(), self._clock.numpy()
        return {
            "slots per particle": self.state.slots,
            "fewest substeps of a step": int(control[FEWEST]),
            "mean substeps of a step": float(clock[SUBSTEPS]) / max(1, self._steps),
            "most substeps of a step": int(control[MOST]),
            "mean sweeps of a substep": float(clock[SWEEPS_MADE]) / max(1.0, float(clock[SUBSTEPS])),
            "substeps at the largest number of sweeps": int(control[UNSOLVED]),
        }

    def _tell(self, array: wp.array, values: dict[Any, float]) -> None:
        """Sets some numbers of an array on the device."""
        numbers = array.numpy()
        for place, value in values.items():
            numbers[place] = value
        array.assign(numbers)

    def _rebuild(self, time: float) -> None:
        """Lists with room for the next substeps at the present speeds of bodies and walls, at a time [scene units]."""
        s, clock = self.state, self._clock.numpy()
        reach = float(clock[H] * max(clock[FASTEST] + clock[H] * self._weight, s.wall_speed))
        s.skin = max(SKIN * s.diameter, min(SKIN_SUBSTEPS * reach, SKIN_LIMIT * s.diameter), 4 * reach)
        s.big_skin = max(BIG_SKIN * s.diameter, s.skin)
        s.place_walls(time)
        s.rebuild()
        # a pair that is not listed is at least a skin apart, so each of the two may use half of it
        half = 0.5 * s.skin
        news = {BUILT: time, WALL_SPEED: s.wall_speed, LIMIT: half, BIG_LIMIT: s.big_skin - half}
        self._tell(self._clock, news)
        self._allocate()

    def _allocate(self) -> None:
        """Room for the rows of all that is listed."""
        s, rows, t = self.state, self._rows, self.state.types
        total = max(1, s.total)
        self._behind = (s.slots + s.wall_slots) * total
        room = self._behind + s.big_capacity
        if room == self._room:
            return
        self._room = room
        kinds = {"j": wp.int32, "slot": wp.int32, "a": t.vec8, "b": t.vec8, "c": t.PairClass}
        for name, kind in kinds.items():
            setattr(rows, name, wp.zeros(room, dtype=kind, device=s.device))
        rows.count = wp.zeros(total, dtype=wp.int32, device=s.device)
        rows.u = wp.zeros(2 * total, dtype=t.vec8, device=s.device)
        rows.parts = wp.zeros(total, dtype=t.real, device=s.device)

    # ---- what is recorded

    def _step(self) -> None:
        """The next step, or what is left of one where the lists were built anew."""
        s, k, control, clock = self.state, self._loop, self._control, self._clock
        inputs = [s.n, s.total, self.dt, self._weight, s.bodies, s.lists, s.walls.record, *self._tables]
        self._launch(k.measure, s.total, *inputs, control, clock, self._needs)
        self._launch_blocks(k.gather, BLOCKS, s.total, self._needs, self._gathered)
        self._launch(k.divide, 1, s.total, self.substeps, self.dt, self._gathered, control, clock, self._stepping)
        wp.capture_while(self._stepping, self._make_substep)

    def _make_substep(self) -> None:
        s, k, control, clock = self.state, self._substep, self._control, self._clock
        walls, middle, rows = s.walls.record, s.spare.kin, self._rows
        flags = [self._solving, self._changed]
        self._launch(self._loop.enter, 1, self.sweeps, self.dt, walls, control, clock, *flags)
        self._launch(k.drift, s.total, s.n, self._gravity, s.bodies, s.reference, middle, control, clock)
        shared = [self._gravity, s.bodies, middle, walls, *self._tables, control, clock, s.lists, rows, self._overlaps]
        self._launch(k.open, s.n, s.n, s.total, *shared)
        self._launch_blocks(k.open_big, s.big_rows, s.n, s.total, self._behind, *shared)
        wp.capture_while(self._solving, self._sweep)
        shared = [self.dt, self._gravity, middle, clock, walls, s.lists, rows, s.bodies, control]
        self._launch(k.finish, s.n, s.total, *shared)
        self._launch_blocks(k.finish_big, s.big_rows, s.n, s.total, self._behind, *shared)
        self._launch(self._loop.leave, 1, self.dt, walls, control, clock, self._going, self._stepping)

    def _sweep(self) -> None:
        s, k, control, clock = self.state, self._substep, self._control, self._clock
        after = [control, clock, self._rows, self._changed]
        self._launch(k.sweep, s.n, s.total, RESIDUAL, s.bodies, *after)
        place = [s.n, s.total, self._behind, RESIDUAL]
        self._launch_blocks(k.sweep_big, s.big_rows, *place, s.bodies, s.lists, *after)
        self._launch(self._loop.judge, 1, self.sweeps, control, self._solving, self._changed)

    def _launch(self, kernel: Any, threads: int, *inputs: Any) -> None:
        wp.launch(kernel, dim=threads, inputs=list(inputs), device=self.state.device, block_dim=THREADS)

    def _launch_blocks(self, kernel: Any, blocks: int, *inputs: Any) -> None:
        if blocks:
            wp.launch_tiled(kernel, dim=blocks, inputs=list(inputs), device=self.state.device, block_dim=THREADS)
