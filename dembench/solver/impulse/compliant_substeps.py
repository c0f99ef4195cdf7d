"""How many substeps a step needs: the stiffest contact that it will meet sets them.

The frequency of a contact is omega = sqrt(k/m*) with the tangent stiffness k = (3/2) kn sqrt(d_max) at the largest
overlap of the step, which follows from the present overlap d and the closing speed v by the energy of a Hertz contact:

    (2/5) kn d_max^(5/2) = (2/5) kn d^(5/2) + m* v^2/2

In a linear law k = kn. Pairs that are still apart count where they can meet within the step, so that an impact finds
the substeps that it needs.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.impulse.compliant_rows import CompliantOptions, compliant_access
from dembench.solver.pairs import pair_lookup, radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.types import types
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import Walls


@cache
def stiffness_functions(o: CompliantOptions) -> Any:
    """Warp functions `pairs`, `bigs` and `walls`: the largest omega^10 among contacts within `time`, and `frequency`.

    omega^10 = (3/2 kn/m*)^5 d_max^(5/2) needs no root; frequency(omega^10) takes it. `fall` is the change of speed by
    gravity within the time.
    """
    t = types(o.law.precision)
    real, Bodies, PairClass, Lists = t.real, t.Bodies, t.PairClass, t.Lists
    native = compliant_access(o.law.precision, o.rotation)
    kin, entry = native.kin, native.entry
    of_pair, of_wall = pair_lookup(o.law.precision, o.pairs, o.radii)
    separation = image_functions(o.law.precision, o.periodic).separation
    of_feature = wall_functions(o.walls)
    distance_of, velocity_of = of_feature.distance, of_feature.velocity
    radius = radius_function(o.law.precision, o.radii)
    shared, linear = o.shared, o.law.linear

    @wp.func
    def measure(c: PairClass, inverse: real, overlap: wp.float64, closing: wp.float64):
        zero, found = wp.float64(0.0), wp.float64(0.0)
        kn, w = wp.float64(c.kn), wp.float64(inverse)
        if kn > zero and w > zero:
            if wp.static(linear):
                stiff = kn * w
                square = stiff * stiff
                found = square * square * stiff
            else:
                stiff = wp.float64(1.5) * kn * w
                d, v = wp.max(overlap, zero), closing
                square = stiff * stiff
                found = square * square * stiff * (d * d * wp.sqrt(d) + wp.float64(1.25) * v * v / (w * kn))
        return found

    @wp.func
    def of_two(
        b: Bodies,
        i: int,
        j: int,
        c: PairClass,
        table: wp.array(dtype=PairClass),
        columns: int,
        time: wp.float64,
        reach: wp.float64,
    ):
        found = wp.float64(0.0)
        ki, kj = kin(b, i), kin(b, j)
        d = separation(b, ki, kj)
        sum = radius(b, ki) + radius(b, kj)
        r2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        if r2 < (sum + reach) * (sum + reach):
            r = wp.sqrt(r2)
            closing = -(d[0] * d[3] + d[1] * d[4] + d[2] * d[5]) / wp.max(r, wp.float64(1.0e-30))
            overlap = sum - r
            if overlap + wp.max(closing, wp.float64(0.0)) * time > wp.float64(0.0):
                constants = c
                if wp.static(not shared):
                    constants = of_pair(b, i, j, table, columns)
                found = measure(constants, b.inv_m[i] + b.inv_m[j], overlap, closing)
        return found

    @wp.func
    def pairs(
        b: Bodies,
        lists: Lists,
        base: int,
        count: int,
        near: int,
        one: PairClass,
        table: wp.array(dtype=PairClass),
        columns: int,
        time: wp.float64,
        reach: wp.float64,
    ):
        """Listed pairs of a region, with `near` = 1 the near ones of them.

        `one`: see `opening_functions`; `reach` is how far two can approach.
        """
        largest = wp.float64(0.0)
        for q in range(count):
            k = base + q
            if near == 1:
                k = entry(lists.near, base + q)
            i, j = entry(lists.i, k), entry(lists.j, k)
            largest = wp.max(largest, of_two(b, i, j, one, table, columns, time, reach))
        return largest

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
        largest = wp.float64(0.0)
        for q in range(count):
            i, j = lists.big_i[q], lists.big_j[q]
            c = of_pair(b, i, j, table, columns)
            largest = wp.max(largest, of_two(b, i, j, c, table, columns, time, reach))
        return largest

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
        largest = wp.float64(0.0)
        for q in range(base, base + count):
            i, f = lists.wall_i[q], lists.wall_f[q]
            k = kin(b, i)
            x = wp.vec3d(k[0], k[1], k[2])
            distance, normal = distance_of(features, f, poses, x)
            v = wp.vec3d(k[3], k[4], k[5]) - velocity_of(features, f, poses, x)
            closing = -wp.dot(v, normal)
            overlap = radius(b, k) - distance
            if overlap + wp.max(closing + fall, wp.float64(0.0)) * time > wp.float64(0.0):
                c = of_wall(b, i, features.features[f].kind, table, columns)
                largest = wp.max(largest, measure(c, b.inv_m[i], overlap, closing + fall))
        return largest

    @wp.func
    def frequency(power: wp.float64):
        return wp.pow(power, wp.float64(0.1))

    return SimpleNamespace(pairs=pairs, bigs=bigs, walls=walls, frequency=frequency)
