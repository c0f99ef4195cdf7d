"""Blocks of rows that share no body: the lanes of a block are opened and solved at the same time.

Each contact goes into the first of the next WINDOW blocks that is not full and has neither of its bodies. The window
moves on when its first block is full, or where all of its blocks are full or have one of the bodies.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.impulse.compliant_rows import (
    FLAGS,
    PER_SEGMENT,
    C,
    CompliantOptions,
    compliant_types,
    constants_function,
)
from dembench.solver.lanes import LANES
from dembench.solver.pairs import pair_lookup
from dembench.solver.types import types
from dembench.solver.walls.records import Walls

WINDOW = 64

# Of a body, `mask` has the blocks of the window that began at `stamp` in which it is.
_BEGIN = f"""
constexpr int W = {LANES}, window = {WINDOW};
unsigned long long full = 0;
int base = 0, used = 0, filled[window] = {{0}};
auto blocks_of = [&](int i) -> unsigned long long {{
    int gone = base - rows.stamp.data[i];
    return gone < window ? rows.mask.data[i] >> gone : 0;
}};
auto move_on = [&](int blocks) {{
    for (int k = 0; k < window; ++k) filled[k] = k + blocks < window ? filled[k + blocks] : 0;
    full = blocks < window ? full >> blocks : 0;
    base += blocks;
}};
auto put = [&](int i, int j, int slot, bool still) {{
    while (true) {{
        unsigned long long taken = full | blocks_of(i) | (still ? 0 : blocks_of(j));
        if (taken + 1 == 0) {{ move_on(1); continue; }}
        int k = __builtin_ctzll(taken ^ ~0ull);
        int lane = (first + base + k) * W + filled[k];
        if (base + k < room) {{
            if (filled[k] == 0)
                for (int q = lane; q < lane + W; ++q) {{
                    rows.i.data[q] = rows.j.data[q] = fixed;
                    rows.slot.data[q] = -1;
                }}
            rows.i.data[lane] = i; rows.j.data[lane] = j; rows.slot.data[lane] = slot;
        }}
        rows.mask.data[i] = blocks_of(i) | 1ull << k;
        rows.stamp.data[i] = base;
        if (!still) {{
            rows.mask.data[j] = blocks_of(j) | 1ull << k;
            rows.stamp.data[j] = base;
        }}
        if (base + k + 1 > used) used = base + k + 1;
        if (++filled[k] == W) full |= 1ull << k;
        int whole = full + 1 == 0 ? window : __builtin_ctzll(~full);
        if (whole) move_on(whole);
        return;
    }}
}};
"""
_PAIRS = """
for (int q = region; q < region + count; ++q) {
    int k = lists.near.data[q];
    put(lists.i.data[k], lists.j.data[k], k, false);
}
return first + used;
"""
_WALLS = """
for (int q = region; q < region + count; ++q) put(lists.wall_i.data[q], fixed, q, true);
return first + used;
"""
_BIGS = """
for (int q = 0; q < count; ++q) {
    int i = lists.big_i.data[q], j = lists.big_j.data[q];
    put(i, j, (j - small) * total + i, false);
}
return first + used;
"""
_CLEAR = "for (int i = begin; i < end; ++i) { rows.mask.data[i] = 0; rows.stamp.data[i] = 0; }"


@cache
def schedule_functions(o: CompliantOptions) -> Any:
    """Warp functions `own` and `bridge` that write bodies, slots and constants of the rows of a segment into blocks.

    Where the room of a segment, or that of its constants, does not suffice, nothing is written behind it, but `state`
    says what it would need. `fixed` is the index of what does not move.
    """
    precision = o.law.precision
    t = types(precision)
    Bodies, PairClass, Lists = t.Bodies, t.PairClass, t.Lists
    Rows = compliant_types(precision)
    of_pair, of_wall = pair_lookup(precision, o.pairs, o.radii)
    constants = constants_function(o)
    present, bigs, threads, shared = o.walls.present, o.bigs, o.threads, o.shared
    lanes, flags, per_segment = wp.constant(LANES), wp.constant(FLAGS), wp.constant(PER_SEGMENT)

    @wp.func_native(_CLEAR)
    def forget(rows: Rows, begin: int, end: int): ...

    @wp.func_native(_BEGIN + _PAIRS)
    def put_pairs(rows: Rows, lists: Lists, region: int, count: int, first: int, room: int, fixed: int) -> int: ...

    @wp.func_native(_BEGIN + _WALLS)
    def put_walls(rows: Rows, lists: Lists, region: int, count: int, first: int, room: int, fixed: int) -> int: ...

    @wp.func_native(_BEGIN + _BIGS)
    def put_bigs(
        rows: Rows, lists: Lists, count: int, small: int, total: int, first: int, room: int, fixed: int
    ) -> int: ...

    @wp.func
    def set_constants(rows: Rows, lane: int, c: PairClass):
        """Those of a lane of the blocks of c."""
        at = lane / lanes * wp.static(C) * lanes + lane % lanes
        rows.c[at] = c.kn
        rows.c[at + lanes] = c.kt
        rows.c[at + 2 * lanes] = c.dn
        rows.c[at + 3 * lanes] = c.dt
        rows.c[at + 4 * lanes] = c.mu

    @wp.func
    def constants_of_pairs(
        b: Bodies, rows: Rows, first: int, end: int, at: int, table: wp.array(dtype=PairClass), columns: int
    ):
        """Those of the blocks first..end, whose blocks in c begin at `at`."""
        for row in range(first * lanes, end * lanes):
            c = PairClass()
            if rows.slot[row] >= 0:
                c = of_pair(b, rows.i[row], rows.j[row], table, columns)
            set_constants(rows, row + (at - first) * lanes, c)

    @wp.func
    def with_constants(rows: Rows, segment: int, other: int, end: int):
        """The end of the blocks from `other` on for whose constants there is room."""
        last = int(end)
        if wp.static(shared):
            last = wp.min(end, other + rows.c_base[segment + 1] - rows.c_base[segment])
        return last

    @wp.func
    def own(
        b: Bodies,
        lists: Lists,
        rows: Rows,
        walls: Walls,
        part: int,
        fixed: int,
        ranges: wp.array(dtype=wp.int32),
        n: int,
        total: int,
        base: wp.array(dtype=wp.int32),
        near_count: wp.array(dtype=wp.int32),
        wall_capacity: int,
        wall_count: wp.array(dtype=wp.int32),
        row_base: wp.array(dtype=wp.int32),
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        state: wp.array(dtype=wp.int32),
    ):
        """The segment of a thread: near pairs within its range, and candidates at walls."""
        first, room = row_base[part] + 0, row_base[part + 1] + 0
        forget(rows, ranges[part], ranges[part + 1])
        other = put_pairs(rows, lists, base[2 * part], near_count[2 * part], first, room - first, fixed)
        if wp.static(shared):
            if part == 0:
                for lane in range(lanes):
                    set_constants(rows, lane, of_pair(b, 0, 0, pair_table, pair_columns))
        else:
            constants_of_pairs(b, rows, first, wp.min(other, room), first, pair_table, pair_columns)
        end = other + 0
        if wp.static(present):
            forget(rows, ranges[part], ranges[part + 1])
            if part == 0:
                forget(rows, n, total)
            end = put_walls(rows, lists, part * wall_capacity, wall_count[part], other, room - other, fixed)
            shift = (constants(rows, part, other) - other) * lanes
            for row in range(other * lanes, with_constants(rows, part, other, wp.min(end, room)) * lanes):
                c = PairClass()
                q = rows.slot[row] + 0
                if q >= 0:
                    kind = walls.features[lists.wall_f[q]].kind
                    c = of_wall(b, rows.i[row], kind, wall_table, wall_columns)
                set_constants(rows, row + shift, c)
        state[flags + per_segment * part] = other
        state[flags + per_segment * part + 1] = end

    @wp.func
    def bridge(
        b: Bodies,
        lists: Lists,
        rows: Rows,
        parts: int,
        fixed: int,
        n: int,
        total: int,
        base: wp.array(dtype=wp.int32),
        near_count: wp.array(dtype=wp.int32),
        row_base: wp.array(dtype=wp.int32),
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        state: wp.array(dtype=wp.int32),
    ):
        """The last segment: near pairs across the ranges of the threads, and candidates of large bodies."""
        first, room = row_base[parts] + 0, row_base[parts + 1] + 0
        other = first + 0
        if wp.static(threads):
            for p in range(parts):
                forget(rows, 0, total)
                across = 2 * p + 1
                other = put_pairs(rows, lists, base[across], near_count[across], other, room - other, fixed)
        if wp.static(not shared):
            constants_of_pairs(b, rows, first, wp.min(other, room), first, pair_table, pair_columns)
        end = other + 0
        if wp.static(bigs):
            forget(rows, 0, total)
            end = put_bigs(rows, lists, near_count[2 * parts], n, total, other, room - other, fixed)
            last, at = with_constants(rows, parts, other, wp.min(end, room)), constants(rows, parts, other)
            constants_of_pairs(b, rows, other, last, at, pair_table, pair_columns)
        state[flags + per_segment * parts] = other
        state[flags + per_segment * parts + 1] = end

    return SimpleNamespace(own=own, bridge=bridge)
