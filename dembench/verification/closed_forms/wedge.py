"""Spheres in a wedge of two planes (SR5): where they rest, and the forces on the planes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from dembench.results import Result
from dembench.scene import Plane, Scene, WallForce
from dembench.verification.checks import Check, Experiment, on_one_scene
from dembench.verification.closed_forms.collisions import Contact
from dembench.verification.scenes import MOTION, WALL, Body, Kind, every, scene_of

GRAVITY, RADIUS, HALF_ANGLE = 9.81, 5e-4, math.radians(10)
STEP, END, EVERY = 1e-5, 0.06, 1e-3
MATERIAL: dict[str, Any] = {"young": 1e7, "density": 1e4, "radius": RADIUS, "restitution": 0.3}
KINDS = {"smooth": Kind(**MATERIAL), "rough": Kind(**MATERIAL, friction=0.5)}
SIDES = ("left", "right")


def scene() -> Scene:
    """A smooth and a rough sphere, set down where they touch both planes."""
    sin, cos = math.sin(HALF_ANGLE), math.cos(HALF_ANGLE)
    walls = [
        Plane(name=name, material=WALL, point=(0, 0, 0), normal=(sign * cos, 0, sin))
        for name, sign in zip(SIDES, (1, -1), strict=True)
    ]
    return scene_of(
        "wedge",
        KINDS,
        [Body(kind, (0, 6 * RADIUS * k, RADIUS / sin)) for k, kind in enumerate(KINDS)],
        time_step=STEP,
        times=every(EVERY, END),
        gravity=(0, 0, -GRAVITY),
        walls=walls,
        observables=[WallForce(name=f"on_{name}", wall=name, interval=EVERY) for name in SIDES],
    )


def sinking() -> float:
    """How far the smooth sphere comes to rest below where it touches both planes [m]: (F/k)^(2/3)/sin a."""
    kind = KINDS["smooth"]
    force = kind.mass * GRAVITY / (2 * math.sin(HALF_ANGLE))
    return Contact.with_wall(kind).overlap(force) / math.sin(HALF_ANGLE)


def _measure(result: Result) -> Mapping[str, float]:
    seen = result.snapshots[MOTION]
    start, end = seen.position[0], seen.position[-1]
    forces = np.array([result.observables[f"on_{name}"].value[-1] for name in SIDES])
    weight = result.scene.masses().sum() * GRAVITY
    return {
        "SR5g": float(start[0, 2] - end[0, 2]),
        "SR5h": float(np.abs(end[:, 0]).max() / RADIUS),
        "SR5i": float(-forces[:, 2].sum() / weight),
        "SR5j": float(abs(forces[:, 0].sum()) / weight),
    }


def experiment() -> Experiment:
    """The experiment."""
    source, depth = "m g/(2 sin a) on each plane; Hertz", sinking()
    checks = (
        Check(
            "SR5g",
            "wedge of 20°: depth to which a smooth sphere sinks",
            "m",
            depth,
            0.01 * depth,
            source,
            scene_law=True,
        ),
        Check("SR5h", "wedge: distance from the middle, in radii", "1", 0.0, 1e-3, "symmetry", scale=1.0),
        Check("SR5i", "wedge: vertical force on both planes over the weight", "1", 1.0, 5e-3, "statics"),
        Check("SR5j", "wedge: horizontal force on both planes over the weight", "1", 0.0, 1e-3, "symmetry", scale=1.0),
    )
    settings = {"dt": f"{STEP:g}"}
    return on_one_scene("wedge", "Spheres in a wedge", scene, _measure, checks, settings=settings)
