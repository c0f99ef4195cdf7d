"""Collapse of columns: grains that are let go at once and spread over a rough floor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from dembench.initial.beds import read_bed
from dembench.initial.stacking import stacked
from dembench.results import Result
from dembench.scene import Cylinder, Domain, Plane, Scene, Snapshot
from dembench.share import share
from dembench.verification.checks import Check, Experiment, Trial
from dembench.verification.statistical.grains import (
    DIAMETER,
    FLOOR_LEVEL,
    FLOOR_RELIEF,
    GRAVITY,
    RADIUS,
    edge,
    of_grains,
    profile,
    round_floor,
)

COLUMN, FRICTION = 12 * DIAMETER, 0.5
"""Radius r0 of the column [m], friction of everything."""
ASPECTS = (0.9, 3.0)
"""Heights of the columns in their radii."""
DURATION, ROOM = 4.5, 9 * DIAMETER
"""End of a run in sqrt(h0/g), of which a collapse takes three, and how far the floor goes on beyond the edge that is
expected [m]."""
SUMMIT = 2
"""Number of rings about the axis whose surface is the height of a deposit."""
SEEDS = range(3)
BED, LOWEST, LOOSER = "case1-large", DIAMETER, 1.005
"""Settled bed in a silo that the columns are cut out of, lowest height of a cut above its cone [m], and by what it is
stretched: under the weight of the whole bed its grains overlap by more than those of a low column may."""


def scene(aspect: float, seed: int) -> Scene:
    """A column that was cut out of a settled bed and stands free on a floor of fixed spheres, in a wide tray."""
    generator = np.random.default_rng(seed)
    reach = COLUMN * (1 + run_out(aspect)) + ROOM
    floor = round_floor(reach, generator)
    grains = packed(aspect * COLUMN, generator) + np.array([0, 0, 2 * RADIUS])
    low, high = -(1 + 2 * FLOOR_RELIEF) * RADIUS, aspect * COLUMN + 10 * DIAMETER
    duration = math.ceil(DURATION * math.sqrt(aspect * COLUMN / GRAVITY) / 0.05) / 20
    walls = (
        Plane(name="ground", material="solid", point=(0, 0, low), normal=(0, 0, 1)),
        Cylinder(name="rim", material="solid", start=(0, 0, low - RADIUS), end=(0, 0, high), radius=reach + RADIUS),
    )
    side = reach + 3 * RADIUS
    return of_grains(
        "collapse",
        FRICTION,
        np.vstack([floor, grains]),
        walls,
        Domain(lower=(-side, -side, low - RADIUS), upper=(side, side, high)),
        duration,
        (Snapshot(name="end", times=(duration,)),),
        fixed=len(floor),
        soft=True,
    )


def packed(height: float, generator: np.random.Generator) -> np.ndarray:
    """Centres of a dense random column of radius r0 on z = 0 [m], shape (n, 3).

    The bed is made smaller until its grains are those of the suite, turned about its axis, and cut at random heights; a
    column higher than the bed is two cuts, one on the other.

    Args:
        height: Of the column [m].
        generator: Where the angle and the heights are from.
    """
    bed = read_bed(share("data", "beds", f"{BED}.npz"))
    position = bed.position * (LOOSER * RADIUS / bed.plan.radii()[0])
    angle = generator.uniform(0, 2 * math.pi)
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    position = position @ turn.T
    lowest, top = LOWEST, float(np.quantile(position[:, 2], 0.99)) - DIAMETER
    twice = height > top - lowest
    piece = 0.5 * height if twice else height
    below = generator.uniform(lowest, top - piece)
    along, away = position[:, 2] - below, np.hypot(position[:, 0], position[:, 1])
    cut = (position - [0, 0, below])[(along >= 0) & (along < piece) & (away < COLUMN)]
    return stacked(cut, RADIUS) if twice else cut


def run_out(aspect: float) -> float:
    """Run-out (r_inf - r0)/r0 of an axisymmetric column [-] (G. Lube et al. 2004, J. Fluid Mech. 508, 175)."""
    return 1.24 * aspect if aspect < 1.7 else 1.6 * math.sqrt(aspect)


def height_left(aspect: float) -> float:
    """Height of the deposit of an axisymmetric column over r0 [-]; see `run_out`.

    Raises:
        ValueError: An aspect ratio from 1 to 1.7, where neither law holds.
    """
    if 1 <= aspect < 1.7:
        raise ValueError(f"aspect ratio {aspect:g}: accepted is below 1, or from 1.7 on")
    return aspect if aspect < 1 else 0.88 * aspect ** (1 / 6)


def deposit(position: np.ndarray) -> tuple[float, float]:
    """Run-out and height of a deposit about the z axis, both over r0 [-].

    Args:
        position: Centres of the grains on a floor at the level of its spheres [m], shape (n, 3).
    """
    _, surface, _ = profile(position)
    return edge(position) / COLUMN - 1, (float(np.nanmean(surface[:SUMMIT])) - FLOOR_LEVEL) / COLUMN


def _measure(results: Mapping[str, Result]) -> Mapping[str, float]:
    found = {}
    for letters, aspect in zip(("ab", "cd"), ASPECTS, strict=True):
        own = [_deposit(results[_name(aspect, seed)]) for seed in SEEDS]
        found |= {f"BK3{letter}": float(value) for letter, value in zip(letters, np.mean(own, axis=0), strict=True)}
    return found


def _deposit(result: Result) -> tuple[float, float]:
    moving = len(result.scene.constraints[0].bodies)
    return deposit(result.snapshots["end"].position[-1, moving:])


def _name(aspect: float, seed: int) -> str:
    return f"collapse_{10 * aspect:.0f}_{seed}"


def experiment() -> Experiment:
    """Deposits of columns of two aspect ratios."""
    trials = [Trial(_name(aspect, seed), partial(scene, aspect, seed)) for aspect in ASPECTS for seed in SEEDS]
    source = "Lube et al. 2004; 20 % of a prefactor"
    checks = []
    for letters, aspect in zip(("ab", "cd"), ASPECTS, strict=True):
        titles = ("run-out over r₀, edge where half a ring has grains", "height of the deposit over r₀")
        for letter, title, law in zip(letters, titles, (run_out, height_left), strict=True):
            expected = law(aspect)
            name = f"column of aspect ratio {aspect:g}: {title}"
            checks.append(Check(f"BK3{letter}", name, "1", expected, 0.2 * expected, source, kind="publication"))
    return Experiment("collapse", "Column collapse", tuple(trials), _measure, tuple(checks), tier="statistical")
