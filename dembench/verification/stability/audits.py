"""An intruder that must miss nobody, and the same run twice: D41 and D42."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from dembench.results import Result
from dembench.scene import Overlap, Plane, Scene
from dembench.verification.checks import Experiment, Trial, at_most, on_one_scene
from dembench.verification.scenes import MOTION, WALL, Body, Kind, every, scene_of
from dembench.verification.stability.common import (
    contact_time,
    fitted,
    impact_overlap,
    kinetic_energy,
    lattice,
    motion,
    rayleigh,
)

G = 9.81
RADIUS = 0.01

TARGETS, INTRUDER = (12, 12, 12), 100.0


# ---- D41 and D42


def intruder_scene(name: str) -> Scene:
    """A sphere at 100 m/s into a block of resting ones in free space."""
    kind = Kind(1e9, 2500, RADIUS, restitution=0.5, friction=0.3)
    position = lattice(TARGETS, 2.05 * RADIUS)
    middle = position.mean(axis=0)
    bodies = [Body("grain", p) for p in position]
    start = (-5 * RADIUS, middle[1] + 0.3 * RADIUS, middle[2] + 0.2 * RADIUS)
    bodies.append(Body("grain", start, (INTRUDER, 0, 0)))
    dt = fitted(min(0.1 * rayleigh(kind), contact_time(kind, INTRUDER) / 50), 1e-4)
    return scene_of(
        name,
        {"grain": kind},
        bodies,
        time_step=dt,
        times=every(1e-3, 0.01),
        observables=[Overlap(name="overlap", interval=1e-5 if dt < 1e-5 else dt)],
    )


def _intruder(result: Result) -> Mapping[str, float]:
    seen, mass = motion(result), result.scene.masses()
    deepest = float(result.observables["overlap"].value.max())
    momentum = np.abs((mass[:, None] * (seen.velocity[-1] - seen.velocity[0])).sum(axis=0)).max()
    energy = kinetic_energy(result)
    return {
        "D41a": deepest / impact_overlap(Kind(1e9, 2500, RADIUS), INTRUDER),
        "D41b": float(momentum / (mass[0] * INTRUDER)),
        "D41c": float(energy.max() / energy[0]),
    }


def again_scene(name: str) -> Scene:
    """A small cloud that falls on a floor."""
    kind = Kind(1e7, 2500, 1e-3, restitution=0.5, friction=0.5)
    random = np.random.default_rng(5)
    position = lattice((5, 5, 8), 2.2e-3) + 1.2e-3 + random.uniform(-1e-4, 1e-4, (200, 3))
    velocity = 0.2 * random.normal(size=(200, 3))
    dt = fitted(0.1 * rayleigh(kind), 1e-3)
    return scene_of(
        name,
        {"grain": kind},
        [Body("grain", p, v) for p, v in zip(position, velocity, strict=True)],
        time_step=dt,
        times=[0, 0.03],
        gravity=(0, 0, -G),
        walls=(Plane(name="floor", material=WALL, point=(0, 0, 0), normal=(0, 0, 1)),),
    )


def _again(results: Mapping[str, Result]) -> Mapping[str, float]:
    a, b = (results[f"d42_{k}"].snapshots[MOTION] for k in (1, 2))
    fields = ("position", "velocity", "angular_velocity")
    return {"D42": float(max(np.abs(getattr(a, f) - getattr(b, f)).max() for f in fields))}


def experiments() -> tuple[Experiment, ...]:
    """D41 and D42."""
    return (
        on_one_scene(
            "d41_intruder",
            "A sphere at 100 m/s into 1728 resting ones (instead of 1e5)",
            partial(intruder_scene, "d41_intruder"),
            _intruder,
            (
                at_most("D41a", "deepest overlap in that of a head-on impact", "1", 1.05, "no pair is missed"),
                at_most("D41b", "error of the momentum", "1", 1e-5, "momentum"),
                at_most("D41c", "largest energy in that of the start", "1", 1.001, "energy"),
            ),
            "long",
        ),
        Experiment(
            "d42_again",
            "The same run twice",
            tuple(Trial(f"d42_{k}", partial(again_scene, f"d42_{k}")) for k in (1, 2)),
            _again,
            (at_most("D42", "largest difference of two runs of one scene", "1", 0.0, "determinism", scale=1.0),),
            "long",
        ),
    )
