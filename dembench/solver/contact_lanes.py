"""Contacts of small bodies sixteen at a time: what `contacts.py` has for one, on vector registers.

A lane is a near pair. All lanes of a block are computed, whether they touch or not; what those do that touch is added
to the loads of their bodies one after the other, so that bodies may occur several times in a block.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.contacts import StepOptions
from dembench.solver.lanes import compiled_apart, prelude, separation
from dembench.solver.laws import ROLLING_SHARE
from dembench.solver.pairs import LINEAR_RADII, ONE, RADII, TABLE
from dembench.solver.types import types

# Bodies, velocities and overlaps of a block; lanes beyond the last pair repeat it.
_GEOMETRY = (
    """
    int slot[W], i[W], j[W];
    const int rest = end - begin;
    if (rest >= W) __builtin_memcpy(slot, lists.near.data + begin, sizeof(slot));
    else for (int k = 0; k < W; ++k) slot[k] = lists.near.data[k < rest ? begin + k : end - 1];
    for (int k = 0; k < W; ++k) i[k] = lists.i.data[slot[k]];
    for (int k = 0; k < W; ++k) j[k] = lists.j.data[slot[k]];
    if (rest >= 3 * W)
        for (int q = begin + 2 * W; q < begin + 3 * W; ++q) {
            int next = lists.j.data[lists.near.data[q]];
            __builtin_prefetch(kin + 8 * next);
            if constexpr (friction) __builtin_prefetch(spin + 4 * next);
            __builtin_prefetch(load + width * next, 1);
        }
"""
    + separation()
    + """
    F v0 = __builtin_convertvector(ki[3] - kj[3], F);
    F v1 = __builtin_convertvector(ki[4] - kj[4], F);
    F v2 = __builtin_convertvector(ki[5] - kj[5], F);
    D sum = ri + rj;
    F inside = __builtin_convertvector(sum * sum - (d0 * d0 + d1 * d1 + d2 * d2), F);
    auto touch = inside > 0;
    // (sum^2 - r^2)/(sum + r) keeps the overlap exact in single precision where sum - r would not
    F e0 = __builtin_convertvector(d0, F), e1 = __builtin_convertvector(d1, F), e2 = __builtin_convertvector(d2, F);
    F r = root(e0 * e0 + e1 * e1 + e2 * e2), both = __builtin_convertvector(sum, F);
    F overlap = touch ? inside / (both + r) : zero, inverse = r > 0 ? 1 / r : zero;
    F n0 = r > 0 ? e0 * inverse : one, n1 = e1 * inverse, n2 = e2 * inverse;
    deepest = larger(deepest, overlap);
"""
)

# Constants of the pairs, see `pairs.py`.
_CONSTANTS = """
    if constexpr (!shared) {
        for (int k = 0; k < W; ++k) {
            const auto& c = table.data[one_kind ? 0 : bodies.kind.data[i[k]] * columns + bodies.kind.data[j[k]]];
            kn[k] = c.kn; dn[k] = c.dn;
            if constexpr (friction) { kt[k] = c.kt; dt[k] = c.dt; mu[k] = c.mu; }
            if constexpr (rolling) rolls[k] = c.roll;
            if constexpr (midpoint) mass[k] = c.m;
        }
        if constexpr (by_radii) {
            F m, a = __builtin_convertvector(ri, F), b = __builtin_convertvector(rj, F);
            for (int k = 0; k < W; ++k) m[k] = bodies.inv_m.data[i[k]] + bodies.inv_m.data[j[k]];
            m = 1 / larger(m, full(1.0e-30));
            F radius = a * b / (a + b), scale = linear ? one : root(radius), dashpot = root(scale * m);
            kn *= scale; kt *= scale; dn *= dashpot; dt *= dashpot; rolls *= radius; mass = m;
        }
    }
