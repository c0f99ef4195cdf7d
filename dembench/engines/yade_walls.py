"""Walls in Yade: triangles, one for a plane.

A wall that stays where it is while its surface moves (a belt, a drum that turns about its axis) has a velocity and a
mask that keeps the integrator from moving it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from dembench.scene import Box, Motion, Plane, Scene
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
        return f"{self.name}.txt" if len(self.triangles) else None


def refused(scene: Scene) -> list[str]:
    """Walls that the adapter does not write, one line each."""
    faults = []
    for wall in scene.walls:
        if not isinstance(wall, Plane | Box):
            faults.append(f"wall {wall.name}: {wall.kind}")
        elif (motion := wall.motion) is not None:
            if not motion.surface and any(_turned(plane) for plane in _planes(wall)):
                faults.append(f"motion of wall {wall.name}: a rotation, where the wall does not stay in its place")
            elif any(scene.domain.periodic) and _mask(wall) == MOVES:
                faults.append(f"motion of wall {wall.name}: a wall that moves in a periodic domain")
            elif motion.surface and _shaken(motion):
                faults.append(f"motion of wall {wall.name}: a surface that oscillates while the wall stays")
    return faults


def built(scene: Scene) -> list[Built]:
    """Every wall of a scene as the script makes it."""
    made = []
    for wall in scene.walls:
        mask = _mask(wall)
        parts = [_plane(plane, scene, mask) for plane in _planes(wall)]
        motion = wall.motion or Motion()
        turns = any(motion.angular_velocity)
        shaken = _shaken(motion)
        made.append(
            Built(
                wall.name,
                wall.material,
                mask,
                parts,
                velocity=motion.velocity,
                spin=motion.angular_velocity if turns else (),
                centre=motion.centre if turns else (),
                amplitude=motion.amplitude if shaken else (),
                rate=2 * math.pi * motion.frequency if shaken else 0.0,
            )
        )
    return made


def _mask(wall: WallShape) -> int:
    motion = wall.motion
    if motion is None:
        return MOVES
    moved = not motion.surface and any(geometry_moves(plane) for plane in _planes(wall))
    return MOVES if moved else STAYS


def _way(motion: Motion | None, duration: float) -> float:
    """The furthest that a motion without rotation takes a wall in a time [s]: [m]."""
    if motion is None or motion.surface:
        return 0.0
    return math.hypot(*motion.velocity) * duration + math.hypot(*motion.amplitude)


def _shaken(motion: Motion) -> bool:
    return motion.frequency > 0 and any(motion.amplitude)


def _turned(plane: Plane) -> bool:
    """Whether a rotation takes a plane elsewhere."""
    motion = plane.motion
    if motion is None or not any(motion.angular_velocity):
        return False
    return geometry_moves(plane)


def _planes(wall: WallShape) -> list[Plane]:
    if isinstance(wall, Plane):
        return [wall]
    return wall.planes() if isinstance(wall, Box) else []


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
