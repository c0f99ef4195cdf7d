"""Walls of a scene as features in scene units.

A wall breaks up into features, and a particle has one contact per feature: a plane, a mantle of revolution with its
open rims, each part of a signed distance, a face, edge or vertex of a mesh. Corners and joints are then right by
themselves: no two normals are ever summed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Box, Cylinder, Frustum, Mesh, Plane, Scene, Sdf
from dembench.solver.needs import Needs
from dembench.solver.units import Units
from dembench.solver.walls.loads import COLUMNS
from dembench.solver.walls.mesh import box_grid, mesh_features
from dembench.solver.walls.motion import Motions, place_all
from dembench.solver.walls.records import GRID, MANTLE, PLANE, Feature, MeshCells, Pose, WallMotion, WallOptions, Walls


class WallSet:
    """The walls of a scene on a device.

    Attributes:
        names: Names of the walls; Feature.owner is an index into them.
        options: What of the walls is compiled in.
        record: The record Walls that kernels take.
        count: Number of features.
        motions: The motions of the walls.
    """

    def __init__(
        self,
        scene: Scene,
        units: Units,
        threads: int = 1,
        device: Any = "cpu",
        loads: bool = False,
        needs: Needs | None = None,
    ):
        needs = needs or Needs.of(scene)
        self._units, self._threads, self._device = units, threads, device
        self.motions = Motions(scene)
        self.names = [wall.name for wall in scene.walls]
        features, nodes, meshes = self._features(scene)
        self.count = len(features)
        self.options = WallOptions(
            present=bool(self.count) or needs.forces("walls"),
            curved=bool((features["shape"] == MANTLE).any()) or needs.forces("curved_walls"),
            grids=bool((features["shape"] == GRID).any()) or needs.forces("sdf_walls"),
            meshes=bool(meshes.cells) or needs.forces("mesh_walls"),
            shapes=bool(meshes.cells) and needs.present.shapes,
            moving=bool(self.motions.found) or needs.forces("moving_walls"),
            timed=self.motions.timed or needs.forces("moving_geometry"),
            loads=loads and bool(self.count),
        )
        self.record = record = Walls()
        record.features, record.nodes = self._array(Feature, features), self._array(wp.vec4d, nodes)
        record.motions = self._array(WallMotion, self.motions.records(units))
        record.poses = wp.zeros(max(1, threads * len(self.motions.found)), dtype=Pose, device=device)
        record.plain = self.count - sum(map(len, meshes.lowest))
        record.spaces = self._array(wp.vec3d, _joined(meshes.spaces, (0, 3)))
        record.meshes = self._array(MeshCells, meshes.cells)
        record.mesh_start = self._array(wp.int32, _joined(meshes.start, 0))
        record.mesh_part = self._array(wp.int32, _joined(meshes.part, 0))
        record.mesh_lowest = self._array(wp.vec3i, _joined(meshes.lowest, (0, 3)))
        size = (threads, len(self.names), COLUMNS) if self.options.loads else (0, 0, 0)
        record.loads = wp.zeros(size, dtype=wp.float64, device=device)
        self.place(0.0)

    def place(self, time: float) -> None:
        """Takes the walls to where they are at a time [scene units]."""
        if self.options.moving:
            wp.launch(place_all, dim=1, inputs=[self._threads, time, self.record], device=self._device)

    def surface_velocity(self, features: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Velocity of the surface of features at points, where the walls were last placed [scene units].

        Args:
            features: Indices of the features, shape (k,).
            points: Shape (k, 3).
        """
        velocity = np.zeros((len(points), 3))
        if self.options.moving:
            motion = self.record.features.numpy()["motion"][features]
            moved = motion >= 0
            poses = self.record.poses.numpy()[motion[moved]]
            arm = points[moved] - poses["centre"]
            velocity[moved] = poses["velocity"] + np.cross(poses["spin"], arm)
        return velocity

    def loads(self) -> np.ndarray:
        """Sums over the threads of what bodies do to each wall, shape (walls, 7), see `loads.py` [scene units]."""
        return self.record.loads.numpy().sum(axis=0)

    @property
    def moves(self) -> bool:
        """Whether some wall changes where it is."""
        return any(self.motions.moved)

    def largest_speed(self, time: float, low: np.ndarray, high: np.ndarray) -> float:
        """Bound of the speed at which walls pass points between low and high [scene units]."""
        return self.motions.largest_speed(self._units, time, low, high)

    def _features(self, scene: Scene) -> tuple[np.ndarray, np.ndarray, _Meshes]:
        """Rows of features, nodes of grids and what belongs to meshes, whose parts come last."""
        rows: list[np.ndarray] = []
        nodes: list[np.ndarray] = []
        meshes = _Meshes()
        materials, length = wall_materials(scene), self._units.length
        for wall in sorted(scene.walls, key=lambda wall: isinstance(wall, Mesh)):
            motion = self.motions.of(wall)
            if isinstance(wall, Sdf):
                found = _grids(wall, self._units, nodes)
            elif isinstance(wall, Mesh):
                found = meshes.add(wall, length, motion, sum(map(len, rows)))
            else:
                found = np.concatenate(_primitives(wall, length) or [np.zeros(0, _ROW)])
            found["owner"], found["motion"] = self.names.index(wall.name), motion
            found["kind"] = materials.index(wall.material)
            rows.append(found)
        return np.concatenate([np.zeros(0, _ROW), *rows]).astype(_ROW), _joined(nodes, (0, 4)), meshes

    def _array(self, record: Any, values: Any) -> wp.array:
        if len(values):
            return wp.array(values, dtype=record, device=self._device)
        return wp.zeros(0, dtype=record, device=self._device)


