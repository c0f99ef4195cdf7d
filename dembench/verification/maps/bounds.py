"""Theoretical bounds of the time step of explicit integration, independent of any engine.

A central difference with the frequency w and the damping ratio z, whose dashpot sees the velocity of half a step
before, is stable up to dt = (2/w) (sqrt(1 + z^2) - z): T. Belytschko 1983, in Computational Methods for Transient
Analysis, ch. 1; for contacts C. O'Sullivan & J. D. Bray 2004, doi 10.1108/02644400410519794; with damping S. J. Burns &
K. J. Hanley 2017, Int. J. Numer. Methods Eng. 110, 186.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dembench.verification.laws import damping_ratio


@dataclass(frozen=True)
class Pair:
    """Two elastic spheres of one material (Hertz; Mindlin 1949).

    Attributes:
        young: Young's modulus [Pa].
        poisson: Poisson's ratio [-].
        radii: [m].
        masses: [kg].
    """

    young: float
    poisson: float
    radii: tuple[float, float]
    masses: tuple[float, float]

    @property
    def radius(self) -> float:
        """Reduced radius [m]."""
        return 1 / sum(1 / r for r in self.radii)

    @property
    def mass(self) -> float:
        """Reduced mass [kg]."""
        return 1 / sum(1 / m for m in self.masses)

    @property
    def modulus(self) -> float:
        """Reduced Young's modulus E* [Pa]."""
        return self.young / (2 * (1 - self.poisson**2))

    @property
    def hertz(self) -> float:
        """Force per overlap^(3/2), 4/3 E* sqrt(R*) [N/m^1.5]."""
        return 4 / 3 * self.modulus * math.sqrt(self.radius)

    def impact_overlap(self, speed: float) -> float:
        """Largest overlap of an elastic impact, (5 m* v^2/(4 k))^(2/5) [m]."""
        return float((1.25 * self.mass * speed**2 / self.hertz) ** 0.4)

    def contact_time(self, speed: float) -> float:
        """Duration of an elastic impact, 2.9432 times overlap over speed [s]."""
        return 2.9432 * self.impact_overlap(speed) / speed

    def normal(self, overlap: float) -> float:
        """Normal stiffness at an overlap, 2 E* sqrt(R* overlap) [N/m]."""
        return 2 * self.modulus * math.sqrt(self.radius * overlap)

    def tangential(self, overlap: float) -> float:
        """Tangential stiffness at an overlap, 8 G* sqrt(R* overlap) with G* = G/(2 (2 - nu)) [N/m]."""
        shear = self.young / (4 * (1 + self.poisson) * (2 - self.poisson))
        return 8 * shear * math.sqrt(self.radius * overlap)


def hertz_damping(restitution: float) -> float:
    """Damping ratio of the Hertz dashpot with the stiffness at an overlap, sqrt(5/6) b [-]."""
    return math.sqrt(5 / 6) * float(damping_ratio(restitution))


def critical_step(frequency: float, damping: float = 0.0) -> float:
    """Largest stable step [s] of a frequency [rad/s] with a damping ratio [-]."""
    return 2 / frequency * (math.sqrt(1 + damping**2) - damping)


def largest_frequency(
    position: np.ndarray,
    free: np.ndarray,
    pairs: Sequence[tuple[int, int]],
    radius: float,
    mass: float,
    stiffness: float,
    shear: float,
) -> float:
    """Largest frequency of equal spheres about their places, with rotation [rad/s].

    Every contact has a normal and a tangential spring; the tangential one sees the displacement of the two surfaces.

    Args:
        position: Centres [m], shape (n, 3).
        free: Which of them move, shape (n,) bool.
        pairs: Indices of those that touch.
        radius, mass: Of each sphere [m], [kg].
        stiffness, shear: Normal and tangential stiffness of each contact [N/m].
    """
    matrix = np.zeros((6 * len(position), 6 * len(position)))
    for i, j in pairs:
        normal = (position[j] - position[i]) / np.linalg.norm(position[j] - position[i])
        x, y, z = radius * normal
        arm = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        moved = np.hstack([-np.eye(3), arm, np.eye(3), arm])
        across = np.outer(normal, normal)
        spring = stiffness * across + shear * (np.eye(3) - across)
        rows = np.r_[6 * i : 6 * i + 6, 6 * j : 6 * j + 6]
        matrix[np.ix_(rows, rows)] += moved.T @ spring @ moved
    inertia = np.tile([mass] * 3 + [0.4 * mass * radius**2] * 3, len(position))
    moving = np.repeat(free, 6)
    scaled = (matrix / np.sqrt(np.outer(inertia, inertia)))[np.ix_(moving, moving)]
    return float(math.sqrt(np.linalg.eigvalsh(scaled)[-1]))
