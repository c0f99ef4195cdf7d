"""Gauss-Seidel over compliant rows: the force of each row is solved together with the velocities that it leaves.

A substep h is a half drift, a change of velocities, and a half drift, so a contact goes the way h (v0 + v)/2 with the
separation speeds v0 before and v after it, from the overlap d0 to d1. With the elastic energy U(d) and the stiffness kt
and dashpots c and ct of the law (`laws.py`):

    normal      Fn = (U(d0) - U(d1))/(d0 - d1) - c (1 + s2 (h omega)^2) (v0 + v)/2
    tangential  Ft = -s kt (xi0 + xi1)/2 - ct (vt0 + vt)/2,      xi1 = xi0 + s h (vt0 + vt)/2
    sliding     s |kt xi1| > mu |Fn|: Ft = mu |Fn| along that spring, no dashpot; nothing where mu |Fn| = 0

The elastic force is the mean over the way of the substep, so its work is the change of U: an elastic contact gives back
what it took, whatever the substep (discrete gradient: Gonzalez 1996, doi 10.1007/BF02440162), and only the dashpots and
friction dissipate. s is the part of the way on which the two touch; c and ct are means over the way; kt is taken at d1,
so that no spring is bent with less than the stiffness that it is left with; s2: see SQUARES. For h -> 0 all this is the
soft-sphere law.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.compliant_rows import (
    BRIDGE,
    OWN,
    A,
    B,
    C,
    CompliantOptions,
    compliant_types,
    constants_function,
)
from dembench.solver.lanes import prelude
from dembench.solver.sync import barrier
from dembench.solver.types import types

NEWTON = 2
"""Newton iterations of the normal force in a visit."""
SQUARES = {"linear": 1 / 6, "hertz": 1 / 8}
"""Part of (h omega)^2 by which a dashpot is larger in a substep h. The mean of two speeds dissipates less than the
speeds between them: 1/6 of (h omega)^2 less in a linear contact, where the substep is the implicit midpoint rule with
its longer contact; 1/8 measured for Hertz contacts of any restitution."""


# The mean elastic force on the way between two overlaps (negative: gaps), its derivative by the second, the mean over
# the way of the power 1/4 of the overlap, and the mean tangent stiffness that goes with it; `part` is that of the way
# on which the two touch.
_NORMAL = """
auto part_of = [&](F before, F after) {
    F deeper = larger(larger(before, after), zero), span = larger(before, after) - smaller(before, after);
    return smaller(before, after) > 0 ? one : deeper > 0 ? deeper / span : zero;
};
auto normal_law = [&](F before, F after, F& force, F& slope, F& quarter, F& stiffness) {
    F d0 = larger(before, zero), d1 = larger(after, zero), deeper = larger(d0, d1), part = part_of(before, after);
    auto inside = smaller(before, after) > 0;
    F span = after - before;
    span = span == 0 ? one : span;
    if constexpr (linear) {
        force = inside ? kn * (before + after) / 2 : kn * deeper * part / 2;
        slope = inside ? kn / 2 : (after > 0 ? kn * d1 - force : -force) / span;
        quarter = part;
        stiffness = kn * part;
    } else {
        F s0 = root(d0), s1 = root(d1), both = s0 * s1;
        F inverse = inside ? 1 / (s0 + s1) : zero, share = real(0.4) * kn * inverse;
        F rest = root(inside ? (before + after) / 2 : deeper);
        force = inside ? share * (d1 * d1 + d0 * d0 + both * (d0 + d1 + both)) : real(0.4) * kn * deeper * rest * part;
        F within = share * inverse * (d1 * (real(1.5) * s1 + 3 * s0) + d0 * (2 * s1 + s0));
        slope = inside ? within : (after > 0 ? kn * d1 * s1 - force : -force) / span;
        quarter = root(rest) * (inside ? one : real(0.8) * part);
        stiffness = real(1.5) * kn * rest * part;
    }
};
"""

# The velocities of the two bodies of each lane, what they gain from the change of impulse, and the spring that is left.
_SWEEP = (
    """
