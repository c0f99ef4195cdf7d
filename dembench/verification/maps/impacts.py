"""Binary impacts: pairs of spheres that meet head-on, over stiffness, speed and restitution."""

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

RADIUS, REFERENCE = 1e-3, 1.0
"""Radius of elastic spheres that meet at the reference speed [m], [m/s]."""
PHASES = (0.0, 0.13, 0.29, 0.41)
"""Flights of the pairs of a cell beyond the first, in contact times: what counts is the worst of them."""
MEETING, DURATION = 4.0, 16.0
"""Time at which pairs meet, and end of a run, in contact times."""


def rigs(values: Mapping[str, Sequence[float]]) -> list[Rig]:
    """One rig for each stiffness, with all speeds and restitutions."""
    return [_rig(young, values["speed"], values["restitution"]) for young in values["stiffness"]]


def _rig(young: float, speeds: Sequence[float], restitutions: Sequence[float]) -> Rig:
    contact = _pair(young, RADIUS).contact_time(REFERENCE)
    grid = list(itertools.product(speeds, restitutions))
    radii = [_radius(speed, e) for speed, e in grid]
    distance = 4 * max(radii)
    kinds = [f"e{round(1000 * e)}" for e in restitutions]
    species = [Species(name=f"pair{k}", material=kinds[k % len(kinds)], radius=r) for k, r in enumerate(radii)]
    position: list[list[float]] = []
    velocity: list[list[float]] = []
    own: list[int] = []
    cells: list[Cell] = []
    bound = _bound(young)
    for k, (speed, e) in enumerate(grid):
        first = len(position)
        for phase in PHASES:
            z = distance * len(position) / 2
            gap = speed * contact * (MEETING + phase)
            position += [[side * (radii[k] + gap / 2), 0.0, z] for side in (-1, 1)]
            velocity += [[-side * speed / 2, 0.0, 0.0] for side in (-1, 1)]
            own += [k, k]
        at = {"stiffness": young, "speed": speed, "restitution": e}
        cells.append(Cell(at, rayleigh_time(young, radii[k]), range(first, len(position))))
    reach = 100 * max(radii)
    end = DURATION * contact
    scene = Scene(
        name="map_impacts",
        materials=tuple(Material(name=kind, density=DENSITY, young=young, poisson=POISSON) for kind in kinds),
        pair_laws=tuple(
            PairLaw(a=kinds[i], b=kinds[j], restitution=min(restitutions[i], restitutions[j]), friction=0)
            for i, j in itertools.combinations_with_replacement(range(len(kinds)), 2)
        ),
        species=tuple(species),
        bodies=Bodies(position=position, velocity=velocity, species=own),
        domain=Domain(
            lower=(-reach, -2 * distance, -distance),
            upper=(reach, 2 * distance, distance * (len(position) / 2 + 1)),
            periodic=(True, True, True),
        ),
        gravity=(0, 0, 0),
        duration=end,
        time_step=end / 320,
        observables=(Snapshot(name="end", times=(end,)),),
    )
    return Rig(f"map_impacts_{young:.0e}".replace("+", ""), scene, tuple(cells), bound, _judge)


def _judge(result: Result, cell: Cell) -> Outcome:
    """The worst of the phases: the class that occurs, the largest energy and error."""
    start, end = result.scene.bodies, result.snapshots["end"]
    speed, e = cell.at["speed"], cell.at["restitution"]
    size = 2 * result.scene.domain.upper[0]
    found = []
    for left in cell.bodies[::2]:
        right = left + 1
        apart = end.position[-1, right, 0] - end.position[-1, left, 0]
        apart -= size * round(apart / size)
        parting = end.velocity[-1, right, 0] - end.velocity[-1, left, 0]
        energy = _energy(end.velocity[-1, [left, right]]) / _energy(start.velocity[[left, right]])
        found.append(of_impact(energy, apart < 0, parting, e * speed, abs(parting / speed - e)))
    worst = max(found, key=lambda one: (one.kind != "stable", one.energy or math.inf))
    known = [one for one in found if one.energy is not None]
    return Outcome(
        worst.kind,
        max((one.energy for one in known if one.energy is not None), default=None),
        max((one.error for one in known if one.error is not None), default=None),
    )


def _energy(velocity: np.ndarray) -> float:
    return float((velocity**2).sum())


def _radius(speed: float, restitution: float) -> float:
    """Radius with the bound of the elastic pair at the reference speed: r v^(-1/5) times that of the damping [m]."""
    damped = critical_step(2.0, hertz_damping(restitution))
    return float(RADIUS * (speed / REFERENCE) ** 0.2 / damped)


def _pair(young: float, radius: float) -> Pair:
    mass = 4 / 3 * math.pi * radius**3 * DENSITY
    return Pair(young, POISSON, (radius, radius), (mass, mass))


def _bound(young: float) -> float:
    """Undamped bound at the largest overlap of an impact: 0.496 contact times [s]."""
    pair = _pair(young, RADIUS)
    return critical_step(math.sqrt(pair.normal(pair.impact_overlap(REFERENCE)) / pair.mass))


FAMILY = Family(
    "impacts",
    "Binary impacts",
    "Two equal spheres without friction meet head-on; four pairs of each kind differ in their flight, and the worst of "
    "them counts. Radii follow speed and damping, so that all pairs of a run have one bound: 2/ω (√(1 + ζ²) − ζ) with "
    "the stiffness at the largest overlap, 0.5 contact times without damping.",
    ("stiffness", "speed", "restitution"),
    rigs,
    measures_restitution=True,
)
