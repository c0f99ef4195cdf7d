"""Weight in a silo: Janssen's law, with friction mobilised by a sleeve that moves slowly up."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from scipy.optimize import curve_fit

from dembench.results import Result
from dembench.scene import Cylinder, Domain, Plane, Scene, Snapshot, WallForce
from dembench.scene.wall import Motion
from dembench.verification.checks import Check, Experiment, Trial, at_most
from dembench.verification.statistical.grains import GRAVITY, MASS, RADIUS, SPACING, column, of_grains

SLEEVE, FRICTION, LIFT_SPEED = 12.0, 0.5, 5e-3
"""Radius of the sleeve in radii of grains, friction of everything, speed with which the sleeve moves up [m/s]."""
LAYERS = (21, 42, 63)
"""Layers that are poured: fillings of about one, two and three diameters of the sleeve."""
DURATION, AVERAGED, INTERVAL = 0.7, 0.1, 5e-3
"""End of a run, its last part in which the force is averaged, and time between two records [s]."""
SEEDS = range(3)


def scene(layers: int, seed: int) -> Scene:
    """Grains that fall from a loose lattice into a sleeve on a floor."""
    radius = SLEEVE * RADIUS
    low, high = -8 * RADIUS, (layers + 2) * (SPACING * RADIUS)
    walls = (
        Plane(name="floor", material="solid", point=(0, 0, 0), normal=(0, 0, 1)),
        Cylinder(
            name="sleeve",
            material="solid",
            start=(0, 0, low),
            end=(0, 0, high),
            radius=radius,
            motion=Motion(velocity=(0, 0, LIFT_SPEED)),
        ),
    )
    room = 1.5 * radius
    return of_grains(
        "janssen",
        FRICTION,
        column(radius, layers, np.random.default_rng(seed)),
        walls,
        Domain(lower=(-room, -room, 1.5 * low), upper=(room, room, high + LIFT_SPEED * DURATION + 2 * RADIUS)),
        DURATION,
        (WallForce(name="weight", wall="floor", interval=INTERVAL), Snapshot(name="end", times=(DURATION,))),
    )


def saturation(filled: Sequence[float], apparent: Sequence[float]) -> tuple[float, float]:
    """Mass at which the apparent mass saturates, and how far Janssen's law is off.

    The law is m = M_s (1 - exp(-M/M_s)) (H. A. Janssen 1895); M_s is that of least squares.

    Args:
        filled: Masses that were filled in [kg].
        apparent: Masses that the floor carries [kg].

    Returns:
        The mass [kg], and the largest deviation over the apparent mass [-].
    """
    masses, carried = np.asarray(filled, dtype=float), np.asarray(apparent, dtype=float)

    def law(mass: np.ndarray, limit: float) -> np.ndarray:
        return np.asarray(limit * -np.expm1(-mass / limit))

    (limit,), _ = curve_fit(law, masses, carried, p0=[carried.max()], bounds=(0, np.inf))
    return float(limit), float(np.max(np.abs(law(masses, limit) - carried) / carried))


def _measure(results: Mapping[str, Result]) -> Mapping[str, float]:
    filled, apparent, density = [], [], []
    for layers in LAYERS:
        own = [results[_name(layers, seed)] for seed in SEEDS]
        mass = MASS * len(own[0].scene.bodies)
        height = [np.quantile(result.snapshots["end"].position[-1, :, 2], 0.99) + RADIUS for result in own]
        density.append(mass / (math.pi * (SLEEVE * RADIUS) ** 2 * float(np.mean(height))))
        filled.append(mass)
        apparent.append(float(np.mean([_carried(result) for result in own])))
    limit, deviation = saturation(filled, apparent)
    pressure = density[-1] * math.pi * (SLEEVE * RADIUS) ** 3 / (2 * FRICTION * limit)
    return {"BK1a": pressure, "BK1b": deviation, "BK1c": apparent[-1] / filled[-1]}


def _carried(result: Result) -> float:
    """Mass that the floor carries on average at the end [kg]."""
    weight = result.observables["weight"]
    return float(np.abs(weight.value[weight.time >= DURATION - AVERAGED, 2]).mean() / GRAVITY)


def _name(layers: int, seed: int) -> str:
    return f"janssen_{layers}_{seed}"


def experiment() -> Experiment:
    """Janssen's law on fillings of three heights."""
    trials = [Trial(_name(layers, seed), partial(scene, layers, seed)) for layers in LAYERS for seed in SEEDS]
    source = "Janssen 1895: M_s (1 − exp(−M/M_s)), M_s = ρ π R³/(2 μ K)"
    return Experiment(
        "janssen",
        "Silo at rest",
        tuple(trials),
        _measure,
        (
            Check("BK1a", "Janssen: ratio K of the pressures", "1", 0.75, 0.25, f"{source}; K of 0.5 to 1"),
            at_most("BK1b", "Janssen: largest deviation from the law", "1", 0.0, source, tolerance=0.05),
            at_most(
                "BK1c",
                "Janssen: share of the weight on the floor at three diameters",
                "1",
                0.6,
                "saturation; it is 1 without friction at the wall",
            ),
        ),
        tier="statistical",
    )