F zero = full(0), one = full(1);
for (int q = first; q < end; ++q) {
    int block = reverse ? first + end - 1 - q : q;
    int next = reverse ? (block > first ? block - 1 : block) : (block + 1 < end ? block + 1 : block);
    const int *i = rows.i.data + block * W, *j = rows.j.data + block * W;
    for (int k = 0; k < W; ++k) {
        __builtin_prefetch(&rows.u.data[rows.i.data[next * W + k]], 1);
        __builtin_prefetch(&rows.u.data[rows.j.data[next * W + k]], 1);
    }
    const real *a = rows.a.data + block * (A * W), *c = rows.c.data + (block_of_c + stride * (block - first)) * (C * W);
    real *b = rows.b.data + block * (B * W), *u = (real*)rows.u.data;

    F ui[8], uj[8];
    rows8(u, i, ui);
    rows8(u, j, uj);
    F n0 = at(a), n1 = at(a + W), n2 = at(a + 2 * W), overlap = at(a + 3 * W);
    F start0 = at(a + 4 * W), start1 = at(a + 5 * W), start2 = at(a + 6 * W);
    F old0 = at(b + 4 * W), old1 = at(b + 5 * W), old2 = at(b + 6 * W);
    F kn = at(c), dn = at(c + 2 * W);

    F g0 = start0 + ui[0] - uj[0], g1 = start1 + ui[1] - uj[1], g2 = start2 + ui[2] - uj[2], ai, aj;
    if constexpr (friction) {
        ai = at(a + 7 * W); aj = at(b + 3 * W);
        F s0 = ai * ui[4] + aj * uj[4], s1 = ai * ui[5] + aj * uj[5], s2 = ai * ui[6] + aj * uj[6];
        g0 += n1 * s2 - n2 * s1; g1 += n2 * s0 - n0 * s2; g2 += n0 * s1 - n1 * s0;
    }
    F vn = g0 * n0 + g1 * n1 + g2 * n2, w = ui[3] + uj[3], normal_old = old0 * n0 + old1 * n1 + old2 * n2;
    F free = vn - w * normal_old, before = start0 * n0 + start1 * n1 + start2 * n2;
    real ahead = h / 2;
"""
    + _NORMAL
    + """
    F from = overlap + ahead * before, v = vn, force, quarter, slope, stiffness, value;
    for (int k = 0; k < newton; ++k) {
        normal_law(from, overlap - ahead * v, value, slope, quarter, stiffness);
        F dashpot = dn * quarter * (1 + squares * h * h * w * stiffness);
        value -= dashpot * (before + v) / 2;
        slope = (h * slope + dashpot) / 2;
        F step = (free + w * h * value - v) / (1 + w * h * slope);
        force = value - slope * step;
        v += step;
    }
    if constexpr (no_tension) force = larger(force, zero);
    F p0 = h * force * n0, p1 = h * force * n1, p2 = h * force * n2;
    if constexpr (friction) {
        F x0 = at(b), x1 = at(b + W), x2 = at(b + 2 * W), kt = at(c + W), dt = at(c + 3 * W), mu = at(c + 4 * W);
        F wt = w + ai * ai * ui[7] + aj * aj * uj[7], left = overlap - ahead * v, touching = part_of(from, left);
        F l0 = old0 - normal_old * n0, l1 = old1 - normal_old * n1, l2 = old2 - normal_old * n2;
        F slip0 = g0 - vn * n0 - wt * l0, slip1 = g1 - vn * n1 - wt * l1, slip2 = g2 - vn * n2 - wt * l2;
        F way0 = start0 - before * n0 + slip0, way1 = start1 - before * n1 + slip1, way2 = start2 - before * n2 + slip2;
        kt *= linear ? touching : touching * root(larger(left, zero));
        F resist = touching * kt * h / 2 + dt * quarter, give = -h / (1 + ahead * resist * wt);
        l0 = (kt * x0 + resist * way0 / 2) * give;
        l1 = (kt * x1 + resist * way1 / 2) * give;
        l2 = (kt * x2 + resist * way2 / 2) * give;
        F e0 = x0 + touching * ahead * (way0 + wt * l0);
        F e1 = x1 + touching * ahead * (way1 + wt * l1);
        F e2 = x2 + touching * ahead * (way2 + wt * l2);
        F bound = mu * (force < 0 ? -force : force), stretched = kt * kt * (e0 * e0 + e1 * e1 + e2 * e2);
        // without a normal force there is neither spring nor dashpot
        auto slides = stretched > bound * bound;
        F shrunk = bound > 0 ? (slides ? bound / root(stretched) : one) : zero;
        e0 *= shrunk; e1 *= shrunk; e2 *= shrunk;
        auto held = (bound > 0) & slides;
        l0 = held ? -h * kt * e0 : bound > 0 ? l0 : zero;
        l1 = held ? -h * kt * e1 : bound > 0 ? l1 : zero;
        l2 = held ? -h * kt * e2 : bound > 0 ? l2 : zero;
        p0 += l0; p1 += l1; p2 += l2;
        if (last) {
            e0 -= ahead * (slip0 + wt * l0); e1 -= ahead * (slip1 + wt * l1); e2 -= ahead * (slip2 + wt * l2);
            F kept[4] = {e0, e1, e2, left > 0 ? one : zero};
            put4((real*)memory.data, rows.slot.data + block * W, kept);
        }
    }
    to(b + 4 * W, p0); to(b + 5 * W, p1); to(b + 6 * W, p2);
    p0 -= old0; p1 -= old1; p2 -= old2;
    ui[0] += ui[3] * p0; ui[1] += ui[3] * p1; ui[2] += ui[3] * p2;
    uj[0] -= uj[3] * p0; uj[1] -= uj[3] * p1; uj[2] -= uj[3] * p2;
    if constexpr (friction) {
        F r0 = n1 * p2 - n2 * p1, r1 = n2 * p0 - n0 * p2, r2 = n0 * p1 - n1 * p0, ti = ai * ui[7], tj = aj * uj[7];
        ui[4] -= ti * r0; ui[5] -= ti * r1; ui[6] -= ti * r2;
        uj[4] -= tj * r0; uj[5] -= tj * r1; uj[6] -= tj * r2;
    }
    put8(u, i, ui);
    put8(u, j, uj);
}
"""
)


@cache
def solve_function(o: CompliantOptions) -> Any:
    """A Warp function that visits the rows of a thread, and those of the bridge with the first one, in some sweeps.

    In the last of them the springs are remembered, with whether the two touch. own..other..own_end and
    bridge..bridge_other..bridge_end: blocks of the segments, see `compliant_schedule`.
    """
    t = types(o.law.precision)
    real, Lists = t.real, t.Lists
    Rows = compliant_types(o.law.precision)
    threads, shared, constants = o.threads, o.shared, constants_function(o)
    declared = prelude(
        o.law.precision,
        A=A,
        B=B,
        C=C,
        newton=NEWTON,
        squares=SQUARES["linear" if o.law.linear else "hertz"],
        friction=o.law.friction,
        linear=o.law.linear,
        no_tension=o.law.no_tension,
    )

    # block_of_c belongs to the block `first`; stride: from one to the next
    @wp.func_native(declared + _SWEEP)
    def sweep(
        rows: Rows,
        memory: wp.array(dtype=t.vec4),
        first: int,
        end: int,
        block_of_c: int,
        stride: int,
        h: real,
        reverse: int,
        last: int,
    ): ...

    @wp.func
    def sweep_pairs(rows: Rows, lists: Lists, first: int, end: int, h: real, reverse: int, last: int):
        if wp.static(shared):
            sweep(rows, lists.memory, first, end, 0, 0, h, reverse, last)
        else:
            sweep(rows, lists.memory, first, end, first, 1, h, reverse, last)

    @wp.func
    def solve(
        rows: Rows,
        lists: Lists,
        part: int,
        parts: int,
        sweeps: int,
        direction: int,
        own: int,
        other: int,
        own_end: int,
        bridge: int,
        bridge_other: int,
        bridge_end: int,
        h: real,
        state: wp.array(dtype=wp.int32),
    ):
        """Sweeps go from the own segment of a thread to the bridge, and back."""
        visited = int(BRIDGE)
        for s in range(sweeps):
            reverse = (direction + s) % 2
            last = int(0)
            if s == sweeps - 1:
                last = 1
            for turn in range(2):
                kind = (turn + reverse) % 2
                if wp.static(threads):
                    if kind != visited:
                        barrier(state, parts)
                visited = kind + 0
                if kind == OWN:
                    for half_way in range(2):
                        if half_way == reverse:
                            sweep_pairs(rows, lists, own, other, h, reverse, last)
                        else:
                            of_walls = constants(rows, part, other)
                            sweep(rows, lists.wall_memory, other, own_end, of_walls, 1, h, reverse, last)
                elif part == 0:
                    for half_way in range(2):
                        if half_way == reverse:
                            sweep_pairs(rows, lists, bridge, bridge_other, h, reverse, last)
                        else:
                            of_bigs = constants(rows, parts, bridge_other)
                            sweep(rows, lists.big_memory, bridge_other, bridge_end, of_bigs, 1, h, reverse, last)
        if wp.static(threads):
            if visited == BRIDGE:
                barrier(state, parts)

    return solve
