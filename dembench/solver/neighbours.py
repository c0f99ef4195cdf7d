"""Neighbour lists on the CPU: particles sorted by cell, half lists with contact memory in the slots.

Large bodies are kept apart behind the small ones, so that one ball does not inflate the cells of a bed. Small particles
are sorted by cell, slowest along the longest axis; a thread owns a contiguous range of them, the pairs inside its range
(region 2p) and those across to the next range (region 2p + 1).
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.lanes import compiled_apart, prelude, separation
from dembench.solver.pairs import radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.types import types
from dembench.solver.walls.candidates import gather_function
from dembench.solver.walls.records import WallOptions, Walls


@cache
def position_function(precision: str) -> Any:
    """Position of a body as a Warp function (bodies, i) -> vec3d."""
    Bodies = types(precision).Bodies

    @wp.func
    def position(b: Bodies, i: int):
        k = b.kin[i]
        return wp.vec3d(k[0], k[1], k[2])

    return position


@cache
def list_kernels(precision: str, options: WallOptions, periodic: bool) -> Any:
    """Kernels that sort particles and build lists; every kernel is serial and launched with dim = 1."""
    t = types(precision)
    real, vec4, Bodies, Lists, Kept = t.real, t.vec4, t.Bodies, t.Lists, t.Kept
    gather = gather_function(options)
    position = position_function(precision)
    image = image_functions(precision, periodic)
    nearest, folded = image.nearest, image.folded
    turns = wp.constant(2 if periodic else 1)

    @wp.func
    def put(kept: Kept, k: int, i: int, j: int, memory: vec4, head: wp.array(dtype=wp.int32)):
        kept.j[k] = j
        kept.memory[k] = memory
        kept.follow[k] = head[i]
        head[i] = k

    @wp.func
    def seen(m: vec4, i: int, j: int):
        """The memory of a pair (i, j) as the lower one sees it, and back."""
        out = m
        if i > j:
            out = vec4(-m[0], -m[1], -m[2], m[3])
        return out

    @wp.kernel(enable_backward=False, module="unique")
    def bounds(
        # inputs
        b: Bodies,
        n: int,
        # outputs
        box: wp.array(dtype=wp.vec3d),
    ):
        low = position(b, 0)
        high = position(b, 0)
        for i in range(1, n):
            low = wp.min(low, position(b, i))
            high = wp.max(high, position(b, i))
        box[0] = low
        box[1] = high

    @wp.kernel(enable_backward=False, module="unique")
    def sort(
        # inputs
        b: Bodies,
        n: int,
        origin: wp.vec3d,
        inverse: wp.vec3d,
        axis: wp.vec3i,
        cells: wp.vec3i,
        # outputs
        cell: wp.array(dtype=wp.int32),
        start: wp.array(dtype=wp.int32),
        order: wp.array(dtype=wp.int32),
    ):
        """Counting sort by cell: order[new] = old; start[c] is the first particle of cell c, with one entry more."""
        n_cells = cells[0] * cells[1] * cells[2]
        for c in range(n_cells + 1):
            start[c] = 0
        for i in range(n):
            p = wp.cw_mul(position(b, i) - origin, inverse)
            u = wp.clamp(int(wp.floor(p[axis[0]])), 0, cells[0] - 1)
            v = wp.clamp(int(wp.floor(p[axis[1]])), 0, cells[1] - 1)
            w = wp.clamp(int(wp.floor(p[axis[2]])), 0, cells[2] - 1)
            c = (u * cells[1] + v) * cells[2] + w
            cell[i] = c
            start[c + 1] += 1
        for c in range(n_cells):
            start[c + 1] += start[c]
        for k in range(n):
            i = n - 1 - k
            c = cell[i]
            last = start[c + 1] - 1
            start[c + 1] = last
            order[last] = i
        for c in range(n_cells):
            start[c] = start[c + 1]
        start[n_cells] = n

    @wp.kernel(enable_backward=False, module="unique")
    def keep(
        # inputs
        lists: Lists,
        regions: int,
        base: wp.array(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        place: wp.array(dtype=wp.int32),
        n: int,
        # outputs
        kept: Kept,
        head: wp.array(dtype=wp.int32),
    ):
        """Takes the pairs that have a memory out of the lists, chained to the lower of their new indices."""
        total = int(0)
        for i in range(n):
            head[i] = -1
        for r in range(regions):
            for q in range(count[r]):
                k = base[r] + q
                m = lists.memory[k]
                if m[3] != real(0.0):
                    a, c = place[lists.i[k]], place[lists.j[k]]
                    put(kept, total, wp.min(a, c), wp.max(a, c), seen(m, a, c), head)
                    total += 1

    @wp.func
    def carried(i: int, j: int, kept: Kept, head: wp.array(dtype=wp.int32)):
        out = vec4()
        lower, upper = wp.min(i, j), wp.max(i, j)
        k = head[lower]
        while k >= 0:
            if kept.j[k] == upper:
                out = seen(kept.memory[k], i, j)
            k = kept.follow[k]
        return out

    @wp.kernel(enable_backward=False, module="unique")
    def build(
        # inputs
        part: int,
        parts: int,
        ranges: wp.array(dtype=wp.int32),
        b: Bodies,
        skin: wp.float64,
        origin: wp.vec3d,
        inverse: wp.vec3d,
        axis: wp.vec3i,
        cells: wp.vec3i,
        start: wp.array(dtype=wp.int32),
        kept: Kept,
        head: wp.array(dtype=wp.int32),
        base: wp.array(dtype=wp.int32),
        # outputs
        lists: Lists,
        count: wp.array(dtype=wp.int32),
    ):
        """Lists the pairs of the part's own particles with a gap below the skin; counts beyond the capacity, too."""
        begin, end = ranges[part], ranges[part + 1]
        room = base[2 * part + 1] - base[2 * part]
        room_across = base[2 * part + 2] - base[2 * part + 1]
        inside, across = int(0), int(0)
        for i in range(begin, end):
            xi = position(b, i)
            ri = b.kin[i][6]
            p = wp.cw_mul(xi - origin, inverse)
            u = wp.clamp(int(wp.floor(p[axis[0]])), 0, cells[0] - 1)
            v = wp.clamp(int(wp.floor(p[axis[1]])), 0, cells[1] - 1)
            w = wp.clamp(int(wp.floor(p[axis[2]])), 0, cells[2] - 1)
            w0, w1 = wp.max(w - 1, 0), wp.min(w + 1, cells[2] - 1)
            for row in range(5):
                # the own column from i on, then the next column of this layer, then three of the next layer
                uu, vv, first = u, v, i + 1
                if row == 1:
                    vv = v + 1
                if row > 1:
                    uu = u + 1
                    vv = v + row - 3
                uu = folded(uu, cells[0], b.inverse_box[axis[0]])
                vv = folded(vv, cells[1], b.inverse_box[axis[1]])
                if uu >= cells[0] or vv < 0 or vv >= cells[1]:
                    continue
                column = (uu * cells[1] + vv) * cells[2]
                last = start[column + w1 + 1] + 0
                if row > 0:
                    first = start[column + w0] + 0
                for turn in range(turns):
                    if turn == 1:
                        # around the corner of the column: ahead, and behind where the column is not the own one
                        other = folded(w + 1, cells[2], b.inverse_box[axis[2]])
                        if w == 0 and row > 0:
                            other = folded(-1, cells[2], b.inverse_box[axis[2]])
                        if other < 0 or other >= cells[2] or wp.abs(other - w) < 2:
                            continue
                        first, last = start[column + other] + 0, start[column + other + 1] + 0
                    for j in range(first, last):
                        d = nearest(b, xi - position(b, j))
                        reach = ri + b.kin[j][6] + skin
                        if wp.dot(d, d) < reach * reach:
                            if j >= begin and j < end:
                                if inside < room:
                                    k = base[2 * part] + inside
                                    lists.i[k] = i
                                    lists.j[k] = j
                                    if k < lists.memory.shape[0]:
                                        lists.memory[k] = carried(i, j, kept, head)
                                inside += 1
                            else:
                                if across < room_across:
                                    k = base[2 * part + 1] + across
                                    lists.i[k] = i
                                    lists.j[k] = j
                                    if k < lists.memory.shape[0]:
                                        lists.memory[k] = carried(i, j, kept, head)
                                across += 1
        count[2 * part] = inside
        count[2 * part + 1] = across

    @wp.kernel(enable_backward=False, module="unique")
    def keep_walls(
        # inputs
        lists: Lists,
        parts: int,
        capacity: int,
        count: wp.array(dtype=wp.int32),
        place: wp.array(dtype=wp.int32),
        bodies: int,
        # outputs
        kept: Kept,
        head: wp.array(dtype=wp.int32),
    ):
        """Takes the wall candidates that have a memory out of the lists, chained to the new index of their body."""
        total = int(0)
        for i in range(bodies):
            head[i] = -1
        for p in range(parts):
            for q in range(p * capacity, p * capacity + count[p]):
                if lists.wall_memory[q][3] != real(0.0):
                    put(kept, total, place[lists.wall_i[q]], lists.wall_f[q], lists.wall_memory[q], head)
                    total += 1

    @wp.kernel(enable_backward=False, module="unique")
    def build_walls(
        # inputs
        part: int,
        first: int,
        last: int,
        b: Bodies,
        walls: Walls,
        skin: wp.float64,
        kept: Kept,
        head: wp.array(dtype=wp.int32),
        base: int,
        capacity: int,
        # outputs
        lists: Lists,
        count: wp.array(dtype=wp.int32),
    ):
        """Lists the wall features near the particles first..last, behind those that the part has already."""
        found = int(count[part])
        for i in range(first, last):
            begin = base + found
            near = gather(walls, position(b, i), b.kin[i][6], skin, begin, 1, capacity - found, lists.wall_f)
            for k in range(begin, wp.min(begin + near, base + capacity)):
                lists.wall_i[k] = i
                if k < lists.wall_memory.shape[0]:
                    memory = vec4()
                    q = head[i]
                    while q >= 0:
                        if kept.j[q] == lists.wall_f[k]:
                            memory = kept.memory[q]
                        q = kept.follow[q]
                    lists.wall_memory[k] = memory
            found += near
        count[part] = found

    return SimpleNamespace(
        bounds=bounds,
        sort=sort,
        keep=keep,
        build=build,
        keep_walls=keep_walls,
        build_walls=build_walls,
    )


