"""The state of a simulation with half lists in scene units, and the rebuild of the lists."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from dembench.solver.body_arrays import BodyArrays
from dembench.solver.neighbours import list_kernels
from dembench.solver.population import drain, large_pairs, listed_at_walls, listed_pairs
from dembench.solver.types import vec8d
from dembench.solver.workspace import Workspace

LISTED = 5
"""Pairs of a body that there is room for at first; lists grow beyond it."""


class State(BodyArrays):
    """Particle arrays in scene units, sorted by cell, with half lists for one or more threads.

    Attributes:
        lists: The Warp record that kernels take.
        base: Where the regions of the pair lists begin.
        pair_count, wall_count, near_count: How much the lists hold.
        workspace: Memory of what only a rebuild needs; a stepper may have it in between.
    """

    def _kernels(self) -> Any:
        kernels = vars(list_kernels(self.types.precision, self.walls.options, self.periodic))
        return SimpleNamespace(**kernels, **self._wrapping())

    # ---- allocation

    def allocate(self, n: int) -> None:
        """Empty arrays for n bodies."""
        self.bodies, self.identity = self._bodies(n), self._ints(n)

    def _lists(self) -> None:
        self.workspace = Workspace()
        self._set_room(max(64, LISTED * self.n // self.parts), 64)
        self.wall_capacity = max(64, self.n // 4)
        self.big_capacity = 1024
        self.lists = self.types.Lists()
        lists = self.lists
        self._new_pairs(lists)
        self._new_walls(lists)
        lists.big_i, lists.big_j = self._ints(self.big_capacity), self._ints(self.big_capacity)
        lists.big_memory = self.contact_memory(self.big_rows * self.total)
        self.pair_count = self._ints(2 * self.parts)
        self.wall_count = self._ints(self.parts)
        self.near_count = self._ints(2 * self.parts + 1)

    def _set_room(self, inside: int, across: int) -> None:
        """Where the regions of the pair lists begin: 2p with room for `inside`, 2p + 1 for `across` pairs."""
        rooms = [inside, across if self.parts > 1 else 0] * self.parts
        self.base = wp.array(np.concatenate([[0], np.cumsum(rooms)]), dtype=wp.int32, device="cpu")

    def _new_pairs(self, lists: Any) -> None:
        pairs = int(self.base.numpy()[-1])
        # the old ones go first: there is never room for both
        lists.i = lists.j = lists.near = lists.memory = None
        lists.i, lists.j, lists.near = self._ints(pairs), self._ints(pairs), self._ints(pairs)
        lists.memory = self.contact_memory(pairs)

    def _new_walls(self, lists: Any) -> None:
        candidates = self.parts * self.wall_capacity
        lists.wall_i, lists.wall_f = self._ints(candidates), self._ints(candidates)
        lists.wall_memory = self.contact_memory(candidates)

    # ---- rebuild

    def rebuild(self) -> None:
        """Sorts the small particles by cell and builds all lists anew; contact memory is carried over.

        Bodies in a sink leave before.
        """
        self.rebuilds += 1
        self._wrap()
        drain(self)
        self._balance()
        grid, place, head, kept = self._sort()
        regions = [2 * self.parts, self.base, self.pair_count]
        self._keep(self.kernels.keep, *regions, place, self.n, kept, head)
        while True:
            self._build(grid, kept, head)
            needed, room = self.pair_count.numpy(), np.diff(self.base.numpy())
            if (needed <= room).all():
                break
            self._set_room(int(1.1 * needed[0::2].max()) + 64, int(1.5 * needed[1::2].max()) + 64)
            self._new_pairs(self.lists)
        self._build_walls(place, kept, head)
        self.near_count.zero_()

    def _balance(self) -> None:
        """Cuts the sorted bodies anew, so that every thread has as much work: the pairs listed last, and the bodies."""
        if self.parts > 1:
            # one more, so that a range without bodies keeps its place
            work = self.pair_count.numpy().reshape(-1, 2).sum(axis=1) + np.diff(self.ranges_host) + 1
            done = np.append(0, np.cumsum(work))
            self.cuts = np.interp(np.linspace(0, done[-1], self.parts + 1), done, self.cuts)
            self.divide()

    def _sort(self) -> tuple[tuple[Any, ...], wp.array, wp.array, Any]:
        """Sorts the small bodies by cell.

        Returns:
            The grid with the first body of each cell; where each body has gone; room for what contacts remember, and
            for the first of them of each body.
        """
        n, total = self.n, self.total
        grid = (wp.vec3d(), wp.vec3d(), wp.vec3i(0, 1, 2), wp.vec3i(1, 1, 1))
        if n:
            grid = self.grid(*self._box())
        cells, kept = int(np.prod(list(grid[3]))), self.types.Kept()
        contacts = max(_remembering(listed) for listed in (listed_pairs(self), listed_at_walls(self)))
        lengths = [cells + 1, n, n, total, total, contacts, contacts]
        wanted = [*((k, wp.int32) for k in lengths), (contacts, self.types.vec4), (n, vec8d)]
        *numbers, kept.memory, moved = self.workspace.arrays(*wanted)
        start, cell, order, place, head, kept.j, kept.follow = numbers
        if n:
            self._launch(self.kernels.sort, self.bodies, n, *grid, cell, start, order)
        self._reorder(order.numpy(), moved.numpy())
        place.numpy()[:] = np.arange(total, dtype=np.int32)
        place.numpy()[order.numpy()] = np.arange(n, dtype=np.int32)
        return (*grid, start), place, head, kept

    def _reorder(self, order: np.ndarray, moved: np.ndarray) -> None:
        """Moves all that belongs to the small bodies into the new order, by way of `moved`; large ones stay."""
        n = self.n
        bodies = [getattr(self.bodies, name) for name in self.bodies._cls.vars]
        for array in (self.identity, *(a for a in bodies if isinstance(a, wp.array) and len(a))):
            rows = array.numpy()[:n]
            out = moved.reshape(-1).view(rows.dtype)[: rows.size].reshape(rows.shape)
            rows[:] = np.take(rows, order, axis=0, out=out, mode="clip")
        if self.needs.history and self.big_rows:
            memory = self.lists.big_memory.numpy()[: self.big_rows * self.total]
            memory = memory.reshape(self.big_rows, self.total, 4)
            memory[:, :n] = memory[:, order]

    def _keep(self, kernel: Any, *arguments: Any) -> None:
        """Puts aside what contacts remember; the lists are then written anew."""
        if self.needs.history:
            self._launch(kernel, self.lists, *arguments)

    def _build(self, grid: tuple[Any, ...], kept: Any, head: wp.array) -> None:
        def one(part: int) -> None:
            self._launch(
                self.kernels.build,
                part,
                self.parts,
                self.ranges,
                self.bodies,
                self.skin,
                *grid,
                kept,
                head,
                self.base,
                self.lists,
                self.pair_count,
            )

        self.each_part(one)

    def _box(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the box around the centres of the small bodies [scene units]."""
        box = wp.zeros(2, dtype=wp.vec3d, device="cpu")
        self._launch(self.kernels.bounds, self.bodies, self.n, box)
        low, high = box.numpy()
        return low, high

    def _build_walls(self, place: wp.array, kept: Any, head: wp.array) -> None:
        if not self.walls.count:
            return
        candidates = [self.parts, self.wall_capacity, self.wall_count]
        self._keep(self.kernels.keep_walls, *candidates, place, self.total, kept, head)

        def one(part: int) -> None:
            spans = [(int(self.ranges_host[part]), int(self.ranges_host[part + 1]), self.skin)]
            if part == 0:
                # large bodies outrun the skin of the small ones: they are tested against all walls in every step, but
                # where there are meshes, whose many parts cost more than a rebuild
                spans.append((self.n, self.total, self.skin if self.walls.options.meshes else 1e30))
            for first, last, skin in spans:
                inputs = [part, first, last, self.bodies, self.walls.record, skin, kept, head]
                inputs += [part * self.wall_capacity, self.wall_capacity]
                self._launch(self.kernels.build_walls, *inputs, self.lists, self.wall_count)

        while True:
            self.wall_count.zero_()
            if len(self.lists.wall_i) < self.parts * self.wall_capacity:
                self._new_walls(self.lists)
            self.each_part(one)
            needed = int(self.wall_count.numpy().max())
            if needed <= self.wall_capacity:
                return
            self.wall_capacity = int(1.2 * needed) + 64

    def grow_big(self) -> None:
        """Makes room for more candidates of the large bodies."""
        self.big_capacity = int(1.2 * int(self.near_count.numpy()[-1])) + 64
        self.lists.big_i, self.lists.big_j = self._ints(self.big_capacity), self._ints(self.big_capacity)

    # ---- launching

    def _launch(self, kernel: Any, *arguments: Any) -> None:
        wp.launch(kernel, dim=1, inputs=list(arguments), device="cpu")

    def each_part(self, work: Any) -> None:
        """Calls work(part) for every part, each in its own thread where there are several."""
        if self._pool is None:
            work(0)
        else:
            list(self._pool.map(work, range(self.parts)))

    def counts(self) -> dict[str, float]:
        """Listed pairs and wall candidates, and, where there is a contact memory, how many have one, by name."""
        listed = {
            "listed pairs": sum(len(row[0]) for row in listed_pairs(self)),
            "listed at walls": sum(len(row[0]) for row in listed_at_walls(self)),
        }
        if not self.needs.history:
            return listed
        pairs, walls, large = (_remembering(rows(self)) for rows in (listed_pairs, listed_at_walls, large_pairs))
        return {**listed, "pairs in contact": pairs + large, "contacts with walls": walls}


def _remembering(listed: list[tuple[Any, ...]]) -> int:
    """Number of listed contacts with a memory."""
    return int(sum(np.count_nonzero(memory[:, 3]) for *_, memory in listed))
