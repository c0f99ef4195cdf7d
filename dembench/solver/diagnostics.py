"""Figures of a state that say how matter moves: the layer of bodies at a moving wall."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

STEP = 1e-4
"""Step of the difference that gives the normal of a wall, in radii."""


@dataclass(frozen=True)
class WallLayer:
    """How the bodies next to a moving wall follow it.

    Attributes:
        bodies: Indices of the bodies of the layer, shape (k,).
        corotation: Mean velocity of their centres along the motion of the wall over the velocity of a body that is
            fixed to the wall at the same place [-]: 1 where the layer moves with the wall, 0 where it stays behind.
        slip: Mean velocity along the motion of the wall by which the wall passes the surface of a body at the point
            next to it [m/s]: 0 for a layer that sticks to the wall and also for one that rolls on it.
    """

    bodies: np.ndarray
    corotation: float
    slip: float


def wall_layer(
    wall: Any,
    thickness: float,
    position: np.ndarray,
    velocity: np.ndarray,
    angular_velocity: np.ndarray,
    radius: np.ndarray,
) -> WallLayer:
    """Kinematics of the bodies whose surface is within a distance of a wall, such as the grains at a drum.

    Args:
        wall: A wall with `signed_distance` and a constant motion that leaves it where it is.
        thickness: Gap between the surface of a body and the wall up to which the body belongs to the layer [m].
        position, velocity, angular_velocity: [m], [m/s], [rad/s], shape (n, 3).
        radius: Radii [m], shape (n,).

    Raises:
        ValueError: The wall does not move.
    """
    if wall.motion is None or not (any(wall.motion.velocity) or any(wall.motion.angular_velocity)):
        raise ValueError(f"wall {wall.name} does not move; accepted are walls with a velocity or an angular velocity")
    distance = wall.signed_distance(position)
    bodies = np.flatnonzero(distance - radius < thickness)
    if not len(bodies):
        return WallLayer(bodies, np.nan, np.nan)
    x, r = position[bodies], radius[bodies]
    normal = np.empty_like(x)
    for axis in range(3):
        step = np.zeros_like(x)
        step[:, axis] = STEP * r
        normal[:, axis] = wall.signed_distance(x + step) - wall.signed_distance(x - step)
    normal /= np.linalg.norm(normal, axis=1)[:, None]

    def carried(points: np.ndarray) -> np.ndarray:
        motion = wall.motion
        return np.array(motion.velocity) + np.cross(motion.angular_velocity, points - np.array(motion.centre))

    here = carried(x)
    speed = np.linalg.norm(here, axis=1)
    direction = here / speed[:, None]
    surface = velocity[bodies] + np.cross(angular_velocity[bodies], -r[:, None] * normal)
    past = carried(x - distance[bodies][:, None] * normal) - surface
    return WallLayer(
        bodies=bodies,
        corotation=float(((velocity[bodies] * direction).sum(axis=1) / speed).mean()),
        slip=float((past * direction).sum(axis=1).mean()),
    )
