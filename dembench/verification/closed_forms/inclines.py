"""Spheres on inclines: sliding and rolling (SR1), and with rolling friction (SR2)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from dembench.results import Result
from dembench.scene import Scene
from dembench.verification.checks import Check, Experiment, deviation, on_one_scene
from dembench.verification.closed_forms.collisions import SPHERE, Contact
from dembench.verification.scenes import MOTION, Body, Kind, every, floor, scene_of

GRAVITY, RADIUS = 9.81, 5e-4
STEP, END, EVERY = 1e-5, 0.06, 1e-3
FROM = 0.02
"""Accelerations are means from here to the end [s]: the springs of the contact have settled."""
MATERIAL: dict[str, Any] = {"young": 1e7, "density": 1e4, "radius": RADIUS, "restitution": 0.5}
SLOPE = math.radians(30)
SLIDING, ROLLING = (0.05, 0.10, 0.15), (0.18, 0.3, 0.8)
"""Friction coefficients below and above (2/7) tan 30° = 0.165, where spheres begin to slide."""
GENTLE = math.radians(10)
RESISTANCES, RESTING = (0.02, 0.05, 0.1), 0.3
"""Coefficients of rolling friction below tan 10° = 0.176, and one above."""
SPIN = 400.0
"""Spin of a sphere without sliding friction that rolling friction stops [rad/s]."""


def _scene(name: str, kinds: Mapping[str, Kind], slope: float, spin: float) -> Scene:
    """Spheres at rest on a floor under a gravity that is tilted by the slope; the last one may spin."""
    pull = GRAVITY * math.cos(slope)
    bodies = []
    for k, (name_of, kind) in enumerate(kinds.items()):
        sunk = Contact.with_wall(kind).overlap(kind.mass * pull)
        turned = spin if k == len(kinds) - 1 else 0.0
        bodies.append(Body(name_of, (0, 6 * RADIUS * k, RADIUS - sunk), spin=(0, turned, 0)))
    return scene_of(
        name,
        kinds,
        bodies,
        time_step=STEP,
        times=every(EVERY, END),
        gravity=(GRAVITY * math.sin(slope), 0, -pull),
        walls=(floor(),),
    )


def incline() -> Scene:
    """Spheres of several frictions."""
    kinds = {f"mu{round(100 * mu)}": Kind(**MATERIAL, friction=mu) for mu in (*SLIDING, *ROLLING)}
    return _scene("incline", kinds, SLOPE, 0.0)


def resistance() -> Scene:
    """Spheres of several rolling frictions; the last one is frictionless but for it, and spins."""
    kinds = {f"roll{round(100 * r)}": Kind(**MATERIAL, friction=0.8, rolling=r) for r in (*RESISTANCES, RESTING)}
    return _scene("rolling_friction", {**kinds, "spun": Kind(**MATERIAL, rolling=0.1)}, GENTLE, SPIN)


def accelerations(result: Result) -> tuple[np.ndarray, np.ndarray]:
    """Mean accelerations down the slope [m/s^2] and mean angular ones times the radius, shape (n,), from `FROM` on."""
    seen = result.snapshots[MOTION]
    k = int(np.argmin(np.abs(seen.time - FROM)))
    span = seen.time[-1] - seen.time[k]
    v, w = seen.velocity[:, :, 0], RADIUS * seen.angular_velocity[:, :, 1]
    return (v[-1] - v[k]) / span, (w[-1] - w[k]) / span


def _incline(result: Result) -> Mapping[str, float]:
    a, alpha = accelerations(result)
    n, sin, cos = len(SLIDING), math.sin(SLOPE), math.cos(SLOPE)
    mu, rolls = np.array(SLIDING), 5 / 7 * GRAVITY * sin
    return {
        "SR1a": float(np.abs(a[:n] / (GRAVITY * (sin - mu * cos)) - 1).max()),
        "SR1b": float(np.abs(alpha[:n] / (SPHERE * mu * GRAVITY * cos) - 1).max()),
        "SR1c": float(np.abs(a[n:] / rolls - 1).max()),
        "SR1d": float(np.abs(alpha[n:] / rolls - 1).max()),
    }


def _resistance(result: Result) -> Mapping[str, float]:
    a, alpha = accelerations(result)
    n, sin, cos = len(RESISTANCES), math.sin(GENTLE), math.cos(GENTLE)
    exact = 5 / 7 * GRAVITY * (sin - np.array(RESISTANCES) * cos)
    seen = result.snapshots[MOTION]
    return {
        "SR2a": float(np.abs(a[:n] / exact - 1).max()),
        "SR2b": float(np.linalg.norm(seen.velocity[-1, n])),
        "SR2c": float(-alpha[n + 1] / (SPHERE * 0.1 * GRAVITY * cos)),
    }


def experiments() -> tuple[Experiment, ...]:
    """Both experiments."""
    settings, sliding = {"dt": f"{STEP:g}"}, "(2/7) tan θ > μ: g (sin θ - μ cos θ), 5 μ g cos θ/(2 R)"
    rolling, resisted = "(2/7) tan θ < μ: (5/7) g sin θ", "moment μ_r R N: (5/7) g (sin θ - μ_r cos θ)"
    slope = (
        deviation("SR1a", "sliding: largest deviation of the acceleration", 5e-3, sliding),
        deviation("SR1b", "sliding: largest deviation of the angular acceleration", 5e-3, sliding),
        deviation("SR1c", "rolling: largest deviation of the acceleration", 5e-3, rolling),
        deviation("SR1d", "rolling: largest deviation of the angular acceleration", 5e-3, rolling),
    )
    friction = (
        deviation("SR2a", "rolling friction: largest deviation of the acceleration", 0.01, resisted),
        Check("SR2b", "rolling friction above tan θ: speed at the end", "m/s", 0.0, GRAVITY * STEP, "rest", scale=1.0),
        Check("SR2c", "spinning sphere: deceleration over 5 μ_r g/(2 R)", "1", 1.0, 0.01, "moment μ_r R N"),
    )
    return (
        on_one_scene("incline", "Spheres on an incline", incline, _incline, slope, settings=settings),
        on_one_scene(
            "rolling_friction", "Rolling friction on an incline", resistance, _resistance, friction, settings=settings
        ),
    )
