"""Walls of a scene as LIGGGHTS has them: infinite primitives where these are exact, else triangles in STL files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dembench.engines.round_walls import axis_of, discs, is_primitive, open_tops, polygon
from dembench.engines.scene_queries import materials_of
from dembench.scene import Box, Cylinder, Frustum, Mesh, Motion, Plane, Scene, Sdf

AXES = "xyz"


def type_of(scene: Scene, material: str) -> int:
    """The type of a material, by its name."""
    return 1 + [m.name for m in materials_of(scene)].index(material)


CURVATURE, LEAST_ANGLE = 0.256235, 0.057
"""Default of the program's option `curvature`, and the angle below which it takes no triangle [degrees]."""


@dataclass(frozen=True)
class Primitive:
    """An infinite wall of the program.

    Attributes:
        id: Name of its fix, of nine characters at most: the program makes room for no more where it stores forces.
        wall: Name of the scene's wall.
        type: Type of its material.
        shape: Kind with its numbers.
        group: Bodies that meet it.
        shear: Motion of its surface as arguments of the fix, or nothing.
    """

    id: str
    wall: str
    type: int
    shape: str
    group: str = "all"
    shear: str = ""


@dataclass(frozen=True)
class Surface:
    """A wall of triangles.

    Attributes:
        id: Name of its fix and of its STL file.
        wall: Name of the scene's wall.
        type: Type of its material.
        triangles: Vertices [m], shape (n, 3, 3).
        motion: How it moves, or None.
    """

    id: str
    wall: str
    type: int
    triangles: np.ndarray
    motion: Motion | None

    def curvature(self) -> float:
        """Angle between neighbouring triangles below which they are one smooth face to the program [degrees].

        It is the program's default, or just below the smallest angle of a triangle: the program refuses a mesh with a
        smaller one, as long sides of polygons have it, and whatever the option any with less than LEAST_ANGLE.
        """
        sides = np.roll(self.triangles, -1, axis=1) - self.triangles
        ahead, back = sides, -np.roll(sides, 1, axis=1)
        across = np.linalg.norm(np.cross(ahead, back), axis=2)
        angles = np.degrees(np.arctan2(across, (ahead * back).sum(axis=2)))
        return min(CURVATURE, max(LEAST_ANGLE, float(f"{0.9 * angles.min():.3g}")))

    def move(self) -> str:
        """Arguments of `fix move/mesh`; nothing for a surface at rest."""
        return motion_of(self.motion) or "" if self.motion else ""

    def reach(self, duration: float) -> tuple[np.ndarray, np.ndarray]:
        """Corners of a box that holds the surface during a time [s] from the start: [m], shape (3,) each."""
        points = self.triangles.reshape(-1, 3)
        if self.motion is None:
            return points.min(axis=0), points.max(axis=0)
        spin = np.array(self.motion.angular_velocity)
        if spin.any():
            axis = spin / np.linalg.norm(spin)
            relative = points - self.motion.centre
            along = (relative @ axis)[:, None] * axis
            swept = np.linalg.norm(relative - along, axis=1)[:, None] * np.sqrt(1 - np.minimum(axis**2, 1))
            points = self.motion.centre + along
            return (points - swept).min(axis=0), (points + swept).max(axis=0)
        way = np.array(self.motion.velocity) * duration
        return (points + np.minimum(way, 0)).min(axis=0), (points + np.maximum(way, 0)).max(axis=0)


@dataclass(frozen=True)
class Walls:
    """All walls of a scene as the program has them.

    Attributes:
        primitives, surfaces: The parts.
        groups: Bodies [numbers from 1, as ranges a:b] by the name of the group, for walls that meet only some bodies.
        polygons: Names of round walls that are polygons.
        floor, ceiling: Corners that the program's box must not exceed [m]: where a primitive goes on beyond its wall.
    """

    primitives: list[Primitive]
    surfaces: list[Surface]
    groups: dict[str, list[str]]
    polygons: list[str]
    floor: np.ndarray
    ceiling: np.ndarray


