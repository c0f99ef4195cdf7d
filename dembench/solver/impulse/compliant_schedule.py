"""The schedule of compliant rows: in which block and lane each of them stands, and its constants there.

No body is twice in a block, see `blocks`.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.blocks import FORGET, PUT
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
from dembench.solver.sync import barrier
from dembench.solver.types import types
from dembench.solver.walls.records import Walls

_PUT = (
    PUT
    + """
auto row = [&](int i, int j, int slot) {
    return [=](int block, int lane) {
        if (block >= room) return;
        int at = (first + block) * W + lane;
        if (lane == 0)
            for (int q = at; q < at + W; ++q) {
                rows.i.data[q] = rows.j.data[q] = fixed;
                rows.slot.data[q] = -1;
            }
        rows.i.data[at] = i; rows.j.data[at] = j; rows.slot.data[at] = slot;
    };
};
"""
)
_PAIRS = """
for (int q = region; q < region + count; ++q) {
    int k = lists.near.data[q];
    put(lists.i.data[k], lists.j.data[k], false, row(lists.i.data[k], lists.j.data[k], k));
}
return first + used;
"""
_WALLS = """
for (int q = region; q < region + count; ++q)
    put(lists.wall_i.data[q], fixed, true, row(lists.wall_i.data[q], fixed, q));
return first + used;
"""
_BIGS = """
for (int q = 0; q < count; ++q) {
    int i = lists.big_i.data[q], j = lists.big_j.data[q];
    put(i, j, false, row(i, j, (j - small) * total + i));
}
return first + used;
"""


@cache
def schedule_function(o: CompliantOptions) -> Any:
    """A Warp function that writes bodies, slots and constants of all rows into blocks; all threads call it.

    It returns whether they fit: where the room of a segment, or that of its constants, does not suffice, nothing is
    written behind it, but `state` says what it would need. `fixed` is the index of what does not move.
    """
    precision = o.law.precision
    t = types(precision)
    Bodies, PairClass, Lists = t.Bodies, t.PairClass, t.Lists
    Rows = compliant_types(precision)
    of_pair, of_wall = pair_lookup(precision, o.pairs, o.radii)
    constants = constants_function(o)
    present, bigs, threads, shared = o.walls.present, o.bigs, o.threads, o.shared
    lanes, flags, per_segment = wp.constant(LANES), wp.constant(FLAGS), wp.constant(PER_SEGMENT)

    @wp.func_native(FORGET)
    def forget(rows: Rows, begin: int, end: int): ...

    @wp.func_native(_PUT + _PAIRS)
    def put_pairs(rows: Rows, lists: Lists, region: int, count: int, first: int, room: int, fixed: int) -> int: ...

    @wp.func_native(_PUT + _WALLS)
    def put_walls(rows: Rows, lists: Lists, region: int, count: int, first: int, room: int, fixed: int) -> int: ...

    @wp.func_native(_PUT + _BIGS)
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

    @wp.func
    def fit(rows: Rows, parts: int, row_base: wp.array(dtype=wp.int32), state: wp.array(dtype=wp.int32)):
        out = int(1)
        for p in range(parts + 1):
            used = state[flags + per_segment * p + 1] + 0
            if used > row_base[p + 1]:
                out = 0
            if wp.static(shared):
                if used - state[flags + per_segment * p] > rows.c_base[p + 1] - rows.c_base[p]:
                    out = 0
        return out

    @wp.func
    def schedule(
        b: Bodies,
        lists: Lists,
        rows: Rows,
        walls: Walls,
        part: int,
        parts: int,
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
        own(
            b,
            lists,
            rows,
            walls,
            part,
            fixed,
            ranges,
            n,
            total,
            base,
            near_count,
            wall_capacity,
            wall_count,
            row_base,
            pair_table,
            pair_columns,
            wall_table,
            wall_columns,
            state,
        )
        if wp.static(threads):
            barrier(state, parts)
        if part == 0:
            bridge(b, lists, rows, parts, fixed, n, total, base, near_count, row_base, pair_table, pair_columns, state)
        if wp.static(threads):
            barrier(state, parts)
        return fit(rows, parts, row_base, state)

    return schedule
