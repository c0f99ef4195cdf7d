"""Which wall features a body may touch before the lists are built again, and what one contact leaves to the next."""

import math
from functools import cache
from typing import Any

import warp as wp

from dembench.solver.pairs import radius_function
from dembench.solver.types import types
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import WallOptions, Walls

ALIKE = math.cos(math.radians(5.0))
"""Cosine of the angle between their normals up to which a contact goes on as that with another part of a mesh."""


@cache
def gather_function(o: WallOptions) -> Any:
    """A Warp function that lists the features near a body.

    gather(walls, x, radius, slack, begin, stride, room, found): writes the features with a gap below `slack` to
    found[begin], found[begin + stride], ..., at most `room`, and returns how many there are. Poses are those of the
    first thread.
    """
    of_feature = wall_functions(o)
    near, local = of_feature.near, of_feature.local
    meshes, shapes = o.meshes, o.shapes

    @wp.func
    def gather(
        walls: Walls,
        x: wp.vec3d,
        radius: wp.float64,
        slack: wp.float64,
        begin: int,
        stride: int,
        room: int,
        found: wp.array(dtype=wp.int32),
    ):
        reach, wide = radius + slack, slack
        if wp.static(shapes):
            # a point of the body may be in a region where its centre is not
            wide = reach
        count = int(0)
        for k in range(walls.plain):
            if near(walls, k, 0, x, wide) < reach:
                if count < room:
                    found[begin + count * stride] = k
                count += 1
        if wp.static(meshes):
            for m in range(walls.meshes.shape[0]):
                mesh = walls.meshes[m]
                y = local(walls, mesh.motion, 0, x) - mesh.reference - mesh.origin
                low, high = wp.vec3i(), wp.vec3i()
                for axis in range(3):
                    # beyond the grid a body may be further from it than an integer can say
                    last = wp.float64(mesh.cells[axis])
                    low[axis] = int(wp.clamp(wp.floor((y[axis] - reach) * mesh.inverse), wp.float64(0.0), last))
                    high[axis] = int(wp.clamp(wp.floor((y[axis] + reach) * mesh.inverse), wp.float64(-1.0), last))
                    high[axis] = wp.min(high[axis], mesh.cells[axis] - 1)
                for u in range(low[0], high[0] + 1):
                    for v in range(low[1], high[1] + 1):
                        for w in range(low[2], high[2] + 1):
                            cell = mesh.start + (u * mesh.cells[1] + v) * mesh.cells[2] + w
                            for e in range(walls.mesh_start[cell], walls.mesh_start[cell + 1]):
                                k = walls.mesh_part[e]
                                first = wp.max(walls.mesh_lowest[k - walls.plain], low)
                                # a part that reaches into several cells counts in the first of them
                                if first[0] == u and first[1] == v and first[2] == w:
                                    if near(walls, k, 0, x, wide) < reach:
                                        if count < room:
                                            found[begin + count * stride] = k
                                        count += 1
        return count

    return gather


@cache
def goes_on_function(o: WallOptions) -> Any:
    """A Warp function (walls, first, f, g, x, reach, n): whether a contact with part f and normal n goes on with g."""
    distance_of = wall_functions(o).distance

    @wp.func
    def goes_on(walls: Walls, first: int, f: int, g: int, x: wp.vec3d, reach: wp.float64, n: wp.vec3d):
        if walls.features[f].owner != walls.features[g].owner:
            return False
        distance, normal = distance_of(walls, g, first, x)
        return distance < reach and wp.dot(normal, n) > wp.float64(wp.static(ALIKE))

    return goes_on


@cache
def hand_over_function(precision: str, o: WallOptions, radii: bool) -> Any:
    """A Warp function (bodies, lists, walls, first, base, count, room) for the candidates of a thread.

    A body that rolls from one face of a mesh to the next ends one contact and begins another. Where their normals
    differ by a few degrees only, the memory of the one goes over to the other. A gap below `room` is a contact.
    `radii`: see `pairs.radius_function`.
    """
    t = types(precision)
    real, vec4, Bodies, Lists = t.real, t.vec4, t.Bodies, t.Lists
    distance_of = wall_functions(o).distance
    goes_on, radius = goes_on_function(o), radius_function(precision, radii)

    @wp.func
    def hand_over(b: Bodies, lists: Lists, walls: Walls, first: int, base: int, count: int, room: wp.float64):
        for q in range(base, base + count):
            f, i = lists.wall_f[q], lists.wall_i[q]
            if f >= walls.plain and lists.wall_memory[q][3] != real(0.0):
                k = b.kin[i]
                x, reach = wp.vec3d(k[0], k[1], k[2]), radius(b, k) + room
                distance, normal = distance_of(walls, f, first, x)
                if distance >= reach:
                    begin = q + 0
                    while begin > base and lists.wall_i[begin - 1] == i:
                        begin -= 1
                    other = begin + 0
                    while other < base + count and lists.wall_i[other] == i:
                        if lists.wall_memory[other][3] == real(0.0):
                            if goes_on(walls, first, f, lists.wall_f[other], x, reach, normal):
                                lists.wall_memory[other] = lists.wall_memory[q]
                                lists.wall_memory[q] = vec4()
                                other = base + count
                        other += 1

    return hand_over
