"""The rows of a substep, opened in its middle: after the first half of the drift.

A row is kept for every pair whose spheres overlap at either end of the way that they go with the velocities of the
start, with the normal in the middle of it. Every row begins with the elastic impulse there: without any sweep the
substep would be one of position Verlet.

The overlap of a row is the mean of those at both ends of the way, so that a row begins with the energy that the one
before has left. Spheres that pass each other are nearer in the middle, by the sagitta (h vt)^2/(8 L) of their way about
each other, with the tangential speed vt and the distance L of their centres; so it is at mantles and edges.

The spring grows by the sliding of the motion that was really made, the velocities after all rows, and not by that which
a row foresaw: the energy in it is then the work of the motion.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.impulse.compliant_rows import FAR, A, B, C, CompliantOptions, compliant_access, compliant_types
from dembench.solver.impulse.exchange import impulse_function
from dembench.solver.lanes import LANES, prelude, separation
from dembench.solver.laws import surface_functions
from dembench.solver.pairs import radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.types import types
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import Walls

_PAIRS = (
    """
F zero = full(0), one = full(1), deepest = zero;
const double* kin = (const double*)bodies.kin.data;
const int last = bodies.kin.shape[0] - 1;
for (int block = first; block < end; ++block) {
    const int *i = rows.i.data + block * W, *j = rows.j.data + block * W, *slot = rows.slot.data + block * W;
    real *a = rows.a.data + block * (A * W), *b = rows.b.data + block * (B * W), *u = (real*)rows.u.data;
    const real* c = rows.c.data + (shared ? 0 : block) * (C * W);
    // what does not move stands behind the bodies
    int bi[W], bj[W], kept[W];
    F used;
    for (int k = 0; k < W; ++k) {
        bi[k] = i[k] < last ? i[k] : last;
        bj[k] = j[k] < last ? j[k] : last;
        kept[k] = slot[k] < 0 ? 0 : slot[k];
        used[k] = slot[k] < 0 ? 0 : 1;
    }
    if (block + 1 < end)
        for (int k = 0; k < W; ++k) {
            int next = j[W + k] < last ? j[W + k] : last;
            __builtin_prefetch(kin + 8 * next);
            __builtin_prefetch(&rows.u.data[next], 1);
        }
"""
    + separation("bi", "bj")
    + """
    F v0 = __builtin_convertvector(ki[3] - kj[3], F);
    F v1 = __builtin_convertvector(ki[4] - kj[4], F);
    F v2 = __builtin_convertvector(ki[5] - kj[5], F);
    D sum = ri + rj, r2 = d0 * d0 + d1 * d1 + d2 * d2;
    F near = __builtin_convertvector((sum + reach) * (sum + reach) - r2, F);
    // (sum^2 - r^2)/(sum + r) keeps the overlap exact in single precision where sum - r would not
    F e0 = __builtin_convertvector(d0, F), e1 = __builtin_convertvector(d1, F), e2 = __builtin_convertvector(d2, F);
    F r = root(e0 * e0 + e1 * e1 + e2 * e2), both = __builtin_convertvector(sum, F);
    F overlap = __builtin_convertvector(sum * sum - r2, F) / (both + r);
    F inverse = r > 0 ? 1 / r : zero;
    F n0 = r > 0 ? e0 * inverse : one, n1 = e1 * inverse, n2 = e2 * inverse;
    F vn = v0 * n0 + v1 * n1 + v2 * n2;
    F mean = overlap - h * h * (v0 * v0 + v1 * v1 + v2 * v2 - vn * vn) / (8 * both);
    auto open = (used > 0) & (near > 0) & (mean + h / 2 * (vn < 0 ? -vn : vn) > 0);
    deepest = open ? larger(deepest, overlap) : deepest;

    F kn = at(c), root_mean = one, normal;
    if constexpr (!linear) root_mean = root(larger(mean, zero));
    normal = h * kn * larger(mean, zero) * root_mean;
    F p0 = normal * n0, p1 = normal * n1, p2 = normal * n2, ai, aj;
    if constexpr (friction) {
        const real *w = (const real*)bodies.spin.data;
        real* memory = (real*)lists.memory.data;
        ai = __builtin_convertvector(ri, F); aj = __builtin_convertvector(rj, F);
        if constexpr (!rescaled) { ai -= overlap / 2; aj -= overlap / 2; }
        F wi[4], wj[4], m[4];
        rows4(w, bi, wi);
        rows4(w, bj, wj);
        rows4(memory, kept, m);
        F s0 = ai * wi[0] + aj * wj[0], s1 = ai * wi[1] + aj * wj[1], s2 = ai * wi[2] + aj * wj[2];
        v0 += n1 * s2 - n2 * s1; v1 += n2 * s0 - n0 * s2; v2 += n0 * s1 - n1 * s0;
        F t0 = v0 - vn * n0, t1 = v1 - vn * n1, t2 = v2 - vn * n2;
        F x0 = m[0], x1 = m[1], x2 = m[2], met = m[3];
        real grows = grown / 2;
        if constexpr (rescaled) {
            F along = x0 * n0 + x1 * n1 + x2 * n2, size = root(x0 * x0 + x1 * x1 + x2 * x2);
            x0 -= along * n0; x1 -= along * n1; x2 -= along * n2;
            F length = root(x0 * x0 + x1 * x1 + x2 * x2), scale = length > 0 ? size / length : one;
            x0 = x0 * scale + grows * t0; x1 = x1 * scale + grows * t1; x2 = x2 * scale + grows * t2;
        } else {
            x0 += grows * t0; x1 += grows * t1; x2 += grows * t2;
            F along = x0 * n0 + x1 * n1 + x2 * n2;
            x0 -= along * n0; x1 -= along * n1; x2 -= along * n2;
        }
        x0 = met != 0 ? x0 : zero; x1 = met != 0 ? x1 : zero; x2 = met != 0 ? x2 : zero;
        F kt = -h * at(c + W) * root_mean, bound = at(c + 4 * W) * normal;
        F l0 = kt * (x0 + h / 2 * t0), l1 = kt * (x1 + h / 2 * t1), l2 = kt * (x2 + h / 2 * t2);
        F size2 = l0 * l0 + l1 * l1 + l2 * l2, share = size2 > bound * bound ? bound / root(size2) : one;
        share = mean > 0 ? share : zero;
        p0 += share * l0; p1 += share * l1; p2 += share * l2;
        to(b, x0); to(b + W, x1); to(b + 2 * W, x2); to(b + 3 * W, aj); to(a + 7 * W, ai);
        auto parted = (used > 0) & (met != 0) & ~open;
        if (__builtin_reduce_or(parted))
            for (int k = 0; k < W; ++k)
                if (parted[k]) __builtin_memset(memory + 4 * slot[k], 0, 4 * sizeof(real));
    }
    p0 = open ? p0 : zero; p1 = open ? p1 : zero; p2 = open ? p2 : zero;
    to(a, n0); to(a + W, n1); to(a + 2 * W, n2); to(a + 3 * W, open ? mean : full(-far));
    to(a + 4 * W, v0); to(a + 5 * W, v1); to(a + 6 * W, v2);
    to(b + 4 * W, p0); to(b + 5 * W, p1); to(b + 6 * W, p2);
    F ui[8], uj[8];
    rows8(u, i, ui);
    rows8(u, j, uj);
    ui[0] += ui[3] * p0; ui[1] += ui[3] * p1; ui[2] += ui[3] * p2;
    uj[0] -= uj[3] * p0; uj[1] -= uj[3] * p1; uj[2] -= uj[3] * p2;
    if constexpr (friction) {
        F q0 = n1 * p2 - n2 * p1, q1 = n2 * p0 - n0 * p2, q2 = n0 * p1 - n1 * p0, ti = ai * ui[7], tj = aj * uj[7];
        ui[4] -= ti * q0; ui[5] -= ti * q1; ui[6] -= ti * q2;
        uj[4] -= tj * q0; uj[5] -= tj * q1; uj[6] -= tj * q2;
    }
    put8(u, i, ui);
    put8(u, j, uj);
}
real largest = 0;
for (int k = 0; k < W; ++k) largest = deepest[k] > largest ? deepest[k] : largest;
return largest;
"""
)


@cache
def opening_functions(o: CompliantOptions) -> Any:
    """Warp functions `pairs`, `bigs` and `walls` that open the rows of the blocks first..end for a substep.

    Each applies the impulses with which its rows begin, and forgets the memory of contacts that are open; the first two
    return the largest overlap. No two small bodies approach by more than `reach` within the substep; the blocks of c of
    large bodies and walls begin at `constants`. `first_impulse` and `sagitta` are of one contact.
    """
    precision = o.law.precision
    t = types(precision)
    real, vec3, vec4 = t.real, t.vec3, t.vec4
    Bodies, Lists = t.Bodies, t.Lists
    PairClass = t.PairClass
    Rows = compliant_types(precision)
    native = compliant_access(precision, o.rotation)
    kin, spin, change_of, set_change = native.kin, native.spin, native.change_of, native.set_change
    after = impulse_function(precision)
    of_feature = wall_functions(o.walls)
    separation = image_functions(precision, o.periodic).separation
    surface = surface_functions(o.law)
    arm_of, spring_of = surface.arm, surface.spring
    distance_of, velocity_of = of_feature.distance, of_feature.velocity
    mean_distance_of = of_feature.mean_distance
    radius = radius_function(precision, o.radii)
    friction, linear = o.law.friction, o.law.linear
    lanes = wp.constant(LANES)
    constants = prelude(
        precision,
        A=A,
        B=B,
        C=C,
        far=FAR,
        friction=friction,
        linear=linear,
        rescaled=o.law.rescaled,
        periodic=o.periodic,
        radii=o.radii,
        shared=o.shared,
    )

    @wp.func_native(constants + _PAIRS)
    def pairs(
        bodies: Bodies, lists: Lists, rows: Rows, first: int, end: int, h: real, grown: real, reach: wp.float64
    ) -> real: ...

    @wp.func
    def first_impulse(n: vec3, overlap: real, xi: vec3, c: PairClass, h: real):
        """Elastic impulse of an overlap and a spring, within the bound of Coulomb."""
        p = vec3()
        if overlap > real(0.0):
            root = real(1.0)
            if wp.static(not linear):
                root = wp.sqrt(overlap)
            normal = h * c.kn * overlap * root
            p = normal * n
            if wp.static(friction):
                lt = (-h * c.kt * root) * xi
                bound = c.mu * normal
                size2 = wp.dot(lt, lt)
                if size2 > bound * bound:
                    lt = lt * (bound / wp.sqrt(size2))
                p = p + lt
        return p

    @wp.func
    def sagitta(v: vec3, vn: real, h: real, distance: real):
        return real(0.125) * h * h * (wp.dot(v, v) - vn * vn) / distance

    @wp.func
    def shut(rows: Rows, row: int):
        """A row that is not open: no sweep changes anything, for all that it is multiplied with is zero."""
        block, lane = row / lanes, row % lanes
        for f in range(wp.static(A)):
            rows.a[(block * wp.static(A) + f) * lanes + lane] = real(0.0)
        for f in range(wp.static(B)):
            rows.b[(block * wp.static(B) + f) * lanes + lane] = real(0.0)
        rows.a[(block * wp.static(A) + 3) * lanes + lane] = real(-wp.static(FAR))

    @wp.func
    def open_row(
        rows: Rows,
        row: int,
        constants: int,
        n: vec3,
        overlap: real,
        v: vec3,
        wi: vec3,
        wj: vec3,
        ai: real,
        aj: real,
        memory: vec4,
        h: real,
        grown: real,
    ):
        """Writes a row, whose constants stand in a block of c, and applies the impulse with which it begins."""
        block, lane = row / lanes, row % lanes
        a, b, k = block * wp.static(A), block * wp.static(B), constants * wp.static(C)
        c = PairClass()
        c.kn = rows.c[k * lanes + lane]
        c.kt = rows.c[(k + 1) * lanes + lane]
        c.mu = rows.c[(k + 4) * lanes + lane]
        half = real(0.5) * h
        vn = wp.dot(v, n)
        g = v
        xi = vec3()
        if wp.static(friction):
            g = v + wp.cross(n, ai * wi + aj * wj)
            if memory[3] != real(0.0):
                xi = spring_of(memory, n, g - vn * n, real(0.5) * grown)
        p = first_impulse(n, overlap, xi + half * (g - vn * n), c, h)
        for f in range(3):
            rows.a[(a + f) * lanes + lane] = n[f]
            rows.a[(a + 4 + f) * lanes + lane] = g[f]
            rows.b[(b + f) * lanes + lane] = xi[f]
            rows.b[(b + 4 + f) * lanes + lane] = p[f]
        rows.a[(a + 3) * lanes + lane] = overlap
        rows.a[(a + 7) * lanes + lane] = ai
        rows.b[(b + 3) * lanes + lane] = aj
        i, j, turn = rows.i[row], rows.j[row], wp.cross(n, p)
        set_change(rows, i, after(change_of(rows, i), p, turn, ai))
        set_change(rows, j, after(change_of(rows, j), -p, turn, aj))

    @wp.func
    def bigs(b: Bodies, lists: Lists, rows: Rows, first: int, end: int, constants: int, h: real, grown: real):
        """Rows of the candidates of large bodies."""
        largest = real(0.0)
        for row in range(first * lanes, end * lanes):
            slot = rows.slot[row] + 0
            if slot < 0:
                shut(rows, row)
                continue
            i, j = rows.i[row] + 0, rows.j[row] + 0
            ki, kj = kin(b, i), kin(b, j)
            d = separation(b, ki, kj)
            ri, rj = radius(b, ki), radius(b, kj)
            sum = ri + rj
            inside = sum * sum - (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            e = vec3(real(d[0]), real(d[1]), real(d[2]))
            r = wp.length(e)
            overlap = real(inside) / (real(sum) + r)
            n = vec3(real(1.0), real(0.0), real(0.0))
            if r > real(0.0):
                n = e * (real(1.0) / r)
            v = vec3(real(d[3]), real(d[4]), real(d[5]))
            memory, wi, wj = vec4(), vec3(), vec3()
            if wp.static(friction):
                memory = lists.big_memory[slot]
                si, sj = spin(b, i), spin(b, j)
                wi, wj = vec3(si[0], si[1], si[2]), vec3(sj[0], sj[1], sj[2])
            vn = wp.dot(v, n)
            mean = overlap - sagitta(v, vn, h, real(sum))
            if mean + real(0.5) * h * wp.abs(vn) > real(0.0):
                ai, aj, at = arm_of(ri, overlap), arm_of(rj, overlap), constants + row / lanes - first
                open_row(rows, row, at, n, mean, v, wi, wj, ai, aj, memory, h, grown)
                largest = wp.max(largest, overlap)
            else:
                shut(rows, row)
                if wp.static(friction):
                    if memory[3] != real(0.0):
                        lists.big_memory[slot] = vec4()
        return largest

    @wp.func
    def walls(
        b: Bodies,
        lists: Lists,
        rows: Rows,
        first: int,
        end: int,
        constants: int,
        features: Walls,
        poses: int,
        h: real,
        grown: real,
        fall: real,
    ):
        """Rows of bodies at walls, whose poses begin at `poses`; `fall` is what gravity adds to a speed."""
        for row in range(first * lanes, end * lanes):
            q = rows.slot[row] + 0
            if q < 0:
                shut(rows, row)
                continue
            i, f = lists.wall_i[q] + 0, lists.wall_f[q] + 0
            k = kin(b, i)
            x = wp.vec3d(k[0], k[1], k[2])
            distance, normal = distance_of(features, f, poses, x)
            radius_i = radius(b, k)
            overlap = real(radius_i - distance)
            n = vec3(real(normal[0]), real(normal[1]), real(normal[2]))
            ai = arm_of(radius_i, overlap)
            dv = wp.vec3d(k[3], k[4], k[5]) - velocity_of(features, f, poses, x - wp.float64(ai) * normal)
            v = vec3(real(dv[0]), real(dv[1]), real(dv[2]))
            mean = overlap
            if overlap + h * (wp.length(v) + fall) > real(0.0):
                way = wp.float64(h) * wp.vec3d(k[3], k[4], k[5])
                mean = real(radius_i - mean_distance_of(features, f, poses, x, way, wp.float64(h), distance, normal))
            memory, w = vec4(), vec3()
            if wp.static(friction):
                memory = lists.wall_memory[q]
                s = spin(b, i)
                w = vec3(s[0], s[1], s[2])
            if mean + real(0.5) * h * (wp.abs(wp.dot(v, n)) + fall) > real(0.0):
                at = constants + row / lanes - first
                open_row(rows, row, at, n, mean, v, w, vec3(), ai, real(0.0), memory, h, grown)
            else:
                shut(rows, row)
                if wp.static(friction):
                    if memory[3] != real(0.0):
                        lists.wall_memory[q] = vec4()

    return SimpleNamespace(pairs=pairs, bigs=bigs, walls=walls, first_impulse=first_impulse, sagitta=sagitta)
