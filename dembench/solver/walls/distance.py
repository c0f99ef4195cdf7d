"""Distance of a point to a wall feature, and the velocity of its surface, as Warp functions for all drivers."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.walls.records import EDGE, FACE, GRID, MANTLE, Feature, WallOptions, Walls

FAR = wp.constant(wp.float64(1e300))
"""Distance to a part of a mesh outside its region: no contact, however large the body."""


@wp.func
def mantle_distance(f: Feature, x: wp.vec3d):
    """Mantle of revolution.

    It ends at its rims: beyond them the nearest point is on the rim circle. Behind a mantle the distance is negative,
    so that a particle is pushed back.
    """
    zero = wp.float64(0.0)
    rel = x - f.point
    along = wp.dot(rel, f.axis)
    across = rel - along * f.axis
    radial = wp.length(across)
    outward = wp.vec3d()
    if radial > zero:
        outward = across / radial
    slant = wp.sqrt(f.length * f.length + (f.r1 - f.r0) * (f.r1 - f.r0))
    ca, cr = f.length / slant, (f.r1 - f.r0) / slant
    s = along * ca + (radial - f.r0) * cr
    distance = along * cr - (radial - f.r0) * ca
    normal = cr * f.axis - ca * outward
    if f.outside == 1:
        distance = -distance
        normal = -normal
    t = wp.clamp(s, zero, slant)
    if s != t:
        da = along - t * ca
        dr = radial - f.r0 - t * cr
        distance = wp.sqrt(da * da + dr * dr)
        normal = wp.vec3d()
        if distance > zero:
            normal = (da * f.axis + dr * outward) / distance
        else:
            normal = ca * f.axis * wp.sign(s)
    return distance, normal


@wp.func
def grid_distance(f: Feature, nodes: wp.array(dtype=wp.vec4d), x: wp.vec3d):
    """Signed distance on a grid, linear along each axis between the nodes; the normal is that of the gradient.

    The gradient is interpolated from the nodes: that of the interpolated distance would jump from cell to cell. Where
    it vanishes, at equal distances from several sides, there is no normal. Outside the grid the nearest point counts.
    """
    zero = wp.float64(0.0)
    p = (x - f.point) / f.length
    for axis in range(3):
        p[axis] = wp.clamp(p[axis], zero, wp.float64(f.size[axis] - 1))
    cell = wp.vec3i(
        wp.min(int(p[0]), f.size[0] - 2), wp.min(int(p[1]), f.size[1] - 2), wp.min(int(p[2]), f.size[2] - 2)
    )
    u, v, w = p[0] - wp.float64(cell[0]), p[1] - wp.float64(cell[1]), p[2] - wp.float64(cell[2])
    k = f.first + (cell[0] * f.size[1] + cell[1]) * f.size[2] + cell[2]
    row, layer = f.size[2], f.size[1] * f.size[2]
    low = wp.lerp(wp.lerp(nodes[k], nodes[k + 1], w), wp.lerp(nodes[k + row], nodes[k + row + 1], w), v)
    k = k + layer
    high = wp.lerp(wp.lerp(nodes[k], nodes[k + 1], w), wp.lerp(nodes[k + row], nodes[k + row + 1], w), v)
    found = wp.lerp(low, high, u)
    return found[3], wp.normalize(wp.vec3d(found[0], found[1], found[2]))


@wp.func
def part_distance(f: Feature, spaces: wp.array(dtype=wp.vec3d), x: wp.vec3d, slack: wp.float64):
    """Face, edge or vertex of a mesh from the side on which x is; FAR outside the region, widened by `slack`.

    The normal is that of the whole plane, line or point, also outside the region.
    """
    zero = wp.float64(0.0)
    y = x - f.point
    away = y - f.base
    along = wp.dot(away, f.axis)
    distance, normal = zero, wp.vec3d()
    if f.shape == wp.static(FACE):
        distance = wp.abs(along)
        normal = wp.vec3d(f.axis)
        if along < zero:
            normal = -normal
    else:
        if f.shape == wp.static(EDGE):
            away = away - along * f.axis
        distance = wp.length(away)
        normal = wp.normalize(away)
    for h in range(f.first, f.first + f.size[0]):
        if wp.dot(y - spaces[2 * h], spaces[2 * h + 1]) <= -slack:
            distance = FAR
    return distance, normal


@cache
def wall_functions(o: WallOptions) -> Any:
    """Warp functions `local`, `near`, `distance`, `extended`, `mean_distance`, `velocity` and `spin`.

    All take (walls, k, first, x): feature k, where the poses of the thread begin, a point; local takes a motion for k.
    local: the point in the frame of the walls of the motion. distance: (distance, unit normal into the void); FAR where
    there can be no contact. extended: the same without regard to the region of a part of a mesh. near(..., slack): what
    the distance is in a region wider by `slack`, for lists. velocity: that of the surface; spin(walls, k, first).
    mean_distance(..., x, way, time, d, n): mean of those at both ends of a straight way of a body that takes `time`, in
    the middle x of which the distance is d with the normal n.
    """
    curved, grids, meshes, timed, moving = o.curved, o.grids, o.meshes, o.timed, o.moving

    @wp.func
    def moved(walls: Walls, motion: int, first: int):
        if motion < 0:
            return False
        return walls.poses[first + motion].stays == 0

    @wp.func
    def local(walls: Walls, motion: int, first: int, x: wp.vec3d):
        y = x
        if wp.static(timed):
            if moved(walls, motion, first):
                pose = walls.poses[first + motion]
                y = pose.start + wp.quat_rotate_inv(pose.turn, x - pose.centre)
        return y

    @wp.func
    def at_rest(walls: Walls, k: int, x: wp.vec3d, slack: wp.float64):
        n = wp.vec3d(walls.features[k].axis)
        d = wp.dot(x - walls.features[k].point, n)
        if wp.static(curved):
            if walls.features[k].shape == wp.static(MANTLE):
                d, n = mantle_distance(walls.features[k], x)
        if wp.static(grids):
            if walls.features[k].shape == wp.static(GRID):
                d, n = grid_distance(walls.features[k], walls.nodes, x)
        if wp.static(meshes):
            if walls.features[k].shape >= wp.static(FACE):
                d, n = part_distance(walls.features[k], walls.spaces, x, slack)
        return d, n

    @wp.func
    def near(walls: Walls, k: int, first: int, x: wp.vec3d, slack: wp.float64):
        d, _n = at_rest(walls, k, local(walls, walls.features[k].motion, first, x), slack)
        return d

    @wp.func
    def within(walls: Walls, k: int, first: int, x: wp.vec3d, slack: wp.float64):
        m = walls.features[k].motion
        d, n = at_rest(walls, k, local(walls, m, first, x), slack)
        if wp.static(timed):
            if moved(walls, m, first):
                n = wp.quat_rotate(walls.poses[first + m].turn, n)
        return d, n

    @wp.func
    def distance(walls: Walls, k: int, first: int, x: wp.vec3d):
        d, n = within(walls, k, first, x, wp.float64(0.0))
        return d, n

    @wp.func
    def extended(walls: Walls, k: int, first: int, x: wp.vec3d):
        d, n = within(walls, k, first, x, FAR)
        return d, n

    @wp.func
    def velocity(walls: Walls, k: int, first: int, x: wp.vec3d):
        v = wp.vec3d()
        if wp.static(moving):
            m = walls.features[k].motion
            if m >= 0:
                pose = walls.poses[first + m]
                v = pose.velocity + wp.cross(pose.spin, x - pose.centre)
        return v

    @wp.func
    def mean_distance(
        walls: Walls, k: int, first: int, x: wp.vec3d, way: wp.vec3d, time: wp.float64, d: wp.float64, n: wp.vec3d
    ):
        mean = wp.float64(d)
        if wp.static(curved or meshes):
            shape = walls.features[k].shape
            if shape == wp.static(MANTLE) or shape > wp.static(FACE):
                half = wp.float64(0.5) * way
                if wp.static(timed):
                    if moved(walls, walls.features[k].motion, first):
                        half = half - wp.float64(0.5) * time * velocity(walls, k, first, x)
                at_start, _n = extended(walls, k, first, x - half)
                mean = at_start + wp.dot(half, n)
        return mean

    @wp.func
    def spin(walls: Walls, k: int, first: int):
        w = wp.vec3d()
        if wp.static(moving):
            m = walls.features[k].motion
            if m >= 0:
                w = walls.poses[first + m].spin + wp.vec3d()
        return w

    return SimpleNamespace(
        local=local,
        near=near,
        distance=distance,
        extended=extended,
        mean_distance=mean_distance,
        velocity=velocity,
        spin=spin,
    )
