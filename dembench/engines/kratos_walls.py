"""Walls in Kratos: rigid faces, one triangle for a plane, polygons for round walls.

A body that touches a face is not pushed by the edges of that face, nor by those that other faces hide: a flat mesh
moves a grain as the plane does, on the common edge of two triangles, too. What a contact remembers does not pass from
one triangle to the next. A ball of 5 mm that rolled in a trough of 5 cm and 71 sides from 60 degrees on turned at 57.5
on the far side.

A wall that changes its place is moved by the program, as `RIGID_BODY_MOTION` of its part of the model. One that stays
in its place while its surface moves (a belt, a drum that turns about its axis) gets the velocities of its corners once,
by the script: the program's own `FIXED_MESH_OPTION` turns those of a rotation on with the time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dembench.engines.flat_walls import moves, planes_of, shaken, triangle
from dembench.engines.round_walls import polygon
from dembench.scene import Box, Cylinder, Frustum, Mesh, Motion, Plane, Scene
from dembench.scene.walls import WallShape


@dataclass(frozen=True)
class Built:
    """A wall as the deck has it.

    Attributes:
        name: Name of the scene's wall.
        material: Name of its material.
        triangles: Corners [m], shape (n, 3, 3).
        moves: Whether it changes its place.
        carries: Whether it stays there while its surface moves.
        velocity, spin, centre: Its motion [m/s, rad/s, m]; of an oscillation the largest velocity.
        period: Period of its oscillation [s]; 0 where it has none.
    """

    name: str
    material: str
    triangles: np.ndarray
    moves: bool
    carries: bool
    velocity: tuple[float, ...]
    spin: tuple[float, ...]
    centre: tuple[float, ...]
    period: float


def refused(scene: Scene) -> list[str]:
    """Walls that the adapter does not write, one line each."""
    faults = []
    for wall in scene.walls:
        motion = wall.motion or Motion()
        if not isinstance(wall, Plane | Box | Cylinder | Frustum | Mesh):
            faults.append(f"wall {wall.name}: a signed distance on a grid")
        elif any(motion.angular_velocity) and moves(wall) and planes_of(wall):
            faults.append(f"motion of wall {wall.name}: a rotation, where the wall does not stay in its place")
        elif motion.surface and shaken(motion):
            faults.append(f"motion of wall {wall.name}: a surface that oscillates while the wall stays")
        elif shaken(motion) and any(motion.velocity):
            faults.append(f"motion of wall {wall.name}: an oscillation and a constant velocity together")
        elif any(scene.domain.periodic) and not _along_periods(wall, scene):
            faults.append(f"wall {wall.name}: in a periodic domain, planes along the periodic axes are accepted")
    return faults


def _along_periods(wall: WallShape, scene: Scene) -> bool:
    """Whether a wall consists of planes that are the same in all periods."""
    planes, axes = planes_of(wall), np.flatnonzero(scene.domain.periodic)
    return bool(planes) and not any(np.array(plane.normal)[axes].any() for plane in planes)


def built(scene: Scene, segments: int) -> list[Built]:
    """Every wall of a scene as the deck has it, round ones with that many sides."""
    made = []
    for wall in scene.walls:
        motion = wall.motion or Motion()
        velocity: tuple[float, ...] = motion.velocity
        period = 0.0
        if shaken(motion):  # amplitude sin(w t) is what the program makes of the velocity w amplitude cos(w t)
            velocity = tuple(float(v) for v in 2 * np.pi * motion.frequency * np.array(motion.amplitude))
            period = 1 / motion.frequency
        going = any(velocity) or any(motion.angular_velocity)
        made.append(
            Built(
                wall.name,
                wall.material,
                _triangles(wall, scene, segments),
                moves=bool(going and moves(wall)),
                carries=bool(going and not moves(wall)),
                velocity=velocity,
                spin=motion.angular_velocity,
                centre=motion.centre,
                period=period,
            )
        )
    return made


def _triangles(wall: WallShape, scene: Scene, segments: int) -> np.ndarray:
    """Triangles of a wall [m], shape (n, 3, 3)."""
    if planes := planes_of(wall):
        return np.array([triangle(plane, scene) for plane in planes])
    if isinstance(wall, Cylinder | Frustum):
        return polygon(wall, segments)
    assert isinstance(wall, Mesh), "signed distances are refused"
    return wall.triangulate()
