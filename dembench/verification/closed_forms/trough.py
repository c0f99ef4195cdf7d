"""A ball that rolls to and fro in a round trough: a contact whose normal turns with a spring in it.

A sphere that rolls without slip at the angle theta from the lowest point, its centre at rho from the axis, obeys
(7/5) rho theta'' = -g sin(theta): a pendulum of length 7/5 rho. The wall carries N = m g cos(theta) + m v^2/rho, and
friction (2/7) m g sin(theta) keeps it rolling, so the spring turns by as much as the contact does. One that stays where
it was bent has a part along the normal: (2/7) m g (1 - cos(theta_0)) at the lowest point.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.special import ellipk

from dembench.cases.quantities import crossings
from dembench.results import Result
from dembench.scene import Cylinder, Scene
from dembench.verification.checks import Check, Experiment, on_one_scene
from dembench.verification.closed_forms.collisions import Contact
from dembench.verification.scenes import MOTION, WALL, Body, Kind, every, scene_of

BALL = Kind(1e7, 2500, 5e-3, restitution=0.5, friction=1.0)
TROUGH, LENGTH, GRAVITY = 0.05, 0.1, 9.81
"""Radius and length of the trough [m]."""
START = math.radians(60)
"""Angle at which the ball is let go; rolling needs a friction of (2/7) tan(theta)."""
STEP, EVERY = 2e-5, 1e-3
NEAR = 0.1
"""Angle on both sides of the lowest point within which the overlap is averaged [rad]: N changes by 0.7 %."""


def overlap(angle: float) -> float:
    """Overlap that carries the ball on its way down, when it passes an angle [m]: Hertz 1882."""
    force = BALL.mass * GRAVITY * (math.cos(angle) + 10 / 7 * (math.cos(angle) - math.cos(START)))
    return Contact.with_wall(BALL).overlap(force)


def half_period() -> float:
    """Time from one pass through the lowest point to the next [s], of a pendulum of length 7/5 rho."""
    length = 7 / 5 * (TROUGH - BALL.radius)
    return float(2 * math.sqrt(length / GRAVITY) * ellipk(math.sin(START / 2) ** 2))


def scene() -> Scene:
    """The ball at rest on the slope; it passes the lowest point twice."""
    away = TROUGH - BALL.radius + overlap(START)
    position = (0.0, away * math.sin(START), -away * math.cos(START))
    trough = Cylinder(name="trough", material=WALL, start=(-LENGTH / 2, 0, 0), end=(LENGTH / 2, 0, 0), radius=TROUGH)
    return scene_of(
        "trough",
        {"ball": BALL},
        [Body("ball", position)],
        time_step=STEP,
        times=every(EVERY, 1.7 * half_period()),
        gravity=(0, 0, -GRAVITY),
        walls=(trough,),
    )


def _measure(result: Result) -> Mapping[str, float]:
    seen = result.snapshots[MOTION]
    y, z = seen.position[:, 0, 1], seen.position[:, 0, 2]
    angle, depth = np.arctan2(y, -z), np.hypot(y, z) + BALL.radius - TROUGH
    passed = crossings(seen.time, angle)
    if len(passed) < 2:
        return {"TR1a": math.nan, "TR1b": math.nan, "TR1c": math.nan, "TR1d": math.nan}
    # on the far side the ball turns between two records
    far = int(np.argmin(angle))
    bend = np.polyfit(np.arange(-2, 3), angle[far - 2 : far + 3], 2)
    turning = np.polyval(bend, -bend[1] / (2 * bend[0]))
    first = np.abs(angle) < NEAR
    first[far:] = False
    return {
        "TR1a": float(passed[1] - passed[0]),
        "TR1b": float(-turning),
        "TR1c": float(np.hypot(*seen.velocity[first, 0, 1:].T).max()),
        "TR1d": float(np.mean(depth[first])),
    }


def experiment() -> Experiment:
    """Period, amplitude, speed and overlap."""
    rho = TROUGH - BALL.radius
    speed = math.sqrt(10 / 7 * GRAVITY * rho * (1 - math.cos(START)))
    near = np.linspace(-NEAR, NEAR, 201)
    mean = float(np.mean([overlap(angle) for angle in near]))
    rolling, hertz = "pendulum of length 7/5 rho", "Hertz 1882 with N = m g cos + m v^2/rho"
    checks = (
        Check("TR1a", "half a period", "s", half_period(), 0.005 * half_period(), rolling),
        Check("TR1b", "angle where it turns on the far side", "rad", START, 0.01 * START, "energy is kept"),
        Check("TR1c", "speed at the lowest point", "m/s", speed, 0.005 * speed, rolling),
        Check("TR1d", "overlap at the lowest point", "m", mean, 0.01 * mean, hertz, scene_law=True),
    )
    return on_one_scene("trough", "A ball rolls in a trough", scene, _measure, checks)
