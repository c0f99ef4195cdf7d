"""Shapes of particles that are no spheres: rigid clumps of spheres, and grains given by a signed distance on a grid.

A shape is given in a frame of its own. The position of a body is its centre of mass, its orientation turns that frame.
"""

from __future__ import annotations

import hashlib
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, PlainSerializer, model_validator
from scipy.spatial import cKDTree

from dembench.scene.base import Model, Positive, Vector
from dembench.scene.mesh import Mesh
from dembench.scene.sdf import Distance
from dembench.scene.solids import Solid, inside_level_set, level_set, union_of_spheres

Sphere = tuple[float, float, float, Positive]


class Clump(Model):
    """Spheres that are joined rigidly; where they overlap, the material counts once.

    Attributes:
        spheres: Centre and radius (x, y, z, r) of every sphere [m].
    """

    kind: Literal["clump"] = "clump"
    spheres: Annotated[tuple[Sphere, ...], Field(min_length=1)]

    @classmethod
    def dumbbell(cls, radius: float, distance: float) -> Clump:
        """Two spheres of a radius [m], their centres at a distance [m] along z."""
        return cls(spheres=((0, 0, -distance / 2, radius), (0, 0, distance / 2, radius)))

    @classmethod
    def rod(cls, radius: float, length: float, spheres: int) -> Clump:
        """A row of spheres of a radius [m] along z, `length` [m] from end to end."""
        heights = np.linspace(radius - length / 2, length / 2 - radius, spheres)
        return cls(spheres=tuple((0, 0, float(z), radius) for z in heights))

    @cached_property
    def solid(self) -> Solid:
        """Volume, centre and inertia of the union of the spheres."""
        return union_of_spheres(np.array(self.spheres))

    @cached_property
    def bounding_radius(self) -> float:
        """Radius of the sphere about the centre of mass that holds the clump [m]."""
        return _bound(np.array(self.spheres), self.solid.centre)

    @property
    def contact_radius(self) -> float:
        """Smallest radius of curvature that enters the contact law [m]: that of the smallest sphere."""
        return min(s[3] for s in self.spheres)

    def probes(self) -> np.ndarray:
        """Spheres that touch other bodies and walls, relative to the centre of mass, rows (x, y, z, r) [m]."""
        return np.array(self.spheres) - np.append(self.solid.centre, 0)


def _field(value: Any) -> np.ndarray:
    array = np.array(value, dtype=np.float64)
    if array.ndim != 3 or min(array.shape) < 3:
        raise ValueError(f"values must have shape (nx, ny, nz) with at least 3 nodes per axis, not {array.shape}")
    return _frozen(array, "values")


def _points(value: Any) -> np.ndarray:
    array = np.array(value, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] not in (3, 4) or len(array) == 0:
        raise ValueError(f"points must have shape (k, 3) or (k, 4) with k > 0, not {array.shape}")
    if array.shape[1] == 3:
        array = np.hstack([array, np.zeros((len(array), 1))])
    if (array[:, 3] < 0).any():
        bad = int(np.argmin(array[:, 3]))
        raise ValueError(f"points: row {bad} has the radius {array[bad, 3]:g} m; it must not be negative")
    return _frozen(array, "points")


def _frozen(array: np.ndarray, what: str) -> np.ndarray:
    if not np.isfinite(array).all():
        bad = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"{what}{list(bad)} is {array[bad]}; all must be finite numbers")
    array.setflags(write=False)
    return array


def _nested(depth: int) -> Any:
    items: dict[str, Any] = {"type": "number"}
    for _ in range(depth):
        items = {"type": "array", "items": items}
    return Field(json_schema_extra=items)


_as_list = PlainSerializer(lambda array: array.tolist(), return_type=list)
FieldValues = Annotated[Any, BeforeValidator(_field), _as_list, _nested(3)]
Points = Annotated[Any, BeforeValidator(_points), _as_list, _nested(2)]


