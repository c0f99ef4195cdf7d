"""Rigid rows by lanes: rows of pairs in blocks that share no body, and visits of a block at a time.

What the lanes compute is what `sweeps` and `positions` have for one row.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.impulse.blocks import FORGET, PUT
from dembench.solver.impulse.rows import ImpulseOptions, row_types
from dembench.solver.impulse.segments import BLOCKS, END, FLAGS, OTHER, PER_SEGMENT, Share, flag
from dembench.solver.lanes import prelude
from dembench.solver.types import types

# Rows without room in blocks, and those from `pairs` on, stand from `behind` on. Lanes without a row: `nil`.
_ORDER = (
    PUT
    + """
int *order = rows.order.data + at, *others = rows.order.data + behind, rest = 0, room = (behind - at) / W;
for (int r = first; r < pairs; ++r)
    put(rows.i.data[r], rows.j.data[r], false, [&](int block, int lane) {
        if (block >= room) { others[rest++] = r; return; }
        if (lane == 0) for (int q = 0; q < W; ++q) order[block * W + q] = nil;
        order[block * W + lane] = r;
    });
for (int r = pairs; r < last; ++r) others[rest++] = r;
share.state.data[flags] = used < room ? used : room;
share.state.data[flags + 1] = rest;
"""
)

_VELOCITIES = """
int changed = 0;
for (int q = 0; q < blocks; ++q) {
    const int *r = rows.order.data + first + (reverse ? blocks - 1 - q : q) * W;
    int i[W], j[W];
    for (int k = 0; k < W; ++k) { i[k] = rows.i.data[r[k]]; j[k] = rows.j.data[r[k]]; }
    real *u = (real*)rows.u.data;
    F a[8], b[8], ui[8], uj[8];
    rows8((real*)rows.a.data, r, a);
    rows8((real*)rows.b.data, r, b);
    rows8(u, i, ui);
    rows8(u, j, uj);
    F v0 = ui[0] - uj[0], v1 = ui[1] - uj[1], v2 = ui[2] - uj[2];
    if constexpr (friction) {
        F s0 = a[7] * ui[4] + b[0] * uj[4], s1 = a[7] * ui[5] + b[0] * uj[5], s2 = a[7] * ui[6] + b[0] * uj[6];
        v0 += a[1] * s2 - a[2] * s1; v1 += a[2] * s0 - a[0] * s2; v2 += a[0] * s1 - a[1] * s0;
    }
    F vn = v0 * a[0] + v1 * a[1] + v2 * a[2], zero = full(0);
    F load = larger(zero, b[1] + (smaller(a[3], zero) - vn) * a[4]), normal = load - b[1], size2 = normal * normal;
    F p0 = normal * a[0], p1 = normal * a[1], p2 = normal * a[2];
    b[1] = load;
    if constexpr (friction) {
        F l0 = b[4] - a[5] * (v0 - vn * a[0]), l1 = b[5] - a[5] * (v1 - vn * a[1]), l2 = b[6] - a[5] * (v2 - vn * a[2]);
        F bound = a[6] * (load + b[7]), asked = l0 * l0 + l1 * l1 + l2 * l2;
        F part = asked > bound * bound ? bound / root(asked) : full(1);
        l0 *= part; l1 *= part; l2 *= part;
        F c0 = l0 - b[4], c1 = l1 - b[5], c2 = l2 - b[6];
        b[4] = l0; b[5] = l1; b[6] = l2;
        size2 += c0 * c0 + c1 * c1 + c2 * c2;
        p0 += c0; p1 += c1; p2 += c2;
        F t0 = a[1] * c2 - a[2] * c1, t1 = a[2] * c0 - a[0] * c2, t2 = a[0] * c1 - a[1] * c0;
        F wi = a[7] * ui[7], wj = b[0] * uj[7];
        ui[4] -= wi * t0; ui[5] -= wi * t1; ui[6] -= wi * t2;
        uj[4] -= wj * t0; uj[5] -= wj * t1; uj[6] -= wj * t2;
    }
    ui[0] += ui[3] * p0; ui[1] += ui[3] * p1; ui[2] += ui[3] * p2;
    uj[0] -= uj[3] * p0; uj[1] -= uj[3] * p1; uj[2] -= uj[3] * p2;
    auto more = size2 > still * still * a[4] * a[4];
    for (int k = 0; k < W; ++k) changed -= more[k];
    put8((real*)rows.b.data, r, b);
    put8(u, i, ui);
    put8(u, j, uj);
}
return changed;
"""

_POSITIONS = """
F largest = full(0);
for (int q = 0; q < blocks; ++q) {
    const int *r = rows.order.data + first + (reverse ? blocks - 1 - q : q) * W;
    int i[W], j[W];
    real push[W];
    for (int k = 0; k < W; ++k) {
        i[k] = rows.i.data[r[k]]; j[k] = rows.j.data[r[k]]; push[k] = rows.push.data[r[k]];
    }
    real *s = (real*)rows.shift.data;
    F e[4], si[4], sj[4];
    rows4((real*)rows.apart.data, r, e);
    rows4(s, i, si);
    rows4(s, j, sj);
    F d0 = e[0] + si[0] - sj[0], d1 = e[1] + si[1] - sj[1], d2 = e[2] + si[2] - sj[2], zero = full(0);
    F length = root(d0 * d0 + d1 * d1 + d2 * d2), overlap = e[3] - length, mass = si[3] + sj[3], held = at(push) * dt;
    auto acts = (overlap > slop) | (held > 0);
    F way = acts ? larger(overlap / mass, -held) : zero, along = length > 0 ? way / length : zero;
    largest = larger(largest, overlap);
    held = (held + way) / dt;
    for (int k = 0; k < W; ++k) rows.push.data[r[k]] = held[k];
    d0 *= along; d1 *= along; d2 *= along;
    si[0] += si[3] * d0; si[1] += si[3] * d1; si[2] += si[3] * d2;
    sj[0] -= sj[3] * d0; sj[1] -= sj[3] * d1; sj[2] -= sj[3] * d2;
    put4(s, i, si);
    put4(s, j, sj);
}
real out = 0;
for (int k = 0; k < W; ++k) out = largest[k] > out ? largest[k] : out;
return out;
"""


@cache
def lane_functions(o: ImpulseOptions) -> Any:
    """Warp functions by blocks.

    order(rows, share, segment): puts the rows of pairs of a segment into blocks; those that find no place there, and
    the other rows, stand from `outside(rows, segment)` on in `order`. The bridge follows when all threads have done so
    with their segments. velocities(rows, first, blocks, still, reverse): see `sweep_functions`; the blocks begin at
    `first`. positions(rows, first, blocks, slop, dt, reverse): see `position_function`; returns the largest overlap.
    """
    t = types(o.precision)
    real, Rows = t.real, row_types(o.precision)
    declared, threads = prelude(o.precision, friction=o.friction), o.threads

    @wp.func_native(FORGET)
    def forget(rows: Rows, begin: int, end: int): ...

    @wp.func_native(_ORDER)
    def put(
        rows: Rows,
        share: Share,
        first: int,
        pairs: int,
        last: int,
        at: int,
        behind: int,
        nil: int,
        flags: int,
    ): ...

    @wp.func_native(declared + _VELOCITIES)
    def velocities(rows: Rows, first: int, blocks: int, still: real, reverse: int) -> int: ...

    @wp.func_native(declared + _POSITIONS)
    def positions(rows: Rows, first: int, blocks: int, slop: real, dt: real, reverse: int) -> real: ...

    @wp.func
    def blocks_at(rows: Rows, segment: int):
        """Where the blocks of a segment begin in `order`."""
        return rows.places[2 * segment] + 0

    @wp.func
    def outside(rows: Rows, segment: int):
        """Where the rows of a segment outside its blocks begin in `order`."""
        return rows.places[2 * segment + 1] + 0

    @wp.func
    def order(rows: Rows, share: Share, segment: int):
        if segment < share.parts:
            forget(rows, share.begin, share.end)
        put(
            rows,
            share,
            rows.base[segment],
            flag(share, segment, OTHER),
            flag(share, segment, END),
            blocks_at(rows, segment),
            outside(rows, segment),
            rows.i.shape[0] - 1 - segment % share.parts,
            wp.static(FLAGS) + wp.static(PER_SEGMENT) * segment + BLOCKS,
        )
        if wp.static(threads):
            if segment < share.parts:
                # for the rows of the bridge
                forget(rows, share.begin, share.end)

    return SimpleNamespace(
        order=order, velocities=velocities, positions=positions, blocks_at=blocks_at, outside=outside
    )
