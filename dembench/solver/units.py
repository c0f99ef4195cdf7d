"""Scene units: powers of two near the smallest diameter, its mass and its contact time scale.

The solver computes in these units, so that single precision holds for a scene of any scale and no absolute threshold is
needed. Powers of two make every conversion exact: a state that goes in comes out with the same bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dembench.scene import Scene


@dataclass(frozen=True)
class Units:
    """One scene unit of length [m], mass [kg] and time [s]."""

    length: float
    mass: float
    time: float

    @property
    def velocity(self) -> float:
        """Scene unit of velocity [m/s]."""
        return self.length / self.time

    @property
    def acceleration(self) -> float:
        """Scene unit of acceleration [m/s^2]."""
        return self.length / self.time**2

    @property
    def force(self) -> float:
        """Scene unit of force [N]."""
        return self.mass * self.length / self.time**2

    @property
    def energy(self) -> float:
        """Scene unit of energy [J]."""
        return self.force * self.length

    @property
    def pressure(self) -> float:
        """Scene unit of stiffness modulus [Pa]."""
        return self.force / self.length**2


def scene_units(scene: Scene) -> Units:
    """Units of a scene: smallest diameter, its mass, free-fall time over it (without gravity 1/64 of the duration)."""
    radii = scene.radii()
    if not len(radii):
        return Units(1.0, 1.0, 1.0)
    smallest = int(np.argmin(radii))
    diameter = 2 * float(radii[smallest])
    gravity = math.hypot(*scene.gravity)
    time = math.sqrt(diameter / gravity) if gravity else scene.duration / 64
    return Units(_power_of_two(diameter), _power_of_two(float(scene.masses()[smallest])), _power_of_two(time))


def _power_of_two(value: float) -> float:
    return 2.0 ** round(math.log2(value))
