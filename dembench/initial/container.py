"""The space inside walls: its bounding box, and how far points are from the walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dembench.scene import Box, Cylinder, Frustum, Mesh, Plane
from dembench.scene.walls import WallShape


def enclosure(walls: Sequence[WallShape]) -> tuple[np.ndarray, np.ndarray]:
    """Bounding box of the space inside walls: lower and upper corner [m], shape (3,) each.

    It holds all walls of finite size, open ends included, and is cut by planes that are normal to an axis.

    Raises:
        ValueError: The walls do not bound the space in some direction, or leave none.
    """
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    for low, high in (_extent(wall) for wall in walls if not isinstance(wall, Plane)):
        lower, upper = np.minimum(lower, low), np.maximum(upper, high)
    unbounded = lower > upper
    lower[unbounded], upper[unbounded] = -np.inf, np.inf
    for wall in walls:
        if isinstance(wall, Plane) and np.count_nonzero(wall.normal) == 1:
            axis = int(np.flatnonzero(wall.normal)[0])
            if wall.normal[axis] > 0:
                lower[axis] = max(lower[axis], wall.point[axis])
            else:
                upper[axis] = min(upper[axis], wall.point[axis])
    names = ", ".join(wall.name for wall in walls) or "none"
    for axis in range(3):
        if not np.isfinite([lower[axis], upper[axis]]).all():
            raise ValueError(f"walls: {names} leave the container open without end along {'xyz'[axis]}; close it")
        if not lower[axis] < upper[axis]:
            raise ValueError(f"walls: {names} leave no space along {'xyz'[axis]}")
    return lower, upper


def clearance(walls: Sequence[WallShape], points: np.ndarray) -> np.ndarray:
    """Distance of points [m], shape (n, 3), to the nearest wall [m], shape (n,); negative behind any wall."""
    found = np.full(len(points), np.inf)
    for wall in walls:
        # what is behind one wall stays outside, whatever the others say
        inside = np.flatnonzero(found >= 0)
        found[inside] = np.minimum(found[inside], wall.signed_distance(points[inside]))
    return found


def _extent(wall: WallShape) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(wall, Box):
        return np.array(wall.lower), np.array(wall.upper)
    if isinstance(wall, Mesh):
        corners = wall.triangles.reshape(-1, 3)
        return corners.min(axis=0), corners.max(axis=0)
    if isinstance(wall, Cylinder | Frustum):
        ends = np.array([wall.start, wall.end])
        radii = [wall.radius] * 2 if isinstance(wall, Cylinder) else [wall.radius_start, wall.radius_end]
        axis = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        reach = np.outer(radii, np.sqrt(np.maximum(0, 1 - axis**2)))
        return (ends - reach).min(axis=0), (ends + reach).max(axis=0)
    raise ValueError(
        f"wall {wall.name}: a {wall.kind} cannot be filled; accepted are box, cylinder, frustum, mesh, plane"
    )
