"""Heap on a rough floor: grains that run out of a sleeve which is lifted slowly."""

from __future__ import annotations

from functools import partial

import numpy as np

from dembench.results import Result
from dembench.scene import Cylinder, Domain, Plane, Scene, Snapshot
from dembench.scene.wall import Motion
from dembench.verification.checks import Check, Experiment, Trial
from dembench.verification.statistical.grains import (
    FLOOR_RELIEF,
    RADIUS,
    SPACING,
    column,
    of_grains,
    profile,
    round_floor,
)

SLEEVE, LAYERS, FLOOR = 14.0, 50, 60.0
"""Radius of the sleeve in radii of grains, layers in it, radius of the floor in radii of grains."""
FRICTION, LIFT_SPEED, DURATION = 0.5, 0.03, 1.0
"""Friction of everything, speed of the lift [m/s], and end of a run [s], when the heap has come to rest below it."""
FOOT, TIP = 0.2, 0.8
"""Shares of its height between which the slope of a heap is measured."""
SEEDS = range(3)


def scene(seed: int) -> Scene:
    """Grains that run out of a sleeve, which starts on a floor of fixed spheres, into a wide tray."""
    generator = np.random.default_rng(seed)
    floor = round_floor(FLOOR * RADIUS, generator)
    grains = column(SLEEVE * RADIUS, LAYERS, generator) + np.array([0, 0, 2 * RADIUS])
    low, high = -(1 + 2 * FLOOR_RELIEF) * RADIUS, (LAYERS + 4) * SPACING * RADIUS
    reach, upper = (FLOOR + 3) * RADIUS, high + LIFT_SPEED * DURATION + 2 * RADIUS
    walls = (
        Plane(name="ground", material="solid", point=(0, 0, low), normal=(0, 0, 1)),
        Cylinder(
            name="rim", material="solid", start=(0, 0, low - RADIUS), end=(0, 0, upper), radius=(FLOOR + 1) * RADIUS
        ),
        Cylinder(
            name="sleeve",
            material="solid",
            start=(0, 0, RADIUS),
            end=(0, 0, high),
            radius=SLEEVE * RADIUS,
            motion=Motion(velocity=(0, 0, LIFT_SPEED)),
        ),
    )
    return of_grains(
        "heap",
        FRICTION,
        np.vstack([floor, grains]),
        walls,
        Domain(lower=(-reach, -reach, low - RADIUS), upper=(reach, reach, upper)),
        DURATION,
        (Snapshot(name="end", times=(DURATION,)),),
        fixed=len(floor),
        soft=True,
    )


def slope_angle(position: np.ndarray) -> float:
    """Angle of the slope of a heap about the z axis on z = 0 [degrees].

    That of the line of least squares through the surface of its rings (`profile`) without the tip, which is round, and
    the foot, which runs out into single grains: between a fifth and four fifths of its height.

    Args:
        position: Centres of the grains [m], shape (n, 3).

    Raises:
        ValueError: Less than three rings lie between foot and tip.
    """
    centre, surface, _ = profile(position)
    share = np.nan_to_num(surface) / np.nanmax(surface)
    foot = int(np.argmax(share < FOOT)) or len(share)
    used = (np.arange(len(share)) < foot) & (share < TIP)
    if np.count_nonzero(used) < 3:
        raise ValueError("the heap is too small for a slope")
    return float(np.degrees(np.arctan(-np.polyfit(centre[used], surface[used], 1)[0])))


def _angle(result: Result) -> float:
    moving = len(result.scene.constraints[0].bodies)
    return slope_angle(result.snapshots["end"].position[-1, moving:])


def experiment() -> Experiment:
    """Angle of the slope of a heap."""
    return Experiment(
        "heap",
        "Heap",
        tuple(Trial(f"heap_{seed}", partial(scene, seed)) for seed in SEEDS),
        lambda results: {"BK4": float(np.mean([_angle(result) for result in results.values()]))},
        (
            Check(
                "BK4",
                "heap from a lifted sleeve on a rough floor, friction 0.5: angle of its slope, mean of three seeds",
                "degrees",
                22.0,
                4.0,
                "free spheres without rolling resistance, 20 to 24 degrees, and 2 for heaps of ten layers",
                kind="publication",
            ),
        ),
        tier="statistical",
    )
