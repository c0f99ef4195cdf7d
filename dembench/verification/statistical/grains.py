"""The grains of the suite: one kind of sphere, where it starts, floors of spheres, and the shape of a heap of them."""

from __future__ import annotations

import math

import numpy as np

from dembench.scene import Bodies, Constraint, Domain, Material, PairLaw, Scene, Sink, Species
from dembench.scene.base import Vector
from dembench.scene.observables import Observable
from dembench.scene.walls import WallShape

RADIUS, DENSITY, POISSON, RESTITUTION = 1e-3, 2500.0, 0.25, 0.5
YOUNG, STEP = 1e7, 1e-5
"""Grains softer than glass by 6000; under a bed of 20 layers they overlap by 0.1 %."""
SOFT_YOUNG, LONG_STEP = 5e6, 2e-5
"""Those that flow are softer by two: a step is a sixth of a Rayleigh time, and the stiffness number
(E/((1 - nu^2) P))^(2/3) of a bed of 30 diameters is above 300, where flow does not depend on it (GDR MiDi 2004)."""
GRAVITY, DIAMETER = 9.81, 2 * RADIUS
MASS = 4 / 3 * math.pi * RADIUS**3 * DENSITY
SPACING = 2.3
"""Distance of grains before they fall, in radii."""
FLOOR_SPACING, FLOOR_ROOM, FLOOR_RELIEF = 2.4, 0.2, 0.4
"""Distance of the spheres of a floor, and by how much they are moved in the plane and across it at most, in radii."""
CELL = 1.5
"""Length of a cell of a profile along its ring, in diameters."""


def column(radius: float, layers: int, generator: np.random.Generator) -> np.ndarray:
    """Centres of a loose jittered lattice in a cylinder about the z axis that stands on z = 0 [m], shape (n, 3).

    Args:
        radius: Radius of the cylinder [m].
        layers: Number of layers.
        generator: Where the jitter is from.
    """
    pitch = SPACING * RADIUS
    reach = math.floor(radius / pitch)
    across = np.arange(-reach, reach + 1)
    places = np.stack(np.meshgrid(across, across, np.arange(layers)), axis=-1).reshape(-1, 3) * pitch
    places = places[np.hypot(places[:, 0], places[:, 1]) < radius - 1.15 * RADIUS] + [0, 0, 0.5 * pitch]
    return np.asarray(places + generator.uniform(-0.1, 0.1, places.shape) * RADIUS)


def sheet(columns: int, rows: int, height: float) -> np.ndarray:
    """Places of a square lattice about the z axis, as far apart as the spheres of a floor [m], shape (n, 3)."""
    across = [(np.arange(count) - 0.5 * (count - 1)) * FLOOR_SPACING * RADIUS for count in (columns, rows)]
    return np.stack(np.meshgrid(*across, [height]), axis=-1).reshape(-1, 3)


def rough_floor(columns: int, rows: int, generator: np.random.Generator) -> np.ndarray:
    """Centres of the spheres of a floor about the origin, at most at z = 0 [m], shape (n, 3)."""
    places = sheet(columns, rows, -FLOOR_RELIEF * RADIUS)
    room = np.array([FLOOR_ROOM, FLOOR_ROOM, FLOOR_RELIEF]) * RADIUS
    return np.asarray(places + generator.uniform(-room, room, places.shape))


def round_floor(radius: float, generator: np.random.Generator) -> np.ndarray:
    """The spheres of a rough floor that lie in a circle [m], shape (n, 3)."""
    count = 2 * math.ceil(radius / (FLOOR_SPACING * RADIUS)) + 1
    found = rough_floor(count, count, generator)
    return found[np.hypot(found[:, 0], found[:, 1]) < radius - RADIUS]


def of_grains(
    name: str,
    friction: float,
    position: np.ndarray,
    walls: tuple[WallShape, ...],
    domain: Domain,
    duration: float,
    observables: tuple[Observable, ...],
    *,
    fixed: int = 0,
    velocity: np.ndarray | None = None,
    gravity: Vector = (0.0, 0.0, -GRAVITY),
    soft: bool = False,
    sinks: tuple[Sink, ...] = (),
) -> Scene:
    """A scene of these grains.

    Args:
        name: Its name.
        friction: Friction of everything [-].
        position: Centres [m], shape (n, 3).
        walls, domain, duration, observables, velocity, gravity, sinks: See `Scene`.
        fixed: How many of the first spheres are fixed.
        soft: Whether the grains are those that flow, softer and with a longer step.
    """
    young, step = (SOFT_YOUNG, LONG_STEP) if soft else (YOUNG, STEP)
    return Scene(
        name=name,
        materials=(Material(name="solid", density=DENSITY, young=young, poisson=POISSON),),
        pair_laws=(PairLaw(a="solid", b="solid", restitution=RESTITUTION, friction=friction),),
        species=(Species(name="grain", material="solid", radius=RADIUS),),
        walls=walls,
        bodies=Bodies(position=position, velocity=velocity),
        domain=domain,
        gravity=gravity,
        duration=duration,
        time_step=step,
        constraints=(Constraint(kind="fixed", bodies=tuple(range(fixed))),) if fixed else (),
        sinks=sinks,
        observables=observables,
    )


def profile(position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Surface of a heap about the z axis, in rings one diameter wide.

    A ring is cut into cells 1.5 diameters long. The surface in a cell is the top of its highest grain, that of a ring
    the mean over its cells with grains.

    Args:
        position: Centres of the grains [m], shape (n, 3).

    Returns:
        Mean radius of each ring [m], its surface [m], NaN where it has no grain, and the share of its cells that have
        grains [-], shape (rings,) each.
    """
    away = np.hypot(position[:, 0], position[:, 1])
    turn = np.arctan2(position[:, 1], position[:, 0]) / (2 * math.pi) % 1
    ring = (away / DIAMETER).astype(int)
    centre = (np.arange(ring.max() + 1) + 0.5) * DIAMETER
    surface, covered = np.full(len(centre), np.nan), np.zeros(len(centre))
    for k, radius in enumerate(centre):
        own = ring == k
        cells = max(1, round(2 * math.pi * radius / (CELL * DIAMETER)))
        tops = np.full(cells, -np.inf)
        np.maximum.at(tops, np.minimum((turn[own] * cells).astype(int), cells - 1), position[own, 2] + RADIUS)
        found = tops[np.isfinite(tops)]
        covered[k] = len(found) / cells
        if len(found):
            surface[k] = found.mean()
    return centre, surface, covered


def edge(position: np.ndarray) -> float:
    """Radius of the edge of a heap about the z axis [m]: that of the first ring with grains in less than half of its
    cells, so that spheres which roll on alone do not count; between two rings by interpolation of the share.

    Args:
        position: Centres of the grains [m], shape (n, 3).
    """
    centre, _, covered = profile(position)
    share = np.append(covered, 0.0)
    radius = np.append(centre, centre[-1] + DIAMETER)
    k = int(np.argmax(share < 0.5))
    if k == 0:
        return 0.0
    return float(radius[k - 1] + (share[k - 1] - 0.5) / (share[k - 1] - share[k]) * DIAMETER)
