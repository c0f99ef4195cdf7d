"""Cooling of a granular gas: Haff's law with the time of Enskog's theory."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from dembench.results import Result
from dembench.scene import Bodies, Domain, Material, PairLaw, Scene, Snapshot, Species
from dembench.verification.checks import Check, Experiment, Trial

SIDE, FRACTION, RESTITUTION = 8, 0.05, 0.9
"""Spheres along an edge of the start, solid fraction, restitution [-]."""
RADIUS, DENSITY, YOUNG, POISSON = 1e-3, 2500.0, 1e7, 0.25
THERMAL = 0.2
"""Root of the mean square of one component of the velocity at the start [m/s]; a contact lasts 3 % of a flight."""
SEEDS = range(8)
STEP, RECORDS = 1e-5, 60
"""Time step, a fiftieth of a mean contact [s], and number of snapshots."""
SPAN, IGNORED = 3.0, 0.2
"""Duration, and beginning in which the gas forgets its lattice, in times of Haff."""


def haff_time(thermal: float = THERMAL) -> float:
    """Time of Haff's law from Enskog's theory [s].

    1/tau = (1 - e^2) w/6 with the collision frequency w = 4 sqrt(pi) n s^2 chi sqrt(T) of each sphere and chi =
    (1 - phi/2)/(1 - phi)^3 (N. F. Carnahan & K. E. Starling 1969; T. P. C. van Noije & M. H. Ernst 1998, Granular
    Matter 1, 57).

    Args:
        thermal: sqrt(T), root of the mean square of one component of the velocity [m/s].
    """
    diameter = 2 * RADIUS
    number = FRACTION / (math.pi / 6 * diameter**3)
    contact = (1 - FRACTION / 2) / (1 - FRACTION) ** 3
    frequency = 4 * math.sqrt(math.pi) * number * diameter**2 * contact * thermal
    return 6 / ((1 - RESTITUTION**2) * frequency)


def scene(seed: int) -> Scene:
    """Smooth spheres in a periodic cube with the velocities of a gas at rest as a whole."""
    generator = np.random.default_rng(seed)
    spacing = (math.pi / 6 * (2 * RADIUS) ** 3 / FRACTION) ** (1 / 3)
    size = SIDE * spacing
    places = (np.stack(np.meshgrid(*3 * [np.arange(SIDE)]), axis=-1).reshape(-1, 3) + 0.5) * spacing
    room = 0.5 * spacing - 1.01 * RADIUS
    velocity = generator.normal(size=places.shape)
    velocity -= velocity.mean(axis=0)
    velocity *= THERMAL / math.sqrt(np.mean(velocity**2))
    interval = math.ceil(SPAN * haff_time() / RECORDS / STEP) * STEP
    return Scene(
        name="haff",
        materials=(Material(name="solid", density=DENSITY, young=YOUNG, poisson=POISSON),),
        pair_laws=(PairLaw(a="solid", b="solid", restitution=RESTITUTION, friction=0),),
        species=(Species(name="grain", material="solid", radius=RADIUS),),
        bodies=Bodies(position=places + generator.uniform(-room, room, places.shape), velocity=velocity),
        domain=Domain(lower=(0, 0, 0), upper=(size, size, size), periodic=(True, True, True)),
        gravity=(0, 0, 0),
        duration=RECORDS * interval,
        time_step=STEP,
        observables=(Snapshot(name="motion", times=tuple(k * interval for k in range(RECORDS + 1))),),
    )


def cooling(time: np.ndarray, temperature: np.ndarray, expected: float) -> tuple[float, float]:
    """Time and exponent of a cooling curve.

    The time [s] is that of the line 1/sqrt(T) = (1 + t/tau)/sqrt(T0) of least squares; the exponent is the slope of
    log T over log(1 + t/tau) with the expected time, -2 in Haff's law.

    Args:
        time: [s], shape (t,).
        temperature: In any unit, shape (t,).
        expected: Time of Haff's law [s].
    """
    later = time >= IGNORED * expected
    slope, start = np.polyfit(time[later], temperature[later] ** -0.5, 1)
    exponent = np.polyfit(np.log1p(time[later] / expected), np.log(temperature[later]), 1)[0]
    return float(start / slope), float(exponent)


def _measure(results: Mapping[str, Result]) -> Mapping[str, float]:
    found = []
    for result in results.values():
        seen = result.snapshots["motion"]
        moving = seen.velocity - seen.velocity.mean(axis=1, keepdims=True)
        found.append(cooling(seen.time, np.mean(moving**2, axis=(1, 2)), haff_time()))
    time, exponent = np.mean(found, axis=0)
    return {"GP1a": float(time), "GP1b": float(exponent)}


def experiment() -> Experiment:
    """Haff's law on an ensemble of seeds."""
    time = haff_time()
    source = "Haff 1983 with the frequency of Enskog; 5 % on eight seeds"
    return Experiment(
        "haff",
        "Cooling gas",
        tuple(Trial(f"haff_{seed}", partial(scene, seed)) for seed in SEEDS),
        _measure,
        (
            Check("GP1a", "Haff's law: time of cooling, mean of eight seeds", "s", time, 0.05 * time, source),
            Check("GP1b", "Haff's law: exponent of the temperature", "1", -2.0, 0.1, source),
        ),
        tier="statistical",
    )
