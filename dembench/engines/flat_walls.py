"""Planes as triangles, for programs whose walls are triangles: one holds all of a plane in the domain.

It needs no inner edges, at which what a contact remembers would be lost.
"""

from __future__ import annotations

import math

import numpy as np

from dembench.engines.round_walls import axis_of
from dembench.scene import Box, Motion, Plane, Scene
from dembench.scene.walls import WallShape, geometry_moves

PERIODS = 1000
"""Lengths of a periodic domain that bodies may go along a plane."""


def planes_of(wall: WallShape) -> list[Plane]:
    """The planes that a wall consists of, those of the faces of a box; none where it is no flat wall."""
    if isinstance(wall, Plane):
        return [wall]
    return wall.planes() if isinstance(wall, Box) else []


def moves(wall: WallShape) -> bool:
    """Whether a wall changes its place."""
    planes = planes_of(wall)
    return any(map(geometry_moves, planes)) if planes else geometry_moves(wall)


def meshed(scene: Scene) -> list[str]:
    """Names of the walls of more than one triangle for a face."""
    return [wall.name for wall in scene.walls if not isinstance(wall, Plane | Box)]


def axes_of(wall: WallShape) -> set[int | None]:
    """The axes that the planes of a wall lie across; None among them for what lies across none."""
    return {axis_of(plane.normal) for plane in planes_of(wall)} or {None}


def shaken(motion: Motion) -> bool:
    """Whether a motion oscillates."""
    return motion.frequency > 0 and any(motion.amplitude)


def triangle(plane: Plane, scene: Scene) -> np.ndarray:
    """Corners of a triangle that holds the plane's part in the domain, wherever the plane moves [m], shape (3, 3)."""
    low, high = np.array(scene.domain.lower), np.array(scene.domain.upper)
    middle, normal = (low + high) / 2, np.array(plane.normal)
    foot = middle - plane.signed_distance(middle[None])[0] * normal
    # A circle about the foot of the domain's middle holds the plane's part in the domain, wherever the plane moves; an
    # equilateral triangle holds a circle of half the distance of its corners. In periodic domains positions run on.
    reach = 2 * (float(np.linalg.norm(high - low)) + _way(plane.motion, scene.duration))
    reach *= PERIODS if any(scene.domain.periodic) else 1
    square = plane.model_copy(update={"point": (0.0, 0.0, 0.0)}).triangulate()
    u, v = (square[0, 1] - square[0, 0]) / 2, (square[0, 2] - square[0, 1]) / 2
    angles = 2 * math.pi * np.arange(3) / 3
    return np.array([foot + reach * (math.cos(a) * u + math.sin(a) * v) for a in angles])


def _way(motion: Motion | None, duration: float) -> float:
    """The furthest that a motion without rotation takes a wall in a time [s]: [m]."""
    if motion is None or motion.surface:
        return 0.0
    return math.hypot(*motion.velocity) * duration + math.hypot(*motion.amplitude)