def walls(scene: Scene, segments: int) -> Walls:
    """Every wall as primitives where these are exact, else as triangles; round ones with that many sides."""
    made = Walls([], [], {}, [], np.full(3, -np.inf), np.full(3, np.inf))
    for k, wall in enumerate(scene.walls, 1):
        kind = type_of(scene, wall.material)
        if isinstance(wall, Cylinder | Frustum):
            _add_round(made, wall, k, kind, scene, segments)
            continue
        shapes = None if wall.motion is not None else _shapes(wall)
        if shapes is not None:
            made.primitives.extend(Primitive(f"w{k}{part}", wall.name, kind, shape) for part, shape in shapes)
            continue
        triangles = _clipped_plane(wall, scene) if isinstance(wall, Plane) else wall.triangulate()
        if len(triangles):
            made.surfaces.append(Surface(f"wall{k}_{wall.name}", wall.name, kind, triangles, wall.motion))
    return made


def _shapes(wall: Plane | Box | Mesh | Sdf) -> list[tuple[str, str]] | None:
    """The exact primitives of a wall at rest as (end of the id, shape); None where there are none."""
    if isinstance(wall, Plane):
        axis = axis_of(wall.normal)
        return None if axis is None else [("", f"{AXES[axis]}plane {wall.point[axis]!r}")]
    if isinstance(wall, Box):
        named = []
        for plane in wall.planes():
            axis = int(np.argmax(np.abs(plane.normal)))
            side = "lo" if plane.normal[axis] > 0 else "hi"
            named.append((f"_{AXES[axis]}{side}", f"{AXES[axis]}plane {plane.point[axis]!r}"))
        return named
    return None


def _add_round(made: Walls, wall: Cylinder | Frustum, k: int, kind: int, scene: Scene, segments: int) -> None:
    """Adds a round wall: a primitive mantle with planes or turning discs as ends, or a polygon."""
    axis = axis_of(np.subtract(wall.end, wall.start))
    if not isinstance(wall, Cylinder) or not is_primitive(wall, scene) or axis is None:
        made.polygons.append(wall.name)
        made.surfaces.append(Surface(f"wall{k}_{wall.name}", wall.name, kind, polygon(wall, segments), wall.motion))
        return
    b, c = (axis + 1) % 3, (axis + 2) % 3  # the program takes the centre in cyclic order: z and x for the y axis
    shape = f"{AXES[axis]}cylinder {wall.radius!r} {wall.start[b]!r} {wall.start[c]!r}"
    if wall.motion is None:
        made.primitives.append(Primitive(f"w{k}", wall.name, kind, shape))
        for closed, here, there in (
            (wall.closed_start, wall.start[axis], wall.end[axis]),
            (wall.closed_end, wall.end[axis], wall.start[axis]),
        ):
            if closed:
                side = "lo" if here < there else "hi"
                made.primitives.append(
                    Primitive(f"w{k}_{AXES[axis]}{side}", wall.name, kind, f"{AXES[axis]}plane {here!r}")
                )
    else:
        _add_turning(made, wall, k, kind, shape, axis, scene)
    for along, end, at in open_tops(wall, scene):
        bound = made.ceiling if end > 0 else made.floor
        bound[along] = min(bound[along], at) if end > 0 else max(bound[along], at)


def _add_turning(made: Walls, wall: Cylinder, k: int, kind: int, shape: str, axis: int, scene: Scene) -> None:
    """Adds a cylinder that turns about itself: a primitive for each radius of the bodies, and its ends as discs.

    The program gives the surface the velocity that it would have where the body's centre is. A higher angular velocity,
    by the ratio of the distances of wall and centre from the axis, makes it that of the wall.
    """
    assert wall.motion is not None, "a wall at rest does not turn"
    radii = scene.radii()
    for size, radius in enumerate(np.unique(radii), 1):
        made.groups.setdefault(f"size{size}", ranges(np.flatnonzero(radii == radius) + 1))
        speed = wall.motion.angular_velocity[axis] * wall.radius / (wall.radius - float(radius))
        shear = f"shear {AXES[(axis + 1) % 3]} {speed!r}"
        made.primitives.append(Primitive(f"w{k}_s{size}", wall.name, kind, shape, f"size{size}", shear))
    if wall.closed_start or wall.closed_end:
        made.surfaces.append(Surface(f"wall{k}_{wall.name}_ends", wall.name, kind, discs(wall), wall.motion))


def ranges(numbers: np.ndarray) -> list[str]:
    """Ascending numbers as ranges a:b."""
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return [f"{run[0]}:{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs]


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
