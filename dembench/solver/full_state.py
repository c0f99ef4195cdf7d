"""The state of a simulation with full lists on one device, and the rebuild of the lists."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Scene
from dembench.solver.body_arrays import BodyArrays
from dembench.solver.full_lists import full_list_kernels, full_lists_type
from dembench.solver.full_sort import CHUNKS, sort_kernels
from dembench.solver.needs import Needs
from dembench.solver.units import Units

SLOTS = 20
"""Partners of a body that there is room for at first: what a dense bed of equal spheres needs; lists grow beyond it."""
WALL_SLOTS = 4
"""Wall features near a body that there is room for at first."""
BIG_ROOM = 4096
"""Candidates of the large bodies that there is room for at first."""


class FullState(BodyArrays):
    """Particle arrays in scene units on a device, sorted by cell, with full lists.

    Attributes:
        lists: The Warp record that kernels take; the current state is always in `bodies`.
        spare: Bodies with arrays of their own for position, velocity and spin, that a step writes.
        big_skin: Gap up to which bodies are partners of a large body [scene units]; set by the stepper.
        reference: Positions at the last rebuild.
        generation: Grows when arrays of the lists are replaced by larger ones.
        slots, wall_slots, big_capacity: Room in the lists.
    """

    def __init__(
        self,
        scene: Scene,
        units: Units,
        precision: str,
        device: str,
        wall_loads: bool = False,
        needs: Needs | None = None,
    ):
        self.device = wp.get_device(device)
        self.generation = 0
        self.big_skin = 0.0
        super().__init__(scene, units, precision, 1, wall_loads, needs)

    def _kernels(self) -> Any:
        precision = self.types.precision
        lists = full_list_kernels(precision, self.walls.options, self.needs.friction, self.periodic)
        kernels = {**vars(sort_kernels(precision)), **vars(lists), **self._wrapping()}
        big = self.total > self.n
        unused = ["build_walls"] * (not self.walls.count) + ["flag_big", "fill_big"] * (not big)
        return SimpleNamespace(**{name: k for name, k in kernels.items() if name not in unused})

    # ---- allocation

    def allocate(self, n: int) -> None:
        """See `BodyArrays.allocate`; the initial state is put together on the host."""
        self.bodies, self.identity = self._bodies(n), self._ints(n)

    def _lists(self) -> None:
        n, total, rows = max(1, self.n), max(1, self.total), self.big_rows
        for name in ("kin", "spin", "load", "force", "inv_m", "inv_i", "kind"):
            setattr(self.bodies, name, getattr(self.bodies, name).to(self.device))
        self.identity = self.identity.to(self.device)
        b, self.spare, self._moved = self.bodies, self._record(), self._record()
        for name in ("kin", "spin"):
            setattr(self.spare, name, wp.zeros_like(getattr(b, name)))
            setattr(self._moved, name, getattr(self.spare, name))
        for name in ("inv_m", "inv_i", "kind", "load", "force"):
            setattr(self.spare, name, getattr(b, name))
        for name in ("inv_m", "inv_i", "kind"):
            setattr(self._moved, name, wp.zeros_like(getattr(b, name)))
        self._moved.load, self._moved.force = b.load, b.force
        self._identity_moved = wp.zeros_like(self.identity)
        self.reference = self._new(total, wp.vec3d)
        self.cell, self.order = self._new(2 * n, wp.int32), self._new(2 * n, wp.int32)
        self._lows, self._highs = self._new(CHUNKS, wp.vec3d), self._new(CHUNKS, wp.vec3d)
        self._overflow = self._new(2, wp.int32)
        self._near, self._until = self._new(rows * total, wp.int32), self._new(rows * total, wp.int32)
        self.slots, self.wall_slots = SLOTS, min(self.walls.count, WALL_SLOTS)
        self.big_capacity = BIG_ROOM if rows else 0
        self.lists, self._old = full_lists_type(self.types.precision)(), full_lists_type(self.types.precision)()
        for lists in (self.lists, self._old):
            lists.count, lists.wall_count = self._new(n, wp.int32), self._new(total, wp.int32)
            lists.big_start = self._new(rows + 1, wp.int32)
            lists.big_memory = self._new(rows * total * self.needs.friction, self.types.vec4)
            lists.big = self._new(self.big_capacity, wp.int32)
            self._allocate_slots(lists)

    def _allocate_slots(self, lists: Any) -> None:
        pairs, walls = self.slots * max(1, self.n), self.wall_slots * max(1, self.total)
        lists.partner, lists.wall = self._new(pairs, wp.int32), self._new(walls, wp.int32)
        lists.memory = self._new(pairs * self.needs.friction, self.types.vec4)
        lists.wall_memory = self._new(walls * self.needs.friction, self.types.vec4)

    def _new(self, n: int, dtype: Any) -> wp.array:
        return wp.zeros(max(1, n), dtype=dtype, device=self.device)

    # ---- rebuild

    def rebuild(self) -> None:
        """Sorts the small particles by cell and builds all lists anew; contact memory is carried over."""
        self.rebuilds += 1
        if not self.total:
            return
        self._wrap()
        grid = self._sort()
        old, lists = self._old, self.lists
        for name in ("partner", "memory", "count", "wall", "wall_memory", "wall_count"):
            wp.copy(getattr(old, name), getattr(lists, name))
        while not self._build(grid):
            self._grow()
        # what was kept of the lists before they grew is as large as they are now
        if old.partner.shape != lists.partner.shape or old.wall.shape != lists.wall.shape:
            self._allocate_slots(old)
        if self.big_rows:
            self._build_big()

    def counts(self) -> dict[str, float]:
        """Listed partners: each pair counts twice."""
        return {"listed partners": int(self.lists.count.numpy().sum())}

    def launch(self, kernel: Any, dim: Any, *arguments: Any) -> None:
        """Launches a kernel on the device of the state."""
        wp.launch(kernel, dim=dim, inputs=list(arguments), device=self.device)

    def _sort(self) -> tuple[Any, ...]:
        n, b, kernels = self.n, self.bodies, self.kernels
        grid = self.grid(*self._box())
        cells = int(np.prod(list(grid[3])))
        self.start = self._new(cells + 1, wp.int32)
        self.launch(kernels.key, n, b, *grid, self.cell, self.order)
        wp.utils.radix_sort_pairs(self.cell, self.order, n)
        self.launch(kernels.cell_starts, cells + 1, n, self.cell, self.start)
        moved, lists, old = self._moved, self.lists, self._old
        inputs = [n, self.total, self.big_rows, self.order, b, self.identity, lists.big_memory]
        outputs = [moved, self._identity_moved, old.big_memory, self.reference]
        self.launch(kernels.permute, self.total, *inputs, *outputs)
        # recorded launches hold the addresses of the arrays, so the state goes back to where it was
        for name in ("kin", "spin", "inv_m", "inv_i", "kind"):
            wp.copy(getattr(b, name), getattr(moved, name))
        wp.copy(self.identity, self._identity_moved)
        wp.copy(lists.big_memory, old.big_memory)
        return grid

    def _box(self) -> tuple[np.ndarray, np.ndarray]:
        self.launch(self.kernels.bounds, CHUNKS, self.bodies, self.n, self._lows, self._highs)
        return self._lows.numpy().min(axis=0), self._highs.numpy().max(axis=0)

    def _build(self, grid: tuple[Any, ...]) -> bool:
        """Builds the lists of partners and walls; False where a list has too few slots."""
        s, kernels = self, self.kernels
        self._overflow.zero_()
        inputs = [s.bodies, s.n, s.total, s.skin, s.big_skin, *grid, s.start, s.order, s._old, s.slots]
        self.launch(kernels.build, s.n, *inputs, s.lists, s._overflow)
        if self.walls.count:
            inputs = [s.bodies, s.n, s.total, s.skin, s.big_skin, s.walls.record, s.order, s._old, s.wall_slots]
            self.launch(kernels.build_walls, s.total, *inputs, s.lists, s._overflow)
        return not self._overflow.numpy().any()

    def _grow(self) -> None:
        """More slots; the old lists stay as they are until the build has carried their memory over."""
        self.generation += 1
        self.slots = max(self.slots, int(1.2 * int(self.lists.count.numpy().max())) + 2)
        self.wall_slots = max(self.wall_slots, int(self.lists.wall_count.numpy().max()))
        self._allocate_slots(self.lists)

    def _build_big(self) -> None:
        rows, total, lists = self.big_rows, self.total, self.lists
        self.launch(
            self.kernels.flag_big,
            (rows, total),
            self.bodies,
            self.n,
            total,
            self.big_skin,
            self._near,
            lists.big_memory,
        )
        wp.utils.array_scan(self._near, self._until, inclusive=True)
        while True:
            self.launch(self.kernels.fill_big, (rows, total), total, self._near, self._until, self.big_capacity, lists)
            needed = int(lists.big_start.numpy()[-1])
            if needed <= self.big_capacity:
                return
            self.generation += 1
            self.big_capacity = int(1.2 * needed) + 64
            lists.big = self._new(self.big_capacity, wp.int32)
