"""Strained lattices at rest: blocks of equal spheres in contact, over coordination and overlap."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
from scipy.spatial import cKDTree

from dembench.results import Result
from dembench.scene import Bodies, Constraint, Domain, Material, PairLaw, Scene, Snapshot, Species
from dembench.verification.maps.bounds import Pair, critical_step, largest_frequency
from dembench.verification.maps.breaking import Outcome, of_lattice
from dembench.verification.maps.rigs import DENSITY, POISSON, Cell, Family, Rig, rayleigh_time

YOUNG, RADIUS, FRICTION = 1e8, 1e-3, 1.0
NEIGHBOURS: dict[int, tuple[tuple[float, float, float], ...]] = {
    6: ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    8: ((1, 1, 1), (1, 1, -1), (1, -1, 1), (-1, 1, 1)),
    12: ((1, 1, 0), (1, 0, 1), (0, 1, 1), (1, -1, 0), (1, 0, -1), (0, 1, -1)),
}
"""Half of the directions to the neighbours, the first three a basis: simple, body-centred and face-centred cubic."""
SIZE = 2.3
"""Radius of a block in diameters; spheres that lack a neighbour are fixed."""
DISTURBANCE = 0.05
"""Displacement by the disturbance in a time of the bound, in overlaps: contacts stay closed."""
RECORDS, INTERVAL = 10, 20
"""Number of snapshots, and time between two in units of the bound."""


def rigs(values: Mapping[str, Sequence[float]]) -> list[Rig]:
    """One rig with all lattices."""
    grid = [(int(contacts), overlap) for contacts in values["coordination"] for overlap in values["overlap"]]
    unscaled = [bound(contacts, overlap) for contacts, overlap in grid]
    shared = unscaled[0]
    generator = np.random.default_rng(0)
    position: list[np.ndarray] = []
    velocity, spin, species, fixed, cells = [], [], [], [], []
    edge = 0.0
    for k, (contacts, overlap) in enumerate(grid):
        radius = RADIUS * shared / unscaled[k]
        points, free, _ = _block(contacts)
        centres = points * 2 * radius * (1 - overlap)
        half = float(np.abs(centres).max()) + 2 * radius
        centres += [edge + half, 0, 0]
        edge += 2 * half
        speed = DISTURBANCE * overlap * 2 * radius / shared
        first = sum(map(len, position))
        fixed += [first + int(i) for i in np.flatnonzero(~free)]
        position.append(centres)
        velocity.append(np.where(free[:, None], generator.normal(0, speed, centres.shape), 0.0))
        spin.append(np.where(free[:, None], generator.normal(0, speed / radius, centres.shape), 0.0))
        species += [k] * len(centres)
        at = {"coordination": float(contacts), "overlap": overlap}
        own = range(first, first + len(centres))
        cells.append(Cell(at, rayleigh_time(YOUNG, radius), own))
    width = max(float(np.abs(block[:, 1:]).max()) for block in position) + 4 * RADIUS
    interval = INTERVAL * shared
    scene = Scene(
        name="map_lattices",
        materials=(Material(name="solid", density=DENSITY, young=YOUNG, poisson=POISSON),),
        pair_laws=(PairLaw(a="solid", b="solid", restitution=1.0, friction=FRICTION),),
        species=tuple(
            Species(name=f"lattice{k}", material="solid", radius=RADIUS * shared / own)
            for k, own in enumerate(unscaled)
        ),
        bodies=Bodies(
            position=np.vstack(position),
            velocity=np.vstack(velocity),
            angular_velocity=np.vstack(spin),
            species=species,
        ),
        constraints=(Constraint(kind="fixed", bodies=tuple(fixed)),),
        domain=Domain(lower=(0, -width, -width), upper=(edge, width, width), periodic=(True, True, True)),
        gravity=(0, 0, 0),
        duration=RECORDS * interval,
        time_step=0.1 * shared,
        observables=(Snapshot(name="motion", times=tuple(k * interval for k in range(1, RECORDS + 1))),),
    )
    return [Rig("map_lattices", scene, tuple(cells), shared, _judge)]


def _judge(result: Result, cell: Cell) -> Outcome:
    """Largest kinetic energy on record, rotation included, over that of the disturbance."""
    start, seen = result.scene.bodies, result.snapshots["motion"]
    own = slice(cell.bodies.start, cell.bodies.stop)
    radius = float(result.scene.radii()[own][0])
    before = _energy(start.velocity[own], start.angular_velocity[own], radius)
    after = _energy(seen.velocity[:, own], seen.angular_velocity[:, own], radius)
    return of_lattice(float(np.max(after) / before))


def _energy(velocity: np.ndarray, spin: np.ndarray, radius: float) -> np.ndarray:
    """Kinetic energy of equal spheres over half the mass of one [m^2/s^2]."""
    return np.asarray((velocity**2 + 0.4 * radius**2 * spin**2).sum(axis=(-1, -2)))


@cache
def _block(contacts: int) -> tuple[np.ndarray, np.ndarray, list[tuple[int, int]]]:
    """A block of a lattice about the origin in diameters: points (n, 3), which are free (n,), pairs that touch."""
    half = np.array(NEIGHBOURS[contacts], dtype=float)
    half /= np.linalg.norm(half[0])
    whole = np.array(list(itertools.product(range(-4, 5), repeat=3)))
    points = whole @ half[:3]
    points = points[np.linalg.norm(points, axis=1) <= SIZE]
    pairs = cKDTree(points).query_pairs(1 + 1e-9, output_type="ndarray")
    touching = np.bincount(pairs.ravel(), minlength=len(points))
    return points, touching == contacts, [(int(i), int(j)) for i, j in pairs]


@cache
def bound(contacts: int, overlap: float) -> float:
    """2/omega_max of a block of spheres of the reference radius [s]."""
    mass = 4 / 3 * math.pi * RADIUS**3 * DENSITY
    pair = Pair(YOUNG, POISSON, (RADIUS, RADIUS), (mass, mass))
    depth = overlap * 2 * RADIUS
    points, free, pairs = _block(contacts)
    return critical_step(
        largest_frequency(points, free, pairs, RADIUS, mass, pair.normal(depth), pair.tangential(depth))
    )


FAMILY = Family(
    "lattices",
    "Strained lattices",
    "Blocks of a simple cubic, a body-centred and a face-centred cubic lattice, compressed between fixed spheres of "
    "their own surface, frictional and elastic, with small random velocities and spins. Bound: 2/ω of the fastest mode "
    "of the block with rotation, from its stiffness matrix.",
    ("overlap", "coordination"),
    rigs,
)
