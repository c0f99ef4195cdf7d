"""Geometry of one contact point: a probe against a probe, against a field, or against a wall feature."""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.shapes.records import Contact, Shapes
from dembench.solver.types import types
from dembench.solver.walls.distance import grid_distance, wall_functions
from dembench.solver.walls.records import WallOptions, Walls

Bodies: Any = types("float64").Bodies

SPHERES, A_IN_B, B_IN_A, WALL = 0, 1, 2, 3
"""Kinds of contacts: probe p of a and probe s of b; probe p of a in the field of b; probe s of b in the field of a;
probe p of a and a wall feature."""


@wp.func
def centre_of(b: Bodies, i: int):
    """Centre of mass of a body."""
    k = b.kin[i]
    return wp.vec3d(k[0], k[1], k[2])


@wp.func
def ends_pair(contacts: wp.array(dtype=Contact), k: int, end: int):
    """Whether contact k is the last of its pair, or of its body and wall feature, among those before `end`."""
    last = k == end - 1
    if not last:
        c, after = contacts[k], contacts[k + 1]
        last = after.slot != c.slot or (after.b < 0) != (c.b < 0)
    return last


@wp.func
def probe_of(shapes: Shapes, b: Bodies, ids: wp.array(dtype=wp.int32), i: int, p: int):
    """Centre of a probe in space and its radius."""
    v = shapes.probes[shapes.table[b.kind[i]].first + p]
    x = centre_of(b, i) + wp.quat_rotate(shapes.turn[ids[i]], wp.vec3d(v[0], v[1], v[2]))
    return wp.vec4d(x[0], x[1], x[2], v[3])


@wp.func
def field_of(shapes: Shapes, b: Bodies, ids: wp.array(dtype=wp.int32), i: int, x: wp.vec3d):
    """Signed distance of a point to the surface of a body, and the direction in which it grows in space.

    Beyond the grid the distance is large: no probe reaches the surface from there.
    """
    zero = wp.float64(0.0)
    distance, normal = wp.float64(1.0e30), wp.vec3d()
    q = wp.quatd(shapes.turn[ids[i]])
    local = wp.quat_rotate_inv(q, x - centre_of(b, i))
    f = shapes.fields[shapes.table[b.kind[i]].field]
    u = (local - f.point) / f.length
    if wp.min(u) >= zero:
        if u[0] < wp.float64(f.size[0] - 1) and u[1] < wp.float64(f.size[1] - 1) and u[2] < wp.float64(f.size[2] - 1):
            distance, normal = grid_distance(f, shapes.nodes, local)
            normal = wp.quat_rotate(q, normal)
    return distance, normal


@cache
def touch_function(walls: WallOptions) -> Any:
    """A Warp function (shapes, bodies, ids, walls, a, b, feature, kind, p, s) -> (gap, normal, point).

    The normal points from b to a, the point lies in the middle of the gap or of the overlap.
    """
    distance_of = wall_functions(walls).distance
    present = walls.present

    @wp.func
    def touch(
        shapes: Shapes,
        b: Bodies,
        ids: wp.array(dtype=wp.int32),
        walls: Walls,
        i: int,
        j: int,
        feature: int,
        kind: int,
        p: int,
        s: int,
    ):
        gap, n = wp.float64(1.0e30), wp.vec3d()
        side = wp.float64(1.0)
        sphere = wp.vec4d()
        if kind == wp.static(B_IN_A):
            sphere = probe_of(shapes, b, ids, j, s)
            side = wp.float64(-1.0)
        else:
            sphere = probe_of(shapes, b, ids, i, p)
        x = wp.vec3d(sphere[0], sphere[1], sphere[2])
        if kind == wp.static(SPHERES):
            other = probe_of(shapes, b, ids, j, s)
            d = x - wp.vec3d(other[0], other[1], other[2])
            length = wp.length(d)
            gap = length - sphere[3] - other[3]
            n = wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0))
            if length > wp.float64(0.0):
                n = d / length
        elif kind == wp.static(A_IN_B):
            distance, normal = field_of(shapes, b, ids, j, x)
            gap = distance - sphere[3]
            n = normal
        elif kind == wp.static(B_IN_A):
            distance, normal = field_of(shapes, b, ids, i, x)
            gap = distance - sphere[3]
            n = -normal
        elif wp.static(present):
            distance, normal = distance_of(walls, feature, 0, x)
            gap = distance - sphere[3]
            n = normal
        point = x - (side * (sphere[3] + wp.float64(0.5) * gap)) * n
        return gap, n, point

    return touch
