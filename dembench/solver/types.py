"""Array and record types of the solver in one floating-point precision.

Positions and velocities are always float64: with single precision a slow particle far from the origin would not move
at all, and g dt would be rounded away. Differences, spins, forces and contact memory are `real`: float32 unless the
user asks for float64.
"""

# Annotations are read by Warp when a record is made, so they must be types and not strings here.

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

vec8d = wp.types.vector(8, wp.float64)


@cache
def types(precision: str) -> Any:
    """Types of a precision ("float32" or "float64"): real, vec3, vec4 and the records Bodies, PairClass, Lists, Kept.

    Bodies: the particle arrays, what a contact needs of a body side by side. kin: position (0-2), velocity (3-5),
    radius (6); spin: angular velocity (0-2); load: force (0-2) and torque (4-6); force: force (0-2), in place of load
    where no body turns; inv_m, inv_i: inverse mass and moment of inertia, 0 where the motion is prescribed; kind:
    species; radius: that of all bodies where they have the same; box, inverse_box: lengths of the periodic axes and
    their inverses, 0 on the others. What a scene does not need has no elements, see `state.Needs`.

    PairClass: constants of a pair of species, of a species and a wall, or of two radii.
    kn, kt: normal and tangential force per overlap^(3/2) and sqrt(overlap); dn, dt: dashpots per overlap^(1/4) (in a
    linear law all four are constants of the contact); mu: friction; roll: rolling friction times reduced radius;
    m: reduced mass; e, beta: normal and tangential restitution.

    Lists: pairs (i, j) within the skin and their contact memory, the subset that is near; candidates of bodies wall_i
    against wall features wall_f, those of one body side by side, with their memory; candidates of the large bodies. The
    memories have no elements where contacts remember nothing.

    Kept: what contacts remember while lists are built anew, that of a body and a higher one j or a wall feature j;
    follow: the next one of the same body, -1 behind the last.
    """
    real: Any = {"float32": wp.float32, "float64": wp.float64}[precision]
    vec3: Any = wp.types.vector(3, real)
    vec4: Any = wp.types.vector(4, real)
    vec8: Any = wp.types.vector(8, real)

    class Bodies:
        kin: wp.array(dtype=vec8d)
        spin: wp.array(dtype=vec4)
        load: wp.array(dtype=vec8)
        force: wp.array(dtype=vec4)
        inv_m: wp.array(dtype=real)
        inv_i: wp.array(dtype=real)
        kind: wp.array(dtype=wp.int32)
        radius: wp.float64
        box: wp.vec3d
        inverse_box: wp.vec3d

    class PairClass:
        kn: real
        kt: real
        dn: real
        dt: real
        mu: real
        roll: real
        m: real
        e: real
        beta: real

    class Lists:
        i: wp.array(dtype=wp.int32)
        j: wp.array(dtype=wp.int32)
        memory: wp.array(dtype=vec4)
        near: wp.array(dtype=wp.int32)
        wall_i: wp.array(dtype=wp.int32)
        wall_f: wp.array(dtype=wp.int32)
        wall_memory: wp.array(dtype=vec4)
        big_i: wp.array(dtype=wp.int32)
        big_j: wp.array(dtype=wp.int32)
        big_memory: wp.array(dtype=vec4)

    class Kept:
        j: wp.array(dtype=wp.int32)
        memory: wp.array(dtype=vec4)
        follow: wp.array(dtype=wp.int32)

    records = {}
    for record in (Bodies, PairClass, Lists, Kept):
        name = record.__name__
        record.__qualname__ = record.__name__ = f"{name}_{precision}"
        records[name] = wp.struct(record)
    return SimpleNamespace(precision=precision, real=real, vec3=vec3, vec4=vec4, vec8=vec8, **records)