def wall_materials(scene: Scene) -> list[str]:
    """Names of the materials of the walls, each once, in order of appearance."""
    return list(dict.fromkeys(w.material for w in scene.walls))


_ROW = Feature.numpy_dtype()


def _rows(n: int = 1, **fields: Any) -> np.ndarray:
    """Rows of features with some of their fields."""
    found = np.zeros(n, _ROW)
    for name, value in fields.items():
        found[name] = value
    return found


def _joined(arrays: list[np.ndarray], shape: Any) -> np.ndarray:
    return np.concatenate(arrays) if arrays else np.zeros(shape)


def _primitives(wall: Plane | Box | Cylinder | Frustum, length: float) -> list[np.ndarray]:
    """Planes and mantles of a wall, lengths divided by `length`."""
    if isinstance(wall, Plane):
        return [_plane(wall.point, wall.normal, length)]
    if isinstance(wall, Box):
        return [_plane(p.point, p.normal, length) for p in wall.planes()]
    start, end = np.array(wall.start), np.array(wall.end)
    height = float(np.linalg.norm(end - start))
    axis = (end - start) / height
    r0, r1 = (wall.radius, wall.radius) if isinstance(wall, Cylinder) else (wall.radius_start, wall.radius_end)
    found = [
        _rows(
            shape=MANTLE,
            outside=wall.outside,
            point=start / length,
            axis=axis,
            length=height / length,
            r0=r0 / length,
            r1=r1 / length,
        )
    ]
    if wall.closed_start:
        found.append(_plane(start, axis, length))
    if wall.closed_end:
        found.append(_plane(end, -axis, length))
    return found


def _plane(point: Any, normal: Any, length: float) -> np.ndarray:
    return _rows(shape=PLANE, point=np.array(point) / length, axis=normal)


def _grids(wall: Sdf, units: Units, nodes: list[np.ndarray]) -> np.ndarray:
    """A feature for each part of a wall; the rows of its nodes are appended to those that are there already."""
    length = units.length
    place = {"point": np.array(wall.origin) / length, "length": wall.spacing / length, "size": wall.values.shape[1:]}
    found = _rows(len(wall.values), shape=GRID, **place)
    for part, values in enumerate(wall.values):
        found["first"][part] = sum(map(len, nodes))
        nodes.append(field_nodes(values, wall.spacing, units))
    return found


def field_nodes(values: np.ndarray, spacing: float, units: Units) -> np.ndarray:
    """Gradient and distance [scene units] of the nodes of a grid, rows of shape (n, 4).

    Args:
        values: Signed distances [m], shape (nx, ny, nz).
        spacing: Distance between nodes [m].
        units: Scene units.
    """
    gradient = np.gradient(values, spacing, edge_order=2)
    return np.stack([*gradient, values / units.length], axis=-1).reshape(-1, 4)


class _Meshes:
    """What belongs to meshes: half-spaces, and the grids over their parts; see `Walls`."""

    def __init__(self) -> None:
        self.spaces: list[np.ndarray] = []
        self.cells: list[Any] = []
        self.start: list[np.ndarray] = []
        self.part: list[np.ndarray] = []
        self.lowest: list[np.ndarray] = []

    def add(self, wall: Mesh, length: float, motion: int, first: int) -> np.ndarray:
        """The features of a mesh, the first of which has the index `first`."""
        parts = mesh_features(wall.triangles / length)
        grid = box_grid(parts.low, parts.high)
        cells = MeshCells()
        cells.motion, cells.inverse = motion, 1 / grid.edge
        cells.reference, cells.origin = wp.vec3d(*parts.reference), wp.vec3d(*grid.origin)
        cells.cells, cells.start = wp.vec3i(*grid.cells.tolist()), sum(map(len, self.start))
        spaces, entries = sum(map(len, self.spaces)) // 2, sum(map(len, self.part))
        self.cells.append(cells)
        self.spaces.append(parts.spaces.reshape(-1, 3))
        self.start.append(grid.start + entries)
        self.part.append(grid.boxes + first)
        self.lowest.append(grid.lowest)
        found = _rows(len(parts.shape), shape=parts.shape, point=parts.reference, base=parts.base, axis=parts.axis)
        found["first"], found["size"][:, 0] = parts.first + spaces, parts.count
        return found
