"""Pairs that meet head-on from every distance: a contact that the neighbour lists find late would throw them apart."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from dembench.results import Result
from dembench.scene import Scene
from dembench.verification.checks import Check, Experiment, deviation, on_one_scene
from dembench.verification.scenes import MOTION, Body, Kind, scene_of

GRAIN = Kind(1e8, 2500, 1e-3, restitution=0.9)
SPEED = 1.0
"""Speed of each of two that meet [m/s]: together they come as near as lists must foresee."""
GAPS = np.geomspace(0.005, 1.2, 60)
"""Gaps at the start, in diameters."""
SPACING = 3.0
"""Distance of neighbouring pairs, in diameters."""
STEP = 1e-6


def scene() -> Scene:
    """Both of each pair move; all are apart again at the end."""
    diameter = 2 * GRAIN.radius
    bodies = []
    for k, gap in enumerate(GAPS):
        for side in (-1, 1):
            x = 0.5 * (1 + gap) * diameter * side
            bodies.append(Body("grain", (x, k * SPACING * diameter, 0), (-side * SPEED, 0, 0)))
    meeting = 0.5 * GAPS[-1] * diameter / SPEED
    end = math.ceil((1.2 * meeting + 1e-4) / STEP) * STEP
    return scene_of("meetings", {"grain": GRAIN}, bodies, time_step=STEP, times=(0.0, end))


def _measure(result: Result) -> Mapping[str, float]:
    v = result.snapshots[MOTION].velocity[-1, :, 0]
    restitution = (v[1::2] - v[0::2]) / (2 * SPEED)
    return {
        "LI1a": float(restitution.mean()),
        "LI1b": float(np.abs(restitution / restitution.mean() - 1).max()),
        "LI1c": float(np.abs(v[1::2] + v[0::2]).max() / SPEED),
    }


def experiment() -> Experiment:
    """The restitution of all pairs, and how much one of them differs from the others."""
    e = GRAIN.restitution
    checks = (
        Check("LI1a", "mean restitution of 60 pairs", "1", e, 0.01 * e, "pair law"),
        deviation("LI1b", "restitution of the pair that differs most", 0.02, "pairs differ in the gap only"),
        deviation("LI1c", "momentum of a pair, over that of one", 1e-6, "both are alike"),
    )
    return on_one_scene("meetings", "Pairs that meet from every distance", scene, _measure, checks)
