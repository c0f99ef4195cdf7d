"""The soft-sphere step on the CPU: half lists, plain accumulation, one or more threads on disjoint ranges.

One launch carries a thread through many steps. It comes back when the steps are done, when the lists may no longer
hold every pair that can touch, or when a value is not finite. The integrator is velocity Verlet; forces are evaluated
with the half-step velocities.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.contact_lanes import near_pairs_function
from dembench.solver.contacts import StepOptions, force_functions, load_functions
from dembench.solver.kick_lanes import move_function
from dembench.solver.neighbours import near_functions
from dembench.solver.pairs import pair_lookup
from dembench.solver.returns import BIG_OVERFLOW, DONE, NOT_FINITE, REBUILD
from dembench.solver.sync import barrier
from dembench.solver.types import types
from dembench.solver.walls.candidates import hand_over_function
from dembench.solver.walls.loads import load_functions as wall_load_functions
from dembench.solver.walls.motion import place
from dembench.solver.walls.records import Walls

NEAR_STEPS = wp.constant(10)
"""Steps for which near pairs are picked at least, if the lists reach that far."""


@cache
def advance_kernel(o: StepOptions) -> Any:
    """The kernel that carries one thread through up to `steps` steps, of which the scene has made `first`.

    `wall_speed` bounds the speed at which walls come towards bodies.
    `state` (int32): 0, 1 barrier; 2 steps done; 3 reason for coming back; 4 whether the step in progress still lacks
    its forces. `travel` (float64): 0 since the lists were built, 1 since the near lists were picked, 2 of the large
    bodies and the small ones since the candidates were listed, 3 gap up to which pairs count as near, from 4 on per
    thread: largest squared speed of small and of large bodies, sum of squared speeds, largest overlap. Near pairs are
    picked up to `near_skin`, or what suffices for NEAR_STEPS steps.
    """
    t = types(o.law.precision)
    real, vec3, vec4, vec8 = t.real, t.vec3, t.vec4, t.vec8
    Bodies, PairClass, Lists = t.Bodies, t.PairClass, t.Lists
    pair, wall, spin = force_functions(o)
    load_of = load_functions(o.law.precision, o.rotation)
    get_load, put_load = load_of.get, load_of.put
    move = move_function(o)
    near_pairs = near_pairs_function(o)
    of_pair, _of_wall = pair_lookup(o.law.precision, o.pairs, o.radii)
    near = near_functions(o.law.precision, o.periodic, o.radii, o.law.friction)
    pick_near, pick_big = near.pick_near, near.pick_big
    present, timed, meshes = o.walls.present, o.walls.timed, o.walls.meshes
    hand_over = hand_over_function(o.law.precision, o.walls, o.radii)
    of_loads, loads = wall_load_functions(o.walls), o.walls.loads
    clear_loads, add_load_to_wall = of_loads.clear, of_loads.add
    bigs, rotation, threads, friction = o.bigs, o.rotation, o.threads, o.law.friction

    @wp.func
    def wall_contacts(
        b: Bodies,
        lists: Lists,
        base: int,
        count: int,
        walls: Walls,
        part: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        dt: real,
    ):
        first = part * walls.motions.shape[0]
        if wp.static(loads):
            clear_loads(walls, part)
        if wp.static(meshes and friction):
            hand_over(b, lists, walls, first, base, count, wp.float64(0.0))
        for q in range(count):
            slot = base + q
            i, memory = lists.wall_i[slot], vec4()
            if wp.static(friction):
                memory = lists.wall_memory[slot]
            load, after, overlap = wall(b, i, walls, lists.wall_f[slot], first, memory, table, columns, dt)
            if overlap > real(0.0):
                put_load(b, i, get_load(b, i) + load)
                if wp.static(friction):
                    lists.wall_memory[slot] = after
                if wp.static(loads):
                    k = b.kin[i]
                    x = wp.vec3d(k[0], k[1], k[2])
                    f = wp.vec3d(wp.float64(load[0]), wp.float64(load[1]), wp.float64(load[2]))
                    t = wp.vec3d(wp.float64(load[4]), wp.float64(load[5]), wp.float64(load[6]))
                    add_load_to_wall(walls, part, lists.wall_f[slot], first, x, f, t, wp.float64(dt))
            elif memory[3] != real(0.0):
                if wp.static(friction):
                    lists.wall_memory[slot] = vec4()

    @wp.func
    def big_contacts(
        b: Bodies,
        lists: Lists,
        count: int,
        n: int,
        total: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        dt: real,
    ):
        largest = real(0.0)
        for q in range(count):
            i, j = lists.big_i[q], lists.big_j[q]
            slot = (j - n) * total + i
            c = of_pair(b, i, j, table, columns)
            wi, wj, memory = spin(b, i), spin(b, j), vec4()
            if wp.static(friction):
                memory = lists.big_memory[slot]
            on_i, on_j, after, overlap = pair(b, i, j, b.kin[i], b.kin[j], wi, wj, memory, c, dt)
            if overlap > real(0.0):
                put_load(b, i, get_load(b, i) + on_i)
                put_load(b, j, get_load(b, j) + on_j)
                largest = wp.max(largest, overlap)
                if wp.static(friction):
                    lists.big_memory[slot] = after
            elif memory[3] != real(0.0):
                if wp.static(friction):
                    lists.big_memory[slot] = vec4()
        return largest

    @wp.kernel(enable_backward=False, module="unique")
    def advance(
        # inputs
        part: int,
        parts: int,
        steps: int,
        first: wp.float64,
        memory_dt: real,
        dt: wp.float64,
        gravity: wp.vec3d,
        ranges: wp.array(dtype=wp.int32),
        n: int,
        total: int,
        walls: Walls,
        wall_speed: wp.float64,
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        skin: wp.float64,
        near_skin: wp.float64,
        big_skin: wp.float64,
        base: wp.array(dtype=wp.int32),
        wall_capacity: int,
        big_capacity: int,
        pair_count: wp.array(dtype=wp.int32),
        wall_count: wp.array(dtype=wp.int32),
        # outputs
        b: Bodies,
        lists: Lists,
        near_count: wp.array(dtype=wp.int32),
        state: wp.array(dtype=wp.int32),
        travel: wp.array(dtype=wp.float64),
    ):
        zero, two = wp.float64(0.0), wp.float64(2.0)
        begin, end = ranges[part], ranges[part + 1]
        since_build = wp.float64(travel[0])
        since_near = wp.float64(travel[1])
        since_big = wp.float64(travel[2])
        near_gap = wp.float64(travel[3])
        overlap = real(0.0)
        done = int(0)
        reason = int(DONE)
        pending = int(0)
        mid = int(state[4])
        half = dt * wp.float64(0.5)
        slot = 4 + 4 * part
        poses = part * walls.motions.shape[0]
        going = int(1)
        moved = wp.float64(0.0)
        if wp.static(threads):
            barrier(state, parts)
        while going == 1 and (done < steps or mid == 1):
            if wp.static(timed):
                now = dt * (first + wp.float64(done + 1))
                place(walls, poses, now, now)
            if mid == 0:
                # the second half kick of the last step where it is pending, the first of this one, and the drift
                speeds = move(b, begin, end, 1 + pending, half, dt, gravity)
                fastest, check, fastest_big = speeds[0] + zero, speeds[1] + zero, wp.float64(0.0)
                if wp.static(bigs):
                    if part == 0:
                        speeds = move(b, n, total, 1 + pending, half, dt, gravity)
                        fastest_big = speeds[0] + zero
                        check += speeds[1]
                if wp.static(threads):
                    travel[slot] = fastest
                    travel[slot + 1] = fastest_big
                    travel[slot + 2] = check
                    barrier(state, parts)
                    for p in range(parts):
                        fastest = wp.max(fastest, travel[4 + 4 * p])
                        fastest_big = wp.max(fastest_big, travel[5 + 4 * p])
                        check += travel[6 + 4 * p]
                pending = 0
                moved = dt * wp.sqrt(fastest)
                if wp.static(meshes):
                    # only the parts of meshes that are near a large body are listed
                    moved = wp.max(moved, dt * wp.sqrt(fastest_big))
                if wp.static(timed):
                    moved = wp.max(moved, dt * wall_speed)
                since_build += moved
                since_near += moved
                if wp.static(bigs):
                    since_big += moved + dt * wp.sqrt(fastest_big)
                if not wp.isfinite(check):
                    reason = int(NOT_FINITE)
                    going = 0
                elif two * since_near > near_gap and near_skin + two * since_build > skin:
                    reason = int(REBUILD)
                    going = 0
                mid = 1
            if going == 1:
                if two * since_near > near_gap or since_near < zero:
                    # a pair that remembers has touched in the step before: it is near, unless a step is that long
                    forget = int(0)
                    if since_near < zero or two * moved > near_skin:
                        forget = 1
                    near_gap = wp.max(near_skin, wp.min(wp.float64(NEAR_STEPS) * two * moved, skin - two * since_build))
                    for region in range(2 * part, 2 * part + wp.static(2 if threads else 1)):
                        near_count[region] = pick_near(b, lists, base[region], pair_count[region], near_gap, forget)
                    since_near = zero
                if wp.static(bigs):
                    if since_big > big_skin or since_big < zero:
                        if part == 0:
                            near_count[2 * parts] = pick_big(b, lists, n, total, big_skin, big_capacity)
                        if wp.static(threads):
                            barrier(state, parts)
                        since_big = zero
                        if near_count[2 * parts] > big_capacity:
                            reason = int(BIG_OVERFLOW)
                            going = 0
            if going == 1:
                overlap = wp.max(
                    overlap,
                    near_pairs(b, lists, base[2 * part], near_count[2 * part], pair_table, pair_columns, memory_dt),
                )
                if wp.static(present):
                    wall_contacts(
                        b,
                        lists,
                        part * wall_capacity,
                        wall_count[part],
                        walls,
                        part,
                        wall_table,
                        wall_columns,
                        memory_dt,
                    )
                if wp.static(threads):
                    barrier(state, parts)
                if part == 0:
                    if wp.static(threads):
                        for p in range(parts):
                            overlap = wp.max(
                                overlap,
                                near_pairs(
                                    b,
                                    lists,
                                    base[2 * p + 1],
                                    near_count[2 * p + 1],
                                    pair_table,
                                    pair_columns,
                                    memory_dt,
                                ),
                            )
                    if wp.static(bigs):
                        overlap = wp.max(
                            overlap,
                            big_contacts(
                                b,
                                lists,
                                near_count[2 * parts],
                                n,
                                total,
                                pair_table,
                                pair_columns,
                                memory_dt,
                            ),
                        )
                if wp.static(threads):
                    barrier(state, parts)
                mid = 0
                pending = 1
                done += 1
        if mid == 0 and pending == 1 and memory_dt > real(0.0):
            move(b, begin, end, 1, half, zero, gravity)
            if wp.static(bigs):
                if part == 0:
                    move(b, n, total, 1, half, zero, gravity)
        travel[slot + 3] = wp.float64(overlap)
        if part == 0:
            travel[0] = since_build
            travel[1] = since_near
            travel[2] = since_big
            travel[3] = near_gap
            state[2] = done
            state[3] = reason
            state[4] = mid

    return advance
