"""The position pass: overlaps that are left after the drift are pushed apart, without momentum.

The load that it carries, mass times shift over dt, counts in the Coulomb bound of the next step. Bodies stay where the
drift left them until the pass ends; what it moves them is small and kept apart, in the precision of the impulses.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.row_lanes import lane_functions
from dembench.solver.impulse.row_opening import direction_function
from dembench.solver.impulse.rows import ImpulseOptions, limit_types, row_types
from dembench.solver.impulse.segments import (
    BLOCKS,
    END,
    REST,
    Share,
    bodies_of,
    body_of,
    flag,
    joining_functions,
    segment_of,
    segments_of,
)
from dembench.solver.pairs import radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.types import types, vec8d
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import Walls

CLOSE = 1e-6
"""Distance of two bodies with the same centre, over the sum of their radii."""


@cache
def position_function(o: ImpulseOptions) -> Any:
    """A Warp function (bodies, lists, rows, walls, poses, share, limits, dt), which all threads call.

    It visits every row again and again, in turn forwards and in reverse, until no overlap is larger than the slop, and
    returns the number of sweeps and the largest overlap in the last one. `poses`: where the thread has its walls.
    """
    t = types(o.precision)
    real, vec3, vec4, Bodies, Lists = t.real, t.vec3, t.vec4, t.Bodies, t.Lists
    Rows, Limits = row_types(o.precision), limit_types(o.precision)
    # a row stays with its plane through the step, also where its body leaves the region of a part of a mesh
    distance_of = wall_functions(o.walls).extended
    separation = image_functions(o.precision, o.periodic).separation
    direction = direction_function(o.precision)
    lanes = lane_functions(o)
    sweep_blocks, blocks_at, outside = lanes.positions, lanes.blocks_at, lanes.outside
    joining, bridged = joining_functions(o.threads), o.bridged
    wait, give, largest_of = joining.wait, joining.give, joining.largest
    zero = wp.constant(wp.float64(0.0))
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
    def begin(b: Bodies, rows: Rows, share: Share):
        """Takes the differences of positions of all pairs of bodies."""
        for k in range(segments_of(share)):
            s = segment_of(share, k)
            for r in range(rows.base[s], flag(share, s, END)):
                if rows.j[r] < share.total:
                    rows.apart[r] = difference(b, rows.i[r], rows.j[r])
        for k in range(bodies_of(share)):
            i = body_of(share, k)
            rows.shift[i] = vec4(real(0.0), real(0.0), real(0.0), b.inv_m[i])

    @wp.func
    def moved(s: vec4, way: vec3):
        return vec4(s[0] + s[3] * way[0], s[1] + s[3] * way[1], s[2] + s[3] * way[2], s[3])

    @wp.func
    def visit(b: Bodies, lists: Lists, rows: Rows, r: int, walls: Walls, poses: int, total: int, slop: real, dt: real):
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
            distance, normal = distance_of(walls, lists.wall_f[rows.slot[r]], poses, x)
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
        walls: Walls,
        poses: int,
        share: Share,
        segment: int,
        slop: real,
        dt: real,
        reverse: int,
    ):
        """Visits the rows of a segment and returns their largest overlap."""
        largest, first, rest = real(0.0), outside(rows, segment), flag(share, segment, REST)
        at, blocks = blocks_at(rows, segment), flag(share, segment, BLOCKS)
        if reverse == 0:
            largest = sweep_blocks(rows, at, blocks, slop, dt, 0)
        for q in range(rest):
            k = first + q
            if reverse == 1:
                k = first + rest - 1 - q
            largest = wp.max(largest, visit(b, lists, rows, rows.order[k], walls, poses, share.total, slop, dt))
        if reverse == 1:
            largest = wp.max(largest, sweep_blocks(rows, at, blocks, slop, dt, 1))
        return largest

    @wp.func
    def end(b: Bodies, rows: Rows, share: Share):
        """Moves the bodies."""
        for n in range(bodies_of(share)):
            i = body_of(share, n)
            k, s = b.kin[i], rows.shift[i]
            x, y, z = wp.float64(s[0]), wp.float64(s[1]), wp.float64(s[2])
            b.kin[i] = vec8d(k[0] + x, k[1] + y, k[2] + z, k[3], k[4], k[5], k[6], k[7])

    @wp.func
    def separate(b: Bodies, lists: Lists, rows: Rows, walls: Walls, poses: int, share: Share, limits: Limits, dt: real):
        # the bridge needs the positions of all bodies, and then their shifts
        wait(share)
        begin(b, rows, share)
        wait(share)
        left, passes = real(wp.inf), int(0)
        while left > limits.slop and passes < limits.position_sweeps:
            reverse = passes % 2
            found = real(0.0)
            if wp.static(bridged):
                if reverse == 1:
                    if share.part == 0:
                        found = sweep(b, lists, rows, walls, poses, share, share.parts, limits.slop, dt, 1)
                    wait(share)
            own = sweep(b, lists, rows, walls, poses, share, share.part, limits.slop, dt, reverse)
            found = wp.max(found, own)
            if wp.static(bridged):
                give(share, wp.vec4d(wp.float64(found), zero, zero, zero))
                if reverse == 0 and share.part == 0:
                    own = sweep(b, lists, rows, walls, poses, share, share.parts, limits.slop, dt, 0)
                    found = wp.max(found, own)
                found = real(largest_of(share, wp.vec4d(wp.float64(found), zero, zero, zero))[0])
            left = found
            passes += 1
        end(b, rows, share)
        return passes, left

    return separate
