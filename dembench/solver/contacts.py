"""One contact of the soft-sphere law: two bodies, or a body and a wall feature, as Warp functions.

Both drivers, half lists on the CPU and full lists on CUDA, call these.
"""

from dataclasses import dataclass, field
from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.laws import LawOptions, contact_force, rolling_torque, surface_functions
from dembench.solver.pairs import ONE, pair_lookup, radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.types import types, vec8d
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import WallOptions, Walls


@dataclass(frozen=True)
class StepOptions:
    """What of the step is compiled in; everything else is left out of the kernel.

    Attributes:
        law: Options of the contact law.
        pairs: How pair constants are looked up.
        alike: Whether all small bodies are of one kind, so that their pairs share one row of the table.
        walls: What of the walls is needed.
        bigs: Whether there are large bodies.
        periodic: Whether some axis of the domain is periodic.
        rotation: Whether spins are integrated.
        radii: Whether bodies have different radii.
        threads: Whether several threads share the step.
    """

    law: LawOptions = field(default_factory=LawOptions)
    pairs: str = ONE
    alike: bool = True
    walls: WallOptions = field(default_factory=WallOptions)
    bigs: bool = False
    periodic: bool = False
    rotation: bool = True
    radii: bool = True
    threads: bool = False


@cache
def load_functions(precision: str, rotation: bool) -> Any:
    """Warp functions `get` (bodies, i) -> row and `put` (bodies, i, row): what acts on a body, force and torque.

    Without rotation there is no torque to keep, and the force stands in an array of its own.
    """
    t = types(precision)
    real, vec4, vec8, Bodies = t.real, t.vec4, t.vec8, t.Bodies

    @wp.func
    def get(b: Bodies, i: int):
        row = vec8()
        if wp.static(rotation):
            row = b.load[i] * real(1.0)
        else:
            f = b.force[i]
            row = vec8(f[0], f[1], f[2], f[3], real(0.0), real(0.0), real(0.0), real(0.0))
        return row

    @wp.func
    def put(b: Bodies, i: int, row: vec8):
        if wp.static(rotation):
            b.load[i] = row
        else:
            b.force[i] = vec4(row[0], row[1], row[2], row[3])

    return SimpleNamespace(get=get, put=put)


@cache
def force_functions(o: StepOptions) -> Any:
    """Warp functions (pair, wall, spin): one contact of two bodies, one of a body and a wall feature, and a spin.

    What a contact does to a body is a row of `load`.
    """
    t = types(o.law.precision)
    real, vec3, vec4, vec8 = t.real, t.vec3, t.vec4, t.vec8
    Bodies, PairClass = t.Bodies, t.PairClass
    force, rolling_of = contact_force(o.law), rolling_torque(o.law.precision)
    _of_pair, of_wall = pair_lookup(o.law.precision, o.pairs, o.radii)
    radius_of, rotation = radius_function(o.law.precision, o.radii), o.rotation
    separation = image_functions(o.law.precision, o.periodic).separation
    of_feature = wall_functions(o.walls)
    distance_of, velocity_of, turning_of = of_feature.distance, of_feature.velocity, of_feature.spin
    friction, rolling, lever = o.law.friction, o.law.rolling, surface_functions(o.law).arm

    @wp.func
    def spin(b: Bodies, i: int):
        out = vec3()
        if wp.static(rotation):
            w = b.spin[i]
            out = vec3(w[0], w[1], w[2])
        return out

    @wp.func
    def load_of(f: vec3, torque: vec3):
        z = real(0.0)
        row = vec8(f[0], f[1], f[2], z, z, z, z, z)
        if wp.static(friction):
            row = vec8(f[0], f[1], f[2], z, torque[0], torque[1], torque[2], z)
        return row

    @wp.func
    def pair(
        b: Bodies,
        i: int,
        j: int,
        ki: vec8d,
        kj: vec8d,
        wi: vec3,
        wj: vec3,
        memory: vec4,
        c: PairClass,
        dt: real,
    ):
        """Contact of bodies i and j: loads of both, the new memory and the overlap (0 if apart)."""
        on_i, on_j, after, overlap = vec8(), vec8(), vec4(), real(0.0)
        d = separation(b, ki, kj)
        ri, rj = radius_of(b, ki), radius_of(b, kj)
        reach = ri + rj
        inside = reach * reach - (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        if inside > wp.float64(0.0):
            # (reach^2 - r^2)/(reach + r) keeps the overlap exact in single precision where reach - r would not
            e = vec3(real(d[0]), real(d[1]), real(d[2]))
            r = wp.length(e)
            overlap = real(inside) / (real(reach) + r)
            n = vec3(real(1.0), real(0.0), real(0.0))
            if r > real(0.0):
                n = e * (real(1.0) / r)
            s, ti, tj = vec3(), vec3(), vec3()
            ai, aj = lever(ri, overlap), lever(rj, overlap)
            if wp.static(friction):
                s = ai * wi + aj * wj
            f, ft, after = force(n, overlap, vec3(real(d[3]), real(d[4]), real(d[5])), s, memory, c, dt)
            if wp.static(friction):
                turn = wp.cross(n, ft)
                ti = -ai * turn
                tj = -aj * turn
            if wp.static(rolling):
                gi, gj = b.inv_i[i], b.inv_i[j]
                roll = rolling_of(n, f, wi - wj, gi * ti - gj * tj, gi + gj, c, dt)
                ti = ti + roll
                tj = tj - roll
            on_i = load_of(f, ti)
            on_j = load_of(-f, tj)
        return on_i, on_j, after, overlap

    @wp.func
    def wall(
        b: Bodies,
        i: int,
        walls: Walls,
        feature: int,
        first: int,
        memory: vec4,
        table: wp.array(dtype=PairClass),
        columns: int,
        dt: real,
    ):
        """Contact of body i and a wall feature: load of the body, the new memory and the overlap (0 if apart).

        The poses of the thread begin at `first`.
        """
        load, after, overlap = vec8(), vec4(), real(0.0)
        k = b.kin[i]
        x = wp.vec3d(k[0], k[1], k[2])
        distance, normal = distance_of(walls, feature, first, x)
        radius = radius_of(b, k)
        gap = distance - radius
        if gap < wp.float64(0.0):
            overlap = real(-gap)
            n = vec3(real(normal[0]), real(normal[1]), real(normal[2]))
            s, torque = vec3(), vec3()
            arm = lever(radius, overlap)
            dv = wp.vec3d(k[3], k[4], k[5]) - velocity_of(walls, feature, first, x - wp.float64(arm) * normal)
            if wp.static(friction):
                s = arm * spin(b, i)
            c = of_wall(b, i, walls.features[feature].kind, table, columns)
            f, ft, after = force(n, overlap, vec3(real(dv[0]), real(dv[1]), real(dv[2])), s, memory, c, dt)
            if wp.static(friction):
                torque = -arm * wp.cross(n, ft)
            if wp.static(rolling):
                turn = turning_of(walls, feature, first)
                w = spin(b, i) - vec3(real(turn[0]), real(turn[1]), real(turn[2]))
                torque = torque + rolling_of(n, f, w, b.inv_i[i] * torque, b.inv_i[i], c, dt)
            load = load_of(f, torque)
        return load, after, overlap

    return pair, wall, spin
