"""A body that a spring pushes over a frictional floor: stick and slip, D36."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

import numpy as np

from dembench.results import Result
from dembench.scene import Domain, Material, Motion, PairLaw, Plane, Scene
from dembench.verification.checks import Check, Experiment, on_one_scene
from dembench.verification.scenes import WALL, Body, Kind, every, scene_of
from dembench.verification.stability.common import changed, fitted, motion, rayleigh

KIND = Kind(1e8, 2500, 0.01, friction=0.5)
SQUEEZE = 1e-3
"""Overlap with each of the two floors [r]."""
YIELDING = 1e5
"""Young's modulus of the plate that pushes [Pa]: two floors hold the sphere 170 times as stiffly as it pushes."""
SWING = 0.05
"""Amplitude of the oscillation in the overlap with the plate: so small that the plate's spring is a linear one [-]."""
PERIODS, SAMPLES = 8, 50
"""Oscillations that are recorded, and snapshots of each."""


def friction() -> float:
    """Coulomb's bound of both floors together [N]: 2 mu (4/3) E* sqrt(r) a^(3/2)."""
    force = 4 / 3 * KIND.modulus * math.sqrt(KIND.radius) * (SQUEEZE * KIND.radius) ** 1.5
    return 2 * KIND.friction * force


def pressed() -> float:
    """Overlap with the plate at which the sphere slips [m]: (3 F/(4 E* sqrt(r)))^(2/3), plate and sphere yield."""
    plate = YIELDING / (1 - KIND.poisson**2)
    modulus = plate * KIND.modulus / (plate + KIND.modulus)
    return (0.75 * friction() / (modulus * math.sqrt(KIND.radius))) ** (2 / 3)


def frequency() -> float:
    """Angular frequency of the sphere on the plate's spring k = 3 F/(2 a) [rad/s]: sqrt(k/m)."""
    return math.sqrt(1.5 * friction() / (pressed() * KIND.mass))


def plate_speed() -> float:
    """Speed of the plate [m/s]: its oscillation about the overlap at which the sphere slips is `SWING` of that."""
    return SWING * pressed() * frequency()


def scene() -> Scene:
    """A sphere squeezed between two floors; a plate without friction comes and pushes it at a constant speed.

    Friction at both floors is the same, so that the sphere does not roll; there is no gravity, and nothing is damped.
    """
    r, v, period = KIND.radius, plate_speed(), 2 * math.pi / frequency()
    end = pressed() / v + PERIODS * period
    half = r * (1 - SQUEEZE)
    interval = period / SAMPLES
    walls = (
        Plane(name="floor", material=WALL, point=(0, 0, -half), normal=(0, 0, 1)),
        Plane(name="ceiling", material=WALL, point=(0, 0, half), normal=(0, 0, -1)),
        Plane(name="plate", material="plate", point=(-r, 0, 0), normal=(1, 0, 0), motion=Motion(velocity=(v, 0, 0))),
    )
    dt = fitted(0.1 * rayleigh(KIND), interval)
    made = scene_of(
        "d36_stick_slip",
        {"grain": KIND},
        [Body("grain", (0, 0.3 * r, 0))],
        time_step=dt,
        times=every(interval, end),
        walls=walls[:2],
    )
    smooth = PairLaw(a="grain", b="plate", restitution=1, friction=0)
    return changed(
        made,
        walls=walls,
        materials=(*made.materials, Material(name="plate", density=1e3, young=YIELDING, poisson=KIND.poisson)),
        pair_laws=(*made.pair_laws, smooth),
        domain=Domain(lower=(-2 * r, -3 * r, -1.5 * r), upper=(4 * r, 3 * r, 1.5 * r)),
    )


def oscillation(result: Result) -> Mapping[str, float]:
    """Period, largest speed, and time until the first slip, over those of the closed form; least speed in the plate's.

    Once F = mu N the sphere has the speed v (1 - cos w t): it comes to rest once in each period, where spring and
    friction balance, and slips again.
    """
    seen = motion(result)
    speed, period = seen.velocity[:, 0, 0] / plate_speed(), 2 * math.pi / frequency()
    tops = [k for k in range(1, len(speed) - 1) if speed[k - 1] <= speed[k] > speed[k + 1] and speed[k] > 1]
    before, top, after = (speed[np.array(tops) + k] for k in (-1, 0, 1))
    bend = before - 2 * top + after
    interval = seen.time[1] - seen.time[0]
    times = seen.time[tops] + 0.5 * interval * (before - after) / bend
    return {
        "D36a": float(np.diff(times).mean() / period),
        "D36b": float((top - (after - before) ** 2 / (8 * bend)).mean() / 2),
        "D36c": float((times[0] - 0.5 * period) / (pressed() / plate_speed())),
        "D36d": float(np.abs([speed[a:b].min() for a, b in itertools.pairwise(tops)]).max()),
    }


def experiments() -> tuple[Experiment, ...]:
    """D36."""
    law = "Coulomb oscillator: v (1 - cos w t)"

    def check(id: str, title: str, expected: float, source: str, scale: float | None = None) -> Check:
        return Check(id, title, "1", expected, 0.02, source, scale=scale, scene_law=True)

    return (
        on_one_scene(
            "d36_stick_slip",
            "A sphere pushed by a spring over a floor",
            scene,
            oscillation,
            (
                check("D36a", "stick-slip: period over 2 pi/w", 1.0, law),
                check("D36b", "stick-slip: largest speed over twice that of the plate", 1.0, law),
                check("D36c", "stick-slip: time until the first slip over that of the closed form", 1.0, "F = mu N"),
                check("D36d", "stick-slip: least speed in that of the plate", 0.0, law, 1.0),
            ),
            "long",
        ),
    )
