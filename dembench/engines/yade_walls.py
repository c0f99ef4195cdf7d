"""Walls in Yade: triangles, one for a plane, polygons for round walls.

Each triangle has contacts of its own: a body that touches two of them at their common edge is pushed by both, and what
a contact remembers does not pass to the next triangle. A grain of 1.5 mm radius that hit a flat mesh at .5 m/s (e = .4)
came back with .297 of its speed where it met the edge of two triangles, and with .400 from a quarter of its radius on.

A ball of 5 mm that rolled in a trough of 5 cm and 71 sides from 60 degrees on turned at 57.4 on the far side.

A wall that stays where it is while its surface moves (a belt, a drum that turns about its axis) has a velocity, and a
mask that keeps the integrator from moving it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from dembench.engines.flat_walls import axes_of, moves, planes_of, shaken, triangle
from dembench.engines.round_walls import polygon
from dembench.scene import Box, Cylinder, Frustum, Mesh, Motion, Plane, Scene
from dembench.scene.walls import WallShape

MOVES, STAYS = 1, 2
"""Masks of walls that the integrator moves, and of walls that stay."""


@dataclass(frozen=True)
class Built:
    """A wall as the script makes it.

    Attributes:
        name: Name of the scene's wall.
        material: Name of its material.
        mask: MOVES or STAYS.
        parts: Calls that make its bodies.
        velocity, spin, centre: Its motion [m/s, rad/s, m]; no spin where it does not turn.
        amplitude, rate: Of its oscillation [m, rad/s].
        triangles: Triangles that stand in a file [m], shape (n, 3, 3).
    """

    name: str
    material: str
    mask: int
    parts: list[str]
    velocity: tuple[float, ...] = (0.0, 0.0, 0.0)
    spin: tuple[float, ...] = ()
    centre: tuple[float, ...] = ()
    amplitude: tuple[float, ...] = ()
    rate: float = 0.0
    triangles: np.ndarray = field(default_factory=lambda: np.empty((0, 3, 3)))

    @property
    def moves(self) -> bool:
        """Whether it has a velocity of its own from the start."""
        return bool(self.spin) or any(self.velocity)

    @property
    def file(self) -> str | None:
        """Name of the file of its triangles, or None."""
        return f"wall_{self.name}.txt" if len(self.triangles) else None


def refused(scene: Scene) -> list[str]:
    """Walls that the adapter does not write, one line each."""
    faults = []
    for wall in scene.walls:
        motion = wall.motion or Motion()
        if not isinstance(wall, Plane | Box | Cylinder | Frustum | Mesh):
            faults.append(f"wall {wall.name}: a signed distance on a grid")
        elif any(motion.angular_velocity) and not motion.surface and moves(wall):
            faults.append(f"motion of wall {wall.name}: a rotation, where the wall does not stay in its place")
        elif motion.surface and shaken(motion):
            faults.append(f"motion of wall {wall.name}: a surface that oscillates while the wall stays")
        elif any(scene.domain.periodic) and (moves(wall) or len(axes_of(wall)) != 1 or across(scene) is None):
            faults.append(f"wall {wall.name}: in a periodic domain, planes across one axis that stay are accepted")
    return faults


def across(scene: Scene) -> int | None:
    """The axis that all planes of a scene lie across, or None.

    In a periodic domain the program finds the bodies that touch a triangle longer than the period by their places along
    the axis by which it sorts first, so that axis must be this one: sorted by another, 1000 grains at rest on a floor
    fell through it.
    """
    axes = set().union(*map(axes_of, scene.walls))
    return axes.pop() if len(axes) == 1 else None


def built(scene: Scene, segments: int) -> list[Built]:
    """Every wall of a scene as the script makes it, round ones with that many sides."""
    made = []
    for wall in scene.walls:
        mask = MOVES if wall.motion is None or moves(wall) else STAYS
        motion = wall.motion or Motion()
        turns, oscillates = any(motion.angular_velocity), shaken(motion)
        made.append(
            Built(
                wall.name,
                wall.material,
                mask,
                [_plane(plane, scene, mask) for plane in planes_of(wall)],
                velocity=motion.velocity,
                spin=motion.angular_velocity if turns else (),
                centre=motion.centre if turns else (),
                amplitude=motion.amplitude if oscillates else (),
                rate=2 * math.pi * motion.frequency if oscillates else 0.0,
                triangles=_triangles(wall, segments),
            )
        )
    return made


def _triangles(wall: WallShape, segments: int) -> np.ndarray:
    """Triangles of a wall that is no plane [m], shape (n, 3, 3)."""
    if isinstance(wall, Cylinder | Frustum):
        return polygon(wall, segments)
    return wall.triangulate() if isinstance(wall, Mesh) else np.empty((0, 3, 3))


def _plane(plane: Plane, scene: Scene, mask: int) -> str:
    """The call that makes a plane: one triangle that holds the plane's part in the domain.

    A `wall` of the program is infinite, but has the radius less the whole overlap as lever of friction, and lies across
    an axis.
    """
    corners = ", ".join(map(_vector, triangle(plane, scene)))
    return f'facet([{corners}], material="{plane.material}", mask={mask})'


def _vector(values: tuple[float, ...] | np.ndarray) -> str:
    return f"({', '.join(repr(float(value)) for value in values)})"
