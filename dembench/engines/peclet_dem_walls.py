"""Walls in peclet-dem: signed distances on grids, between whose nodes the program interpolates linearly.

Its soft-sphere solver knows no other walls: planes of its own are an error there, and shapes of its own let every body
through (a sphere that falls on a box went on with all its speed). It takes four grids at most.

A grid is exact where the distance is linear between the nodes: of a plane, and of two parallel planes across an axis
with a node halfway, one grid for both while no body is as thick as the gap between them. A mantle is off by up to
h^2/(8 R), h the distance of the nodes. One along y or z that ends in caps or with the domain needs few nodes along its
axis; the program takes normals from differences over half the distance of the nodes along x, whatever the direction.

Beyond a grid the program takes the way to it off the distance, so that grids cover the domain and half a cell.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dembench.engines.round_walls import axis_of
from dembench.scene import Box, Cylinder, Frustum, Motion, Plane, Scene, Sdf
from dembench.scene.walls import WallShape, geometry_moves

MOST_OF_SOFT_SPHERES = 4
"""Grids that the soft-sphere solver takes."""
MOST_ACROSS = 2000
"""Most nodes across a plane."""
MOST_NODES = 4e6
"""Most nodes of the grid of a round wall by default, in a plane across it or in space."""
FINE = 0.25
"""Distance of the nodes of round walls by default, in radii of the smallest body [-]."""
Distance = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Grid:
    """A surface as the program takes it.

    Attributes:
        wall: Name of the scene's wall.
        part: Number of the surface of that wall.
        material: Name of its material.
        origin, spacing: Position of the first node and distances of the nodes along x, y, z [m].
        values: Distances at the nodes [m], positive where bodies are, shape (nx, ny, nz).
        motion: How its surface moves.
    """

    wall: str
    part: int
    material: str
    origin: tuple[float, ...]
    spacing: tuple[float, ...]
    values: np.ndarray
    motion: Motion

    @property
    def file(self) -> str:
        """Name of the file of its values."""
        return f"wall_{self.wall}_{self.part}.npy"

    @property
    def moves(self) -> bool:
        """Whether its surface has a velocity."""
        return any(self.motion.velocity) or any(self.motion.angular_velocity)


def refused(scene: Scene) -> list[str]:
    """Walls that the adapter does not write, one line each."""
    faults = []
    for wall in scene.walls:
        motion = wall.motion or Motion()
        if not isinstance(wall, Plane | Box | Cylinder | Frustum | Sdf):
            faults.append(f"wall {wall.name}: a mesh")
        elif geometry_moves(wall):
            faults.append(f"motion of wall {wall.name}: a wall that does not stay in its place")
        elif motion.frequency > 0 and any(motion.amplitude):
            faults.append(f"motion of wall {wall.name}: a surface that oscillates")
    return faults


def surfaces(scene: Scene) -> int:
    """Number of grids that the walls of a scene need."""
    return sum(len(_faces(wall, scene)) + _round(wall) + _parts(wall) for wall in scene.walls)


def write_grids(made: Sequence[Grid], directory: Path) -> None:
    """The values of grids, in single precision, one file each."""
    for grid in made:
        np.save(directory / grid.file, grid.values.astype(np.float32))


def grids(scene: Scene, fine: float) -> list[Grid]:
    """The grids of all walls.

    Args:
        scene: The scene.
        fine: Distance of the nodes of round walls [m].
    """
    found = []
    for wall in scene.walls:
        made = [_flat(faces, scene) for faces in _faces(wall, scene)]
        if isinstance(wall, Cylinder | Frustum):
            made.append(_mantle(wall, scene, fine))
        elif isinstance(wall, Sdf):
            made += _sampled(wall, scene)
        motion = wall.motion or Motion()
        for part, (origin, spacing, values) in enumerate(made):
            found.append(Grid(wall.name, part, wall.material, tuple(origin), tuple(spacing), values, motion))
    return found


def default_fine(scene: Scene) -> float:
    """Distance of the nodes of round walls by default [m]: a share of the smallest radius while the nodes are few."""
    found = [FINE * scene.extreme_radii()[0]]
    for wall in scene.walls:
        if isinstance(wall, Cylinder | Frustum):
            along = _uniform_axis(wall, scene)
            sides = np.delete(_extents(scene), [] if along is None else along)
            found.append(float(np.prod(sides) / MOST_NODES) ** (1 / len(sides)))
    return float(f"{max(found):.6g}")


# ---- flat walls

Nodes = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Origin [m], spacing [m] and values [m] of a grid."""


