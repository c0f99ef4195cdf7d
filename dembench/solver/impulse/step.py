"""The impulse step on the CPU: one serial launch carries the simulation through many steps."""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.collisions import collide_functions
from dembench.solver.impulse.positions import position_functions
from dembench.solver.impulse.row_lanes import BLOCKS, lane_functions
from dembench.solver.impulse.rows import ImpulseOptions, limit_types, row_functions, row_types
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
    """The kernel that makes up to `steps` steps, of which the scene has made `first`.

    `wall_speed` bounds the speed at which walls come towards bodies.

    Each step: gravity; rows from the near pairs; collisions, until no pair meets faster than the event speed; warm
    start; velocity sweeps; stabilization of matter at rest; drift with the new velocities (symplectic); position
    sweeps.

    `state` (int32): 2 steps done, 3 reason for coming back, 4 rows and 7 collisions of the last step, in all steps 5
    velocity sweeps, 6 position sweeps, 8 sweeps of the stabilization; 9 blocks of rows and 10 rows outside them in the
    last step. `travel` (float64): 0 since the lists were built,
    1 since the near pairs were picked, 2 of large and small bodies since the candidates were listed, 3 largest overlap
    left by a step, 4 gap up to which pairs count as near.
    """
    t = types(o.precision)
    real, vec4, vec8 = t.real, t.vec4, t.vec8
    Bodies, PairClass, Lists = t.Bodies, t.PairClass, t.Lists
    Rows, Limits, Search = row_types(o.precision), limit_types(o.precision), search_types(o.precision)
    pair_rows, big_rows, wall_rows = row_functions(o)
    warm_start, sweep, remember = sweep_functions(o)
    collide, close = collide_functions(o)
    positions = position_functions(o)
    part, push, shift = positions.begin, positions.sweep, positions.end
    order = lane_functions(o).order
    near = near_functions(o.precision, o.periodic, o.radii, True)
    pick_near, pick_big = near.pick_near, near.pick_big
    flows, stabilize = stabilization_functions(o)
    present, timed, meshes = o.walls.present, o.walls.timed, o.walls.meshes
    hand_over = hand_over_function(o.precision, o.walls, o.radii)
    of_loads, loads = load_functions(o.walls), o.walls.loads
    clear_loads, add_load_to_wall = of_loads.clear, of_loads.add
    bigs, friction, stabilization = o.bigs, o.friction, o.stabilization

    @wp.func
    def fall(b: Bodies, i: int, rows: Rows, dt: wp.float64, gravity: wp.vec3d):
        """Adds gravity and hands the velocities to the rows; returns the squared speed."""
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
        return vx * vx + vy * vy + vz * vz

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
        return vx * vx + vy * vy + vz * vz

    @wp.func
    def moved(b: Bodies, i: int, rows: Rows):
        k = b.kin[i]
        d = wp.vec3d(k[0], k[1], k[2]) - rows.x[i]
        return wp.dot(d, d)

    @wp.func
    def load_walls(b: Bodies, lists: Lists, walls: Walls, rows: Rows, begin: int, end: int, total: int, dt: wp.float64):
        """Hands the impulses of the rows begin..end of the step to the walls, as forces over the step."""
        clear_loads(walls, 0)
        for r in range(begin, end):
            a, p, blow = rows.a[r], rows.b[r], rows.blow[r]
            k = b.kin[rows.i[r]]
            n, f = wp.vec3d(), wp.vec3d()
            for c in range(3):
                n[c] = wp.float64(a[c])
                f[c] = wp.float64(p[1] * a[c] + p[4 + c] + blow[c]) / dt
            t = -wp.float64(a[7]) * wp.cross(n, f)
            x = wp.vec3d(k[0], k[1], k[2])
            add_load_to_wall(walls, 0, lists.wall_f[rows.j[r] - total], 0, x, f, t, dt)

    @wp.kernel(enable_backward=False, module="unique")
    def advance(
        # inputs
        steps: int,
        first: wp.float64,
        dt: wp.float64,
        gravity: wp.vec3d,
        n: int,
        total: int,
        walls: Walls,
        wall_speed: wp.float64,
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        skin: wp.float64,
        big_skin: wp.float64,
        big_capacity: int,
        row_capacity: int,
        limits: Limits,
        pair_count: wp.array(dtype=wp.int32),
        wall_count: wp.array(dtype=wp.int32),
        # outputs
        b: Bodies,
        lists: Lists,
        rows: Rows,
        search: Search,
        near_count: wp.array(dtype=wp.int32),
        state: wp.array(dtype=wp.int32),
        travel: wp.array(dtype=wp.float64),
    ):
        margin = wp.float64(limits.margin)
        two, eight = wp.float64(2.0), wp.float64(8.0)
        since_build = wp.float64(travel[0])
        since_near = wp.float64(travel[1])
        since_big = wp.float64(travel[2])
        done, reason, going = int(0), int(DONE), int(1)
        counted = int(0)
        while going == 1 and done < steps:
            now = dt * (first + wp.float64(done))
            if wp.static(timed):
                # the mean velocity over the step, so that a gap closes where the wall will be
                place(walls, 0, now, now + wp.float64(0.5) * dt)
            fastest, fastest_big, check = wp.float64(0.0), wp.float64(0.0), wp.float64(0.0)
            for i in range(n):
                k = b.kin[i]
                fastest = wp.max(fastest, k[3] * k[3] + k[4] * k[4] + k[5] * k[5])
            for i in range(n, total):
                k = b.kin[i]
                fastest_big = wp.max(fastest_big, k[3] * k[3] + k[4] * k[4] + k[5] * k[5])
            fall_step = dt * dt * wp.length(gravity)
            reach = dt * wp.sqrt(fastest) + fall_step
            reach_big = dt * wp.sqrt(fastest_big) + fall_step
            if wp.static(meshes):
                # only the parts of meshes that are near a large body are listed
                reach = wp.max(reach, reach_big)
            if wp.static(timed):
                reach = wp.max(reach, dt * wall_speed)
            if since_build > wp.float64(0.0) and two * (since_build + reach) + margin > skin:
                reason = int(REBUILD)
                going = 0
            if going == 1 and (since_near < wp.float64(0.0) or two * (since_near + reach) + margin > travel[4]):
                travel[4] = wp.max(limits.near, eight * reach + margin)
                near_count[0] = pick_near(b, lists, 0, pair_count[0], travel[4], 1)
                since_near = wp.float64(0.0)
            if wp.static(bigs):
                need = since_big + reach + reach_big + margin
                if going == 1 and (since_big < wp.float64(0.0) or need > big_skin):
                    near_count[2] = pick_big(b, lists, n, total, big_skin, big_capacity)
                    since_big = wp.float64(0.0)
                    if near_count[2] > big_capacity:
                        reason = int(BIG_OVERFLOW)
                        going = 0
            if going == 1:
                for i in range(total):
                    check += fall(b, i, rows, dt, gravity)
                step = real(dt)
                first_big = pair_rows(
                    b,
                    lists,
                    near_count[0],
                    pair_table,
                    pair_columns,
                    step,
                    limits,
                    rows,
                    row_capacity,
                )
                first_wall = first_big + 0
                if wp.static(bigs):
                    first_wall = big_rows(
                        b,
                        lists,
                        near_count[2],
                        n,
                        total,
                        pair_table,
                        pair_columns,
                        step,
                        limits,
                        rows,
                        first_big,
                        row_capacity,
                    )
                counted = first_wall + 0
                if wp.static(meshes):
                    hand_over(b, lists, walls, 0, 0, wall_count[0], margin)
                if wp.static(present):
                    counted = wall_rows(
                        b,
                        lists,
                        wall_count[0],
                        walls,
                        total,
                        wall_table,
                        wall_columns,
                        step,
                        limits,
                        rows,
                        first_wall,
                        row_capacity,
                    )
                hits, blow = collide(b, total, rows, counted, limits, step, 0)
                state[7] = hits
                blows = int(1)
                while hits > 0 and blows < limits.velocity_sweeps:
                    hits, more = collide(b, total, rows, counted, limits, step, blows)
                    blow += more
                    state[7] = state[7] + hits
                    blows += 1
                if state[7] > 0:
                    close(b, total, rows, counted, step)
                warm_start(rows, counted)
                order(rows, total, first_big, counted, state)
                blocks, rest = state[wp.static(BLOCKS)] + 0, state[wp.static(BLOCKS) + 1] + 0
                changed = sweep(rows, blocks, rest, limits.still, 0)
                sweeps = int(1)
                while changed > 0 and sweeps < limits.velocity_sweeps:
                    changed = sweep(rows, blocks, rest, limits.still, sweeps % 2)
                    sweeps += 1
                state[5] = state[5] + sweeps
                if wp.static(stabilization):
                    if not flows(rows, counted, limits, blow):
                        state[8] = state[8] + stabilize(rows, search, counted, blocks, rest, total, limits)
                if wp.static(loads):
                    load_walls(b, lists, walls, rows, first_wall, counted, total, dt)
                for i in range(total):
                    check += drift(b, i, rows, dt)
                if wp.static(timed):
                    place(walls, 0, now + dt, now + dt)
                part(b, rows, counted, total)
                left = real(wp.inf)
                passes = int(0)
                while left > limits.slop and passes < limits.position_sweeps:
                    left = push(b, lists, rows, blocks, rest, walls, total, limits.slop, step, passes % 2)
                    passes += 1
                shift(b, rows, total)
                state[6] = state[6] + passes
                remember(rows, 0, first_big, lists.memory)
                if wp.static(bigs):
                    remember(rows, first_big, first_wall, lists.big_memory)
                if wp.static(present):
                    remember(rows, first_wall, counted, lists.wall_memory)
                travel[3] = wp.max(travel[3], wp.float64(left))
                farthest, farthest_big = wp.float64(0.0), wp.float64(0.0)
                for i in range(n):
                    farthest = wp.max(farthest, moved(b, i, rows))
                for i in range(n, total):
                    farthest_big = wp.max(farthest_big, moved(b, i, rows))
                travelled = wp.sqrt(farthest)
                if wp.static(meshes):
                    travelled = wp.sqrt(wp.max(farthest, farthest_big))
                if wp.static(timed):
                    travelled = wp.max(travelled, dt * wall_speed)
                since_build += travelled
                since_near += travelled
                since_big += wp.sqrt(farthest) + wp.sqrt(farthest_big)
                done += 1
                if not wp.isfinite(check):
                    reason = int(NOT_FINITE)
                    going = 0
        travel[0] = since_build
        travel[1] = since_near
        travel[2] = since_big
        state[2] = done
        state[3] = reason
        state[4] = counted

    return advance
