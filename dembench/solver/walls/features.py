"""Walls of a scene as features in scene units.

A wall breaks up into features, and a particle has one contact per feature: a plane, or a mantle of revolution with its
open rims. Corners and joints are then right by themselves: no two normals are ever summed.
"""

from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Box, Cylinder, Mesh, Plane, Scene, Sdf
from dembench.solver.units import Units
from dembench.solver.walls.motion import Motions, place_all
from dembench.solver.walls.records import GRID, MANTLE, PLANE, Feature, Pose, WallMotion, WallOptions, Walls


def unsupported_walls(scene: Scene) -> list[str]:
    """Walls that the solver cannot do exactly, one line each."""
    return [f"wall {wall.name}: triangle meshes" for wall in scene.walls if isinstance(wall, Mesh)]


class WallSet:
    """The walls of a scene on a device.

    Attributes:
        options: What of the walls is compiled in.
        record: The record Walls that kernels take.
        count: Number of features.
        owners: Name of the wall that each feature belongs to.
        motions: The motions of the walls.
    """

    def __init__(self, scene: Scene, units: Units, threads: int = 1, device: Any = "cpu"):
        self._units, self._threads, self._device = units, threads, device
        self.motions = Motions(scene)
        materials = wall_materials(scene)
        features: list[Any] = []
        nodes: list[np.ndarray] = []
        self.owners = []
        for wall in scene.walls:
            for parts in _grids(wall, units, nodes) if isinstance(wall, Sdf) else _features(wall):
                feature = Feature()
                feature.kind, feature.motion = materials.index(wall.material), self.motions.of(wall)
                for name, value in parts.items():
                    setattr(feature, name, value)
                for name in ("point", "length", "r0", "r1"):
                    if name in parts:
                        setattr(feature, name, _scaled(parts[name], 1 / units.length))
                features.append(feature)
                self.owners.append(wall.name)
        self.count = len(features)
        self.options = WallOptions(
            present=bool(features),
            curved=any(f.shape == MANTLE for f in features),
            grids=bool(nodes),
            moving=bool(self.motions.found),
            timed=self.motions.timed,
        )
        self.record = Walls()
        self.record.features = self._array(Feature, features)
        self.record.motions = self._array(WallMotion, self.motions.records(units))
        self.record.poses = wp.zeros(max(1, threads * len(self.motions.found)), dtype=Pose, device=device)
        self.record.nodes = self._array(wp.vec4d, np.concatenate(nodes) if nodes else [])
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

    @property
    def moves(self) -> bool:
        """Whether some wall changes where it is."""
        return any(self.motions.moved)

    def largest_speed(self, time: float, low: np.ndarray, high: np.ndarray) -> float:
        """Bound of the speed at which walls pass points between low and high [scene units]."""
        return self.motions.largest_speed(self._units, time, low, high)

    def _array(self, record: Any, values: Any) -> wp.array:
        if len(values):
            return wp.array(values, dtype=record, device=self._device)
        return wp.zeros(0, dtype=record, device=self._device)


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


def _grids(wall: Sdf, units: Units, nodes: list[np.ndarray]) -> list[dict[str, Any]]:
    """One feature for each part of a wall; the rows of its nodes are appended to those that are there already."""
    found = []
    for values in wall.values:
        feature = {"shape": GRID, "point": wall.origin, "length": wall.spacing, "first": sum(map(len, nodes))}
        found.append({**feature, "size": wp.vec3i(*values.shape)})
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


def _plane(point: Any, normal: Any) -> dict[str, Any]:
    return {"shape": PLANE, "point": wp.vec3d(*point), "axis": wp.vec3d(*normal)}
