"""How many substeps a step needs: the stiffest contact that it will meet sets them.

The frequency of a contact is omega = sqrt(k/m*) with the tangent stiffness k = (3/2) kn sqrt(d_max) at the largest
overlap of the step, which follows from the present overlap d and the closing speed v by the energy of a Hertz contact:

    (2/5) kn d_max^(5/2) = (2/5) kn d^(5/2) + m* v^2/2

In a linear law k = kn. Pairs that are still apart count where they can meet within the step, so that an impact finds
the substeps that it needs.

A collision is the law's up to h omega = 2. In a pile at rest one sweep finds the forces up to 1.2; beyond that those of
a sweep and of the next, which goes the other way, differ by up to 0.5 % about the right mean. So the root mean square
of omega over the contacts that touch, at their present overlaps, has its own bound.

The bounds hold for bodies with up to `CROWDED` contacts. A body moves with the stiffness of all its contacts together:
where there are z of them for each body, frequencies are higher by sqrt(z/CROWDED). Spheres that are let go on one point
have such crowds.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.impulse.compliant_rows import PER_THREAD, TRAVEL, CompliantOptions, compliant_access
from dembench.solver.lanes import compiled_apart, prelude, separation
from dembench.solver.pairs import LINEAR_RADII, ONE, RADII, pair_lookup, radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.sync import barrier
from dembench.solver.types import types
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import Walls

STIFFEST = 2.0
"""Largest substep times the frequency of the stiffest contact."""
USUAL = 0.8
"""Largest substep times the root mean square of the frequencies of contacts."""
CROWDED = 8.0
"""Mean number of contacts of a body up to which that number does not matter; in piles it is 4 to 7."""

# What `of_two` and `measure` say, of many pairs at a time; all pairs of small bodies have the constants of the first
# where they are shared.
_REGION = (
    """