"""

# The law, see `laws.py`: forces f on i, its tangential part l, torques ti and tj.
_FORCE = """
    F s = linear ? one : root(overlap), quarter = linear ? one : root(s);
    F vn = v0 * n0 + v1 * n1 + v2 * n2, eta = dn * quarter, fn = kn * overlap * s - eta * vn;
    if constexpr (midpoint) fn /= 1 + eta * h / (2 * mass);
    if constexpr (no_tension) fn = larger(fn, zero);
    F f0 = fn * n0, f1 = fn * n1, f2 = fn * n2;
    F t0 = zero, t1 = zero, t2 = zero, back0 = zero, back1 = zero, back2 = zero;
    if constexpr (friction) {
        F wi[4], wj[4], m[4];
        rows4(spin, i, wi);
        rows4(spin, j, wj);
        rows4(memory, slot, m);
        F ai = __builtin_convertvector(ri, F), aj = __builtin_convertvector(rj, F);
        if constexpr (!rescaled) { ai -= overlap / 2; aj -= overlap / 2; }
        F s0 = ai * wi[0] + aj * wj[0], s1 = ai * wi[1] + aj * wj[1], s2 = ai * wi[2] + aj * wj[2];
        v0 += n1 * s2 - n2 * s1 - vn * n0; v1 += n2 * s0 - n0 * s2 - vn * n1; v2 += n0 * s1 - n1 * s0 - vn * n2;
        F x0 = m[0], x1 = m[1], x2 = m[2];
        if constexpr (rescaled) {
            F along = x0 * n0 + x1 * n1 + x2 * n2, size = root(x0 * x0 + x1 * x1 + x2 * x2);
            x0 -= along * n0; x1 -= along * n1; x2 -= along * n2;
            F length = root(x0 * x0 + x1 * x1 + x2 * x2), scale = length > 0 ? size / length : one;
            x0 = x0 * scale + h * v0; x1 = x1 * scale + h * v1; x2 = x2 * scale + h * v2;
        } else {
            x0 += h * v0; x1 += h * v1; x2 += h * v2;
            F along = x0 * n0 + x1 * n1 + x2 * n2;
            x0 -= along * n0; x1 -= along * n1; x2 -= along * n2;
        }
        F stiff = kt * s, eta_t = dt * quarter, bound = mu * (fn < 0 ? -fn : fn);
        F stretched = stiff * stiff * (x0 * x0 + x1 * x1 + x2 * x2);
        auto slides = stretched > bound * bound;
        F shrunk = slides ? bound / root(stretched) : one;
        x0 *= shrunk; x1 *= shrunk; x2 *= shrunk;
        // without a normal force there is neither spring nor dashpot
        F share = bound > 0 ? -one : zero, resist = slides ? zero : eta_t;
        if constexpr (midpoint) share = slides ? share : share / (1 + 7 * eta_t * h / (4 * mass));
        F l0 = share * (stiff * x0 + resist * v0);
        F l1 = share * (stiff * x1 + resist * v1);
        F l2 = share * (stiff * x2 + resist * v2);
        f0 += l0; f1 += l1; f2 += l2;
        F turn0 = n1 * l2 - n2 * l1, turn1 = n2 * l0 - n0 * l2, turn2 = n0 * l1 - n1 * l0;
        t0 = -ai * turn0; t1 = -ai * turn1; t2 = -ai * turn2;
        back0 = -aj * turn0; back1 = -aj * turn1; back2 = -aj * turn2;
        if constexpr (rolling) {
            F gi, gj;
            for (int k = 0; k < W; ++k) { gi[k] = bodies.inv_i.data[i[k]]; gj[k] = bodies.inv_i.data[j[k]]; }
            F w0 = wi[0] - wj[0], w1 = wi[1] - wj[1], w2 = wi[2] - wj[2], wn = w0 * n0 + w1 * n1 + w2 * n2;
            w0 -= wn * n0; w1 -= wn * n1; w2 -= wn * n2;
            F g0 = gi * t0 - gj * back0, g1 = gi * t1 - gj * back1, g2 = gi * t2 - gj * back2;
            F drives = g0 * (w0 + h * g0) + g1 * (w1 + h * g1) + g2 * (w2 + h * g2), sum_i = gi + gj;
            real part = h > 0 ? rolling_share / h : 0;
            F taken = drives >= 0 ? one : zero, all = sum_i > 0 ? -1 / sum_i : zero;
            if (h == 0) all = zero;
            F q0 = all * (part * w0 + taken * g0), q1 = all * (part * w1 + taken * g1);
            F q2 = all * (part * w2 + taken * g2), size = root(q0 * q0 + q1 * q1 + q2 * q2);
            F most = rolls * (fn < 0 ? -fn : fn), kept = size > most ? most / size : one;
            t0 += kept * q0; t1 += kept * q1; t2 += kept * q2;
            back0 -= kept * q0; back1 -= kept * q1; back2 -= kept * q2;
        }
        F after[4] = {touch ? x0 : zero, touch ? x1 : zero, touch ? x2 : zero, touch ? one : zero};
        put4(memory, slot, after);
    }