class Grain(Model):
    """A body given by its signed distance on a grid, and by small spheres on its surface that probe other bodies.

    Where two grains meet, the probes of each are looked up in the field of the other. A probe is a sphere that touches
    the surface from inside; radius 0 makes it a point. Probes with a radius bridge flat and gently curved surfaces
    exactly; sharp edges need points.

    Attributes:
        values: Signed distance to the surface [m], negative inside, shape (nx, ny, nz); linear between the nodes.
        origin: Position of node (0, 0, 0) [m].
        spacing: Distance of the nodes [m].
        points: Probes (x, y, z, r) [m], shape (k, 4); three columns mean radius 0.
        weight: Share of a full contact that a probe carries in the soft-sphere law [-]: a face on which n probes rest
            is n * weight times as stiff as one contact.
    """

    kind: Literal["grain"] = "grain"
    values: FieldValues
    origin: Vector
    spacing: Positive
    points: Points
    weight: Annotated[float, Field(gt=0, le=1)] = 1.0

    @model_validator(mode="after")
    def _closed(self) -> Grain:
        faces = [self.values.take(side, axis=axis) for axis in range(3) for side in (0, -1)]
        if min(face.min() for face in faces) <= 0:
            raise ValueError("values must be positive on the outer nodes of the grid: the surface must lie inside it")
        if not (self.values < 0).any():
            raise ValueError("values must be negative somewhere: there is no node inside the surface")
        return self

    @classmethod
    def from_function(
        cls,
        f: Distance,
        lower: Vector,
        upper: Vector,
        spacing: float,
        points: np.ndarray | None = None,
        probe: float = np.inf,
        distance: float | None = None,
        weight: float = 1.0,
    ) -> Grain:
        """A grain from a signed-distance function.

        Args:
            f: Takes points [m], shape (n, 3), and returns signed distances [m], negative inside, shape (n,).
            lower, upper: Box of the grid [m]. It must reach beyond the surface by the largest probe or sphere that
                the grain meets.
            spacing: Distance of the nodes [m].
            points: Probes, see the class; None takes spheres that touch the surface from inside.
            probe: Largest radius of the probes that are made [m]; without it they are as large as fits, so that smooth
                surfaces are smooth to walls and other bodies.
            distance: Distance of the probes that are made [m]; None takes 3 spacings.
            weight: See the class.
        """
        cells = np.ceil((np.array(upper) - np.array(lower)) / spacing - 1e-9).astype(int)
        axes = [low + spacing * np.arange(n + 1) for low, n in zip(lower, cells, strict=True)]
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        values = np.asarray(f(nodes.reshape(-1, 3))).reshape(nodes.shape[:3])
        if points is None:
            surface = level_set(values, np.array(lower), spacing)
            points = inner_spheres(f, surface, probe, distance or 3 * spacing)
        return cls(values=values, origin=tuple(lower), spacing=spacing, points=points, weight=weight)

    @classmethod
    def box(cls, size: Vector, rounding: float, spacing: float, probes: int = 5, reach: float | None = None) -> Grain:
        """A box about the origin with rounded edges.

        Args:
            size: Edges [m].
            rounding: Radius of the edges and of the probes [m].
            spacing: Distance of the nodes [m].
            probes: Probes along an edge; every face has their square.
            reach: How far the field reaches beyond the surface [m]; None takes twice the rounding.
        """
        inner = np.array(size) / 2 - rounding
        if not (inner > 0).all():
            raise ValueError(f"rounding {rounding:g} m must be below half of the shortest edge {min(size):g} m")
        corner = np.array(size) / 2 + (2 * rounding if reach is None else reach) + spacing
        corner = spacing * np.ceil(corner / spacing)  # nodes as symmetric as the box
        steps = np.linspace(-1, 1, probes)
        lattice = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
        shell = lattice[np.abs(lattice).max(axis=1) == 1] * inner
        points = np.hstack([shell, np.full((len(shell), 1), rounding)])

        def distance(x: np.ndarray) -> np.ndarray:
            beyond = np.abs(x) - inner
            return np.linalg.norm(np.maximum(beyond, 0), axis=-1) + np.minimum(beyond.max(axis=-1), 0) - rounding

        low, high = tuple(-corner), tuple(corner)
        return cls.from_function(distance, low, high, spacing, points, weight=1 / probes**2)

    @classmethod
    def from_stl(
        cls,
        path: Path | str,
        spacing: float,
        scale: float = 1.0,
        probe: float = np.inf,
        distance: float | None = None,
        reach: float = 0.0,
        weight: float = 1.0,
    ) -> Grain:
        """A grain from a file with a closed surface of triangles (STL, and what else trimesh reads).

        Probes are the vertices and points on the triangles, at most `distance` apart.

        Args:
            path: The file.
            spacing: Distance of the nodes [m].
            scale: Metres per unit of the file.
            probe: Largest radius of the probes [m]; without it they are as large as fits.
            distance: Largest distance of the probes along an edge [m]; None takes 3 spacings.
            reach: How far the field reaches beyond the surface at least [m]: the radius of the largest probe or sphere
                that the grain meets.
            weight: See the class.

        Raises:
            ValueError: The surface is not closed or its triangles do not all face outward.
        """
        import trimesh

        mesh = trimesh.load_mesh(path)
        if not mesh.is_volume:
            raise ValueError(f"{path}: the surface must be closed and its triangles must all face outward")
        mesh.apply_scale(scale)
        wall = Mesh(name="surface", material="surface", triangles=mesh.triangles)

        every = distance or 3 * spacing
        vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, every)
        margin = reach + 3 * spacing
        low, high = mesh.bounds[0] - margin, mesh.bounds[1] + margin
        points = inner_spheres(wall.signed_distance, vertices[faces], probe, every / 2, corners=mesh.vertices)
        return cls.from_function(wall.signed_distance, tuple(low), tuple(high), spacing, points, weight=weight)

    @cached_property
    def surface(self) -> np.ndarray:
        """Triangles of the surface, normals outward, shape (n, 3, 3) [m]."""
        return level_set(self.values, np.array(self.origin), self.spacing)

    @cached_property
    def solid(self) -> Solid:
        """Volume, centre and inertia, second order in the spacing: a sphere of radius 20 spacings lacks 0.13 %."""
        return inside_level_set(self.values, np.array(self.origin), self.spacing)

    @cached_property
    def bounding_radius(self) -> float:
        """Radius of the sphere about the centre of mass that holds the grain [m]."""
        corners = self.surface.reshape(-1, 3)
        spheres = np.vstack([np.hstack([corners, np.zeros((len(corners), 1))]), self.points])
        return _bound(spheres, self.solid.centre)

    @cached_property
    def contact_radius(self) -> float:
        """Radius of curvature that enters the contact law [m]: that of the sphere of the same volume."""
        return float((3 * self.solid.volume / (4 * np.pi)) ** (1 / 3))

    @cached_property
    def reach(self) -> float:
        """How far the field reaches beyond the surface [m]: the largest probe that it can be asked about."""
        faces = [self.values.take(side, axis=axis) for axis in range(3) for side in (0, -1)]
        return float(min(face.min() for face in faces))

    def probes(self) -> np.ndarray:
        """Spheres that touch other bodies and walls, relative to the centre of mass, rows (x, y, z, r) [m]."""
        return self.points - np.append(self.solid.centre, 0)

    def _digest(self) -> str:
        digest = hashlib.sha256(repr((self.values.shape, self.origin, self.spacing, self.weight)).encode())
        digest.update(self.values.tobytes() + self.points.tobytes())
        return digest.hexdigest()

    def __hash__(self) -> int:
        return hash(self._digest())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Grain) and self._digest() == other._digest()


