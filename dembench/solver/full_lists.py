"""Full neighbour lists for devices of many threads: every body lists all its partners.

One thread builds and uses the list of one body, slot q of body i at [q n + i], so that neighbouring threads read
neighbouring words. The contact memory is kept on both sides of a pair, for the lower index against the higher. Bit 30
of an entry marks a partner that touched in the last step; only then is its memory valid.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.full_sort import cell_function
from dembench.solver.neighbours import position_function
from dembench.solver.pairs import radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.types import types, vec8d
from dembench.solver.walls.candidates import gather_function, goes_on_function
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import WallOptions, Walls

MARK = wp.constant(1 << 30)
"""Added to an entry of a list while the two touch."""


@cache
def full_lists_type(precision: str) -> Any:
    """Record of the lists.

    partner, memory: slots of the small bodies, partner index and tangential spring, with `count` filled slots each.
    wall, wall_memory, wall_count: the same for all bodies against wall features. big: candidates of the large bodies,
    those of row r from big_start[r] to big_start[r + 1]; big_memory: spring and touching flag of row r and body i at
    [r total + i].
    """
    vec4: Any = types(precision).vec4

    class FullLists:
        partner: wp.array(dtype=wp.int32)
        memory: wp.array(dtype=vec4)
        count: wp.array(dtype=wp.int32)
        wall: wp.array(dtype=wp.int32)
        wall_memory: wp.array(dtype=vec4)
        wall_count: wp.array(dtype=wp.int32)
        big: wp.array(dtype=wp.int32)
        big_start: wp.array(dtype=wp.int32)
        big_memory: wp.array(dtype=vec4)

    FullLists.__qualname__ = FullLists.__name__ = f"FullLists_{precision}"
    return wp.struct(FullLists)


@cache
def hand_over_function(precision: str, o: WallOptions, radii: bool) -> Any:
    """A Warp function (bodies, k, lists, i, total, walls) for body i, which has the row k of `kin`.

    Memory of contacts that go on with another part of a mesh goes over: see `candidates.hand_over_function`.
    """
    Bodies, FullLists = types(precision).Bodies, full_lists_type(precision)
    distance_of, goes_on, radius = wall_functions(o).distance, goes_on_function(o), radius_function(precision, radii)

    @wp.func
    def hand_over(b: Bodies, k: vec8d, lists: FullLists, i: int, total: int, walls: Walls):
        x = wp.vec3d(k[0], k[1], k[2])
        for q in range(lists.wall_count[i]):
            slot = q * total + i
            f = lists.wall[slot] - MARK
            if f >= walls.plain:
                distance, normal = distance_of(walls, f, 0, x)
                if distance >= radius(b, k):
                    lists.wall[slot] = f
                    going = bool(True)
                    for p in range(lists.wall_count[i]):
                        g = lists.wall[p * total + i]
                        if going and p != q and g < MARK:
                            if goes_on(walls, 0, f, g, x, radius(b, k), normal):
                                lists.wall[p * total + i] = g + MARK
                                lists.wall_memory[p * total + i] = lists.wall_memory[slot]
                                going = False

    return hand_over


@cache
def full_list_kernels(precision: str, walls: WallOptions, friction: bool, periodic: bool) -> Any:
    """Kernels that build full lists; each has one thread per body unless it says otherwise."""
    t = types(precision)
    vec4, Bodies = t.vec4, t.Bodies
    FullLists = full_lists_type(precision)
    gather = gather_function(walls)
    position = position_function(precision)
    cell_of = cell_function()
    image = image_functions(precision, periodic)
    nearest, folded = image.nearest, image.folded
    turns = wp.constant(2 if periodic else 1)

    @wp.func
    def enter(
        k: int,
        j: int,
        found: int,
        slots: int,
        n: int,
        order: wp.array(dtype=wp.int32),
        old: FullLists,
        lists: FullLists,
    ):
        """Writes partner j of body k into slot `found` where there is room, with the memory that the pair had."""
        if found < slots:
            i = order[k]
            was = j
            if j < n:
                was = order[j]
            entry = j + 0
            for q in range(old.count[i]):
                if old.partner[q * n + i] == was + MARK:
                    entry = j + MARK
                    if wp.static(friction):
                        m = old.memory[q * n + i]
                        if (i < was) != (k < j):
                            m = -m
                        lists.memory[found * n + k] = m
            lists.partner[found * n + k] = entry

    @wp.kernel(enable_backward=False, module="unique")
    def build(
        # inputs
        b: Bodies,
        n: int,
        total: int,
        skin: wp.float64,
        big_skin: wp.float64,
        origin: wp.vec3d,
        inverse: wp.vec3d,
        axis: wp.vec3i,
        cells: wp.vec3i,
        start: wp.array(dtype=wp.int32),
        order: wp.array(dtype=wp.int32),
        old: FullLists,
        slots: int,
        # outputs
        lists: FullLists,
        overflow: wp.array(dtype=wp.int32),
    ):
        """Lists the partners of each small body; counts beyond the slots, too, and says so in overflow[0]."""
        k = wp.tid()
        x = position(b, k)
        r = b.kin[k][6]
        c = cell_of(x, origin, inverse, axis, cells)
        found = int(0)
        w0, w1 = wp.max(c[2] - 1, 0), wp.min(c[2] + 1, cells[2] - 1)
        for column in range(9):
            u = folded(c[0] + column // 3 - 1, cells[0], b.inverse_box[axis[0]])
            v = folded(c[1] + column % 3 - 1, cells[1], b.inverse_box[axis[1]])
            if u < 0 or u >= cells[0] or v < 0 or v >= cells[1]:
                continue
            base = (u * cells[1] + v) * cells[2]
            first, last = start[base + w0] + 0, start[base + w1 + 1] + 0
            for turn in range(turns):
                if turn == 1:
                    other = folded(c[2] + 1, cells[2], b.inverse_box[axis[2]])
                    if c[2] == 0:
                        other = folded(-1, cells[2], b.inverse_box[axis[2]])
                    if other < 0 or other >= cells[2] or wp.abs(other - c[2]) < 2:
                        continue
                    first, last = start[base + other] + 0, start[base + other + 1] + 0
                for j in range(first, last):
                    d = nearest(b, x - position(b, j))
                    reach = r + b.kin[j][6] + skin
                    if wp.dot(d, d) < reach * reach and j != k:
                        enter(k, j, found, slots, n, order, old, lists)
                        found += 1
        for j in range(n, total):
            d = nearest(b, x - position(b, j))
            reach = r + b.kin[j][6] + big_skin
            if wp.dot(d, d) < reach * reach:
                enter(k, j, found, slots, n, order, old, lists)
                found += 1
        lists.count[k] = found
        if found > slots:
            overflow[0] = 1

    @wp.kernel(enable_backward=False, module="unique")
    def build_walls(
        # inputs
        b: Bodies,
        n: int,
        total: int,
        skin: wp.float64,
        big_skin: wp.float64,
        walls: Walls,
        order: wp.array(dtype=wp.int32),
        old: FullLists,
        slots: int,
        # outputs
        lists: FullLists,
        overflow: wp.array(dtype=wp.int32),
    ):
        """Lists the wall features near each body; counts beyond the slots, too, and says so in overflow[1]."""
        k = wp.tid()
        i, reach = k, big_skin
        if k < n:
            i = order[k]
            reach = skin
        x = position(b, k)
        found = gather(walls, x, b.kin[k][6], reach, k, total, slots, lists.wall)
        for p in range(wp.min(found, slots)):
            slot = p * total + k
            f = lists.wall[slot]
            for q in range(old.wall_count[i]):
                if old.wall[q * total + i] == f + MARK:
                    lists.wall[slot] = f + MARK
                    if wp.static(friction):
                        lists.wall_memory[slot] = old.wall_memory[q * total + i]
        lists.wall_count[k] = found
        if found > slots:
            overflow[1] = 1

    @wp.kernel(enable_backward=False, module="unique")
    def flag_big(
        # inputs
        b: Bodies,
        n: int,
        total: int,
        skin: wp.float64,
        # outputs
        near: wp.array(dtype=wp.int32),
        big_memory: wp.array(dtype=vec4),
    ):
        """Flags the bodies within `skin` of each large body, and all other large ones; clears the memory of the rest.

        Threads (row, body).
        """
        row, i = wp.tid()
        j = n + row
        d = nearest(b, position(b, i) - position(b, j))
        reach = b.kin[i][6] + b.kin[j][6] + skin
        near[row * total + i] = 0
        if i != j and (i >= n or wp.dot(d, d) < reach * reach):
            near[row * total + i] = 1
        elif row * total + i < big_memory.shape[0]:
            big_memory[row * total + i] = vec4()

    @wp.kernel(enable_backward=False, module="unique")
    def fill_big(
        # inputs
        total: int,
        near: wp.array(dtype=wp.int32),
        until: wp.array(dtype=wp.int32),
        capacity: int,
        # outputs
        lists: FullLists,
    ):
        """Lists the flagged bodies in ascending order; the last of big_start is the room needed.

        Threads (row, body).
        """
        row, i = wp.tid()
        k = row * total + i
        if near[k] == 1 and until[k] <= capacity:
            lists.big[until[k] - 1] = i
        if i == total - 1:
            lists.big_start[row + 1] = until[k]

    return SimpleNamespace(
        build=build,
        build_walls=build_walls,
        flag_big=flag_big,
        fill_big=fill_big,
    )
