"""The position pass: overlaps that are left after the drift are pushed apart, without momentum.

The load that it carries, mass times shift over dt, counts in the Coulomb bound of the next step. Bodies stay where the
drift left them until the pass ends; what it moves them is small and kept apart, in the precision of the impulses.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.impulse.row_lanes import lane_functions
from dembench.solver.impulse.rows import ImpulseOptions, direction_function, row_types
from dembench.solver.pairs import radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.types import types, vec8d
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import Walls

CLOSE = 1e-6
"""Distance of two bodies with the same centre, over the sum of their radii."""


@cache
def position_functions(o: ImpulseOptions) -> Any:
    """Warp functions (begin, sweep, end).

    begin(bodies, rows, count, total) takes the differences of positions of all pairs of bodies.
    sweep(bodies, lists, rows, blocks, rest, ..., reverse) visits every row and returns the largest overlap.
    end(bodies, rows, total) moves the bodies.
    """
    t = types(o.precision)
    real, vec3, vec4, Bodies, Lists = t.real, t.vec3, t.vec4, t.Bodies, t.Lists
    Rows = row_types(o.precision)
    # a row stays with its plane through the step, also where its body leaves the region of a part of a mesh
    distance_of = wall_functions(o.walls).extended
    separation = image_functions(o.precision, o.periodic).separation
    direction = direction_function(o.precision)
    lanes = lane_functions(o)
    sweep_blocks, room = lanes.positions, lanes.room
    radius, present = radius_function(o.precision, o.radii), o.walls.present

    @wp.func
    def difference(b: Bodies, i: int, j: int):
        """Of the positions of two bodies, and the sum of their radii."""
        ki, kj = b.kin[i], b.kin[j]
        d = separation(b, ki, kj)
        reach = real(radius(b, ki) + radius(b, kj))
        out = vec4(real(d[0]), real(d[1]), real(d[2]), reach)
        if wp.length_sq(vec3(out[0], out[1], out[2])) == real(0.0):
            n = real(CLOSE) * reach * direction(i, j)
            out = vec4(n[0], n[1], n[2], reach)
        return out

    @wp.func
    def begin(b: Bodies, rows: Rows, count: int, total: int):
        for r in range(count):
            if rows.j[r] < total:
                rows.apart[r] = difference(b, rows.i[r], rows.j[r])
        for i in range(total):
            rows.shift[i] = vec4(real(0.0), real(0.0), real(0.0), b.inv_m[i])

    @wp.func
    def moved(s: vec4, way: vec3):
        return vec4(s[0] + s[3] * way[0], s[1] + s[3] * way[1], s[2] + s[3] * way[2], s[3])

    @wp.func
    def visit(b: Bodies, lists: Lists, rows: Rows, r: int, walls: Walls, total: int, slop: real, dt: real):
        i, j = rows.i[r], rows.j[r]
        si = rows.shift[i]
        held = rows.push[r] * dt
        overlap, mass = real(0.0), si[3]
        n, sj = vec3(), vec4()
        if j < total:
            e = rows.apart[r]
            sj = rows.shift[j]
            d = vec3(e[0] + si[0] - sj[0], e[1] + si[1] - sj[1], e[2] + si[2] - sj[2])
            overlap = e[3] - wp.length(d)
            mass += sj[3]
            n = wp.normalize(d)
        elif wp.static(present):
            k = b.kin[i]
            x = wp.vec3d(k[0] + wp.float64(si[0]), k[1] + wp.float64(si[1]), k[2] + wp.float64(si[2]))
            distance, normal = distance_of(walls, lists.wall_f[j - total], 0, x)
            overlap = real(radius(b, k) - distance)
            n = vec3(real(normal[0]), real(normal[1]), real(normal[2]))
        if overlap > slop or held > real(0.0):
            way = wp.max(overlap / mass, -held)
            rows.push[r] = (held + way) / dt
            rows.shift[i] = moved(si, way * n)
            if j < total:
                rows.shift[j] = moved(sj, -way * n)
        return overlap

    @wp.func
    def sweep(
        b: Bodies,
        lists: Lists,
        rows: Rows,
        blocks: int,
        rest: int,
        walls: Walls,
        total: int,
        slop: real,
        dt: real,
        reverse: int,
    ):
        largest, first = real(0.0), room(rows)
        if reverse == 0:
            largest = sweep_blocks(rows, blocks, slop, dt, 0)
        for q in range(rest):
            at = first + q
            if reverse == 1:
                at = first + rest - 1 - q
            largest = wp.max(largest, visit(b, lists, rows, rows.order[at], walls, total, slop, dt))
        if reverse == 1:
            largest = wp.max(largest, sweep_blocks(rows, blocks, slop, dt, 1))
        return largest

    @wp.func
    def end(b: Bodies, rows: Rows, total: int):
        for i in range(total):
            k, s = b.kin[i], rows.shift[i]
            x, y, z = wp.float64(s[0]), wp.float64(s[1]), wp.float64(s[2])
            b.kin[i] = vec8d(k[0] + x, k[1] + y, k[2] + z, k[3], k[4], k[5], k[6], k[7])

    return SimpleNamespace(begin=begin, sweep=sweep, end=end)
