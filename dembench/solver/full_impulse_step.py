"""A substep of compliant rows on full lists: one thread per small body, one block per large body.

The bodies drift for half of the substep into arrays of their own, every body opens its rows there
(`full_impulse_opening.py`), sweeps solve them (`full_impulse_sweep.py`), and the last one gives the velocities and the
drift of the second half. A substep that the lists do not cover leaves everything as it was.

Lists are exact as long as no body can touch another one outside of the ball of half a skin around where it was when
they were built, at the end of its way with the velocity at its start.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.full_impulse_loops import BIG_LIMIT, BROKEN, LIMIT, STALE, SWEEPS, H
from dembench.solver.full_impulse_opening import opening_kernels
from dembench.solver.full_impulse_rows import SHUT, WALL, full_rows_type
from dembench.solver.full_impulse_sweep import sweep_kernels, visit_function
from dembench.solver.full_lists import MARK, full_lists_type
from dembench.solver.impulse.compliant_rows import CompliantOptions
from dembench.solver.types import types, vec8d
from dembench.solver.walls.loads import load_functions as wall_load_functions
from dembench.solver.walls.records import Walls


@cache
def substep_kernels(o: CompliantOptions) -> Any:
    """Kernels `drift`, `open`, `sweep`, `finish` and, of large bodies, `open_big`, `sweep_big` and `finish_big`.

    middle: rows of `kin` in the middle of the substep. control, clock: see `full_impulse_loops`.
    """
    t = types(o.law.precision)
    real, vec3, vec4, vec8, Bodies = t.real, t.vec3, t.vec4, t.vec8, t.Bodies
    FullLists, FullRows = full_lists_type(o.law.precision), full_rows_type(o.law.precision)
    visit, add_load_to_wall = visit_function(o), wall_load_functions(o.walls).add
    loads, rotation, friction = o.walls.loads, o.rotation, o.law.friction

    @wp.kernel(enable_backward=False, module="unique")
    def drift(
        # inputs
        n: int,
        gravity: wp.vec3d,
        b: Bodies,
        reference: wp.array(dtype=wp.vec3d),
        # outputs
        middle: wp.array(dtype=vec8d),
        control: wp.array(dtype=wp.int32),
        clock: wp.array(dtype=wp.float64),
    ):
        """The first half of the way; the lists are stale where a body may leave its ball in the second one."""
        i = wp.tid()
        half = wp.float64(0.5) * clock[H]
        k = b.kin[i]
        v = wp.vec3d(k[3], k[4], k[5])
        x = wp.vec3d(k[0], k[1], k[2]) + half * v
        middle[i] = vec8d(x[0], x[1], x[2], v[0], v[1], v[2], k[6], k[7])
        limit = clock[LIMIT]
        if i >= n:
            limit = clock[BIG_LIMIT]
        speed = wp.length(v) + clock[H] * wp.length(gravity)
        if not wp.isfinite(speed):
            control[BROKEN] = 1
        if not wp.length(x - reference[i]) + half * speed <= limit:
            control[STALE] = 1

    @wp.func
    def remember(
        rows: FullRows,
        middle: wp.array(dtype=vec8d),
        lists: FullLists,
        walls: Walls,
        i: int,
        at: int,
        p: vec3,
        xi: vec3,
        touches: int,
        dt: wp.float64,
    ):
        """What a row in the list of a body leaves to the next substep, and to a wall."""
        slot, j = rows.slot[at] + 0, rows.j[at] + 0
        mark = MARK * touches
        kept = vec4(xi[0], xi[1], xi[2], real(1.0))
        if j != WALL:
            lists.partner[slot] = j + mark
            if wp.static(friction):
                lists.memory[slot] = kept
        else:
            f = lists.wall[slot] & (MARK - 1)
            lists.wall[slot] = f + mark
            if wp.static(friction):
                lists.wall_memory[slot] = kept
            if wp.static(loads):
                k, a = middle[i], rows.a[at] * real(1.0)
                n = wp.vec3d(wp.float64(a[0]), wp.float64(a[1]), wp.float64(a[2]))
                force = wp.vec3d(wp.float64(p[0]), wp.float64(p[1]), wp.float64(p[2])) / dt
                torque = -wp.float64(a[7]) * wp.cross(n, force)
                add_load_to_wall(walls, 0, f, 0, wp.vec3d(k[0], k[1], k[2]), force, torque, dt)

    @wp.func
    def end(
        b: Bodies,
        rows: FullRows,
        middle: wp.array(dtype=vec8d),
        i: int,
        here: int,
        h: wp.float64,
        gravity: wp.vec3d,
        gained: vec8,
        control: wp.array(dtype=wp.int32),
    ):
        """Velocity and spin of a body after the last sweep, and the second half of its way."""
        k, u = middle[i], rows.u[here + i] + gained
        half = wp.float64(0.5) * h
        v = wp.vec3d(k[3] + wp.float64(u[0]), k[4] + wp.float64(u[1]), k[5] + wp.float64(u[2]))
        if b.inv_m[i] > real(0.0):
            # the part of gravity that single precision leaves out
            f = h * gravity
            v = v + f - wp.vec3d(wp.float64(real(f[0])), wp.float64(real(f[1])), wp.float64(real(f[2])))
        b.kin[i] = vec8d(k[0] + half * v[0], k[1] + half * v[1], k[2] + half * v[2], v[0], v[1], v[2], k[6], k[7])
        if wp.static(rotation):
            b.spin[i] = b.spin[i] + vec4(u[4], u[5], u[6], real(0.0))
        if not wp.isfinite(wp.dot(v, v)):
            control[BROKEN] = 1

    @wp.kernel(enable_backward=False, module="unique")
    def finish(
        # inputs
        total: int,
        dt: wp.float64,
        gravity: wp.vec3d,
        middle: wp.array(dtype=vec8d),
        clock: wp.array(dtype=wp.float64),
        # outputs
        walls: Walls,
        lists: FullLists,
        rows: FullRows,
        b: Bodies,
        control: wp.array(dtype=wp.int32),
    ):
        """The last sweep over the rows of the small bodies, and the end of their substep."""
        i = wp.tid()
        if control[STALE] != 0:
            return
        h = real(clock[H])
        here = control[SWEEPS] % 2 * total
        sum = vec8()
        for k in range(rows.count[i]):
            at = k * total + i
            gained, p, xi, touches = visit(b, rows, i, at, here, h)
            sum = sum + gained
            remember(rows, middle, lists, walls, i, at, p, xi, touches, dt)
        end(b, rows, middle, i, here, clock[H], gravity, sum, control)

    @wp.kernel(enable_backward=False, module="unique")
    def finish_big(
        # inputs
        n: int,
        total: int,
        behind: int,
        dt: wp.float64,
        gravity: wp.vec3d,
        middle: wp.array(dtype=vec8d),
        clock: wp.array(dtype=wp.float64),
        # outputs
        walls: Walls,
        lists: FullLists,
        rows: FullRows,
        b: Bodies,
        control: wp.array(dtype=wp.int32),
    ):
        """The same for the large bodies."""
        row, lane = wp.tid()
        i = n + row
        h = real(clock[H])
        here = control[SWEEPS] % 2 * total
        sum = vec8()
        if control[STALE] == 0:
            for q in range(lists.big_start[row] + lane, lists.big_start[row + 1], wp.block_dim()):
                if rows.slot[behind + q] != SHUT:
                    gained, _p, xi, touches = visit(b, rows, i, behind + q, here, h)
                    sum = sum + gained
                    if wp.static(friction):
                        lists.big_memory[rows.slot[behind + q]] = vec4(xi[0], xi[1], xi[2], real(touches))
            if lane == 0:
                for k in range(rows.count[i]):
                    at = k * total + i
                    by_wall, p, zeta, meets = visit(b, rows, i, at, here, h)
                    sum = sum + by_wall
                    remember(rows, middle, lists, walls, i, at, p, zeta, meets, dt)
        gains = wp.tile_sum(wp.tile(sum, preserve_type=True))[0]
        if lane == 0 and control[STALE] == 0:
            end(b, rows, middle, i, here, clock[H], gravity, gains, control)

    opening, sweeps = opening_kernels(o), sweep_kernels(o)
    return SimpleNamespace(drift=drift, finish=finish, finish_big=finish_big, **vars(opening), **vars(sweeps))
