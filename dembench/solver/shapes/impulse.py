"""The impulse step of bodies of any shape: rows, velocity sweeps, drift and free rotation, position pass."""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.returns import CONTACT_OVERFLOW, DONE, NOT_FINITE, REBUILD
from dembench.solver.shapes.geometry import centre_of, touch_function
from dembench.solver.shapes.narrow import narrow_functions
from dembench.solver.shapes.records import Contact, Shapes
from dembench.solver.shapes.rotation import inverse_inertia, turn_freely, turned_by
from dembench.solver.shapes.rows import Row, response_of, row_functions
from dembench.solver.types import types, vec8d
from dembench.solver.walls.motion import place
from dembench.solver.walls.records import WallOptions, Walls


@cache
def impulse_kernel(friction: bool, options: WallOptions) -> Any:
    """The kernel that makes up to `steps` steps, of which the scene has made `first`.

    Each step: gravity; contacts and rows; warm start; velocity sweeps until the largest correction is below `still`;
    drift and free rotation with the new velocities; position sweeps until the largest overlap is below `slop`.

    `flags` (int32): 2 steps done; 3 reason for coming back; 4 whether gravity is added already in the step in progress;
    5 half of the contacts that was written last; 6 contacts found; 7 velocity and 8 position sweeps in all. `travel`
    (float64): 0 since the lists were built; 1 largest overlap left by a step.
    """
    t = types("float64")
    Bodies, PairClass, Lists = t.Bodies, t.PairClass, t.Lists
    touch = touch_function(options)
    narrow = narrow_functions(options)
    find, commit = narrow.find, narrow.commit
    functions = row_functions(friction, options)
    row_of, blocks, exchange, sweep = functions.row_of, functions.blocks, functions.exchange, functions.sweep
    timed = options.timed

    @wp.func
    def shift(
        shapes: Shapes,
        b: Bodies,
        ids: wp.array(dtype=wp.int32),
        inertia: wp.array(dtype=wp.mat33d),
        i: int,
        lever: wp.vec3d,
        p: wp.vec3d,
    ):
        """Moves and turns a body as an impulse would in unit time."""
        k, m = b.kin[i], b.inv_m[i]
        b.kin[i] = vec8d(k[0] + m * p[0], k[1] + m * p[1], k[2] + m * p[2], k[3], k[4], k[5], k[6], k[7])
        at = ids[i]
        shapes.turn[at] = turned_by(shapes.turn[at], inertia[i] * wp.cross(lever, p))

    @wp.func
    def separate(
        shapes: Shapes,
        b: Bodies,
        ids: wp.array(dtype=wp.int32),
        walls: Walls,
        inertia: wp.array(dtype=wp.mat33d),
        contacts: wp.array(dtype=Contact),
        rows: wp.array(dtype=Row),
        first: int,
        count: int,
        slop: wp.float64,
        reverse: int,
    ):
        """Pushes overlaps apart without momentum; returns the largest that was met."""
        zero = wp.float64(0.0)
        largest = wp.float64(0.0)
        for q in range(count):
            r = q
            if reverse == 1:
                r = count - 1 - q
            c = contacts[first + r]
            gap, n, point = touch(shapes, b, ids, walls, c.a, c.b, c.feature, c.kind, c.p, c.s)
            largest = wp.max(largest, -gap)
            if gap < -slop:
                ra = point - centre_of(b, c.a)
                response = response_of(b.inv_m[c.a], inertia[c.a], ra)
                rb = wp.vec3d()
                if c.b >= 0:
                    rb = point - centre_of(b, c.b)
                    response = response + response_of(b.inv_m[c.b], inertia[c.b], rb)
                size = -gap / wp.dot(n, response * n)
                shift(shapes, b, ids, inertia, c.a, ra, size * n)
                if c.b >= 0:
                    shift(shapes, b, ids, inertia, c.b, rb, -size * n)
                rows[r].push = rows[r].push + size
        return wp.max(largest, zero)

    @wp.kernel(enable_backward=False, module="unique")
    def advance(
        # inputs
        steps: int,
        first: wp.float64,
        dt: wp.float64,
        gravity: wp.vec3d,
        n: int,
        ids: wp.array(dtype=wp.int32),
        walls: Walls,
        wall_speed: wp.float64,
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        skin: wp.float64,
        capacity: int,
        velocity_sweeps: int,
        position_sweeps: int,
        event: wp.float64,
        still: wp.float64,
        margin: wp.float64,
        slop: wp.float64,
        pair_count: wp.array(dtype=wp.int32),
        wall_count: wp.array(dtype=wp.int32),
        # outputs
        b: Bodies,
        shapes: Shapes,
        lists: Lists,
        contacts: wp.array(dtype=Contact),
        rows: wp.array(dtype=Row),
        inertia: wp.array(dtype=wp.mat33d),
        start: wp.array(dtype=wp.vec3d),
        flags: wp.array(dtype=wp.int32),
        travel: wp.array(dtype=wp.float64),
    ):
        zero, two = wp.float64(0.0), wp.float64(2.0)
        since, deepest = wp.float64(travel[0]), wp.float64(travel[1])
        done, reason, going = int(0), int(DONE), int(1)
        mid, side = int(flags[4]), int(flags[5])
        while going == 1 and done < steps:
            now = dt * (first + wp.float64(done))
            if wp.static(timed):
                # the mean velocity over the step, so that a gap closes where the wall will be
                place(walls, 0, now, now + wp.float64(0.5) * dt)
            if mid == 0:
                fastest = wp.float64(0.0)
                for i in range(n):
                    k = b.kin[i]
                    fastest = wp.max(fastest, k[3] * k[3] + k[4] * k[4] + k[5] * k[5])
                reach = dt * wp.sqrt(fastest) + dt * dt * wp.length(gravity)
                if wp.static(timed):
                    reach = wp.max(reach, dt * wall_speed)
                if since > zero and two * (since + reach) + margin > skin:
                    reason = int(REBUILD)
                    going = 0
                else:
                    for i in range(n):
                        k = b.kin[i]
                        start[i] = centre_of(b, i)
                        inertia[i] = inverse_inertia(shapes, b, ids, i)
                        if b.inv_m[i] > zero:
                            vx, vy, vz = k[3] + dt * gravity[0], k[4] + dt * gravity[1], k[5] + dt * gravity[2]
                            b.kin[i] = vec8d(k[0], k[1], k[2], vx, vy, vz, k[6], k[7])
                    mid = 1
            if going == 1:
                found = find(
                    shapes, b, ids, walls, lists, pair_count[0], wall_count[0], side, capacity, dt, margin, contacts
                )
                flags[6] = found
                if found > capacity:
                    reason = int(CONTACT_OVERFLOW)
                    going = 0
                else:
                    mid = 0
                    side = 1 - side
                    at = side * capacity
                    commit(lists, pair_count[0], wall_count[0], contacts, at, found)
                    for r in range(found):
                        rows[r] = row_of(
                            b, walls, inertia, pair_table, pair_columns, wall_table, wall_columns,
                            contacts[at + r], dt, event,
                        )  # fmt: skip
                    blocks(contacts, rows, at, found)
                    for r in range(found):
                        exchange(b, inertia, contacts[at + r], rows[r].impulse)
                    sweeps = int(0)
                    while sweeps < velocity_sweeps:
                        largest = sweep(b, walls, inertia, contacts, rows, at, found, still, sweeps % 2)
                        sweeps += 1
                        flags[7] = flags[7] + 1
                        if largest <= still:
                            sweeps = velocity_sweeps
                    check = wp.float64(0.0)
                    for i in range(n):
                        k = b.kin[i]
                        b.kin[i] = vec8d(
                            k[0] + dt * k[3], k[1] + dt * k[4], k[2] + dt * k[5], k[3], k[4], k[5], k[6], k[7]
                        )
                        turn_freely(shapes, b, ids, i, dt)
                        check += k[3] * k[3] + k[4] * k[4] + k[5] * k[5] + wp.length(b.spin[i])
                    if wp.static(timed):
                        place(walls, 0, now + dt, now + dt)
                    left = wp.float64(0.0)
                    sweeps = int(0)
                    while sweeps < position_sweeps:
                        left = separate(shapes, b, ids, walls, inertia, contacts, rows, at, found, slop, sweeps % 2)
                        sweeps += 1
                        flags[8] = flags[8] + 1
                        if left <= slop:
                            sweeps = position_sweeps
                    deepest = wp.max(deepest, left)
                    for r in range(found):
                        p = rows[r].impulse
                        contacts[at + r].memory = wp.vec4d(p[0], p[1], p[2], rows[r].push / dt)
                        contacts[at + r].force = p / dt
                    moved = wp.float64(0.0)
                    for i in range(n):
                        moved = wp.max(moved, wp.length(centre_of(b, i) - start[i]))
                    if wp.static(timed):
                        moved = wp.max(moved, dt * wall_speed)
                    since += moved
                    done += 1
                    if not wp.isfinite(check):
                        reason = int(NOT_FINITE)
                        going = 0
        travel[0] = since
        travel[1] = deepest
        flags[2] = done
        flags[3] = reason
        flags[4] = mid
        flags[5] = side

    return advance
