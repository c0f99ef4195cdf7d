"""Walls of triangles."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, PlainSerializer

from dembench.scene.wall import Wall


def _triangles(value: Any) -> np.ndarray:
    array = np.array(value, dtype=np.float64)
    if array.ndim != 3 or array.shape[1:] != (3, 3) or len(array) == 0:
        raise ValueError(f"triangles must have shape (n, 3, 3) with n > 0, not {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"triangle {int(np.argwhere(~np.isfinite(array))[0][0])} has a coordinate that is not finite")
    array.setflags(write=False)
    return array


Triangles = Annotated[
    Any,
    BeforeValidator(_triangles),
    PlainSerializer(lambda array: array.tolist(), return_type=list),
    Field(json_schema_extra={"type": "array", "minItems": 1, "items": {"type": "array", "minItems": 3, "maxItems": 3}}),
]


class Mesh(Wall):
    """A surface of triangles; the void is on the side of their normals (counter-clockwise order).

    The in-tree solvers take it as a thin sheet: a particle touches it from the side on which its centre is.

    Attributes:
        triangles: Vertices [m], shape (n, 3, 3).
    """

    kind: Literal["mesh"] = "mesh"
    triangles: Triangles

    def __hash__(self) -> int:
        return hash((self.name, self.material, self.triangles.tobytes()))

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Mesh)
            and (self.name, self.material, self.motion) == (other.name, other.material, other.motion)
            and np.array_equal(self.triangles, other.triangles)
        )

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """Distance of points [m], shape (n, 3), to the nearest triangle, signed by its normal [m], shape (n,)."""
        points = np.asarray(points, dtype=np.float64)
        best = np.full(len(points), np.inf)
        side = np.zeros(len(points))
        tie = 1e-12 * float(np.abs(self.triangles).max())
        for triangle in self.triangles:
            offset = points - closest_points(points, triangle)
            distance = np.linalg.norm(offset, axis=1)
            normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
            own_side = offset @ normal / (np.linalg.norm(normal) * np.maximum(distance, tie))
            # At a shared edge several triangles are equally near; the one seen most from the front knows the side.
            nearer = (distance < best - tie) | ((distance <= best + tie) & (np.abs(own_side) > np.abs(side)))
            side = np.where(nearer, own_side, side)
            best = np.minimum(best, distance)
        return np.where(side < 0, -best, best)

    def triangulate(self) -> np.ndarray:
        """The triangles themselves, shape (n, 3, 3)."""
        return self.triangles


def closest_points(points: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """Closest points of a triangle [m], shape (n, 3): the projection, or the nearest point of the three edges."""
    a, b, c = triangle
    normal = np.cross(b - a, c - a)
    normal = normal / np.linalg.norm(normal)
    projected = points - ((points - a) @ normal)[:, None] * normal
    inside = np.ones(len(points), dtype=bool)
    candidates, distances = [], []
    for p, q in ((a, b), (b, c), (c, a)):
        edge = q - p
        inside &= (projected - p) @ np.cross(normal, edge) >= 0
        t = np.clip((points - p) @ edge / (edge @ edge), 0, 1)
        nearest = p + t[:, None] * edge
        candidates.append(nearest)
        distances.append(np.linalg.norm(points - nearest, axis=1))
    edge_point = np.array(candidates)[np.argmin(distances, axis=0), np.arange(len(points))]
    return np.where(inside[:, None], projected, edge_point)
