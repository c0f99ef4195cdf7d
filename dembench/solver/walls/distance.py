"""Distance of a point to a wall feature, and the velocity of its surface, as Warp functions for all drivers."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.walls.records import GRID, MANTLE, Feature, WallOptions, Walls


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


@cache
def wall_functions(o: WallOptions) -> Any:
    """Warp functions `distance`, `velocity` and `spin` of a feature.

    distance(walls, k, first, x) -> (distance, unit normal into the void) of feature k; `first` is where the poses of
    the thread begin. velocity(walls, k, first, x) is that of the surface at x, spin(walls, k, first) its rotation.
    """
    curved, grids, timed, moving = o.curved, o.grids, o.timed, o.moving

    @wp.func
    def at_rest(walls: Walls, k: int, x: wp.vec3d):
        n = wp.vec3d(walls.features[k].axis)
        d = wp.dot(x - walls.features[k].point, n)
        if wp.static(curved):
            if walls.features[k].shape == wp.static(MANTLE):
                d, n = mantle_distance(walls.features[k], x)
        if wp.static(grids):
            if walls.features[k].shape == wp.static(GRID):
                d, n = grid_distance(walls.features[k], walls.nodes, x)
        return d, n

    @wp.func
    def distance(walls: Walls, k: int, first: int, x: wp.vec3d):
        d, n = wp.float64(0.0), wp.vec3d()
        if wp.static(timed):
            m = walls.features[k].motion
            if m >= 0 and walls.poses[first + m].stays == 0:
                pose = walls.poses[first + m]
                d, n = at_rest(walls, k, pose.start + wp.quat_rotate_inv(pose.turn, x - pose.centre))
                n = wp.quat_rotate(pose.turn, n)
            else:
                d, n = at_rest(walls, k, x)
        else:
            d, n = at_rest(walls, k, x)
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
    def spin(walls: Walls, k: int, first: int):
        w = wp.vec3d()
        if wp.static(moving):
            m = walls.features[k].motion
            if m >= 0:
                w = walls.poses[first + m].spin + wp.vec3d()
        return w

    return SimpleNamespace(distance=distance, velocity=velocity, spin=spin)
