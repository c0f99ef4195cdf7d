"""The choice of rigid rows: the contacts that a step may need, one per pair and wall feature, at the start of the step.

A row is kept for every pair whose gap can close within the step, also where one of the two is stopped by another
contact: grains that fall side by side pile up within the step in which the first one lands. Normals and gaps are those
at the start of the step; a positive gap enters as v' >= -gap/dt. Two that are both held have none.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.rows import ImpulseOptions, limit_types, row_access, row_types
from dembench.solver.pairs import pair_lookup, radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.types import types, vec8d
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import Walls

PASSING = 0.005
"""Two that meet pass each other where they move sideways by more than this part of the sum of their radii before; with
the normal of the start a deflection would be wrong by up to twice this angle [-]."""


@cache
def direction_function(precision: str) -> Any:
    """Direction in which two bodies with the same centre part, as a Warp function (i, j) -> unit vector.

    It depends on the two indices alone, so a run can be repeated, and many bodies at one point part in all directions.
    """
    t = types(precision)
    real, vec3 = t.real, t.vec3

    @wp.func
    def direction(i: int, j: int):
        seed = wp.rand_init(i, j)
        d = wp.sample_unit_sphere_surface(seed)
        return vec3(real(d[0]), real(d[1]), real(d[2]))

    return direction


@cache
def row_functions(o: ImpulseOptions) -> Any:
    """Warp functions (pair_rows, big_rows, wall_rows) that write rows from `first` on and return where they end.

    pair_rows reads the `near` near pairs of the region that begins at `region`, wall_rows the `listed` candidates from
    `begin` on, whose walls stand in u from `fixed` on and where the thread has them at `poses`.
    """
    t = types(o.precision)
    real, vec3, vec4, vec8 = t.real, t.vec3, t.vec4, t.vec8
    Bodies, PairClass, Lists = t.Bodies, t.PairClass, t.Lists
    Rows, Limits = row_types(o.precision), limit_types(o.precision)
    of_pair, of_wall = pair_lookup(o.precision, o.pairs, o.radii)
    radius = radius_function(o.precision, o.radii)
    separation = image_functions(o.precision, o.periodic).separation
    of_feature = wall_functions(o.walls)
    distance_of, velocity_of = of_feature.distance, of_feature.velocity
    direction = direction_function(o.precision)
    access = row_access(o.precision)
    state, set_row = access.state, access.set_row
    friction, loads = o.friction, o.walls.loads

    @wp.func
    def put(
        rows: Rows,
        at: int,
        i: int,
        j: int,
        slot: int,
        n: vec3,
        gap: real,
        ri: real,
        rj: real,
        c: PairClass,
        memory: vec4,
        dt: real,
        limits: Limits,
    ):
        """Writes a row with the impulses of the last step. Memory: tangential impulse, along n the load that the
        position pass carried, and the normal impulse."""
        ui, uj = state(rows, i), state(rows, j)
        mass = real(1.0) / (ui[3] + uj[3])
        turning = real(1.0) / (ui[3] + uj[3] + ri * ri * ui[7] + rj * rj * uj[7])
        if wp.static(loads):
            rows.blow[at] = vec3()
        lt = vec3()
        carried = real(0.0)
        if wp.static(friction):
            m = vec3(memory[0], memory[1], memory[2])
            along = wp.dot(m, n)
            lt = m - along * n
            vn = n[0] * (ui[0] - uj[0]) + n[1] * (ui[1] - uj[1]) + n[2] * (ui[2] - uj[2])
            if wp.abs(vn) < limits.event:
                carried = wp.max(along, real(0.0))
        a = vec8(n[0], n[1], n[2], -gap / dt, mass, turning, c.mu, ri)
        set_row(rows, at, i, j, slot, a, vec8(rj, memory[3], c.e, c.beta, lt[0], lt[1], lt[2], carried))

    @wp.func
    def meeting(d: vec8d, inside: wp.float64, dt: wp.float64):
        """Difference of two positions, and the time of it, where two that approach each other on straight ways touch,
        where they pass each other, or at the end of the step, whichever is first; `inside` is (ri + rj)^2 - |d|^2."""
        speed2 = d[3] * d[3] + d[4] * d[4] + d[5] * d[5]
        rate = -(d[0] * d[3] + d[1] * d[4] + d[2] * d[5])
        time = rate / speed2
        root = rate * rate + speed2 * inside
        if root > wp.float64(0.0):
            time = -inside / (rate + wp.sqrt(root))
        time = wp.min(time, dt)
        return wp.vec4d(d[0] + time * d[3], d[1] + time * d[4], d[2] + time * d[5], time)

    @wp.func
    def add_pair(
        b: Bodies,
        rows: Rows,
        found: int,
        capacity: int,
        i: int,
        j: int,
        slot: int,
        c: PairClass,
        memory: vec4,
        dt: real,
        limits: Limits,
    ):
        count = found
        ki, kj = b.kin[i], b.kin[j]
        d = separation(b, ki, kj)
        ri, rj = radius(b, ki), radius(b, kj)
        reach = ri + rj
        inside = reach * reach - (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        e = vec3(real(d[0]), real(d[1]), real(d[2]))
        r = wp.length(e)
        gap = -real(inside) / (real(reach) + r)
        n = e * (real(1.0) / r)
        if r == real(0.0):
            n = direction(i, j)
        if gap > real(0.0) and -(d[0] * d[3] + d[1] * d[4] + d[2] * d[5]) > wp.float64(limits.event * r):
            way = meeting(d, inside, wp.float64(dt))
            met = wp.vec3d(way[0], way[1], way[2])
            away = wp.length(met)
            if wp.length(wp.cross(wp.vec3d(d[0], d[1], d[2]), met)) > wp.float64(PASSING) * reach * away:
                # two that pass each other collide, if at all, where their ways meet, not along the line of here
                met = met / away
                n = vec3(real(met[0]), real(met[1]), real(met[2]))
                closed = way[3] * (met[0] * d[3] + met[1] * d[4] + met[2] * d[5])
                gap = real(wp.max(away - reach, wp.float64(0.0)) - closed)
        vi = n[0] * real(ki[3]) + n[1] * real(ki[4]) + n[2] * real(ki[5])
        vj = n[0] * real(kj[3]) + n[1] * real(kj[4]) + n[2] * real(kj[5])
        # either may be stopped by another contact within the step
        closing = wp.max(wp.max(-vi, vj), wp.max(vj - vi, real(0.0)))
        if gap - closing * dt < limits.margin and b.inv_m[i] + b.inv_m[j] > real(0.0):
            if count < capacity:
                put(rows, count, i, j, slot, n, gap, real(ri), real(rj), c, memory, dt, limits)
            count = count + 1
        return count

    @wp.func
    def pair_rows(
        b: Bodies,
        lists: Lists,
        region: int,
        near: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        dt: real,
        limits: Limits,
        rows: Rows,
        first: int,
        capacity: int,
    ):
        found = int(first)
        for q in range(region, region + near):
            k = lists.near[q]
            i, j = lists.i[k], lists.j[k]
            c = of_pair(b, i, j, table, columns)
            found = add_pair(b, rows, found, capacity, i, j, k, c, lists.memory[k], dt, limits)
            lists.memory[k] = vec4()
        return found

    @wp.func
    def big_rows(
        b: Bodies,
        lists: Lists,
        listed: int,
        n: int,
        total: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        dt: real,
        limits: Limits,
        rows: Rows,
        first: int,
        capacity: int,
    ):
        found = int(first)
        for q in range(listed):
            i, j = lists.big_i[q], lists.big_j[q]
            slot = (j - n) * total + i
            c = of_pair(b, i, j, table, columns)
            found = add_pair(b, rows, found, capacity, i, j, slot, c, lists.big_memory[slot], dt, limits)
            lists.big_memory[slot] = vec4()
        return found

    @wp.func
    def wall_rows(
        b: Bodies,
        lists: Lists,
        begin: int,
        listed: int,
        walls: Walls,
        poses: int,
        fixed: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        dt: real,
        limits: Limits,
        rows: Rows,
        first: int,
        capacity: int,
    ):
        found = int(first)
        for q in range(begin, begin + listed):
            i, f = lists.wall_i[q], lists.wall_f[q]
            k = b.kin[i]
            x = wp.vec3d(k[0], k[1], k[2])
            distance, normal = distance_of(walls, f, poses, x)
            n = vec3(real(normal[0]), real(normal[1]), real(normal[2]))
            own = radius(b, k)
            gap = real(distance - own)
            v = velocity_of(walls, f, poses, x - wp.float64(own) * normal)
            approach = real((k[3] - v[0]) * normal[0] + (k[4] - v[1]) * normal[1] + (k[5] - v[2]) * normal[2])
            if gap + wp.min(approach, real(0.0)) * dt < limits.margin and b.inv_m[i] > real(0.0):
                if found < capacity:
                    z = real(0.0)
                    j = fixed + q - begin
                    rows.hit[j] = 0
                    rows.u[j] = vec8(real(v[0]), real(v[1]), real(v[2]), z, z, z, z, z)
                    c = of_wall(b, i, walls.features[f].kind, table, columns)
                    put(
                        rows,
                        found,
                        i,
                        j,
                        q,
                        n,
                        gap,
                        real(own),
                        z,
                        c,
                        lists.wall_memory[q],
                        dt,
                        limits,
                    )
                found += 1
            lists.wall_memory[q] = vec4()
        return found

    return pair_rows, big_rows, wall_rows