Shape = Annotated[Clump | Grain, Field(discriminator="kind")]


def inner_spheres(
    f: Distance,
    triangles: np.ndarray,
    radius: float,
    distance: float,
    corners: np.ndarray | None = None,
) -> np.ndarray:
    """Spheres that touch a surface from inside, rows (x, y, z, r) [m]: as large as fit there, at most `radius` [m].

    They touch at `corners` and at vertices of the triangles, which are thinned to a distance [m]. Sharp edges get
    radius 0, and spheres that are the same are given once.
    """
    vertices = triangles.reshape(-1, 3)
    if corners is not None:
        vertices = np.vstack([corners, vertices])
    vertices = vertices[_thinned(vertices, distance)]
    small = 1e-4 * distance
    slope = np.stack([f(vertices + small * e) - f(vertices - small * e) for e in np.eye(3)], axis=-1)
    normal = slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12 * small)
    vertices = vertices - f(vertices)[:, None] * normal
    radius = min(radius, float(np.ptp(vertices, axis=0).max()))
    fitting, beyond = np.zeros(len(vertices)), np.full(len(vertices), 2 * radius)
    for _ in range(45 if radius else 0):
        # a sphere that touches here from inside holds all smaller ones, so bisection finds the largest
        middle = (fitting + beyond) / 2
        fits = -f(vertices - middle[:, None] * normal) >= middle * (1 - 1e-6)
        fitting, beyond = np.where(fits, middle, fitting), np.where(fits, beyond, middle)
    fitting = np.minimum(fitting, radius)
    fitting[fitting < 1e-3 * distance] = 0
    spheres = np.hstack([vertices - fitting[:, None] * normal, fitting[:, None]])
    return spheres[_thinned(spheres, 1e-3 * distance)]


def _thinned(points: np.ndarray, distance: float) -> np.ndarray:
    """Indices of points of which no two are nearer than a distance; the first of a crowd stays."""
    kept = np.ones(len(points), dtype=bool)
    near = cKDTree(points).query_ball_point(points, distance * (1 - 1e-9))
    for k, others in enumerate(near):
        if kept[k]:
            kept[[j for j in others if j > k]] = False
    return np.flatnonzero(kept)


def _bound(spheres: np.ndarray, centre: np.ndarray) -> float:
    return float((np.linalg.norm(spheres[:, :3] - centre, axis=1) + spheres[:, 3]).max())
