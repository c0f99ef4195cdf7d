"""Vertical stress of a packing at rest from its contact forces, and what Janssen's formula says about it.

Janssen 1895 (Versuche über Getreidedruck in Silozellen, Z. Ver. Dtsch. Ing. 39, 1045): a slice of a column of
cross-section A and perimeter P that rubs at its wall, with horizontal stress K sigma and wall friction mu, is in
balance where d sigma/dh = rho g - sigma/lambda, lambda = A/(P K mu), so that sigma = rho g lambda (1 - exp(-h/lambda))
at the depth h below a free surface.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dembench.scene import Box, Cylinder
from dembench.scene.base import Model
from dembench.scene.walls import WallShape

if TYPE_CHECKING:
    from dembench.solver import Simulation


def janssen(depth: np.ndarray, density: float, length: float | None, gravity: float) -> np.ndarray:
    """Vertical stress at some depths below a free surface [Pa], shape (k,).

    Args:
        depth: Depths [m], shape (k,).
        density: Bulk density [kg/m^3].
        length: Janssen's length lambda [m]; None where walls carry nothing, which gives the hydrostatic stress.
        gravity: Acceleration [m/s^2].
    """
    if length is None:
        return density * gravity * depth
    return density * gravity * length * -np.expm1(-depth / length)


@dataclass(frozen=True)
class Shaft:
    """The part of a container that has one cross-section, with vertical walls.

    Attributes:
        wall: Name of its wall.
        area, perimeter: Of the cross-section [m^2], [m].
        lower, upper: Ends [m].
    """

    wall: str
    area: float
    perimeter: float
    lower: float
    upper: float


def shaft(walls: Sequence[WallShape]) -> Shaft | None:
    """The shaft of a container: its box, or its upright cylinder; None where it has neither."""
    for wall in walls:
        if isinstance(wall, Box):
            a, b, _ = np.array(wall.upper) - np.array(wall.lower)
            return Shaft(wall.name, float(a * b), float(2 * (a + b)), wall.lower[2], wall.upper[2])
        if isinstance(wall, Cylinder) and wall.start[:2] == wall.end[:2]:
            r, ends = wall.radius, sorted((wall.start[2], wall.end[2]))
            return Shaft(wall.name, math.pi * r**2, 2 * math.pi * r, *ends)
    return None


class Support(Model):
    """What carries a packing, and how its shaft compares with Janssen's.

    Attributes:
        weight: Weight of the packing [N].
        residual: Share of the weight that no wall carries: what is still accelerated [-].
        density: Bulk density in the shaft [kg/m^3].
        pressure_ratio: K, mean horizontal stress on the wall of the shaft over the mean vertical stress [-].
        wall_friction: Coefficient of friction of the wall [-].
        mobilised_friction: Vertical over normal force on the wall [-]; at most `wall_friction`.
        length: Janssen's length with the whole wall friction [m]; None for a smooth wall.
        mobilised_length: The same with the mobilised friction [m]; None where the wall carries nothing.
    """

    weight: float
    residual: float
    density: float
    pressure_ratio: float
    wall_friction: float
    mobilised_friction: float
    length: float | None
    mobilised_length: float | None


@dataclass(frozen=True)
class Loads:
    """Vertical loads of a packing.

    Attributes:
        level: Heights of horizontal planes [m], ascending, shape (k,).
        passed: Vertical force that contacts pass down through each plane [N], shape (k,).
        above: Weight of the bodies with their centre above each plane [N], shape (k,).
        residual: See `Support`.
        weight: Weight of all [N].
    """

    level: np.ndarray
    passed: np.ndarray
    above: np.ndarray
    residual: float
    weight: float


def loads(simulation: Simulation, level: np.ndarray) -> Loads:
    """Vertical loads through horizontal planes: the sum over the contacts whose two centres lie on both sides.

    Args:
        simulation: A packing at rest, with the state of its contacts.
        level: Heights of the planes [m], ascending, shape (k,).
    """
    contacts, z = simulation.contacts(), simulation.position[:, 2]
    weight = simulation.scene.masses() * -simulation.scene.gravity[2]
    force, pairs = contacts.force()[:, 2], contacts.j >= 0
    i, j = contacts.i[pairs], contacts.j[pairs]
    upward = np.where(z[i] > z[j], force[pairs], -force[pairs])
    passed = np.zeros(len(level) + 1)
    np.add.at(passed, np.searchsorted(level, np.minimum(z[i], z[j])), upward)
    np.add.at(passed, np.searchsorted(level, np.maximum(z[i], z[j])), -upward)
    above = np.array([weight[z > height].sum() for height in level])
    carried = float(force[~pairs].sum())
    return Loads(level, passed.cumsum()[:-1], above, 1 - carried / float(weight.sum()), float(weight.sum()))


def support(simulation: Simulation, column: Shaft, found: Loads, top: float) -> Support | None:
    """How a packing is carried; None where fewer than four planes lie in the part of the shaft that is filled.

    Args:
        simulation: A packing at rest, with the state of its contacts.
        column: The shaft.
        found: Its loads.
        top: Height of the free surface [m].
    """
    scene, gravity = simulation.scene, -simulation.scene.gravity[2]
    # the floor and the free surface are no part of the column that the formula describes
    margin = 0.1 * (top - max(column.lower, found.level[0]))
    inside = (found.level > column.lower + margin) & (found.level < top - margin)
    if np.count_nonzero(inside) < 4:
        return None
    level, stress = found.level[inside], found.passed[inside] / column.area
    density = float(-np.polyfit(level, found.above[inside], 1)[0] / (gravity * column.area))
    contacts = simulation.contacts()
    at = np.flatnonzero((contacts.wall >= 0) & (np.abs(contacts.normal[:, 2]) < 0.1))
    at = at[(contacts.point[at, 2] > level[0]) & (contacts.point[at, 2] < level[-1])]
    normal = float(contacts.normal_force[at].sum())
    ratio = normal / (column.perimeter * float(level[-1] - level[0])) / float(stress.mean())
    wall = next(wall for wall in scene.walls if wall.name == column.wall)
    friction = max(scene.pair_law(s.material, wall.material).friction for s in scene.species)
    mobilised = float(contacts.force()[at, 2].sum()) / normal
    length = column.area / (column.perimeter * ratio)
    return Support(
        weight=found.weight,
        residual=found.residual,
        density=density,
        pressure_ratio=ratio,
        wall_friction=friction,
        mobilised_friction=mobilised,
        length=length / friction if friction else None,
        mobilised_length=length / mobilised if mobilised > 0 else None,
    )
