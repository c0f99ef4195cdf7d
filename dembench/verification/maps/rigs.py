"""Rigs: one scene with many cells, each a small experiment on its own, all with the same theoretical bound.

The time in which spheres of one material collide or vibrate grows with their radius alone, everything else being equal.
So each cell takes the radius with which its bound is that of all others: one run with one step probes the whole row.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from dembench.results import Result
from dembench.scene import Scene
from dembench.verification.maps.breaking import Outcome

DENSITY, POISSON = 2500.0, 0.25
AXES: dict[str, tuple[float, ...]] = {
    "stiffness": (1e7, 1e9, 1e11),
    "speed": (0.01, 0.1, 1.0, 10.0),
    "restitution": (1.0, 0.5, 0.1),
    "coordination": (6, 8, 12),
    "overlap": (1e-4, 1e-3, 4e-3),
    "mass ratio": (1, 1e2, 1e4, 1e6),
}
"""Values of each axis: Young's modulus [Pa], speed of impact [m/s], restitution, contacts of a sphere, overlap over the
diameter, mass over that of the light grain [-]."""
USUAL: dict[str, float] = {
    "stiffness": 1e9,
    "speed": 1.0,
    "restitution": 0.5,
    "coordination": 12,
    "overlap": 1e-3,
    "mass ratio": 1e2,
}
"""Value of an axis that is not varied, and of the cell on which guards are probed."""
TITLES = {
    "stiffness": "Young's modulus [Pa]",
    "speed": "Speed of impact [m/s]",
    "restitution": "Restitution",
    "coordination": "Contacts of a sphere",
    "overlap": "Overlap over diameter",
    "mass ratio": "Mass ratio",
}


@dataclass(frozen=True)
class Cell:
    """One point of a map.

    Attributes:
        at: Values on the axes of its map.
        rayleigh: Rayleigh time of its smallest body [s].
        bodies: Its bodies in the scene, as a range.
    """

    at: Mapping[str, float]
    rayleigh: float
    bodies: range


@dataclass(frozen=True)
class Rig:
    """One scene with its cells.

    Attributes:
        name: Name of its runs.
        scene: The scene; its sampling interval is a whole number of steps.
        cells: The cells.
        bound: Theoretical bound of the step that all cells share [s].
        judge: What came of a cell in a complete result.
    """

    name: str
    scene: Scene
    cells: tuple[Cell, ...]
    bound: float
    judge: Callable[[Result, Cell], Outcome]


@dataclass(frozen=True)
class Family:
    """A map: a kind of elementary probe.

    Attributes:
        name: Identifier.
        title: Heading.
        text: What is done, and what the bound is.
        axes: Its axes: last but one what figures have across, last what they have as lines.
        rigs: Makes its rigs from values on the axes.
        measures_restitution: Whether its cells have an error of the restitution.
    """

    name: str
    title: str
    text: str
    axes: tuple[str, ...]
    rigs: Callable[[Mapping[str, Sequence[float]]], list[Rig]]
    measures_restitution: bool = False

    def values(self, asked: Sequence[str]) -> dict[str, tuple[float, ...]]:
        """Values on its axes: the whole series of those that are asked for, the usual value of the others."""
        return {axis: AXES[axis] if axis in asked else (USUAL[axis],) for axis in self.axes}

    def guard_rig(self, row: Rig) -> Rig:
        """A rig of one cell in which an engine's guard sees nothing else: the usual cell of a row.

        Args:
            row: A rig of this map.
        """
        usual = min(row.cells, key=lambda cell: sum(cell.at[axis] != USUAL[axis] for axis in self.axes))
        alone = self.rigs({axis: (usual.at[axis],) for axis in self.axes})
        return alone[0]


def rayleigh_time(young: float, radius: float) -> float:
    """Rayleigh time of a sphere of the rigs' density, pi r sqrt(rho/G)/(0.1631 nu + 0.8766) [s].

    Args:
        young: Young's modulus [Pa].
        radius: [m].
    """
    shear = young / (2 * (1 + POISSON))
    return math.pi * radius * math.sqrt(DENSITY / shear) / (0.1631 * POISSON + 0.8766)
