"""Collapse of columns: grains that are let go at once and spread over a rough floor.

The height of a deposit is not checked. The laws for it (G. Lube et al. 2004) are those of sand, rice and the like, with
angles of repose of 30 degrees and more, whose columns keep their summit up to an aspect ratio of 1. Spheres without
rolling resistance come to rest at 20 degrees, and the summit sinks; glass beads stand between the two (E. Lajeunesse,
A. Mangeney-Castelnau & J. P. Vilotte 2004, Phys. Fluids 16, 2371).
"""

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
    FLOOR_RELIEF,
    GRAVITY,
    RADIUS,
    edge,
    of_grains,
    round_floor,
)

COLUMN, FRICTION = 12 * DIAMETER, 0.5
"""Radius r0 of the column [m], friction of everything."""
ASPECTS = (0.9, 3.0)
"""Heights of the columns in their radii."""
DURATION, ROOM = 4.5, 9 * DIAMETER
"""End of a run in sqrt(h0/g), of which a collapse takes three, and how far the floor goes on beyond the edge that is
expected [m]."""
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


def growth(first: float, second: float) -> float:
    """Exponent with which the run-out grows between the two aspect ratios [-].

    Args:
        first, second: Run-outs of the lower and the higher column [-].
    """
    return math.log(second / first) / math.log(ASPECTS[1] / ASPECTS[0])


def _measure(results: Mapping[str, Result]) -> Mapping[str, float]:
    first, second = (float(np.mean([_spread(results[_name(aspect, seed)]) for seed in SEEDS])) for aspect in ASPECTS)
    return {"BK3a": first, "BK3b": second, "BK3c": growth(first, second)}


def _spread(result: Result) -> float:
    """Run-out of a deposit, as `run_out`."""
    moving = len(result.scene.constraints[0].bodies)
    return edge(result.snapshots["end"].position[-1, moving:]) / COLUMN - 1


def _name(aspect: float, seed: int) -> str:
    return f"collapse_{10 * aspect:.0f}_{seed}"


def experiment() -> Experiment:
    """Run-out of columns of two aspect ratios."""
    trials = [Trial(_name(aspect, seed), partial(scene, aspect, seed)) for aspect in ASPECTS for seed in SEEDS]
    source = "Lube et al. 2004"
    expected = [run_out(aspect) for aspect in ASPECTS]
    checks = [
        Check(
            f"BK3{letter}",
            f"column of aspect ratio {aspect:g}: run-out over r₀, edge where half a ring has grains",
            "1",
            value,
            0.2 * value,
            f"{source}; 20 % of the prefactor",
            kind="publication",
        )
        for letter, aspect, value in zip("ab", ASPECTS, expected, strict=True)
    ]
    checks.append(
        Check(
            "BK3c",
            f"columns of aspect ratios {ASPECTS[0]:g} and {ASPECTS[1]:g}: exponent of the run-out between them",
            "1",
            growth(*expected),
            0.1,
            source,
            kind="publication",
        )
    )
    return Experiment("collapse", "Column collapse", tuple(trials), _measure, tuple(checks), tier="statistical")
