"""Walls of a scene as LIGGGHTS has them: infinite primitives where these are exact, else triangles in STL files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dembench.scene import Box, Cylinder, Frustum, Material, Mesh, Motion, Plane, Scene, Sdf

AXES = "xyz"


def materials_of(scene: Scene) -> list[Material]:
    """Materials in use, in the order of their types 1, 2, ..."""
    used = {s.material for s in scene.species} | {w.material for w in scene.walls}
    return [m for m in scene.materials if m.name in used]


def type_of(scene: Scene, material: str) -> int:
    """The type of a material, by its name."""
    return 1 + [m.name for m in materials_of(scene)].index(material)


@dataclass(frozen=True)
class Primitive:
    """An infinite wall of the program: fix id, type (material), shape with its numbers."""

    id: str
    type: int
    shape: str


@dataclass(frozen=True)
class Surface:
    """A wall of triangles [m], shape (n, 3, 3): fix id, type (material), arguments of `move/mesh` or nothing."""

    id: str
    type: int
    triangles: np.ndarray
    motion: str


def walls(scene: Scene, segments: int) -> tuple[list[Primitive], list[Surface]]:
    """Every wall as primitives where these are exact, else as triangles."""
    primitives: list[Primitive] = []
    surfaces: list[Surface] = []
    for k, wall in enumerate(scene.walls, 1):
        name, kind = f"wall{k}_{wall.name}", type_of(scene, wall.material)
        shapes = None if wall.motion is not None else _shapes(wall, scene)
        if shapes is not None:
            primitives += [Primitive(f"{name}{suffix}", kind, shape) for suffix, shape in shapes]
            continue
        if isinstance(wall, Plane):
            triangles = _clipped_plane(wall, scene)
        elif isinstance(wall, Cylinder | Frustum):
            triangles = wall.triangulate(segments)
        else:
            triangles = wall.triangulate()
        if len(triangles):
            surfaces.append(Surface(name, kind, triangles, motion_of(wall.motion) or "" if wall.motion else ""))
    return primitives, surfaces


def _shapes(wall: Plane | Box | Cylinder | Frustum | Mesh | Sdf, scene: Scene) -> list[tuple[str, str]] | None:
    """The exact primitives of a wall at rest as (suffix of its name, shape); None where there are none."""
    if isinstance(wall, Plane):
        axis = _axis(wall.normal)
        return None if axis is None else [("", f"{AXES[axis]}plane {wall.point[axis]!r}")]
    if isinstance(wall, Box):
        named = []
        for plane in wall.planes():
            axis = int(np.argmax(np.abs(plane.normal)))
            side = "low" if plane.normal[axis] > 0 else "high"
            named.append((f"_{AXES[axis]}_{side}", f"{AXES[axis]}plane {plane.point[axis]!r}"))
        return named
    if isinstance(wall, Cylinder) and not wall.outside:
        return _cylinder(wall, scene)
    return None


def _cylinder(wall: Cylinder, scene: Scene) -> list[tuple[str, str]] | None:
    """A primitive cylinder is infinite: exact only where each end is closed or reaches the end of the domain."""
    axis = _axis(np.subtract(wall.end, wall.start))
    if axis is None:
        return None
    shapes = []
    for closed, here, there in (
        (wall.closed_start, wall.start[axis], wall.end[axis]),
        (wall.closed_end, wall.end[axis], wall.start[axis]),
    ):
        side = "low" if here < there else "high"
        if closed:
            shapes.append((f"_{side}", f"{AXES[axis]}plane {here!r}"))
        elif scene.domain.lower[axis] < here < scene.domain.upper[axis]:
            return None
    b, c = (axis + 1) % 3, (axis + 2) % 3  # the program takes the centre in cyclic order: z and x for the y axis
    return [("", f"{AXES[axis]}cylinder {wall.radius!r} {wall.start[b]!r} {wall.start[c]!r}"), *shapes]


def _axis(direction: Sequence[float] | np.ndarray) -> int | None:
    """The coordinate axis that a direction lies on, or None."""
    along = np.flatnonzero(direction)
    return int(along[0]) if len(along) == 1 else None


def _clipped_plane(wall: Plane, scene: Scene) -> np.ndarray:
    """The part of a plane inside the domain as triangles, shape (n, 3, 3): triangles outside would be deleted."""
    low, high = np.array(scene.domain.lower), np.array(scene.domain.upper)
    reach = float(np.linalg.norm(high - low) + np.linalg.norm((low + high) / 2 - wall.point))
    square = wall.triangulate(reach)
    polygon = [square[0, 0], square[0, 1], square[0, 2], square[1, 2]]
    for axis in range(3):
        for sign, bound in ((1.0, low[axis]), (-1.0, high[axis])):
            clipped = []
            for a, b in zip(polygon, [*polygon[1:], *polygon[:1]], strict=True):
                u, v = sign * (a[axis] - bound), sign * (b[axis] - bound)
                if u >= 0:
                    clipped.append(a)
                if u * v < 0:
                    crossing = a + u / (u - v) * (b - a)
                    crossing[axis] = bound
                    clipped.append(crossing)
            polygon = clipped
    fan = [[polygon[0], polygon[k], polygon[k + 1]] for k in range(1, len(polygon) - 1)]
    return np.array(fan).reshape(-1, 3, 3)


def motion_of(motion: Motion) -> str | None:
    """Arguments of `fix move/mesh`; nothing for no motion, None for what it cannot do exactly."""
    speed, rate = math.hypot(*motion.velocity), math.hypot(*motion.angular_velocity)
    if motion.surface or (motion.frequency > 0 and any(motion.amplitude)) or (speed and rate):
        return None
    if rate:
        centre, axis = (" ".join(map(repr, v)) for v in (motion.centre, motion.angular_velocity))
        return f"rotate origin {centre} axis {axis} period {2 * math.pi / rate!r}"
    return f"linear {' '.join(map(repr, motion.velocity))}" if speed else ""


def write_stl(path: Path, triangles: np.ndarray) -> None:
    vertex = "   vertex %.17g %.17g %.17g\n"
    facet = f" facet normal 0 0 0\n  outer loop\n{3 * vertex}  endloop\n endfacet\n"
    with open(path, "w") as stream:
        stream.write(f"solid {path.stem}\n")
        stream.writelines(facet % tuple(t.ravel()) for t in triangles)
        stream.write(f"endsolid {path.stem}\n")
