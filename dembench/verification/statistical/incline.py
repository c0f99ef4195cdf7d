"""Steady flow down a rough incline: friction over the inertial number, and Bagnold's profile."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from dembench.results import Result
from dembench.scene import Domain, Plane, Scene, Snapshot
from dembench.verification.checks import Check, Experiment, Trial, at_least, deviation
from dembench.verification.statistical.beds import solid_fraction
from dembench.verification.statistical.grains import (
    DENSITY,
    DIAMETER,
    FLOOR_RELIEF,
    FLOOR_SPACING,
    GRAVITY,
    MASS,
    RADIUS,
    SPACING,
    of_grains,
    rough_floor,
    sheet,
)

COLUMNS, ROWS, LAYERS = 9, 7, 34
"""Spheres of the floor along and across the flow, and layers of as many grains: 21 diameters, where profiles are those
of thick flows (L. E. Silbert et al. 2001, 2003)."""
START, FRICTION = {22.0: 0.07, 24.0: 0.13, 26.0: 0.2}, 0.5
"""Inertial numbers of the velocities at the start by inclination [degrees], and friction of everything. The angles are
two and more above the angle of repose of such grains and below that at which they speed up for ever."""
DURATION, STEADY, INTERVAL = 2.2, 1.2, 0.04
"""End of a run, beginning of what is measured, two relaxation times after the start, and time between two snapshots of
it [s]."""
CORE, BULK = (0.3, 0.7), (0.1, 0.9)
"""Parts of the height in which inertial number and solid fraction, and in which the profile is measured."""
STATIC, RISE, SCALE = 0.37, math.tan(math.radians(32.8)) - math.tan(math.radians(20.9)), 0.279
"""mu_s of simulated spheres with friction, 0.36 to 0.38; mu_2 - mu_s and I_0 of glass beads (P. Jop, Y. Forterre &
O. Pouliquen 2006, Nature 441, 727)."""
FRACTION = 0.57
"""Solid fraction with which the velocities of the start are those of Bagnold's profile [-]."""
SEEDS = range(2)
AREA = COLUMNS * ROWS * (FLOOR_SPACING * RADIUS) ** 2


def rise(inertial: np.ndarray) -> np.ndarray:
    """mu(I) - mu_s = (mu_2 - mu_s)/(1 + I_0/I) [-] of Jop et al. 2006.

    Args:
        inertial: I, shape (n,).
    """
    return np.asarray(RISE * inertial / (inertial + SCALE))


def friction_law(angles: np.ndarray, inertial: np.ndarray) -> tuple[float, float]:
    """mu_s of a set of flows, and the largest distance of the tangent of an angle from mu(I) with it [-].

    Args:
        angles: Inclinations [degrees], whose tangents are the friction of steady flows, shape (n,).
        inertial: Their inertial numbers, shape (n,).
    """
    static = np.tan(np.radians(angles)) - rise(inertial)
    return float(static.mean()), float(np.abs(static - static.mean()).max())


def bagnold(height: np.ndarray, top: float) -> np.ndarray:
    """h^(3/2) - (h - z)^(3/2), to which velocities of a layer of height h go as they grow from its floor up.

    Args:
        height: z [m], shape (n,), at most `top`.
        top: h [m].
    """
    return np.asarray(top**1.5 - (top - height) ** 1.5)


def scene(angle: float, seed: int) -> Scene:
    """Grains above a floor of fixed spheres, with velocities near those that are expected: they soon flow steadily."""
    generator = np.random.default_rng(seed)
    floor = rough_floor(COLUMNS, ROWS, generator)
    grains = np.concatenate([sheet(COLUMNS, ROWS, (k + 1.5) * SPACING * RADIUS) for k in range(LAYERS)])
    grains += generator.uniform(-0.1, 0.1, grains.shape) * RADIUS
    slope = math.radians(angle)
    thickness = len(grains) * MASS / (FRACTION * DENSITY * AREA)
    shear = START[angle] * math.sqrt(FRACTION * GRAVITY * math.cos(slope)) / DIAMETER
    share = (grains[:, 2] - grains[:, 2].min()) / np.ptp(grains[:, 2])
    velocity = np.zeros_like(grains)
    velocity[:, 0] = 2 / 3 * shear * bagnold(thickness * share, thickness)
    low, high = -(1 + 2 * FLOOR_RELIEF) * RADIUS, (LAYERS + 4) * SPACING * RADIUS
    half = 0.5 * FLOOR_SPACING * RADIUS * np.array([COLUMNS, ROWS])
    snapshots = np.arange(round((DURATION - STEADY) / INTERVAL) + 1) * INTERVAL + STEADY
    return of_grains(
        "incline",
        FRICTION,
        np.vstack([floor, grains]),
        (Plane(name="ground", material="solid", point=(0, 0, low), normal=(0, 0, 1)),),
        Domain(lower=(-half[0], -half[1], low - RADIUS), upper=(half[0], half[1], high), periodic=(True, True, False)),
        DURATION,
        (Snapshot(name="flow", times=tuple(np.round(snapshots, 6).tolist())),),
        fixed=len(floor),
        velocity=np.vstack([np.zeros_like(floor), velocity]),
        gravity=(GRAVITY * math.sin(slope), 0.0, -GRAVITY * math.cos(slope)),
        soft=True,
    )