def _faces(wall: WallShape, scene: Scene) -> list[list[Plane]]:
    """The planes of a wall; two that face each other across an axis stand together, if no body touches both."""
    if isinstance(wall, Plane):
        return [[wall]]
    if isinstance(wall, Box):
        planes = wall.planes()
    elif isinstance(wall, Cylinder | Frustum):
        planes = _caps(wall)
    else:
        return []
    thickest = 2 * scene.extreme_radii()[1]
    found: list[list[Plane]] = []
    for plane in planes:
        axis = axis_of(plane.normal)
        for other in found:
            gap = abs(other[0].signed_distance(np.array([plane.point]))[0])
            if axis is not None and axis_of(other[0].normal) == axis and gap > thickest and len(other) == 1:
                other.append(plane)
                break
        else:
            found.append([plane])
    return found


def _caps(wall: Cylinder | Frustum) -> list[Plane]:
    """The closed ends of a wall as planes."""
    axis = np.subtract(wall.end, wall.start)
    axis = axis / np.linalg.norm(axis)
    ends = ((wall.start, axis, wall.closed_start), (wall.end, -axis, wall.closed_end))
    return [
        Plane(name=wall.name, material=wall.material, motion=wall.motion, point=point, normal=tuple(normal.tolist()))
        for point, normal, closed in ends
        if closed
    ]


def _flat(faces: list[Plane], scene: Scene) -> Nodes:
    """The grid of a plane, or of two that face each other."""
    lower, upper, lengths = np.array(scene.domain.lower), np.array(scene.domain.upper), _extents(scene)
    axis = axis_of(faces[0].normal)
    spacing = np.full(3, lengths.max()) if axis is None else lengths.copy()
    anchor = (lower + upper) / 2
    if axis is not None:
        sides = [face.point[axis] for face in faces]
        wide = abs(sides[1] - sides[0]) / 2 if len(sides) == 2 else 4 * scene.extreme_radii()[1]
        spacing[axis] = max(wide, lengths[axis] / MOST_ACROSS) if len(sides) == 1 else wide
        anchor[axis] = sides[0]
    first, last = lower - spacing[0] / 2, upper + spacing[0] / 2
    if axis is not None and len(faces) == 1:  # the program goes on linearly behind the first or last node across
        behind = faces[0].point[axis] - 2 * np.sign(faces[0].normal[axis]) * spacing[axis]
        first[axis], last[axis] = (behind, last[axis]) if faces[0].normal[axis] > 0 else (first[axis], behind)
    return _nodes(
        lambda points: np.min([face.signed_distance(points) for face in faces], axis=0), anchor, spacing, first, last
    )


def _nodes(distance: Distance, anchor: np.ndarray, spacing: np.ndarray, first: np.ndarray, last: np.ndarray) -> Nodes:
    """A grid with a node at the anchor that holds a box [m]."""
    low = np.minimum(np.floor((first - anchor) / spacing - 1e-9), 0)
    high = np.maximum(np.ceil((last - anchor) / spacing + 1e-9), 0)
    shape = (high - low + 1).astype(int)
    axes = [anchor[k] + spacing[k] * (low[k] + np.arange(shape[k])) for k in range(3)]
    values = np.empty(shape)
    across = np.stack(np.meshgrid(axes[1], axes[2], indexing="ij"), axis=-1).reshape(-1, 2)
    for k, x in enumerate(axes[0]):  # layer by layer, so that no more than one is in memory as points
        values[k] = distance(np.column_stack([np.full(len(across), x), across])).reshape(shape[1:])
    return anchor + spacing * low, spacing, values