wp::vec_t<3, double> out;
if (count == 0) return out;
const double* kin = (const double*)bodies.kin.data;
D zero = {}, one = zero + 1, lane, worst = zero, squares = zero, touching = zero;
for (int k = 0; k < W; ++k) lane[k] = k;
auto constant = [&](int i, int j) {
    return table.data[one_kind ? 0 : bodies.kind.data[i] * columns + bodies.kind.data[j]].kn;
};
auto slot_of = [&](int q) { return near ? lists.near.data[q] : q; };
const int end = base + count;
F stiffness = full(constant(lists.i.data[slot_of(base)], lists.j.data[slot_of(base)]));
for (int begin = base; begin < end; begin += W) {
    int i[W], j[W];
    for (int k = 0; k < W; ++k) {
        int slot = slot_of(begin + k < end ? begin + k : end - 1);
        i[k] = lists.i.data[slot];
        j[k] = lists.j.data[slot];
    }
"""
    + separation()
    + """
    D sum = ri + rj, square = d0 * d0 + d1 * d1 + d2 * d2, distance = root(square), overlap = sum - distance;
    D along = d0 * (ki[3] - kj[3]) + d1 * (ki[4] - kj[4]) + d2 * (ki[5] - kj[5]);
    D closing = -along / larger(distance, zero + 1.0e-30);
    auto meet = (lane < end - begin) & (square < (sum + reach) * (sum + reach));
    meet &= overlap + larger(closing, zero) * time > 0;
    if (!__builtin_reduce_or(meet)) continue;
    F inverse;
    for (int k = 0; k < W; ++k) inverse[k] = bodies.inv_m.data[i[k]] + bodies.inv_m.data[j[k]];
    if constexpr (!shared) {
        for (int k = 0; k < W; ++k) stiffness[k] = constant(i[k], j[k]);
        if constexpr (by_radii && !linear) {
            F a = __builtin_convertvector(ri, F), b = __builtin_convertvector(rj, F);
            stiffness *= root(a * b / (a + b));
        }
    }
    D kn = __builtin_convertvector(stiffness, D), w = __builtin_convertvector(inverse, D), stiff = kn * w;
    meet &= stiff > 0;
    D power = one, tangent = one;
    if constexpr (!linear) {
        D deep = larger(overlap, zero);
        stiff *= 1.5;
        tangent = root(deep);
        power = deep * deep * tangent + 1.25 * closing * closing / (meet ? w * kn : one);
    }
    D fourth = stiff * stiff;
    fourth *= fourth;
    worst = larger(worst, meet ? fourth * stiff * power : zero);
    auto touch = meet & (overlap > 0);
    squares += touch ? stiff * tangent : zero;
    touching += touch ? one : zero;
}
for (int k = 0; k < W; ++k) {
    out.c[0] = worst[k] > out.c[0] ? worst[k] : out.c[0];
    out.c[1] += squares[k];
    out.c[2] += touching[k];
}
return out;
"""
)


@cache
def stiffness_functions(o: CompliantOptions) -> Any:
    """Warp functions `pairs`, `bigs` and `walls`: what contacts within `time` need; `joined` and `rate` of such needs.

    `of_two` and `at_wall` are those of a single contact, whatever the lists.

    A need is a vector: the largest omega^10, which is (3/2 kn/m*)^5 d_max^(5/2) and needs no root; the sum of omega^2
    of those that touch; their number. rate(need, bodies) is the least number of substeps per time for so many bodies.
    `fall` is the change of speed by gravity within the time.
    """
    t = types(o.law.precision)
    real, Bodies, PairClass, Lists = t.real, t.Bodies, t.PairClass, t.Lists
    kin = compliant_access(o.law.precision, o.rotation).kin
    of_pair, of_wall = pair_lookup(o.law.precision, o.pairs, o.radii)
    separation = image_functions(o.law.precision, o.periodic).separation
    of_feature = wall_functions(o.walls)
    distance_of, velocity_of = of_feature.distance, of_feature.velocity
    radius = radius_function(o.law.precision, o.radii)
    linear, threads = o.law.linear, o.threads
    declared = prelude(
        o.law.precision,
        shared=o.shared,
        one_kind=o.pairs == ONE,
        by_radii=o.pairs in (RADII, LINEAR_RADII),
        periodic=o.periodic,
        radii=o.radii,
        linear=linear,
    )

    @wp.func
    def measure(c: PairClass, inverse: real, overlap: wp.float64, closing: wp.float64):
        zero, power, root = wp.float64(0.0), wp.float64(1.0), wp.float64(1.0)
        found = wp.vec3d()
        kn, w = wp.float64(c.kn), wp.float64(inverse)
        if kn > zero and w > zero:
            stiff = kn * w
            if wp.static(not linear):
                stiff = wp.float64(1.5) * stiff
                d = wp.max(overlap, zero)
                root = wp.sqrt(d)
                power = d * d * root + wp.float64(1.25) * closing * closing / (w * kn)
            square = stiff * stiff
            found = wp.vec3d(square * square * stiff * power, zero, zero)
            if overlap > zero:
                found = wp.vec3d(found[0], stiff * root, wp.float64(1.0))
        return found

    @wp.func
    def joined(a: wp.vec3d, b: wp.vec3d):
        return wp.vec3d(wp.max(a[0], b[0]), a[1] + b[1], a[2] + b[2])

    @wp.func
    def of_two(
        b: Bodies,
        i: int,
        j: int,
        c: PairClass,
        time: wp.float64,
        reach: wp.float64,
    ):
        found = wp.vec3d()
        ki, kj = kin(b, i), kin(b, j)
        d = separation(b, ki, kj)
        sum = radius(b, ki) + radius(b, kj)
        r2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        if r2 < (sum + reach) * (sum + reach):
            r = wp.sqrt(r2)
            closing = -(d[0] * d[3] + d[1] * d[4] + d[2] * d[5]) / wp.max(r, wp.float64(1.0e-30))
            overlap = sum - r
            if overlap + wp.max(closing, wp.float64(0.0)) * time > wp.float64(0.0):
                found = measure(c, b.inv_m[i] + b.inv_m[j], overlap, closing)
        return found

    @wp.func_native(compiled_apart(declared + _REGION))
    def of_region(
        bodies: Bodies,
        lists: Lists,
        base: int,
        count: int,
        near: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        time: wp.float64,
        reach: wp.float64,
    ) -> wp.vec3d: ...

    @wp.func
    def pairs(
        b: Bodies,
        lists: Lists,
        part: int,
        base: wp.array(dtype=wp.int32),
        pair_count: wp.array(dtype=wp.int32),
        near_count: wp.array(dtype=wp.int32),
        known: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        time: wp.float64,
        reach: wp.float64,
    ):
        """Pairs of small bodies that a thread has; with `known` = 1 those in reach are among the near ones.

        `reach` is how far two can approach.
        """
        need = wp.vec3d()
        for region in range(2 * part, 2 * part + wp.static(2 if threads else 1)):
            count = pair_count[region] + 0
            if known == 1:
                count = near_count[region] + 0
            need = joined(need, of_region(b, lists, base[region], count, known, table, columns, time, reach))
        return need

    @wp.func
    def bigs(
        b: Bodies,
        lists: Lists,
        count: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        time: wp.float64,
        reach: wp.float64,
    ):
        need = wp.vec3d()
        for q in range(count):
            i, j = lists.big_i[q], lists.big_j[q]
            c = of_pair(b, i, j, table, columns)
            need = joined(need, of_two(b, i, j, c, time, reach))
        return need

    @wp.func
    def at_wall(
        b: Bodies,
        i: int,
        f: int,
        features: Walls,
        poses: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        time: wp.float64,
        fall: wp.float64,
    ):
        need = wp.vec3d()
        k = kin(b, i)
        x = wp.vec3d(k[0], k[1], k[2])
        distance, normal = distance_of(features, f, poses, x)
        v = wp.vec3d(k[3], k[4], k[5]) - velocity_of(features, f, poses, x)
        closing = -wp.dot(v, normal)
        overlap = radius(b, k) - distance
        if overlap + wp.max(closing + fall, wp.float64(0.0)) * time > wp.float64(0.0):
            c = of_wall(b, i, features.features[f].kind, table, columns)
            need = measure(c, b.inv_m[i], overlap, closing + fall)
        return need

    @wp.func
    def walls(
        b: Bodies,
        lists: Lists,
        base: int,
        count: int,
        features: Walls,
        poses: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        time: wp.float64,
        fall: wp.float64,
    ):
        need = wp.vec3d()
        for q in range(base, base + count):
            i, f = lists.wall_i[q] + 0, lists.wall_f[q] + 0
            need = joined(need, at_wall(b, i, f, features, poses, table, columns, time, fall))
        return need

    @wp.func
    def rate(need: wp.vec3d, bodies: int):
        usual = wp.sqrt(need[1] / wp.max(need[2], wp.float64(1.0)))
        stiffest = wp.pow(need[0], wp.float64(0.1))
        crowd = wp.max(wp.float64(2.0) * need[2] / (wp.float64(bodies) * wp.float64(CROWDED)), wp.float64(1.0))
        return wp.sqrt(crowd) * wp.max(stiffest / wp.float64(STIFFEST), usual / wp.float64(USUAL))

    @wp.func
    def of_all(
        need: wp.vec3d, travel: wp.array(dtype=wp.float64), part: int, parts: int, state: wp.array(dtype=wp.int32)
    ):
        """What the contacts of all threads need, by way of their places in `travel`."""
        own = wp.static(TRAVEL) + wp.static(PER_THREAD) * part + 3
        for c in range(3):
            travel[own + c] = need[c]
        barrier(state, parts)
        found = wp.vec3d()
        for p in range(parts):
            at = wp.static(TRAVEL) + wp.static(PER_THREAD) * p + 3
            found = joined(found, wp.vec3d(travel[at], travel[at + 1], travel[at + 2]))
        return found

    return SimpleNamespace(
        pairs=pairs, bigs=bigs, walls=walls, of_two=of_two, at_wall=at_wall, joined=joined, of_all=of_all, rate=rate
    )
