"""What a substep of compliant rows does with each body, and how walls get their loads."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.contacts import load_functions
from dembench.solver.impulse.compliant_rows import (
    FAR,
    PER_THREAD,
    TRAVEL,
    A,
    B,
    CompliantOptions,
    compliant_access,
    compliant_types,
)
from dembench.solver.lanes import LANES
from dembench.solver.sync import barrier
from dembench.solver.types import types, vec8d
from dembench.solver.walls.loads import load_functions as wall_load_functions
from dembench.solver.walls.records import Walls


@cache
def body_functions(o: CompliantOptions) -> Any:
    """Warp functions `begin`, `drift` and `end` of a body in a substep, `fastest` of many, and `load_walls`;
    `speeds_of_all` joins what threads have."""
    t = types(o.law.precision)
    real, vec4, vec8, Bodies, Lists = t.real, t.vec4, t.vec8, t.Bodies, t.Lists
    Rows = compliant_types(o.law.precision)
    native = compliant_access(o.law.precision, o.rotation)
    kin, change_of, set_change = native.kin, native.change_of, native.set_change
    get_load, add_load_to_wall = load_functions(o.law.precision, o.rotation).get, wall_load_functions(o.walls).add
    rotation, friction = o.rotation, o.law.friction
    lanes = wp.constant(LANES)

    @wp.func
    def begin(b: Bodies, rows: Rows, i: int, h: real, fall: vec4, driven: int):
        """A body's change of velocity in a substep starts with that by gravity and by forces from outside."""
        z = real(0.0)
        m, g = b.inv_m[i], z
        if wp.static(rotation):
            g = b.inv_i[i]
        # choices between numbers: those between vectors go through memory, which takes longer than all the rest
        falls = wp.where(m > z, real(1.0), z)
        px, py, pz = falls * fall[0], falls * fall[1], falls * fall[2]
        qx, qy, qz = real(0.0), real(0.0), real(0.0)
        if driven == 1:
            f = get_load(b, i)
            p, turn = h * m, h * g
            px, py, pz = px + p * f[0], py + p * f[1], pz + p * f[2]
            qx, qy, qz = turn * f[4], turn * f[5], turn * f[6]
        set_change(rows, i, vec8(px, py, pz, m, qx, qy, qz, g))

    @wp.func
    def drift(b: Bodies, i: int, half: wp.float64):
        """Moves a body for the first half of a substep."""
        k = kin(b, i)
        b.kin[i] = vec8d(k[0] + half * k[3], k[1] + half * k[4], k[2] + half * k[5], k[3], k[4], k[5], k[6], k[7])

    @wp.func
    def end(b: Bodies, rows: Rows, i: int, half: wp.float64, fall: vec4, finer: wp.vec3d, driven: int):
        """Takes the change of velocity from the rows and moves the body for the second half; returns the squared speed.

        `finer` is the part of gravity that single precision leaves out of `fall`.
        """
        k, u = kin(b, i), change_of(rows, i)
        v = wp.vec3d(k[3] + wp.float64(u[0]), k[4] + wp.float64(u[1]), k[5] + wp.float64(u[2]))
        z = real(0.0)
        if u[3] > z:
            v = v + finer
        b.kin[i] = vec8d(k[0] + half * v[0], k[1] + half * v[1], k[2] + half * v[2], v[0], v[1], v[2], k[6], k[7])
        if wp.static(rotation):
            if wp.static(friction) or driven == 1:
                b.spin[i] = b.spin[i] + vec4(u[4], u[5], u[6], z)
        begin(b, rows, i, real(half + half), fall, driven)
        return wp.dot(v, v)

    @wp.func
    def fastest(b: Bodies, first: int, last: int):
        """The largest squared speed of the bodies first..last."""
        square = wp.float64(0.0)
        for i in range(first, last):
            k = kin(b, i)
            square = wp.max(square, k[3] * k[3] + k[4] * k[4] + k[5] * k[5])
        return square

    @wp.func
    def speeds_of_all(
        own: wp.vec3d, travel: wp.array(dtype=wp.float64), part: int, parts: int, state: wp.array(dtype=wp.int32)
    ):
        """The largest of two, and the sum of the third, of what all threads have, by way of `travel`."""
        at = wp.static(TRAVEL) + wp.static(PER_THREAD) * part
        for c in range(3):
            travel[at + c] = own[c]
        barrier(state, parts)
        found = wp.vec3d()
        for p in range(parts):
            of = wp.static(TRAVEL) + wp.static(PER_THREAD) * p
            found = wp.vec3d(wp.max(found[0], travel[of]), wp.max(found[1], travel[of + 1]), found[2] + travel[of + 2])
        return found

    @wp.func
    def load_walls(b: Bodies, lists: Lists, walls: Walls, part: int, rows: Rows, first: int, end: int, dt: wp.float64):
        """Hands the impulses of the rows of the blocks first..end to the walls, as forces over the whole step."""
        poses = part * walls.motions.shape[0]
        for row in range(first * lanes, end * lanes):
            slot = rows.slot[row] + 0
            a, p = row / lanes * wp.static(A) * lanes + row % lanes, row / lanes * wp.static(B) * lanes + row % lanes
            if slot < 0 or rows.a[a + 3 * lanes] == real(-wp.static(FAR)):
                continue
            k = b.kin[rows.i[row]]
            n, f = wp.vec3d(), wp.vec3d()
            for c in range(3):
                n[c] = wp.float64(rows.a[a + c * lanes])
                f[c] = wp.float64(rows.b[p + (4 + c) * lanes]) / dt
            t = -wp.float64(rows.a[a + 7 * lanes]) * wp.cross(n, f)
            x = wp.vec3d(k[0], k[1], k[2])
            add_load_to_wall(walls, part, lists.wall_f[slot], poses, x, f, t, dt)

    return SimpleNamespace(
        begin=begin, drift=drift, end=end, fastest=fastest, speeds_of_all=speeds_of_all, load_walls=load_walls
    )