@dataclass(frozen=True)
class Flow:
    """What is measured of a flow.

    Attributes:
        inertial: Inertial number I = shear rate d/sqrt(P/rho) in the core [-].
        fraction: Solid fraction there [-].
        misfit: Largest deviation from Bagnold's profile, over the velocity at the top of what is compared [-].
        drift: Acceleration of all grains over the part of gravity that presses them on the plane [-]: what the friction
            differs by from the tangent of the angle.
    """

    inertial: float
    fraction: float
    misfit: float
    drift: float


def measured(time: np.ndarray, height: np.ndarray, speed: np.ndarray, pressing: float) -> Flow:
    """The flow in a series of snapshots, from layers one diameter thick.

    The pressure in the middle of a layer is the weight of the grains above it over the area; the top is where it would
    vanish if it went on as in the core. Grains in the hollows of the floor belong to the lowest layer.

    Args:
        time: [s], shape (t,).
        height: Heights of the grains above the plane [m], shape (t, n).
        speed: Their velocities down the plane [m/s], shape (t, n).
        pressing: Gravity across the plane [m/s^2].
    """
    layer = np.maximum(np.floor(height / DIAMETER).astype(int), 0)
    levels = (np.arange(layer.max() + 1) + 0.5) * DIAMETER
    count = np.bincount(layer.ravel(), minlength=len(levels))
    full = count > 0.5 * np.median(count)
    levels = levels[full]
    mean = np.bincount(layer.ravel(), weights=speed.ravel())[full] / count[full]
    above = np.array([np.count_nonzero(height > level) for level in levels]) / len(time)
    pressure = above * MASS * pressing / AREA
    core = _between(levels, CORE, 2 * float(height.mean()))
    slope, offset = np.polyfit(levels[core], pressure[core], 1)
    top = -offset / slope
    core, bulk = _between(levels, CORE, top), _between(levels, BULK, top)
    inertial = np.gradient(mean, DIAMETER)[core] * DIAMETER / np.sqrt(pressure[core] / DENSITY)
    shape = bagnold(levels[bulk], top)
    fitted = np.polyval(np.polyfit(shape, mean[bulk], 1), shape)
    fraction = np.mean([solid_fraction(own, RADIUS, AREA, CORE[0] * top, CORE[1] * top) for own in height])
    return Flow(
        float(inertial.mean()),
        float(fraction),
        float(np.abs(fitted - mean[bulk]).max() / mean[bulk][-1]),
        float(np.polyfit(time, speed.mean(axis=1), 1)[0] / pressing),
    )


def _between(levels: np.ndarray, shares: tuple[float, float], top: float) -> np.ndarray:
    return (levels > shares[0] * top) & (levels < shares[1] * top)


def _flow(result: Result) -> Flow:
    moving = len(result.scene.constraints[0].bodies)
    seen = result.snapshots["flow"]
    return measured(
        seen.time, seen.position[:, moving:, 2], seen.velocity[:, moving:, 0], -float(result.scene.gravity[2])
    )


def _measure(results: Mapping[str, Result]) -> Mapping[str, float]:
    mean = []
    for angle in START:
        flows = [_flow(results[_name(angle, seed)]) for seed in SEEDS]
        mean.append(np.mean([[f.inertial, f.fraction, f.misfit, abs(f.drift)] for f in flows], axis=0))
    inertial, fraction, misfit, drift = np.transpose(mean)
    static, distance = friction_law(np.array(list(START)), inertial)
    return {
        "BK8a": static,
        "BK8b": distance,
        "BK8c": -float(np.polyfit(inertial, fraction, 1)[0]),
        "BK8d": float(drift.max()),
        "BK9": float(misfit.max()),
    }


def _name(angle: float, seed: int) -> str:
    return f"incline_{angle:.0f}_{seed}"


def experiment() -> Experiment:
    """Friction and profile of flows at three angles."""
    trials = [Trial(_name(angle, seed), partial(scene, angle, seed)) for angle in START for seed in SEEDS]
    law = "μ_s + (μ_2 − μ_s)/(1 + I_0/I), μ_2 − μ_s and I_0 of Jop et al. 2006"
    return Experiment(
        "incline",
        "Flow down a rough incline",
        tuple(trials),
        _measure,
        (
            Check(
                "BK8a",
                "incline: μ_s of the friction law",
                "1",
                STATIC,
                0.03,
                f"{law}; 0.36 to 0.38 of simulated spheres with friction, and 0.02",
                kind="publication",
            ),
            deviation(
                "BK8b", "incline: largest distance of tan θ from the friction law", 0.02, law, kind="publication"
            ),
            at_least(
                "BK8c",
                "incline: decrease of the solid fraction over I",
                "1",
                0.05,
                "φ = φ_c − a I (GDR MiDi 2004)",
                kind="publication",
            ),
            deviation("BK8d", "incline: acceleration over gravity across the plane", 0.01, "steady flow"),
            deviation(
                "BK9",
                "incline: deviation from Bagnold's profile, over the velocity of the top",
                0.05,
                "h^3/2 − (h − z)^3/2 (R. A. Bagnold 1954; Silbert et al. 2001)",
                kind="publication",
            ),
        ),
        tier="statistical",
    )
