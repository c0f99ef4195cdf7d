"""The compliant step on the CPU: a launch carries a thread through many steps and their substeps.

Every thread has a range of the sorted bodies. It opens and solves the rows within its range and those at walls: its
segment of the rows. The rows across two ranges and those of large bodies are one more segment, the bridge, which the
first thread opens and solves while the others wait. So the bits of a result depend on the number of threads, as those
of Gauss-Seidel sweeps do on the order of the rows, and on nothing else.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.compliant_bodies import body_functions
from dembench.solver.impulse.compliant_opening import opening_functions
from dembench.solver.impulse.compliant_rows import (
    FLAGS,
    PER_THREAD,
    TRAVEL,
    CompliantOptions,
    compliant_types,
    constants_function,
)
from dembench.solver.impulse.compliant_schedule import schedule_function
from dembench.solver.impulse.compliant_substeps import stiffness_functions
from dembench.solver.impulse.compliant_sweep import solve_function
from dembench.solver.neighbours import near_functions
from dembench.solver.returns import BIG_OVERFLOW, DONE, NOT_FINITE, REBUILD, ROW_OVERFLOW
from dembench.solver.sync import barrier
from dembench.solver.types import types
from dembench.solver.walls.candidates import hand_over_function
from dembench.solver.walls.loads import load_functions as wall_load_functions
from dembench.solver.walls.motion import place
from dembench.solver.walls.records import Walls


@cache
def compliant_kernel(o: CompliantOptions) -> Any:
    """The kernel that carries one thread through up to `steps` steps, of which the scene has made `first`.

    Each substep: half a drift; rows from the near pairs, the candidates of large bodies and the walls; their first
    impulses; sweeps; half a drift with the new velocities. `substeps` is the number of substeps of a step, 0 where the
    stiffness of contacts decides, see `stiffness_functions`. With `driven` = 1 the load of the bodies acts on them all
    the time. A launch may come back within a step, with `state[5]` substeps to go, and goes on there; where the lists
    were built anew, what is left of the step is divided anew. The rows of segment s begin at row_base[s]; the bridge is
    the last one.

    `state` (int32): 0, 1 barrier, 2 steps done, 3 reason for coming back, 5 substeps left, 6 direction of the next
    sweep, 7 substeps made in this step, 8 fewest and 9 most substeps of a step; from FLAGS on for each segment: where
    its rows of walls or of large bodies begin, and where they end.

    `travel` (float64): 0 since the lists were built, 1 since the near pairs were picked, 2 of large and small bodies
    since the candidates were listed, 4 gap up to which pairs count as near and 5 bodies as candidates, 6 substep, 7
    that of the last substep made, 8 substeps made in all, 9 travel of the fastest small body in a substep; from TRAVEL
    on for each thread: largest squared speed of small and of large bodies, sum of squared speeds, what its contacts
    need, largest overlap.
    """
    t = types(o.law.precision)
    real, vec4, vec8 = t.real, t.vec4, t.vec8
    Bodies, PairClass, Lists = t.Bodies, t.PairClass, t.Lists
    Rows = compliant_types(o.law.precision)
    of_bodies = body_functions(o)
    begin, drift, end, load_walls = of_bodies.begin, of_bodies.drift, of_bodies.end, of_bodies.load_walls
    largest_square, speeds_of_all = of_bodies.fastest, of_bodies.speeds_of_all
    opening, stiffness, solve = opening_functions(o), stiffness_functions(o), solve_function(o)
    schedule = schedule_function(o)
    open_pairs, open_bigs, open_walls = opening.pairs, opening.bigs, opening.walls
    stiff_pairs, stiff_bigs, stiff_walls = stiffness.pairs, stiffness.bigs, stiffness.walls
    joined, of_all, rate = stiffness.joined, stiffness.of_all, stiffness.rate
    near = near_functions(o.law.precision, o.periodic, o.radii, o.law.friction)
    pick_near, pick_big = near.pick_near, near.pick_big
    present, timed, meshes = o.walls.present, o.walls.timed, o.walls.meshes
    hand_over = hand_over_function(o.law.precision, o.walls, o.radii)
    clear_loads, loads = wall_load_functions(o.walls).clear, o.walls.loads
    bigs, friction, threads = o.bigs, o.law.friction, o.threads
    constants = constants_function(o)
    segments, slots = wp.constant(FLAGS), wp.constant(TRAVEL)

    @wp.func
    def list_bigs(
        b: Bodies,
        lists: Lists,
        near_count: wp.array(dtype=wp.int32),
        n: int,
        total: int,
        gap: wp.float64,
        capacity: int,
        part: int,
        parts: int,
        state: wp.array(dtype=wp.int32),
    ):
        """The first thread lists the candidates of the large bodies, the others wait."""
        if part == 0:
            near_count[2 * parts] = pick_big(b, lists, n, total, gap, capacity)
        if wp.static(threads):
            barrier(state, parts)

    @wp.kernel(enable_backward=False, module="unique")
    def advance(
        # inputs
        part: int,
        parts: int,
        steps: int,
        substeps: int,
        sweeps: int,
        driven: int,
        first: wp.float64,
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
        row_base: wp.array(dtype=wp.int32),
        pair_count: wp.array(dtype=wp.int32),
        wall_count: wp.array(dtype=wp.int32),
        # outputs
        b: Bodies,
        lists: Lists,
        rows: Rows,
        near_count: wp.array(dtype=wp.int32),
        state: wp.array(dtype=wp.int32),
        travel: wp.array(dtype=wp.float64),
    ):
        zero, two, eight = wp.float64(0.0), wp.float64(2.0), wp.float64(8.0)
        weight = wp.length(gravity)
        begin_small, end_small = ranges[part], ranges[part + 1]
        begin_big, end_big = int(n), int(n)
        if part == 0:
            end_big = total + 0
        own, bridge = row_base[part] + 0, row_base[parts] + 0
        inside, across, at_walls = 2 * part, 2 * part + 1, part * wall_capacity
        poses, fixed = part * walls.motions.shape[0], total + part
        slot = slots + wp.static(PER_THREAD) * part
        since_build, since_near, since_big = wp.float64(travel[0]), wp.float64(travel[1]), wp.float64(travel[2])
        near_gap, big_gap = wp.float64(travel[4]), wp.float64(travel[5])
        h, made, reach = wp.float64(travel[6]), wp.float64(travel[7]), wp.float64(travel[9])
        left, direction, within = int(state[5]), int(state[6]), int(state[7])
        done, reason, going = int(0), int(DONE), int(1)
        fresh, unscheduled = int(1), int(1)
        substeps_made = wp.float64(0.0)
        fewest, most = int(state[8]), int(state[9])
        deepest, moved = real(0.0), wp.float64(0.0)
        fall, finer = vec4(), wp.vec3d()
        fastest, fastest_big = largest_square(b, begin_small, end_small), largest_square(b, begin_big, end_big)
        if wp.static(threads):
            speeds = speeds_of_all(wp.vec3d(fastest, fastest_big, zero), travel, part, parts, state)
            fastest, fastest_big = speeds[0], speeds[1]
        fastest, fastest_big = wp.sqrt(fastest), wp.sqrt(fastest_big)
        while going == 1 and (done < steps or left > 0):
            if left == 0 or fresh == 1:
                ahead = wp.float64(left) * h
                if left == 0:
                    ahead = dt
                    within = 0
                if substeps > 0:
                    if left == 0:
                        left = substeps
                else:
                    gain = ahead * weight
                    look = ahead * (fastest + gain)
                    if wp.static(timed):
                        moment = dt * (first + wp.float64(done + 1)) - ahead
                        place(walls, poses, moment, moment)
                    known = int(0)
                    if since_near >= zero and two * (since_near + look) <= near_gap:
                        known = 1
                    need = stiff_pairs(
                        b, lists, part, base, pair_count, near_count, known, pair_table, pair_columns, ahead, two * look
                    )
                    if wp.static(bigs):
                        look_big = look + ahead * (fastest_big + gain)
                        if since_big < zero or since_big + look_big > big_gap:
                            big_gap = wp.max(big_skin, two * look_big)
                            list_bigs(b, lists, near_count, n, total, big_gap, big_capacity, part, parts, state)
                            since_big = wp.float64(0.0)
                        if near_count[2 * parts] > big_capacity:
                            reason = int(BIG_OVERFLOW)
                            going = 0
                        elif part == 0:
                            need = joined(
                                need,
                                stiff_bigs(b, lists, near_count[2 * parts], pair_table, pair_columns, ahead, look_big),
                            )
                    if wp.static(present):
                        need = joined(
                            need,
                            stiff_walls(
                                b,
                                lists,
                                at_walls,
                                wall_count[part],
                                walls,
                                poses,
                                wall_table,
                                wall_columns,
                                ahead,
                                gain,
                            ),
                        )
                    if wp.static(threads):
                        need = of_all(need, travel, part, parts, state)
                    if going == 1:
                        left = wp.max(int(wp.ceil(ahead * rate(need, total))), 1)
                if going == 1:
                    h = ahead / wp.float64(left)
                    f = h * gravity
                    fall = vec4(real(f[0]), real(f[1]), real(f[2]), real(0.0))
                    finer = f - wp.vec3d(wp.float64(fall[0]), wp.float64(fall[1]), wp.float64(fall[2]))
                    for i in range(begin_small, end_small):
                        begin(b, rows, i, real(h), fall, driven)
                    for i in range(begin_big, end_big):
                        begin(b, rows, i, real(h), fall, driven)
                    rows.u[fixed] = vec8()
                    fresh = 0
            reach = h * (fastest + h * weight)
            if wp.static(meshes):
                # only the parts of meshes that are near a large body are listed
                reach = wp.max(reach, h * (fastest_big + h * weight))
            if wp.static(timed):
                reach = wp.max(reach, h * wall_speed)
            relisted = int(0)
            if going == 1 and (since_near < zero or two * (since_near + reach) > near_gap):
                wanted = wp.min(wp.max(near_skin, eight * reach), skin - two * since_build)
                if wanted < two * reach:
                    reason = int(REBUILD)
                    going = 0
                else:
                    near_gap = wanted
                    # a pair that remembers has touched in the substep before: it is near, unless that was so long
                    forget = int(0)
                    if unscheduled == 1 or since_near < zero or two * moved > wanted:
                        forget = 1
                    near_count[inside] = pick_near(b, lists, base[inside], pair_count[inside], wanted, forget)
                    if wp.static(threads):
                        near_count[across] = pick_near(b, lists, base[across], pair_count[across], wanted, forget)
                        barrier(state, parts)
                    since_near = wp.float64(0.0)
                    relisted = 1
            if wp.static(bigs):
                reach_big = reach + h * (fastest_big + h * weight)
                if going == 1 and (since_big < zero or since_big + reach_big > big_gap):
                    big_gap = wp.max(big_skin, two * reach_big)
                    list_bigs(b, lists, near_count, n, total, big_gap, big_capacity, part, parts, state)
                    since_big = wp.float64(0.0)
                    relisted = 1
                if going == 1 and near_count[2 * parts] > big_capacity:
                    reason = int(BIG_OVERFLOW)
                    going = 0
            if going == 1 and (relisted == 1 or unscheduled == 1):
                unscheduled = 0
                fits = schedule(
                    b,
                    lists,
                    rows,
                    walls,
                    part,
                    parts,
                    fixed,
                    ranges,
                    n,
                    total,
                    base,
                    near_count,
                    wall_capacity,
                    wall_count,
                    row_base,
                    pair_table,
                    pair_columns,
                    wall_table,
                    wall_columns,
                    state,
                )
                if fits == 0:
                    reason = int(ROW_OVERFLOW)
                    going = 0
            if going == 1:
                now = dt * (first + wp.float64(done + 1)) - wp.float64(left) * h
                half = wp.float64(0.5) * h
                if wp.static(timed):
                    place(walls, poses, now + half, now + half)
                for i in range(begin_small, end_small):
                    drift(b, i, half)
                for i in range(begin_big, end_big):
                    drift(b, i, half)
                step, grown = real(h), real(made)
                other, own_end = state[segments + 2 * part] + 0, state[segments + 2 * part + 1] + 0
                deepest = wp.max(deepest, open_pairs(b, lists, rows, own, other, step, grown, two * reach))
                if wp.static(present):
                    if wp.static(meshes and friction):
                        hand_over(b, lists, walls, poses, at_walls, wall_count[part], wp.float64(0.0))
                    of_walls = constants(rows, part, other)
                    open_walls(b, lists, rows, other, own_end, of_walls, walls, poses, step, grown, real(h * weight))
                bridge_other = state[segments + 2 * parts] + 0
                bridge_end = state[segments + 2 * parts + 1] + 0
                if wp.static(threads):
                    barrier(state, parts)
                if part == 0:
                    if wp.static(threads):
                        overlap = open_pairs(b, lists, rows, bridge, bridge_other, step, grown, two * reach)
                        deepest = wp.max(deepest, overlap)
                    if wp.static(bigs):
                        of_bigs = constants(rows, parts, bridge_other)
                        overlap = open_bigs(b, lists, rows, bridge_other, bridge_end, of_bigs, step, grown)
                        deepest = wp.max(deepest, overlap)
                solve(
                    rows,
                    lists,
                    part,
                    parts,
                    sweeps,
                    direction,
                    own,
                    other,
                    own_end,
                    bridge,
                    bridge_other,
                    bridge_end,
                    step,
                    state,
                )
                if wp.static(loads):
                    if within == 0:
                        clear_loads(walls, part)
                    load_walls(b, lists, walls, part, rows, other, own_end, dt)
                before, before_big = fastest + zero, fastest_big + zero
                fastest, fastest_big, check = wp.float64(0.0), wp.float64(0.0), wp.float64(0.0)
                for i in range(begin_small, end_small):
                    speed = end(b, rows, i, half, fall, finer, driven)
                    fastest = wp.max(fastest, speed)
                    check += speed
                for i in range(begin_big, end_big):
                    speed = end(b, rows, i, half, fall, finer, driven)
                    fastest_big = wp.max(fastest_big, speed)
                    check += speed
                if wp.static(threads):
                    speeds = speeds_of_all(wp.vec3d(fastest, fastest_big, check), travel, part, parts, state)
                    fastest, fastest_big, check = speeds[0], speeds[1], speeds[2]
                fastest, fastest_big = wp.sqrt(fastest), wp.sqrt(fastest_big)
                moved = h * wp.max(before, fastest)
                moved_big = h * wp.max(before_big, fastest_big)
                if wp.static(meshes):
                    moved = wp.max(moved, moved_big)
                if wp.static(timed):
                    moved = wp.max(moved, h * wall_speed)
                since_build += moved
                since_near += moved
                if wp.static(bigs):
                    since_big += moved + moved_big
                made = h
                left -= 1
                direction = 1 - direction
                within += 1
                substeps_made += wp.float64(1.0)
                if left == 0:
                    done += 1
                    if fewest == 0 or within < fewest:
                        fewest = within + 0
                    most = wp.max(most, within)
                if not wp.isfinite(check):
                    reason = int(NOT_FINITE)
                    going = 0
        if wp.static(timed):
            now = dt * (first + wp.float64(done))
            place(walls, poses, now, now)
        travel[slot + 6] = wp.max(travel[slot + 6], wp.float64(deepest))
        if part == 0:
            travel[0] = since_build
            travel[1] = since_near
            travel[2] = since_big
            travel[4] = near_gap
            travel[5] = big_gap
            travel[6] = h
            travel[7] = made
            travel[8] = travel[8] + substeps_made
            travel[9] = reach
            state[2] = done
            state[3] = reason
            state[5] = left
            state[6] = direction
            state[7] = within
            state[8] = fewest
            state[9] = most

    return advance
