"""The rows of compliant contacts on full lists, opened in the middle of a substep.

Every body opens its own rows, at the places that the bodies have reached after the first half of their drift; see
`impulse/compliant_opening.py` for which rows there are and how they begin.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.full_impulse_loops import MADE, STALE, H
from dembench.solver.full_impulse_rows import SHUT, WALL, full_rows_type, row_functions
from dembench.solver.full_lists import MARK, full_lists_type, hand_over_function
from dembench.solver.impulse.compliant_opening import opening_functions
from dembench.solver.impulse.compliant_rows import CompliantOptions
from dembench.solver.laws import surface_functions
from dembench.solver.pairs import pair_lookup, radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.types import types, vec8d
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import Walls


@cache
def opening_kernels(o: CompliantOptions) -> Any:
    """Kernels `open`, of small bodies, and `open_big`, of large ones; arguments: see `full_impulse_step`."""
    precision = o.law.precision
    t = types(precision)
    real, vec3, vec4, vec8 = t.real, t.vec3, t.vec4, t.vec8
    Bodies, PairClass = t.Bodies, t.PairClass
    FullLists, FullRows = full_lists_type(precision), full_rows_type(precision)
    of_row = row_functions(o)
    put, given, inertia = of_row.put, of_row.given, of_row.inertia
    sagitta, arm_of = opening_functions(o).sagitta, surface_functions(o.law).arm
    of_pair, of_wall = pair_lookup(precision, o.pairs, o.radii)
    separation, radius = image_functions(precision, o.periodic).separation, radius_function(precision, o.radii)
    of_feature = wall_functions(o.walls)
    distance_of, velocity_of = of_feature.distance, of_feature.velocity
    mean_distance_of = of_feature.mean_distance
    hand_over = hand_over_function(precision, o.walls, o.radii)
    present, meshes = o.walls.present, o.walls.meshes
    rotation, friction = o.rotation, o.law.friction

    @wp.func
    def spin(b: Bodies, i: int):
        w = vec3()
        if wp.static(rotation):
            s = b.spin[i]
            w = vec3(s[0], s[1], s[2])
        return w

    @wp.func
    def meet(
        b: Bodies,
        rows: FullRows,
        middle: wp.array(dtype=vec8d),
        i: int,
        j: int,
        at: int,
        slot: int,
        memory: vec4,
        table: wp.array(dtype=PairClass),
        columns: int,
        h: real,
        grown: real,
    ):
        """Opens the row of bodies i and j where they touch on their way.

        What its first impulse changes of i, whether there is a row, and the overlap.
        """
        first, second = i, j
        if j < i:
            first, second = j, i
        ki, kj = middle[first], middle[second]
        d = separation(b, ki, kj)
        ri, rj = radius(b, ki), radius(b, kj)
        sum = ri + rj
        # (sum^2 - r^2)/(sum + r) keeps the overlap exact in single precision where sum - r would not
        inside = sum * sum - (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        e = vec3(real(d[0]), real(d[1]), real(d[2]))
        r = wp.length(e)
        overlap = real(inside) / (real(sum) + r)
        n = vec3(real(1.0), real(0.0), real(0.0))
        if r > real(0.0):
            n = e * (real(1.0) / r)
        v = vec3(real(d[3]), real(d[4]), real(d[5]))
        vn = wp.dot(v, n)
        mean = overlap - sagitta(v, vn, h, real(sum))
        gained, opened = vec8(), int(0)
        if mean + real(0.5) * h * wp.abs(vn) > real(0.0):
            c = of_pair(b, first, second, table, columns)
            ai, aj = arm_of(ri, overlap), arm_of(rj, overlap)
            wi, wj = spin(b, first), spin(b, second)
            p = put(rows, at, j, slot, n, mean, v, wi, wj, ai, aj, memory, c, h, grown)
            turn = wp.cross(n, p)
            if i == first:
                gained = given(b.inv_m[i], inertia(b, i), p, turn, ai)
            else:
                gained = given(b.inv_m[i], inertia(b, i), -p, turn, aj)
            opened = 1
        return gained, opened, overlap

    @wp.func
    def meet_walls(
        b: Bodies,
        rows: FullRows,
        middle: wp.array(dtype=vec8d),
        lists: FullLists,
        i: int,
        total: int,
        found: int,
        walls: Walls,
        table: wp.array(dtype=PairClass),
        columns: int,
        h: real,
        grown: real,
        fall: real,
    ):
        """Opens the rows of body i at walls after `found` others: what they change of it, and how many there are then.

        `fall` is what gravity adds to a speed.
        """
        gained, count = vec8(), int(found)
        k = middle[i]
        if wp.static(meshes and friction):
            hand_over(b, k, lists, i, total, walls)
        x, velocity = wp.vec3d(k[0], k[1], k[2]), wp.vec3d(k[3], k[4], k[5])
        radius_i = radius(b, k)
        for q in range(lists.wall_count[i]):
            slot = q * total + i
            entry = lists.wall[slot] + 0
            f = entry & (MARK - 1)
            distance, normal = distance_of(walls, f, 0, x)
            overlap = real(radius_i - distance)
            n = vec3(real(normal[0]), real(normal[1]), real(normal[2]))
            ai = arm_of(radius_i, overlap)
            dv = velocity - velocity_of(walls, f, 0, x - wp.float64(ai) * normal)
            v = vec3(real(dv[0]), real(dv[1]), real(dv[2]))
            mean = overlap
            if overlap + h * (wp.length(v) + fall) > real(0.0):
                way, time = wp.float64(h) * velocity, wp.float64(h)
                mean = real(radius_i - mean_distance_of(walls, f, 0, x, way, time, distance, normal))
            if mean + real(0.5) * h * (wp.abs(wp.dot(v, n)) + fall) > real(0.0):
                memory = vec4()
                if wp.static(friction):
                    if entry >= MARK:
                        memory = lists.wall_memory[slot]
                c = of_wall(b, i, walls.features[f].kind, table, columns)
                at, z = count * total + i, real(0.0)
                p = put(rows, at, WALL, slot, n, mean, v, spin(b, i), vec3(), ai, z, memory, c, h, grown)
                gained = gained + given(b.inv_m[i], inertia(b, i), p, wp.cross(n, p), ai)
                count += 1
            elif entry >= MARK:
                lists.wall[slot] = f
        return gained, count

    @wp.func
    def begin(b: Bodies, rows: FullRows, i: int, h: real, gravity: wp.vec3d, gained: vec8, count: int):
        """A body's change of velocity before the first sweep, and its parts."""
        m, z = b.inv_m[i], real(0.0)
        start = vec8(z, z, z, m, z, z, z, inertia(b, i))
        if m > z:
            f = wp.float64(h) * gravity
            start = vec8(real(f[0]), real(f[1]), real(f[2]), m, z, z, z, inertia(b, i))
        rows.u[i] = start + gained
        rows.parts[i] = wp.max(real(0.5) * real(count), real(1.0))

    @wp.kernel(enable_backward=False, module="unique")
    def open(
        # inputs
        n: int,
        total: int,
        gravity: wp.vec3d,
        b: Bodies,
        middle: wp.array(dtype=vec8d),
        walls: Walls,
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        control: wp.array(dtype=wp.int32),
        clock: wp.array(dtype=wp.float64),
        # outputs
        lists: FullLists,
        rows: FullRows,
        overlaps: wp.array(dtype=real),
    ):
        """Opens the rows of the small bodies."""
        i = wp.tid()
        if control[STALE] != 0:
            return
        h, grown = real(clock[H]), real(clock[MADE])
        sum, found, largest = vec8(), int(0), real(0.0)
        for q in range(lists.count[i]):
            slot = q * n + i
            entry = lists.partner[slot] + 0
            j = entry & (MARK - 1)
            memory = vec4()
            if wp.static(friction):
                if entry >= MARK:
                    memory = lists.memory[slot]
            at = found * total + i
            gained, opened, overlap = meet(b, rows, middle, i, j, at, slot, memory, pair_table, pair_columns, h, grown)
            if opened == 1:
                sum = sum + gained
                found += 1
                largest = wp.max(largest, overlap)
            elif entry >= MARK:
                lists.partner[slot] = j
        if wp.static(present):
            fall = h * real(wp.length(gravity))
            by_walls, found_too = meet_walls(
                b, rows, middle, lists, i, total, found, walls, wall_table, wall_columns, h, grown, fall
            )
            sum = sum + by_walls
            found = found_too
        rows.count[i] = found
        if largest > overlaps[i]:
            overlaps[i] = largest
        begin(b, rows, i, h, gravity, sum, found)

    @wp.kernel(enable_backward=False, module="unique")
    def open_big(
        # inputs
        n: int,
        total: int,
        behind: int,
        gravity: wp.vec3d,
        b: Bodies,
        middle: wp.array(dtype=vec8d),
        walls: Walls,
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        control: wp.array(dtype=wp.int32),
        clock: wp.array(dtype=wp.float64),
        # outputs
        lists: FullLists,
        rows: FullRows,
        overlaps: wp.array(dtype=real),
    ):
        """Opens the rows of the large bodies; those of their candidates stand from `behind` on."""
        row, lane = wp.tid()
        i = n + row
        h, grown = real(clock[H]), real(clock[MADE])
        sum, found, largest = vec8(), int(0), real(0.0)
        if control[STALE] == 0:
            for q in range(lists.big_start[row] + lane, lists.big_start[row + 1], wp.block_dim()):
                j = lists.big[q] + 0
                slot = row * total + j
                memory = vec4()
                if wp.static(friction):
                    memory = lists.big_memory[slot]
                gained, opened, overlap = meet(
                    b, rows, middle, i, j, behind + q, slot, memory, pair_table, pair_columns, h, grown
                )
                if opened == 1:
                    sum = sum + gained
                    found += 1
                    largest = wp.max(largest, overlap)
                else:
                    rows.slot[behind + q] = SHUT
                    if wp.static(friction):
                        lists.big_memory[slot] = vec4()
        # all threads of a block take part in what reads an element of a tile
        by_bodies = wp.tile_sum(wp.tile(sum, preserve_type=True))[0]
        count = wp.tile_sum(wp.tile(found))[0]
        deepest = wp.tile_max(wp.tile(largest))[0]
        if lane == 0 and control[STALE] == 0:
            at_walls = int(0)
            if wp.static(present):
                fall = h * real(wp.length(gravity))
                by_walls, found_too = meet_walls(
                    b, rows, middle, lists, i, total, 0, walls, wall_table, wall_columns, h, grown, fall
                )
                by_bodies = by_bodies + by_walls
                at_walls = found_too
            rows.count[i] = at_walls
            if deepest > overlaps[i]:
                overlaps[i] = deepest
            begin(b, rows, i, h, gravity, by_bodies, count + at_walls)

    return SimpleNamespace(open=open, open_big=open_big)
