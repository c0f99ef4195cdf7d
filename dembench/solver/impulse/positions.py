"""The position pass: overlaps that are left after the drift are pushed apart, without momentum.

The load that it carries, mass times shift over dt, counts in the Coulomb bound of the next step.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.rows import ImpulseOptions, direction_function, row_types
from dembench.solver.pairs import radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.types import types, vec8d
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import Walls


@cache
def position_sweep(o: ImpulseOptions) -> Any:
    """A Warp function (bodies, lists, rows, ..., reverse) that visits every row and returns the largest overlap."""
    t = types(o.precision)
    real, Bodies, Lists = t.real, t.Bodies, t.Lists
    Rows = row_types(o.precision)
    # a row stays with its plane through the step, also where its body leaves the region of a part of a mesh
    distance_of = wall_functions(o.walls).extended
    nearest = image_functions(o.precision, o.periodic).nearest
    direction = direction_function(o.precision)
    radius, present = radius_function(o.precision, o.radii), o.walls.present

    @wp.func
    def shifted(k: vec8d, d: wp.vec3d):
        return vec8d(k[0] + d[0], k[1] + d[1], k[2] + d[2], k[3], k[4], k[5], k[6], k[7])

    @wp.func
    def sweep(
        b: Bodies,
        lists: Lists,
        rows: Rows,
        count: int,
        walls: Walls,
        total: int,
        slop: wp.float64,
        dt: wp.float64,
        reverse: int,
    ):
        zero = wp.float64(0.0)
        largest = wp.float64(0.0)
        for q in range(count):
            r = q
            if reverse == 1:
                r = count - 1 - q
            i, j = rows.i[r], rows.j[r]
            ki = b.kin[i]
            xi = wp.vec3d(ki[0], ki[1], ki[2])
            mi = wp.float64(b.inv_m[i])
            if j < total:
                kj = b.kin[j]
                d = nearest(b, xi - wp.vec3d(kj[0], kj[1], kj[2]))
                reach = radius(b, ki) + radius(b, kj)
                r2 = wp.dot(d, d)
                held = wp.float64(rows.push[r]) * dt
                if r2 < reach * reach or held > zero:
                    length = wp.sqrt(r2)
                    overlap = reach - length
                    mass = wp.float64(b.inv_m[j]) + mi
                    largest = wp.max(largest, overlap)
                    if (overlap > slop or held > zero) and mass > zero:
                        shift = wp.max(overlap / mass, -held)
                        n = d / length
                        if length == zero:
                            n = wp.vec3d(direction(i, j))
                        rows.push[r] = real((held + shift) / dt)
                        b.kin[i] = shifted(ki, mi * shift * n)
                        b.kin[j] = shifted(kj, -wp.float64(b.inv_m[j]) * shift * n)
            elif wp.static(present):
                distance, normal = distance_of(walls, lists.wall_f[j - total], 0, xi)
                overlap = radius(b, ki) - distance
                held = wp.float64(rows.push[r]) * dt
                largest = wp.max(largest, overlap)
                if (overlap > slop or held > zero) and mi > zero:
                    shift = wp.max(overlap / mi, -held)
                    rows.push[r] = real((held + shift) / dt)
                    b.kin[i] = shifted(ki, mi * shift * normal)
        return largest

    return sweep
