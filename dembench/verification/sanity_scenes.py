"""Scenes of the sanity suite: rigid unit spheres (r = 1 m, m = 1 kg, I = 2/5 m r^2), g = 9.8 m/s^2, dt = 2 ms."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from dembench.scene import (
    Bodies,
    Box,
    Domain,
    Material,
    PairLaw,
    Plane,
    Rigid,
    Scene,
    Sdf,
    Snapshot,
    Species,
)

RADIUS = 1.0
DENSITY = 3 / (4 * math.pi)
GRAVITY = 9.8
DT = 2e-3
MOTION = "motion"
"""Name of the snapshots on which everything is measured."""

HEAD_ON = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Restitutions of the head-on pairs."""
SPEED = 2.0
SPIN, SPIN_RESTITUTION, SPIN_FRICTION = 10.0, 0.2, 0.6
HALF_GAP = 2.503
"""Distance of a sphere from the point where its pair meets, so that the meeting is no multiple of a step [m]."""

DROP, BOUNCE = 5.0, 0.7
"""Height of the fall [m] and restitution of the floor under it."""
SLIDE, SLIDE_FRICTION = 3.0, 0.5
COLUMN, COLUMN_STEPS = 6, 7000
BED, BED_STEPS, BED_FRICTION = (5, 5, 40), 5000, 0.3
LAST = 0.5
"""The end of a run in which what should be at rest is looked at in every step [s]."""


def collisions() -> Scene:
    """Pairs that meet without gravity: one head-on for every restitution, then two that spin, apart in z.

    Bodies 2 k and 2 k + 1 are pair k; the spinning ones have equal and opposite spins.
    """
    names = [f"e{round(100 * e)}" for e in HEAD_ON]
    laws = {name: (e, 0.0) for name, e in zip(names, HEAD_ON, strict=True)}
    laws["rough"] = (SPIN_RESTITUTION, SPIN_FRICTION)
    kinds = [*range(len(names)), len(names), len(names)]
    spins = [(0.0, 0.0)] * len(names) + [(SPIN, SPIN), (SPIN, -SPIN)]
    position = [[side * HALF_GAP, 0, 4.0 * k] for k in range(len(kinds)) for side in (-1, 1)]
    velocity = [[-side * SPEED, 0, 0] for _ in kinds for side in (-1, 1)]
    spin = [[0, 0, w] for pair in spins for w in pair]
    bodies = Bodies(position=position, velocity=velocity, angular_velocity=spin, species=np.repeat(kinds, 2))
    return _scene("sanity_collisions", laws, bodies, duration=2.0, times=_every(0.02, 2.0), gravity=0.0)


def floor() -> Scene:
    """On a plane: a sphere that falls (body 0), one that slides (body 1) and a column of six (bodies 2 to 7)."""
    laws = {"bouncing": (BOUNCE, 0.0), "sliding": (0.0, SLIDE_FRICTION), "stacked": (0.0, BED_FRICTION)}
    column = [[0, -10, RADIUS * (2 * k + 1)] for k in range(COLUMN)]
    velocity = np.zeros((2 + COLUMN, 3))
    velocity[1] = SLIDE, 0, 0
    bodies = Bodies(
        position=[[0, 0, DROP + RADIUS], [0, 10, RADIUS], *column],
        velocity=velocity,
        species=[0, 1, *[2] * COLUMN],
    )
    duration = COLUMN_STEPS * DT
    times = [*_every(0.01, 4.0), *_every(0.1, duration), *_last(duration)]
    plane = Plane(name="floor", material="floor", point=(0, 0, 0), normal=(0, 0, 1))
    return _scene("sanity_floor", laws, bodies, walls=(plane,), duration=duration, times=times)


def sdf_floor() -> Scene:
    """The falling sphere above a floor that is given by its signed distance on a grid."""
    wall = Sdf.from_function(
        name="floor",
        material="floor",
        function=lambda points: points[:, 2],
        lower=(-3, -3, -1),
        upper=(3, 3, 3),
        spacing=0.25,
    )
    bodies = Bodies(position=[[0, 0, DROP + RADIUS]])
    duration = 4.0
    laws = {"bouncing": (BOUNCE, 0.0)}
    return _scene("sanity_sdf_floor", laws, bodies, walls=(wall,), duration=duration, times=_every(0.01, duration))


def bed() -> Scene:
    """Touching spheres on a simple cubic lattice in a snug box; body order: layer by layer."""
    nx, ny, layers = BED
    lattice = [[2 * i + 1, 2 * j + 1, 2 * k + 1] for k in range(layers) for j in range(ny) for i in range(nx)]
    box = Box(
        name="box",
        material="floor",
        lower=(0, 0, 0),
        upper=(2 * nx * RADIUS, 2 * ny * RADIUS, 2 * (layers + 1) * RADIUS),
        open_faces=("z+",),
    )
    duration = BED_STEPS * DT
    return _scene(
        "sanity_bed",
        {"stacked": (0.0, BED_FRICTION)},
        Bodies(position=RADIUS * np.array(lattice, dtype=float)),
        walls=(box,),
        duration=duration,
        times=[*_every(0.1, duration), *_last(duration)],
    )


def _scene(
    name: str,
    laws: Mapping[str, tuple[float, float]],
    bodies: Bodies,
    *,
    duration: float,
    times: list[float],
    walls: tuple[Any, ...] = (),
    gravity: float = GRAVITY,
) -> Scene:
    """Spheres of several materials that touch their own kind and the floor, each with its restitution and friction.

    Young's modulus and Poisson's ratio are there because a scene has them; rigid contacts use neither.
    """
    names = [*laws, "floor"] if walls else list(laws)
    pairs = []
    for a, b in itertools.combinations_with_replacement(names, 2):
        e, mu = laws.get(a, (0.0, 0.0))
        pairs.append(PairLaw(a=a, b=b, restitution=e, friction=mu))
    return Scene(
        name=name,
        law=Rigid(),
        materials=tuple(Material(name=n, density=DENSITY, young=1e7, poisson=0.2) for n in names),
        pair_laws=tuple(pairs),
        species=tuple(Species(name=n, material=n, radius=RADIUS) for n in laws),
        walls=walls,
        bodies=bodies,
        domain=Domain(lower=(-100, -100, -10), upper=(100, 100, 100)),
        gravity=(0, 0, -gravity),
        duration=duration,
        time_step=DT,
        observables=(Snapshot(name=MOTION, times=tuple(sorted({round(t / DT) * DT for t in times}))),),
    )


def _every(interval: float, end: float) -> list[float]:
    return [k * interval for k in range(round(end / interval) + 1)]


def _last(end: float) -> list[float]:
    """Every step of the last `LAST` seconds [s]."""
    return [end - k * DT for k in range(round(LAST / DT) + 1)]
