"""Wall features of a scene and the distance of a particle to one of them.

A wall breaks up into features, and a particle has one contact per feature: a plane, or a mantle of revolution with its
open rims. Corners and joints are then right by themselves: no two normals are ever summed.
"""

from functools import cache
from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Box, Cylinder, Frustum, Mesh, Plane, Scene
from dembench.solver.types import types
from dembench.solver.units import Units

PLANE, MANTLE = 0, 1


def unsupported_walls(scene: Scene) -> list[str]:
    """Walls that the solver cannot do exactly, one line each."""
    found = []
    for wall in scene.walls:
        if isinstance(wall, Mesh):
            found.append(f"wall {wall.name}: triangle meshes")
        elif wall.motion is not None and not _shape_stays(wall):
            found.append(f"wall {wall.name}: a motion that changes where the wall is")
    return found


def _shape_stays(wall: Any) -> bool:
    """Whether the motion leaves the set of points of the wall as it is: sliding in a plane, rotation about the axis."""
    motion = wall.motion
    velocity, spin = np.array(motion.velocity), np.array(motion.angular_velocity)
    if motion.frequency and any(motion.amplitude):
        return False
    if isinstance(wall, Plane):
        normal = np.array(wall.normal)
        return _parallel(spin, normal) and abs(velocity @ normal) <= 1e-12 * np.linalg.norm(velocity)
    if isinstance(wall, Cylinder | Frustum):
        axis = np.array(wall.end) - np.array(wall.start)
        on_axis = _parallel(np.array(motion.centre) - np.array(wall.start), axis) or not spin.any()
        return _parallel(spin, axis) and on_axis and not velocity.any()
    return not (velocity.any() or spin.any())


def _parallel(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.linalg.norm(np.cross(a, b)) <= 1e-9 * np.linalg.norm(a) * np.linalg.norm(b))


def wall_features(scene: Scene, units: Units, precision: str) -> tuple[wp.array, list[str]]:
    """Features of all walls in scene units as an array of Wall records, and the wall that each belongs to.

    `kind` of a feature is the index of its material among `wall_materials(scene)`.
    """
    Wall = types(precision).Wall
    materials = wall_materials(scene)
    records, owners = [], []
    for wall in scene.walls:
        for parts in _features(wall):
            record = Wall()
            record.kind = materials.index(wall.material)
            for name, value in parts.items():
                setattr(record, name, value)
            for name in ("point", "length", "r0", "r1"):
                if name in parts:
                    setattr(record, name, _scaled(parts[name], 1 / units.length))
            if wall.motion is not None:
                record.velocity = _scaled(wall.motion.velocity, 1 / units.velocity)
                record.spin = _scaled(wall.motion.angular_velocity, units.time)
                record.centre = _scaled(wall.motion.centre, 1 / units.length)
            records.append(record)
            owners.append(wall.name)
    return wp.array(records, dtype=Wall, device="cpu") if records else wp.zeros(1, dtype=Wall, device="cpu"), owners


def wall_materials(scene: Scene) -> list[str]:
    """Names of the materials of the walls, each once, in order of appearance."""
    return list(dict.fromkeys(w.material for w in scene.walls))


def _scaled(value: Any, factor: float) -> Any:
    return value * factor if isinstance(value, int | float) else wp.vec3d(*(factor * float(x) for x in value))


def _features(wall: Any) -> list[dict[str, Any]]:
    if isinstance(wall, Plane):
        return [_plane(wall.point, wall.normal)]
    if isinstance(wall, Box):
        return [_plane(p.point, p.normal) for p in wall.planes()]
    start, end = np.array(wall.start), np.array(wall.end)
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length
    r0, r1 = (wall.radius, wall.radius) if isinstance(wall, Cylinder) else (wall.radius_start, wall.radius_end)
    found = [
        {
            "shape": MANTLE,
            "point": wp.vec3d(*start),
            "axis": wp.vec3d(*axis),
            "length": length,
            "r0": r0,
            "r1": r1,
            "outside": int(wall.outside),
        }
    ]
    if wall.closed_start:
        found.append(_plane(start, axis))
    if wall.closed_end:
        found.append(_plane(end, -axis))
    return found


def _plane(point: Any, normal: Any) -> dict[str, Any]:
    return {"shape": PLANE, "point": wp.vec3d(*point), "axis": wp.vec3d(*normal)}


@cache
def wall_distance(precision: str, curved: bool) -> Any:
    """Distance of a point to a feature as a Warp function: (Wall, x) -> (distance, unit normal into the void), float64.

    A mantle ends at its rims: beyond them the nearest point is on the rim circle. Behind a
    mantle the distance is negative, so that a particle is pushed back.
    """
    Wall = types(precision).Wall

    @wp.func
    def mantle(wall: Wall, x: wp.vec3d):
        zero = wp.float64(0.0)
        rel = x - wall.point
        along = wp.dot(rel, wall.axis)
        across = rel - along * wall.axis
        radial = wp.length(across)
        outward = wp.vec3d()
        if radial > zero:
            outward = across / radial
        slant = wp.sqrt(wall.length * wall.length + (wall.r1 - wall.r0) * (wall.r1 - wall.r0))
        ca, cr = wall.length / slant, (wall.r1 - wall.r0) / slant
        s = along * ca + (radial - wall.r0) * cr
        distance = along * cr - (radial - wall.r0) * ca
        normal = cr * wall.axis - ca * outward
        if wall.outside == 1:
            distance = -distance
            normal = -normal
        t = wp.clamp(s, zero, slant)
        if s != t:
            da = along - t * ca
            dr = radial - wall.r0 - t * cr
            distance = wp.sqrt(da * da + dr * dr)
            normal = wp.vec3d()
            if distance > zero:
                normal = (da * wall.axis + dr * outward) / distance
            else:
                normal = ca * wall.axis * wp.sign(s)
        return distance, normal

    @wp.func
    def distance_of(wall: Wall, x: wp.vec3d):
        d = wp.dot(x - wall.point, wall.axis)
        n = wall.axis
        if wp.static(curved):
            if wall.shape == 1:
                d, n = mantle(wall, x)
        return d, n

    return distance_of
