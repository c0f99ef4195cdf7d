"""Blocks of rows that share no body: the lanes of a block are opened and solved at the same time.

Each contact goes into the first of the next WINDOW blocks that is not full and has neither of its bodies. The window
moves on when its first block is full, or where all of its blocks are full or have one of the bodies.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.impulse.compliant_rows import C, CompliantOptions, compliant_types
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
    """Warp functions that write bodies, slots and constants of rows into blocks from `first` on; they return the end.

    They go on counting beyond `end`, where nothing is written. Bodies begin..last are those that may occur. pairs: the
    near pairs of a region that begins at `base`; walls: candidates at walls, with `fixed` for what does not move; bigs:
    candidates of large bodies.
    """
    precision = o.law.precision
    t = types(precision)
    Bodies, PairClass, Lists = t.Bodies, t.PairClass, t.Lists
    Rows = compliant_types(precision)
    of_pair, of_wall = pair_lookup(precision, o.pairs, o.radii)
    lanes = wp.constant(LANES)

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
    def set_constants(rows: Rows, row: int, c: PairClass):
        at = row / lanes * wp.static(C) * lanes + row % lanes
        rows.c[at] = c.kn
        rows.c[at + lanes] = c.kt
        rows.c[at + 2 * lanes] = c.dn
        rows.c[at + 3 * lanes] = c.dt
        rows.c[at + 4 * lanes] = c.mu

    @wp.func
    def constants_of_pairs(b: Bodies, rows: Rows, first: int, end: int, table: wp.array(dtype=PairClass), columns: int):
        for row in range(first * lanes, end * lanes):
            c = PairClass()
            if rows.slot[row] >= 0:
                c = of_pair(b, rows.i[row], rows.j[row], table, columns)
            set_constants(rows, row, c)

    @wp.func
    def pairs(
        b: Bodies,
        lists: Lists,
        rows: Rows,
        region: int,
        count: int,
        first: int,
        end: int,
        fixed: int,
        table: wp.array(dtype=PairClass),
        columns: int,
    ):
        found = put_pairs(rows, lists, region, count, first, end - first, fixed)
        constants_of_pairs(b, rows, first, wp.min(found, end), table, columns)
        return found

    @wp.func
    def bigs(
        b: Bodies,
        lists: Lists,
        rows: Rows,
        count: int,
        small: int,
        total: int,
        first: int,
        end: int,
        fixed: int,
        table: wp.array(dtype=PairClass),
        columns: int,
    ):
        found = put_bigs(rows, lists, count, small, total, first, end - first, fixed)
        constants_of_pairs(b, rows, first, wp.min(found, end), table, columns)
        return found

    @wp.func
    def walls(
        b: Bodies,
        lists: Lists,
        rows: Rows,
        features: Walls,
        region: int,
        count: int,
        first: int,
        end: int,
        fixed: int,
        table: wp.array(dtype=PairClass),
        columns: int,
    ):
        found = put_walls(rows, lists, region, count, first, end - first, fixed)
        for row in range(first * lanes, wp.min(found, end) * lanes):
            c = PairClass()
            q = rows.slot[row] + 0
            if q >= 0:
                c = of_wall(b, rows.i[row], features.features[lists.wall_f[q]].kind, table, columns)
            set_constants(rows, row, c)
        return found

    return SimpleNamespace(forget=forget, pairs=pairs, walls=walls, bigs=bigs)
