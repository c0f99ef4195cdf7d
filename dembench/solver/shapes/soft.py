"""The soft-sphere step of bodies of any shape: every contact point obeys the scene's law.

The reduced radius of a contact comes from the probes: the sphere of a clump has its own radius, a grain the radius of
the sphere of the same volume. The reduced mass is that of the two bodies. A contact point of weight w has w times the
stiffness of a contact; where two grains meet, each looks up its probes in the field of the other, and either side
counts half. The dashpot of a pair is that of the sum W of its weights, shared in proportion: w / sqrt(W) of the dashpot
of one contact, so that n equal points together have its damping ratio.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.laws import LawOptions, contact_energy, contact_force
from dembench.solver.pairs import scaling
from dembench.solver.returns import CONTACT_OVERFLOW, DONE, NOT_FINITE, REBUILD
from dembench.solver.shapes.geometry import B_IN_A
from dembench.solver.shapes.narrow import narrow_functions
from dembench.solver.shapes.records import Contact, Shapes
from dembench.solver.shapes.rotation import inverse_inertia, turn_freely
from dembench.solver.types import types, vec8d
from dembench.solver.walls.motion import place
from dembench.solver.walls.records import WallOptions, Walls


@cache
def soft_kernel(law: LawOptions, options: WallOptions) -> Any:
    """The kernel that makes up to `steps` steps, of which the scene has made `first`.

    Velocity Verlet; forces are evaluated with the half-step velocities, as for spheres.

    `flags` (int32): 2 steps done; 3 reason for coming back; 4 whether the step in progress still lacks its forces;
    5 half of the contacts that was written last; 6 contacts found. `travel` (float64): 0 since the lists were built;
    1 largest overlap of two bodies.
    """
    t = types("float64")
    Bodies, PairClass, Lists = t.Bodies, t.PairClass, t.Lists
    force, scaled = contact_force(law), scaling("float64", law.linear)
    energy_of = contact_energy(law)
    narrow = narrow_functions(options)
    find, commit, relative = narrow.find, narrow.commit, narrow.relative
    timed, present = options.timed, options.present

    @wp.func
    def kick(shapes: Shapes, b: Bodies, ids: wp.array(dtype=wp.int32), i: int, half: wp.float64, gravity: wp.vec3d):
        """Half a step of acceleration."""
        k, load, m = b.kin[i], b.load[i], b.inv_m[i]
        if m > wp.float64(0.0):
            vx = k[3] + half * (load[0] * m + gravity[0])
            vy = k[4] + half * (load[1] * m + gravity[1])
            vz = k[5] + half * (load[2] * m + gravity[2])
            b.kin[i] = vec8d(k[0], k[1], k[2], vx, vy, vz, k[6], k[7])
        turn = half * (inverse_inertia(shapes, b, ids, i) * wp.vec3d(load[4], load[5], load[6]))
        b.spin[i] = b.spin[i] + wp.vec4d(turn[0], turn[1], turn[2], wp.float64(0.0))

    @wp.func
    def add_load(b: Bodies, i: int, f: wp.vec3d, torque: wp.vec3d):
        z = wp.float64(0.0)
        b.load[i] = b.load[i] + vec8d(f[0], f[1], f[2], z, torque[0], torque[1], torque[2], z)

    @wp.func
    def curvature(shapes: Shapes, b: Bodies, i: int, p: int):
        """Radius of curvature of body i at its probe p."""
        k = b.kind[i]
        radius = shapes.table[k].radius
        if shapes.table[k].field < 0:
            radius = shapes.probes[shapes.table[k].first + p][3]
        return radius

    @wp.func
    def weight_of(shapes: Shapes, b: Bodies, c: Contact):
        """Share of a full contact: that of the body whose probe it is, half of it where both bodies have probes."""
        weight = shapes.table[b.kind[c.a]].weight
        if c.kind == wp.static(B_IN_A):
            weight = shapes.table[b.kind[c.b]].weight
        if c.b >= 0:
            if shapes.table[b.kind[c.a]].field >= 0 and shapes.table[b.kind[c.b]].field >= 0:
                weight = wp.float64(0.5) * weight
        return weight

    @wp.func
    def forces(
        shapes: Shapes,
        b: Bodies,
        walls: Walls,
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        memory_dt: wp.float64,
        contacts: wp.array(dtype=Contact),
        first: int,
        count: int,
    ):
        """Loads of all bodies; returns the largest overlap of two bodies."""
        zero = wp.float64(0.0)
        largest = wp.float64(0.0)
        shared = wp.float64(0.0)
        until = int(0)
        for q in range(count):
            c = contacts[first + q]
            if q == until:
                # the contacts of one pair, or of one body and wall feature, stand side by side
                shared = zero
                going = int(1)
                while until < count and going == 1:
                    o = contacts[first + until]
                    if o.slot == c.slot and (o.b < 0) == (c.b < 0):
                        shared += weight_of(shapes, b, o)
                        until += 1
                    else:
                        going = 0
            overlap = -c.gap
            inverse_radius = wp.float64(1.0) / curvature(shapes, b, c.a, c.p)
            inverse_mass = b.inv_m[c.a]
            constants = PairClass()
            if c.b >= 0:
                inverse_radius += wp.float64(1.0) / curvature(shapes, b, c.b, c.s)
                inverse_mass += b.inv_m[c.b]
                constants = pair_table[b.kind[c.a] * pair_columns + b.kind[c.b]]
                largest = wp.max(largest, overlap)
            elif wp.static(present):
                constants = wall_table[b.kind[c.a] * wall_columns + walls.features[c.feature].kind]
            constants = scaled(constants, wp.float64(1.0) / inverse_radius, inverse_mass)
            w = weight_of(shapes, b, c)
            constants.kn = constants.kn * w
            constants.kt = constants.kt * w
            constants.dn = constants.dn * (w / wp.sqrt(shared))
            constants.dt = constants.dt * (w / wp.sqrt(shared))
            v = relative(b, walls, c)
            f, _ft, after = force(c.n, overlap, v, wp.vec3d(), c.memory, constants, memory_dt)
            contacts[first + q].memory = after
            contacts[first + q].force = f
            contacts[first + q].energy = energy_of(overlap, after, constants)
            add_load(b, c.a, f, wp.cross(c.ra, f))
            if c.b >= 0:
                add_load(b, c.b, -f, -wp.cross(c.rb, f))
        return largest

    @wp.kernel(enable_backward=False, module="unique")
    def advance(
        # inputs
        steps: int,
        first: wp.float64,
        memory_dt: wp.float64,
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
        pair_count: wp.array(dtype=wp.int32),
        wall_count: wp.array(dtype=wp.int32),
        # outputs
        b: Bodies,
        shapes: Shapes,
        lists: Lists,
        contacts: wp.array(dtype=Contact),
        flags: wp.array(dtype=wp.int32),
        travel: wp.array(dtype=wp.float64),
    ):
        zero = wp.float64(0.0)
        half = dt * wp.float64(0.5)
        since, largest = wp.float64(travel[0]), wp.float64(travel[1])
        done, reason, going = int(0), int(DONE), int(1)
        mid, side = int(flags[4]), int(flags[5])
        while going == 1 and (done < steps or mid == 1):
            if wp.static(timed):
                now = dt * (first + wp.float64(done + 1))
                place(walls, 0, now, now)
            if mid == 0:
                fastest, check = wp.float64(0.0), wp.float64(0.0)
                for i in range(n):
                    kick(shapes, b, ids, i, half, gravity)
                    turn_freely(shapes, b, ids, i, dt)
                    k = b.kin[i]
                    b.kin[i] = vec8d(k[0] + dt * k[3], k[1] + dt * k[4], k[2] + dt * k[5], k[3], k[4], k[5], k[6], k[7])
                    speed = k[3] * k[3] + k[4] * k[4] + k[5] * k[5]
                    fastest = wp.max(fastest, speed)
                    check += speed + wp.length(b.spin[i])
                moved = dt * wp.sqrt(fastest)
                if wp.static(timed):
                    moved = wp.max(moved, dt * wall_speed)
                since += moved
                mid = 1
                if not wp.isfinite(check):
                    reason = int(NOT_FINITE)
                    going = 0
                elif wp.float64(2.0) * since > skin:
                    reason = int(REBUILD)
                    going = 0
            if going == 1:
                found = find(
                    shapes, b, ids, walls, lists, pair_count[0], wall_count[0], side, capacity, zero, zero, contacts
                )
                flags[6] = found
                if found > capacity:
                    reason = int(CONTACT_OVERFLOW)
                    going = 0
                else:
                    side = 1 - side
                    commit(lists, pair_count[0], wall_count[0], contacts, side * capacity, found)
                    for i in range(n):
                        b.load[i] = vec8d()
                    largest = wp.max(
                        largest,
                        forces(
                            shapes, b, walls, pair_table, pair_columns, wall_table, wall_columns, memory_dt,
                            contacts, side * capacity, found,
                        ),
                    )  # fmt: skip
                    if memory_dt > zero:
                        for i in range(n):
                            kick(shapes, b, ids, i, half, gravity)
                    mid = 0
                    done += 1
        travel[0] = since
        travel[1] = largest
        flags[2] = done
        flags[3] = reason
        flags[4] = mid
        flags[5] = side

    return advance
