"""The impulse step on the CPU: a launch carries a thread through many steps."""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.collisions import collide_function
from dembench.solver.impulse.positions import position_function
from dembench.solver.impulse.row_lanes import lane_functions
from dembench.solver.impulse.row_opening import row_functions
from dembench.solver.impulse.rows import ImpulseOptions, limit_types, row_types
from dembench.solver.impulse.segments import (
    END,
    OTHER,
    Share,
    bodies_of,
    body_of,
    flag,
    joining_functions,
    segment_of,
    segments_of,
    set_flag,
)
from dembench.solver.impulse.stabilization import search_types, stabilization_functions
from dembench.solver.impulse.sweeps import sweep_functions
from dembench.solver.neighbours import near_functions
from dembench.solver.returns import BIG_OVERFLOW, DONE, NOT_FINITE, REBUILD
from dembench.solver.types import types, vec8d
from dembench.solver.walls.candidates import hand_over_function
from dembench.solver.walls.loads import load_functions
from dembench.solver.walls.motion import place
from dembench.solver.walls.records import Walls


@cache
def impulse_kernel(o: ImpulseOptions) -> Any:
    """The kernel that carries one thread through up to `steps` steps, of which the scene has made `first`.

    `wall_speed` bounds the speed at which walls come towards bodies.

    Each step: gravity; rows from the near pairs; collisions, until no pair meets faster than the event speed; warm
    start; velocity sweeps; stabilization of matter at rest; drift with the new velocities (symplectic); position
    sweeps.

    `share.state` (int32): 0, 1 barrier, 2 steps done, 3 reason for coming back, 4 rows and 7 collisions of the last
    step, in all steps 5 velocity sweeps, 6 position sweeps, 8 sweeps of the stabilization; from FLAGS on of each
    segment, see `segments`. `share.travel` (float64): 0 since the lists were built, 1 since the near pairs were picked,
    2 of large and small bodies since the candidates were listed, 3 largest overlap left by a step, 4 gap up to which
    pairs count as near; from JOINED on what threads exchange.
    """
    t = types(o.precision)
    real, vec4, vec8 = t.real, t.vec4, t.vec8
    Bodies, PairClass, Lists = t.Bodies, t.PairClass, t.Lists
    Rows, Limits, Search = row_types(o.precision), limit_types(o.precision), search_types(o.precision)
    pair_rows, big_rows, wall_rows = row_functions(o)
    warm_start, sweep, remember = sweep_functions(o)
    collide, separate = collide_function(o), position_function(o)
    order = lane_functions(o).order
    near = near_functions(o.precision, o.periodic, o.radii, True)
    pick_near, pick_big = near.pick_near, near.pick_big
    flows, stabilize = stabilization_functions(o)
    present, timed, meshes = o.walls.present, o.walls.timed, o.walls.meshes
    hand_over = hand_over_function(o.precision, o.walls, o.radii)
    of_loads, loads = load_functions(o.walls), o.walls.loads
    clear_loads, add_load_to_wall = of_loads.clear, of_loads.add
    bigs, friction, stabilization, threads, bridged = o.bigs, o.friction, o.stabilization, o.threads, o.bridged
    joining = joining_functions(o.threads)
    wait, sum_of, largest_of = joining.wait, joining.sum_of, joining.largest_of
    zero = wp.constant(wp.float64(0.0))

    @wp.func
    def fall(b: Bodies, i: int, rows: Rows, dt: wp.float64, gravity: wp.vec3d):
        """Adds gravity and hands the velocities to the rows."""
        k = b.kin[i]
        m = b.inv_m[i]
        vx, vy, vz = k[3], k[4], k[5]
        if m > real(0.0):
            vx, vy, vz = vx + dt * gravity[0], vy + dt * gravity[1], vz + dt * gravity[2]
        b.kin[i] = vec8d(k[0], k[1], k[2], vx, vy, vz, k[6], k[7])
        rows.hit[i] = 0
        rows.x[i] = wp.vec3d(k[0], k[1], k[2])
        z = real(0.0)
        u = vec8(real(vx), real(vy), real(vz), m, z, z, z, z)
        if wp.static(friction):
            w = b.spin[i]
            u = vec8(real(vx), real(vy), real(vz), m, w[0], w[1], w[2], b.inv_i[i])
        rows.u[i] = u

    @wp.func
    def drift(b: Bodies, i: int, rows: Rows, dt: wp.float64):
        """Takes the change of velocity from the rows and moves the body."""
        k, u = b.kin[i], rows.u[i]
        vx = k[3] + wp.float64(u[0] - real(k[3]))
        vy = k[4] + wp.float64(u[1] - real(k[4]))
        vz = k[5] + wp.float64(u[2] - real(k[5]))
        b.kin[i] = vec8d(k[0] + dt * vx, k[1] + dt * vy, k[2] + dt * vz, vx, vy, vz, k[6], k[7])
        if wp.static(friction):
            b.spin[i] = vec4(u[4], u[5], u[6], real(0.0))

    @wp.func
    def speeds(b: Bodies, share: Share):
        """Largest squared speeds of the small and of the large bodies, and the sum of all that a thread has."""
        fastest, fastest_big, check = wp.float64(0.0), wp.float64(0.0), wp.float64(0.0)
        for q in range(bodies_of(share)):
            i = body_of(share, q)
            k = b.kin[i]
            square = k[3] * k[3] + k[4] * k[4] + k[5] * k[5]
            check += square
            if i < share.n:
                fastest = wp.max(fastest, square)
            else:
                fastest_big = wp.max(fastest_big, square)
        return fastest, fastest_big, check

    @wp.func
    def moved(b: Bodies, i: int, rows: Rows):
        k = b.kin[i]
        d = wp.vec3d(k[0], k[1], k[2]) - rows.x[i]
        return wp.dot(d, d)

    @wp.func
    def load_walls(b: Bodies, lists: Lists, walls: Walls, poses: int, rows: Rows, share: Share, dt: wp.float64):
        """Hands the impulses of the rows of walls of a thread to the walls, as forces over the step."""
        clear_loads(walls, share.part)
        for r in range(flag(share, share.part, OTHER), flag(share, share.part, END)):
            a, p, blow = rows.a[r], rows.b[r], rows.blow[r]
            k = b.kin[rows.i[r]]
            n, f = wp.vec3d(), wp.vec3d()
            for c in range(3):
                n[c] = wp.float64(a[c])
                f[c] = wp.float64(p[1] * a[c] + p[4 + c] + blow[c]) / dt
            t = -wp.float64(a[7]) * wp.cross(n, f)
            x = wp.vec3d(k[0], k[1], k[2])
            add_load_to_wall(walls, share.part, lists.wall_f[rows.slot[r]], poses, x, f, t, dt)

    @wp.kernel(enable_backward=False, module="unique")
    def advance(
        # inputs
        steps: int,
        first: wp.float64,
        dt: wp.float64,
        gravity: wp.vec3d,
        walls: Walls,
        wall_speed: wp.float64,
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        skin: wp.float64,
        big_skin: wp.float64,
        base: wp.array(dtype=wp.int32),
        wall_capacity: int,
        big_capacity: int,
        limits: Limits,
        pair_count: wp.array(dtype=wp.int32),
        wall_count: wp.array(dtype=wp.int32),
        # outputs
        share: Share,
        b: Bodies,
        lists: Lists,
        rows: Rows,
        search: Search,
        near_count: wp.array(dtype=wp.int32),
    ):
        part, parts, n, total = share.part, share.parts, share.n, share.total
        state, travel = share.state, share.travel
        inside, across, at_walls = 2 * part, 2 * part + 1, part * wall_capacity
        poses = part * walls.motions.shape[0]
        margin, step = wp.float64(limits.margin), real(dt)
        two, eight = wp.float64(2.0), wp.float64(8.0)
        fall_step = dt * dt * wp.length(gravity)
        since_build = wp.float64(travel[0])
        since_near = wp.float64(travel[1])
        since_big = wp.float64(travel[2])
        near_gap = wp.float64(travel[4])
        done, reason, going = int(0), int(DONE), int(1)
        deepest = real(travel[3])
        fast, fast_big, check = speeds(b, share)
        fastest = largest_of(share, wp.vec4d(fast, fast_big, zero, zero))
        while going == 1 and done < steps:
            now = dt * (first + wp.float64(done))
            if wp.static(timed):
                # the mean velocity over the step, so that a gap closes where the wall will be
                place(walls, poses, now, now + wp.float64(0.5) * dt)
            reach = dt * wp.sqrt(fastest[0]) + fall_step
            reach_big = dt * wp.sqrt(fastest[1]) + fall_step
            if wp.static(meshes):
                # only the parts of meshes that are near a large body are listed
                reach = wp.max(reach, reach_big)
            if wp.static(timed):
                reach = wp.max(reach, dt * wall_speed)
            if since_build > zero and two * (since_build + reach) + margin > skin:
                reason = int(REBUILD)
                going = 0
            if going == 1 and (since_near < zero or two * (since_near + reach) + margin > near_gap):
                near_gap = wp.max(limits.near, eight * reach + margin)
                near_count[inside] = pick_near(b, lists, base[inside], pair_count[inside], near_gap, 1)
                if wp.static(threads):
                    near_count[across] = pick_near(b, lists, base[across], pair_count[across], near_gap, 1)
                since_near = wp.float64(0.0)
            if wp.static(bigs):
                need = since_big + reach + reach_big + margin
                if going == 1 and (since_big < zero or need > big_skin):
                    if part == 0:
                        near_count[2 * parts] = pick_big(b, lists, n, total, big_skin, big_capacity)
                    wait(share)
                    since_big = wp.float64(0.0)
                    if near_count[2 * parts] > big_capacity:
                        reason = int(BIG_OVERFLOW)
                        going = 0
            if going == 1:
                for q in range(bodies_of(share)):
                    fall(b, body_of(share, q), rows, dt, gravity)
                other = pair_rows(
                    b,
                    lists,
                    base[inside],
                    near_count[inside],
                    pair_table,
                    pair_columns,
                    step,
                    limits,
                    rows,
                    rows.base[part],
                    rows.base[part + 1],
                )
                last = other + 0
                if wp.static(meshes):
                    hand_over(b, lists, walls, poses, at_walls, wall_count[part], margin)
                if wp.static(present):
                    last = wall_rows(
                        b,
                        lists,
                        at_walls,
                        wall_count[part],
                        walls,
                        poses,
                        rows.fixed[part],
                        wall_table,
                        wall_columns,
                        step,
                        limits,
                        rows,
                        other,
                        rows.base[part + 1],
                    )
                set_flag(share, part, OTHER, other)
                set_flag(share, part, END, last)
                order(rows, share, part)
                if wp.static(bridged):
                    wait(share)
                    if part == 0:
                        first_row = rows.base[parts] + 0
                        other = int(first_row)
                        if wp.static(threads):
                            for p in range(parts):
                                region = 2 * p + 1
                                other = pair_rows(
                                    b,
                                    lists,
                                    base[region],
                                    near_count[region],
                                    pair_table,
                                    pair_columns,
                                    step,
                                    limits,
                                    rows,
                                    other,
                                    rows.base[parts + 1],
                                )
                        last = other + 0
                        if wp.static(bigs):
                            last = big_rows(
                                b,
                                lists,
                                near_count[2 * parts],
                                n,
                                total,
                                pair_table,
                                pair_columns,
                                step,
                                limits,
                                rows,
                                other,
                                rows.base[parts + 1],
                            )
                        set_flag(share, parts, OTHER, other)
                        set_flag(share, parts, END, last)
                        order(rows, share, parts)
                    wait(share)
                hits, blow = collide(b, rows, share, limits, step)
                warm_start(rows, share)
                changed = sweep(rows, share, limits.still, 0)
                sweeps = int(1)
                while changed > 0 and sweeps < limits.velocity_sweeps:
                    changed = sweep(rows, share, limits.still, sweeps % 2)
                    sweeps += 1
                stabilized = int(0)
                if wp.static(stabilization):
                    if not flows(rows, share, limits, blow):
                        stabilized = stabilize(rows, search, share, limits)
                if wp.static(loads):
                    load_walls(b, lists, walls, poses, rows, share, dt)
                for q in range(bodies_of(share)):
                    drift(b, body_of(share, q), rows, dt)
                if wp.static(timed):
                    place(walls, poses, now + dt, now + dt)
                passes, left = separate(b, lists, rows, walls, poses, share, limits, step)
                for q in range(segments_of(share)):
                    s = segment_of(share, q)
                    begin, middle, end = rows.base[s] + 0, flag(share, s, OTHER), flag(share, s, END)
                    remember(rows, begin, middle, lists.memory)
                    if s == parts:
                        if wp.static(bigs):
                            remember(rows, middle, end, lists.big_memory)
                    elif wp.static(present):
                        remember(rows, middle, end, lists.wall_memory)
                deepest = wp.max(deepest, left)
                far, far_big = wp.float64(0.0), wp.float64(0.0)
                for q in range(bodies_of(share)):
                    i = body_of(share, q)
                    if i < n:
                        far = wp.max(far, moved(b, i, rows))
                    else:
                        far_big = wp.max(far_big, moved(b, i, rows))
                fast, fast_big, check = speeds(b, share)
                fastest = largest_of(share, wp.vec4d(fast, fast_big, far, far_big))
                check = sum_of(share, wp.vec4d(check))[0]
                farthest, farthest_big = wp.sqrt(fastest[2]), wp.sqrt(fastest[3])
                travelled = farthest + zero
                if wp.static(meshes):
                    travelled = wp.max(farthest, farthest_big)
                if wp.static(timed):
                    travelled = wp.max(travelled, dt * wall_speed)
                since_build += travelled
                since_near += travelled
                since_big += farthest + farthest_big
                done += 1
                if part == 0:
                    state[4] = flag(share, parts, END) - rows.base[parts]
                    for p in range(parts):
                        state[4] = state[4] + flag(share, p, END) - rows.base[p]
                    state[5] = state[5] + sweeps
                    state[6] = state[6] + passes
                    state[7] = hits
                    state[8] = state[8] + stabilized
                if not wp.isfinite(check):
                    reason = int(NOT_FINITE)
                    going = 0
        if part == 0:
            travel[0] = since_build
            travel[1] = since_near
            travel[2] = since_big
            travel[3] = wp.float64(deepest)
            travel[4] = near_gap
            state[2] = done
            state[3] = reason

    return advance
