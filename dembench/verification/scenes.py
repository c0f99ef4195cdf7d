"""Scenes of suites: bodies of several kinds, far from each other, in one run."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dembench.scene import (
    Bodies,
    Cylinder,
    Domain,
    HertzMindlin,
    Material,
    PairLaw,
    Plane,
    Scene,
    Snapshot,
    Species,
)
from dembench.scene.materials import Law
from dembench.scene.observables import Observable
from dembench.scene.shapes import Shape
from dembench.scene.walls import WallShape

MOTION = "motion"
"""Name of the snapshots on which suites measure."""
WALL = "wall"
"""Name of the material of walls."""
UNYIELDING = 1e20
"""Young's modulus of walls [Pa]: the compliance of a contact with them is that of the body."""


@dataclass(frozen=True)
class Kind:
    """A material with a size: what bodies of this kind do with each other and with walls.

    Attributes:
        young, poisson, density: Material [Pa], [-], [kg/m^3].
        radius: Radius [m].
        restitution, friction, rolling, tangential: Pair law of two of them, and of one with a wall: coefficients of
            restitution, of sliding and rolling friction and of tangential restitution [-].
        shape: Shape of bodies that are no spheres; then the radius is that of the shape.
    """

    young: float
    density: float
    radius: float
    poisson: float = 0.25
    restitution: float = 1.0
    friction: float = 0.0
    rolling: float = 0.0
    tangential: float | None = None
    shape: Shape | None = None

    @property
    def mass(self) -> float:
        """Mass of a sphere of this kind [kg]."""
        return self.density * 4 / 3 * math.pi * self.radius**3

    @property
    def modulus(self) -> float:
        """E* of a contact with an unyielding wall [Pa]: E/(1 - nu^2)."""
        return self.young / (1 - self.poisson**2)


@dataclass(frozen=True)
class Body:
    """A body of a scene.

    Attributes:
        kind: Name of its kind.
        position, velocity, spin: [m], [m/s], [rad/s].
    """

    kind: str
    position: Sequence[float]
    velocity: Sequence[float] = (0.0, 0.0, 0.0)
    spin: Sequence[float] = (0.0, 0.0, 0.0)


def floor() -> Plane:
    """The plane z = 0 with the void above it."""
    return Plane(name="floor", material=WALL, point=(0, 0, 0), normal=(0, 0, 1))


def every(interval: float, end: float, start: float = 0.0) -> list[float]:
    """Multiples of an interval from start to end [s]."""
    return [k * interval for k in range(round(start / interval), round(end / interval) + 1)]


def scene_of(
    name: str,
    kinds: Mapping[str, Kind],
    bodies: Sequence[Body],
    *,
    time_step: float,
    times: Iterable[float],
    gravity: Sequence[float] = (0.0, 0.0, 0.0),
    walls: Sequence[WallShape] = (),
    between: Sequence[PairLaw] = (),
    law: Law | None = None,
    observables: Sequence[Observable] = (),
) -> Scene:
    """A scene that records all bodies at some times, the last of which is its end.

    Args:
        name: Name of the scene.
        kinds: Kinds of bodies by name. Two of one kind, and one and a wall, have its pair law.
        bodies: Bodies.
        time_step: Time step of the closed division [s].
        times: Times of the snapshots `MOTION` [s].
        gravity: Acceleration [m/s^2].
        walls: Walls, of the material `WALL`.
        between: Pair laws of two kinds; without one a pair has no friction and a restitution of 1.
        law: Contact law; None takes Hertz-Mindlin.
        observables: What is recorded beyond the snapshots.
    """
    times = sorted({round(t / time_step) * time_step for t in times})
    given = {frozenset((p.a, p.b)): p for p in between}
    for own, kind in kinds.items():
        for other in (own, WALL):
            given[frozenset((own, other))] = PairLaw(
                a=own,
                b=other,
                restitution=kind.restitution,
                friction=kind.friction,
                tangential_restitution=kind.tangential,
                rolling_friction=kind.rolling,
            )
    for a, b in itertools.combinations(kinds, 2):
        given.setdefault(frozenset((a, b)), PairLaw(a=a, b=b, restitution=1, friction=0))
    if not walls:
        given = {pair: law for pair, law in given.items() if WALL not in pair}
    materials = [Material(name=n, density=k.density, young=k.young, poisson=k.poisson) for n, k in kinds.items()]
    if walls:
        materials.append(Material(name=WALL, density=1e3, young=UNYIELDING, poisson=0.25))
    return Scene(
        name=name,
        law=law or HertzMindlin(),
        materials=tuple(materials),
        pair_laws=tuple(given.values()),
        species=tuple(_species(n, k) for n, k in kinds.items()),
        walls=tuple(walls),
        bodies=Bodies(
            position=[b.position for b in bodies],
            velocity=[b.velocity for b in bodies],
            angular_velocity=[b.spin for b in bodies],
            species=[list(kinds).index(b.kind) for b in bodies],
        ),
        domain=_domain(kinds, bodies, times[-1], gravity, walls),
        gravity=tuple(gravity),
        duration=times[-1],
        time_step=time_step,
        observables=(Snapshot(name=MOTION, times=tuple(times)), *observables),
    )


def _species(name: str, kind: Kind) -> Species:
    if kind.shape is not None:
        return Species.model_validate({"name": name, "material": name, "shape": kind.shape})
    return Species(name=name, material=name, radius=kind.radius)


def _domain(
    kinds: Mapping[str, Kind],
    bodies: Sequence[Body],
    duration: float,
    gravity: Sequence[float],
    walls: Sequence[WallShape],
) -> Domain:
    """A box that the bodies do not leave: as far as they fly, as wide as barrels, little beyond planes."""
    position = np.array([b.position for b in bodies])
    speed = np.abs([b.velocity for b in bodies]).max(axis=0)
    room = 6 * max(k.radius for k in kinds.values())
    way = room + speed * duration + 0.5 * np.abs(gravity) * duration**2
    lower, upper = position.min(axis=0) - way, position.max(axis=0) + way
    for wall in walls:
        if isinstance(wall, Cylinder):
            start, end = np.array(wall.start), np.array(wall.end)
            across = start == end
            lower = np.where(across, np.minimum(lower, start - wall.radius - room), lower)
            upper = np.where(across, np.maximum(upper, start + wall.radius + room), upper)
        if isinstance(wall, Plane) and np.count_nonzero(wall.normal) == 1:
            axis = int(np.argmax(np.abs(wall.normal)))
            if wall.normal[axis] > 0:
                lower[axis] = wall.point[axis] - room
            else:
                upper[axis] = wall.point[axis] + room
    return Domain(lower=tuple(lower), upper=tuple(upper))