def _extents(scene: Scene) -> np.ndarray:
    return np.subtract(scene.domain.upper, scene.domain.lower)


# ---- round walls and grids


def _round(wall: WallShape) -> bool:
    return isinstance(wall, Cylinder | Frustum)


def _parts(wall: WallShape) -> int:
    return len(wall.values) if isinstance(wall, Sdf) else 0


def _mantle(wall: Cylinder | Frustum, scene: Scene, fine: float) -> Nodes:
    """The grid of a mantle, which goes on beyond ends that are closed or outside the domain."""
    extended = _extended(wall, scene)
    along = _uniform_axis(wall, scene)
    lower, upper = np.array(scene.domain.lower), np.array(scene.domain.upper)
    spacing = np.full(3, fine)
    if along is not None:
        spacing[along] = _extents(scene)[along]
    return _nodes(extended.signed_distance, (lower + upper) / 2, spacing, lower - fine, upper + fine)


def _extended(wall: Cylinder | Frustum, scene: Scene) -> Cylinder | Frustum:
    """A wall without caps that is longer at the ends where no body can tell."""
    start, end = np.array(wall.start), np.array(wall.end)
    length = float(np.linalg.norm(end - start))
    axis, far = (end - start) / length, 2 * float(np.linalg.norm(_extents(scene))) + length
    radii = [wall.radius_start, wall.radius_end] if isinstance(wall, Frustum) else [wall.radius, wall.radius]
    steep = (radii[1] - radii[0]) / length
    points = [start, end]
    for k, sign in ((0, -1), (1, 1)):
        if _goes_on(wall, k, scene):
            way = min(far, radii[k] / (-sign * steep)) if sign * steep < 0 else far
            points[k] = points[k] + sign * way * axis
            radii[k] = max(radii[k] + sign * steep * way, 0.0)
    changes = {"start": tuple(points[0]), "end": tuple(points[1]), "closed_start": False, "closed_end": False}
    if isinstance(wall, Frustum):
        changes |= {"radius_start": radii[0], "radius_end": radii[1]}
    return wall.model_copy(update=changes)


def _goes_on(wall: Cylinder | Frustum, end: int, scene: Scene) -> bool:
    """Whether an end (0 or 1) is closed, or outside the domain on an axis across which it lies."""
    if (wall.closed_start, wall.closed_end)[end]:
        return True
    axis = axis_of(np.subtract(wall.end, wall.start))
    place = (wall.start, wall.end)[end]
    return axis is not None and not scene.domain.lower[axis] < place[axis] < scene.domain.upper[axis]


def _uniform_axis(wall: Cylinder | Frustum, scene: Scene) -> int | None:
    """The axis along which a mantle is the same everywhere, unless it is x, or None."""
    axis = axis_of(np.subtract(wall.end, wall.start))
    if axis in (None, 0) or not isinstance(wall, Cylinder):
        return None
    return axis if all(_goes_on(wall, end, scene) for end in (0, 1)) else None


def _sampled(wall: Sdf, scene: Scene) -> list[Nodes]:
    """The grids of a wall given on grids, with the distance of their ends as far as the domain goes."""
    lower, upper = np.array(scene.domain.lower), np.array(scene.domain.upper)
    before = np.ceil((np.array(wall.origin) - lower) / wall.spacing + 0.5).clip(min=0).astype(int)
    end = np.array(wall.origin) + wall.spacing * (np.array(wall.values.shape[1:]) - 1)
    after = np.ceil((upper - end) / wall.spacing + 0.5).clip(min=0).astype(int)
    origin = np.array(wall.origin) - wall.spacing * before
    pads = list(zip(before, after, strict=True))
    return [(origin, np.full(3, wall.spacing), np.pad(part, pads, mode="edge")) for part in wall.values]