"""

_PAIRS = (
    """
if (count == 0) return real(0);
F zero = full(0), one = full(1), deepest = zero;
const double* kin = (const double*)bodies.kin.data;
const real* spin = (const real*)bodies.spin.data;
real* load = width == 8 ? (real*)bodies.load.data : (real*)bodies.force.data;
real* memory = (real*)lists.memory.data;
F kn = zero, kt = zero, dn = zero, dt = zero, mu = zero, rolls = zero, mass = one;
if constexpr (shared) {
    int first = lists.near.data[base];
    int kinds = bodies.kind.data[lists.i.data[first]] * columns + bodies.kind.data[lists.j.data[first]];
    const auto& c = table.data[one_kind ? 0 : kinds];
    kn += c.kn; kt += c.kt; dn += c.dn; dt += c.dt; mu += c.mu; rolls += c.roll; mass = full(c.m);
}
const int end = base + count;
for (int begin = base; begin < end; begin += W) {
"""
    + _GEOMETRY
    + _CONSTANTS
    + _FORCE
    + """
    F acts = touch ? one : zero;
    for (int k = rest; k < W; ++k) acts[k] = 0;
    f0 *= acts; f1 *= acts; f2 *= acts;
    t0 *= acts; t1 *= acts; t2 *= acts;
    back0 *= acts; back1 *= acts; back2 *= acts;
    if constexpr (width == 8) {
        F on_i[8] = {f0, f1, f2, zero, t0, t1, t2, zero}, on_j[8] = {-f0, -f1, -f2, zero, back0, back1, back2, zero};
        add8(load, i, on_i);
        add8(load, j, on_j);
    } else {
        F on_i[4] = {f0, f1, f2, zero}, on_j[4] = {-f0, -f1, -f2, zero};
        add4(load, i, on_i);
        add4(load, j, on_j);
    }
}
real largest = 0;
for (int k = 0; k < W; ++k) largest = deepest[k] > largest ? deepest[k] : largest;
return largest;
"""
)


@cache
def near_pairs_function(o: StepOptions) -> Any:
    """A Warp function that adds what the near pairs base..base + count do to the loads; returns the largest overlap.

    `h` is the time by which the springs grow.
    """
    t = types(o.law.precision)
    real, Bodies, Lists, PairClass = t.real, t.Bodies, t.Lists, t.PairClass
    constants = prelude(
        o.law.precision,
        width=8 if o.rotation else 4,
        shared=o.alike and o.pairs in (ONE, TABLE),
        one_kind=o.pairs == ONE,
        by_radii=o.pairs in (RADII, LINEAR_RADII),
        periodic=o.periodic,
        radii=o.radii,
        friction=o.law.friction,
        rolling=o.law.rolling,
        linear=o.law.linear,
        rescaled=o.law.rescaled,
        no_tension=o.law.no_tension,
        midpoint=o.law.midpoint,
        rolling_share=float(ROLLING_SHARE),
    )

    @wp.func_native(compiled_apart(constants + _PAIRS))
    def near_pairs(
        bodies: Bodies,
        lists: Lists,
        base: int,
        count: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        h: real,
    ) -> real: ...

    return near_pairs
