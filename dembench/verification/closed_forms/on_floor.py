"""On a floor: balls that slide until they roll (MF04), a column and a pyramid at rest (SR5)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from dembench.results import Result
from dembench.scene import Scene, WallForce
from dembench.verification.checks import Check, Experiment, deviation, on_one_scene
from dembench.verification.closed_forms.collisions import SPHERE, Contact
from dembench.verification.scenes import MOTION, Body, Kind, every, floor, scene_of

GRAVITY = 9.81
RADIUS = 5e-4
STEP, END, EVERY = 1e-5, 0.06, 5e-4
FRICTIONS, SPEEDS = (0.1, 0.3, 1.0), (0.05, 0.1)
"""Friction coefficients, and initial speeds of two balls each [m/s]: the longest sliding takes 29 ms."""
MATERIAL: dict[str, Any] = {"young": 1e7, "density": 1e4, "radius": RADIUS}
BRISK, DULL = 0.9, 0.3
"""Restitutions of the balls that slide and of those that stand. The law does not bound the dashpot of a contact whose
spring is still short, and a ball that begins to slide at once meets it at full speed: in one step of 10 μs it loses 3 %
of its speed at e = 0.5, and 0.4 % at 0.9."""
KINDS = {f"mu{round(100 * mu)}": Kind(**MATERIAL, restitution=BRISK, friction=mu) for mu in FRICTIONS} | {
    "stacked": Kind(**MATERIAL, restitution=DULL, friction=0.5)
}
BALLS = [(mu, u) for mu in FRICTIONS for u in SPEEDS]
COLUMN, PYRAMID = 5, 3
APART = 1.02
"""Half the distance of the lower spheres of the pyramid, in radii: they must not touch each other."""
BASE, TOP = len(BALLS), len(BALLS) + COLUMN
"""Body at the foot of the column, and first body of the pyramid."""
FLOOR_FORCE = "floor_force"
GARG = "Garg et al. 2012: slides to t = 2 u/(7 μ g) with u - μ g t, then rolls with 5/7 u"


def weight() -> float:
    """Weight of a ball [N]."""
    return KINDS["stacked"].mass * GRAVITY


def scene() -> Scene:
    """Sliding balls rest on the floor already; column and pyramid are set down touching and settle."""
    sunk = Contact.with_wall(KINDS["stacked"]).overlap(weight())
    bodies = [
        Body(f"mu{round(100 * mu)}", (0, 6 * RADIUS * k, RADIUS - sunk), (u, 0, 0)) for k, (mu, u) in enumerate(BALLS)
    ]
    y = 6 * RADIUS * len(BALLS)
    bodies += [Body("stacked", (0, y, (2 * k + 1) * RADIUS)) for k in range(COLUMN)]
    y += 6 * RADIUS
    bodies += [Body("stacked", (side * APART * RADIUS, y, RADIUS)) for side in (-1, 1)]
    bodies.append(Body("stacked", (0, y, (1 + math.sqrt(4 - APART**2)) * RADIUS)))
    return scene_of(
        "on_floor",
        KINDS,
        bodies,
        time_step=STEP,
        times=every(EVERY, END),
        gravity=(0, 0, -GRAVITY),
        walls=(floor(),),
        observables=(WallForce(name=FLOOR_FORCE, wall="floor", interval=EVERY),),
    )


def _measure(result: Result) -> Mapping[str, float]:
    seen = result.snapshots[MOTION]
    t, v, w, x = seen.time, seen.velocity[:, :, 0], seen.angular_velocity[:, :, 1], seen.position
    sliding, turning, rolling = 0.0, 0.0, 0.0
    for k, (mu, u) in enumerate(BALLS):
        during = t < 0.95 * 2 * u / (7 * mu * GRAVITY)
        slowed = mu * GRAVITY * t[during]
        sliding = max(sliding, np.abs(v[during, k] - u + slowed).max() / u)
        turning = max(turning, np.abs(RADIUS * w[during, k] - SPHERE * slowed).max() / u)
        rolling = max(rolling, abs(v[-1, k] / (5 / 7 * u) - 1), abs(RADIUS * w[-1, k] / (5 / 7 * u) - 1))
    column, foot = x[-1, BASE : BASE + COLUMN], Contact.with_wall(KINDS["stacked"])
    between = Contact.between(KINDS["stacked"], KINDS["stacked"])
    overlaps = np.append(RADIUS - column[0, 2], 2 * RADIUS - np.diff(column[:, 2]))
    carried = (COLUMN - np.arange(COLUMN)) * weight()
    expected = [(foot if k == 0 else between).overlap(float(f)) for k, f in enumerate(carried)]
    left, right, top = x[-1, TOP : TOP + PYRAMID]
    bases = RADIUS - np.array([left[2], right[2]])
    sides = 2 * RADIUS - np.array([np.linalg.norm(top - left), np.linalg.norm(top - right)])
    force = result.observables[FLOOR_FORCE].value[-1]
    total = weight() * len(result.scene.bodies)
    return {
        "MF04a": sliding,
        "MF04b": turning,
        "MF04c": rolling,
        "SR5a": float(np.abs(overlaps / expected - 1).max()),
        "SR5b": float(foot.stiffness * max(overlaps[0], 0.0) ** 1.5 / weight()),
        "SR5c": float(np.abs(bases / foot.overlap(1.5 * weight()) - 1).max()),
        "SR5d": float(np.abs(sides / between.overlap(0.5 * weight()) - 1).max()),
        "SR5e": float(abs(force[2]) / total),
        "SR5f": float(np.linalg.norm(seen.velocity[-1, BASE:], axis=1).max()),
    }


def experiment() -> Experiment:
    """The experiment."""
    hertz, statics = "Hertz: d = (F/k)^(2/3) under the weight above", "statics of the pyramid: m g/2 along each side"
    checks = (
        deviation("MF04a", "sliding: largest deviation of the speed, over that at the start", 0.01, GARG),
        deviation("MF04b", "sliding: largest deviation of the surface speed, over the speed at the start", 0.01, GARG),
        deviation("MF04c", "rolling: largest deviation of speed and spin", 0.01, GARG),
        deviation("SR5a", f"column of {COLUMN}: largest deviation of an overlap", 0.01, hertz, scene_law=True),
        Check(
            "SR5b",
            f"column of {COLUMN}: force at the foot over the weight of a ball",
            "1",
            COLUMN,
            0.05,
            hertz,
            scene_law=True,
        ),
        deviation("SR5c", "pyramid: deviation of the overlaps with the floor", 0.01, "3/2 m g under each", True),
        deviation("SR5d", "pyramid: deviation of the overlaps of the sides", 0.02, statics, True),
        Check("SR5e", "force on the floor over the weight of all", "1", 1.0, 5e-3, "statics"),
        Check("SR5f", "column and pyramid: largest speed at the end", "m/s", 0.0, GRAVITY * STEP, "rest", scale=1.0),
    )
    settings = {"dt": f"{STEP:g}"}
    return on_one_scene("on_floor", "Sliding balls, a column and a pyramid", scene, _measure, checks, settings=settings)