# Writes the pairs of a region with a gap below `skin` into `near` and returns their number.
_PICK_NEAR = (
    """
const double* kin = (const double*)bodies.kin.data;
int found = 0;
for (int first = base; first < base + count; first += W) {
    int i[W], j[W], last = base + count - 1;
    for (int k = 0; k < W; ++k) {
        int q = first + k < last ? first + k : last;
        i[k] = lists.i.data[q];
        j[k] = lists.j.data[q];
    }
"""
    + separation()
    + """
    D reach = ri + rj + skin;
    auto near = d0 * d0 + d1 * d1 + d2 * d2 < reach * reach;
    const int block = last - first + 1 < W ? last - first + 1 : W;
    for (int k = 0; k < block; ++k) {
        lists.near.data[base + found] = first + k;
        found += near[k] ? 1 : 0;
    }
    if constexpr (history)
        if (forget)
            for (int k = 0; k < block; ++k) {
                real* memory = (real*)lists.memory.data + 4 * (first + k);
                if (!near[k] && memory[3] != 0) memory[0] = memory[1] = memory[2] = memory[3] = 0;
            }
}
return found;
"""
)


@cache
def near_functions(precision: str, periodic: bool, radii: bool, history: bool) -> Any:
    """Warp functions that pick the near pairs of a region and the candidates of the large bodies.

    `radii`: bodies have different ones; `history`: contacts have a memory, which with `forget` = 1 the pairs lose that
    are not near. Otherwise none of those may have one.
    """
    t = types(precision)
    real, vec4, Bodies, Lists = t.real, t.vec4, t.Bodies, t.Lists
    position = position_function(precision)
    image = image_functions(precision, periodic)
    nearest = image.nearest
    radius = radius_function(precision, radii)

    @wp.func_native(compiled_apart(prelude(precision, periodic=periodic, radii=radii, history=history) + _PICK_NEAR))
    def pick_near(bodies: Bodies, lists: Lists, base: int, count: int, skin: wp.float64, forget: int) -> int: ...

    @wp.func
    def pick_big(b: Bodies, lists: Lists, n: int, total: int, skin: wp.float64, capacity: int):
        """Lists all bodies within `skin` of each large body n..total; counts on beyond the capacity.

        Two large bodies are always listed: both may be fast, and the skin allows for one of them.
        """
        found = int(0)
        for j in range(n, total):
            xj = position(b, j)
            rj = radius(b, b.kin[j]) + skin
            for i in range(j):
                d = nearest(b, position(b, i) - xj)
                reach = radius(b, b.kin[i]) + rj
                if i >= n or wp.dot(d, d) < reach * reach:
                    if found < capacity:
                        lists.big_i[found] = i
                        lists.big_j[found] = j
                    found += 1
                elif wp.static(history):
                    if lists.big_memory[(j - n) * total + i][3] != real(0.0):
                        lists.big_memory[(j - n) * total + i] = vec4()
        return found

    return SimpleNamespace(pick_near=pick_near, pick_big=pick_big)
