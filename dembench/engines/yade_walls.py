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

from dembench.engines.round_walls import axis_of, polygon
from dembench.scene import Box, Cylinder, Frustum, Mesh, Motion, Plane, Scene
from dembench.scene.walls import WallShape, geometry_moves

MOVES, STAYS = 1, 2
"""Masks of walls that the integrator moves, and of walls that stay."""
PERIODS = 1000
"""Lengths of a periodic domain that bodies may go along a plane."""


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
        elif any(motion.angular_velocity) and not motion.surface and _moves(wall):
            faults.append(f"motion of wall {wall.name}: a rotation, where the wall does not stay in its place")
        elif motion.surface and _shaken(motion):
            faults.append(f"motion of wall {wall.name}: a surface that oscillates while the wall stays")
        elif any(scene.domain.periodic) and (_moves(wall) or len(_axes(wall)) != 1 or across(scene) is None):
            faults.append(f"wall {wall.name}: in a periodic domain, planes across one axis that stay are accepted")
    return faults


def across(scene: Scene) -> int | None:
    """The axis that all planes of a scene lie across, or None.

    In a periodic domain the program finds the bodies that touch a triangle longer than the period by their places along
    the axis by which it sorts first, so that axis must be this one: sorted by another, 1000 grains at rest on a floor
    fell through it.
    """
    axes = set().union(*map(_axes, scene.walls))
    return axes.pop() if len(axes) == 1 else None


def _axes(wall: WallShape) -> set[int | None]:
    """The axes that the planes of a wall lie across; None among them for what lies across none."""
    return {axis_of(plane.normal) for plane in _planes(wall)} or {None}


def meshed(scene: Scene) -> list[str]:
    """Names of the walls of more than one triangle for a face."""
    return [wall.name for wall in scene.walls if not isinstance(wall, Plane | Box)]


def built(scene: Scene, segments: int) -> list[Built]:
    """Every wall of a scene as the script makes it, round ones with that many sides."""
    made = []
    for wall in scene.walls:
        mask = MOVES if wall.motion is None or _moves(wall) else STAYS
        motion = wall.motion or Motion()
        turns, shaken = any(motion.angular_velocity), _shaken(motion)
        made.append(
            Built(
                wall.name,
                wall.material,
                mask,
                [_plane(plane, scene, mask) for plane in _planes(wall)],
                velocity=motion.velocity,
                spin=motion.angular_velocity if turns else (),
                centre=motion.centre if turns else (),
                amplitude=motion.amplitude if shaken else (),
                rate=2 * math.pi * motion.frequency if shaken else 0.0,
                triangles=_triangles(wall, segments),
            )
        )
    return made


def _moves(wall: WallShape) -> bool:
    """Whether a wall changes its place."""
    planes = _planes(wall)
    return any(map(geometry_moves, planes)) if planes else geometry_moves(wall)


def _planes(wall: WallShape) -> list[Plane]:
    if isinstance(wall, Plane):
        return [wall]
    return wall.planes() if isinstance(wall, Box) else []


def _triangles(wall: WallShape, segments: int) -> np.ndarray:
    """Triangles of a wall that is no plane [m], shape (n, 3, 3)."""
    if isinstance(wall, Cylinder | Frustum):
        return polygon(wall, segments)
    return wall.triangulate() if isinstance(wall, Mesh) else np.empty((0, 3, 3))


def _way(motion: Motion | None, duration: float) -> float:
    """The furthest that a motion without rotation takes a wall in a time [s]: [m]."""
    if motion is None or motion.surface:
        return 0.0
    return math.hypot(*motion.velocity) * duration + math.hypot(*motion.amplitude)


def _shaken(motion: Motion) -> bool:
    return motion.frequency > 0 and any(motion.amplitude)


def _plane(plane: Plane, scene: Scene, mask: int) -> str:
    """The call that makes a plane: one triangle that holds the plane's part in the domain.

    It needs no inner edges. A `wall` of the program is infinite, but has the radius less the whole overlap as lever of
    friction, and lies across an axis.
    """
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
    corners = [foot + reach * (math.cos(a) * u + math.sin(a) * v) for a in angles]
    return f'facet([{", ".join(map(_vector, corners))}], material="{plane.material}", mask={mask})'


def _vector(values: tuple[float, ...] | np.ndarray) -> str:
    return f"({', '.join(repr(float(value)) for value in values)})"
