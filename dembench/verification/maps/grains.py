"""A light grain between two heavy ones that close in on it, over mass ratio and restitution."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np

from dembench.results import Result
from dembench.scene import Bodies, Domain, Material, PairLaw, Scene, Snapshot, Species
from dembench.verification.maps.bounds import Pair, critical_step, hertz_damping
from dembench.verification.maps.breaking import Outcome, of_impact
from dembench.verification.maps.rigs import DENSITY, POISSON, Cell, Family, Rig, rayleigh_time

YOUNG, RADIUS = 1e8, 1e-3
SOFTNESS = 5e-3
"""Largest overlap of both contacts over the radius [-]."""
DISTURBANCE = 0.05
"""Speed of the light grain over that with which it would make the largest overlap itself [-]."""
DURATION = 4.5
"""End of a run in times that the heaviest grains need for the largest overlap; an impact takes about 3."""


def rigs(values: Mapping[str, Sequence[float]]) -> list[Rig]:
    """One rig with all mass ratios and restitutions."""
    ratios, restitutions = values["mass ratio"], values["restitution"]
    bound = RADIUS * _bound_over_radius(1.0, 1.0)
    names = [(f"light{k}", f"heavy{k}") for k in range(len(ratios) * len(restitutions))]
    kinds = {light: 1.0 for light, _ in names}
    grid = list(itertools.product(ratios, restitutions))
    kinds |= {heavy: ratio for (_, heavy), (ratio, _) in zip(names, grid, strict=True)}
    order = list(kinds)
    radii = [bound / _bound_over_radius(ratio, e) for ratio, e in grid]
    distance = 4 * max(radii)
    position: list[list[float]] = []
    velocity: list[list[float]] = []
    species: list[int] = []
    cells: list[Cell] = []
    for (ratio, e), (light, heavy), radius in zip(grid, names, radii, strict=True):
        z = distance * len(cells)
        speed = _speed(ratio)
        first = len(position)
        position += [[2 * radius * side, 0, z] for side in (-1, 0, 1)]
        velocity += [[speed, 0, 0], [DISTURBANCE * _speed(1.0), 0, 0], [-speed, 0, 0]]
        species += [order.index(heavy), order.index(light), order.index(heavy)]
        at = {"mass ratio": ratio, "restitution": e}
        cells.append(Cell(at, rayleigh_time(YOUNG, radius), range(first, first + 3)))
    end = DURATION * SOFTNESS * max(radii) / _speed(max(ratios))
    size = {kind: radius for pair, radius in zip(names, radii, strict=True) for kind in pair}
    laws = {}
    for (_, e), (light, heavy) in zip(grid, names, strict=True):
        laws[frozenset((light, heavy))] = e
    scene = Scene(
        name="map_grains",
        materials=tuple(
            Material(name=kind, density=ratio * DENSITY, young=YOUNG, poisson=POISSON) for kind, ratio in kinds.items()
        ),
        pair_laws=tuple(
            PairLaw(a=a, b=b, restitution=laws.get(frozenset((a, b)), 1.0), friction=0)
            for a, b in itertools.combinations_with_replacement(order, 2)
        ),
        species=tuple(Species(name=kind, material=kind, radius=size[kind]) for kind in order),
        bodies=Bodies(position=position, velocity=velocity, species=species),
        domain=Domain(
            lower=(-25 * distance, -2 * distance, -distance),
            upper=(25 * distance, 2 * distance, distance * len(cells)),
            periodic=(True, True, True),
        ),
        gravity=(0, 0, 0),
        duration=end,
        time_step=0.1 * bound,
        observables=(Snapshot(name="end", times=(end,)),),
    )
    return [Rig("map_grains", scene, tuple(cells), bound, _judge)]


def _judge(result: Result, cell: Cell) -> Outcome:
    """All three grains: their energy, their order, and whether the heavy ones part."""
    start, end = result.scene.bodies, result.snapshots["end"]
    own = list(cell.bodies)
    mass = result.scene.masses()[own][:, None]
    energy = float((mass * end.velocity[-1, own] ** 2).sum() / (mass * start.velocity[own] ** 2).sum())
    size = 2 * result.scene.domain.upper[0]
    apart = np.diff(end.position[-1, own, 0])
    apart -= size * np.round(apart / size)
    parting = float(end.velocity[-1, own[2], 0] - end.velocity[-1, own[0], 0])
    return of_impact(energy, bool((apart < 0).any()), parting, 0.0)


def _bound_over_radius(ratio: float, restitution: float) -> float:
    """Bound of a light grain between two contacts over its radius [s/m]; the damping is that of the reduced mass."""
    pair, light = _pair(ratio), _pair(1.0).masses[0]
    frequency = math.sqrt(2 * pair.normal(SOFTNESS * RADIUS) / light)
    return critical_step(frequency, hertz_damping(restitution) * math.sqrt(2 * pair.mass / light)) / RADIUS


def _pair(ratio: float) -> Pair:
    """A light and a heavy sphere of the reference radius."""
    mass = 4 / 3 * math.pi * RADIUS**3 * DENSITY
    return Pair(YOUNG, POISSON, (RADIUS, RADIUS), (mass, ratio * mass))


def _speed(ratio: float) -> float:
    """Speed of each heavy grain with which both contacts reach the largest overlap, whatever the radius [m/s].

    The kinetic energy m v^2 of both goes into two contacts with 2/5 k a^(5/2) each.
    """
    pair = _pair(ratio)
    return math.sqrt(0.8 * pair.hertz * (SOFTNESS * RADIUS) ** 2.5 / pair.masses[1])


FAMILY = Family(
    "grains",
    "A light grain between heavy ones",
    "Two heavy grains close in on a light one that touches both and moves a little, without friction. Speeds follow "
    "the mass, so that overlaps are the same, and radii the damping. Bound: the light grain between two springs at the "
    "largest overlap, with the damping of both contacts.",
    ("mass ratio", "restitution"),
    rigs,
)
