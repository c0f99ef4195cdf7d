"""Walton's map of rigid spheres (IM1): restitution e, friction mu and tangential restitution b0."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dembench.results import Result
from dembench.scene import Rigid
from dembench.verification.checks import Experiment, deviation, on_one_scene
from dembench.verification.closed_forms.collisions import SLIP
from dembench.verification.closed_forms.oblique import push, turn
from dembench.verification.closed_forms.volleys import Volley, angles
from dembench.verification.scenes import Kind

SOURCE = "Walton 1993; parameters of Foerster et al. 1994"
KINDS = {
    "glass": Kind(7e10, 2500, 1.59e-3, restitution=0.97, friction=0.092, tangential=0.44),
    "acetate": Kind(3.2e9, 1319, 2.995e-3, restitution=0.87, friction=0.25, tangential=0.43),
}
SPEED = 1.0
ANGLES = (5.0, 12.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0)
"""Angles to the normal [degrees]: glass slides above 23.7, acetate above 48.8."""
VOLLEY = Volley(
    name="impact_rigid",
    kinds=KINDS,
    shots=tuple(shot for kind in KINDS for shot in angles(kind, SPEED, ANGLES)),
    time_step=1e-5,
    duration=2e-4,
    law=Rigid(),
)


def slip_after(kind: Kind, speed: float, slip: float) -> float:
    """Slip after a collision with a wall [m/s]: -b0 times that before, or less by (7/2) mu (1 + e) v where it slides.

    Args:
        kind: The sphere, with its tangential restitution.
        speed, slip: Normal and tangential speed of the surfaces before [m/s].
    """
    sliding = slip - SLIP * kind.friction * (1 + kind.restitution) * speed
    return max(sliding, -(kind.tangential or 0.0) * slip)


def _measure(result: Result) -> Mapping[str, float]:
    found: dict[bool, list[float]] = {True: [], False: []}
    rebounds = []
    for shot, outcome in VOLLEY.seen(result):
        kind = KINDS[shot.kind]
        exact = slip_after(kind, shot.speed, shot.along)
        after = shot.along - push(shot, outcome) - turn(shot, outcome, KINDS)
        sticks = bool(np.isclose(exact, -(kind.tangential or 0.0) * shot.along))
        found[sticks].append(abs(after - exact) / shot.along)
        rebounds.append(abs(outcome.rebound / shot.speed / kind.restitution - 1))
    return {"IM1b": max(found[True]), "IM1c": max(found[False]), "IM1d": max(rebounds)}


def experiment() -> Experiment:
    """The experiment, for engines that compute rigid contacts."""
    checks = (
        deviation("IM1b", "rigid, sticking: largest deviation of the slip, over that before", 1e-3, SOURCE),
        deviation("IM1c", "rigid, sliding: largest deviation of the slip, over that before", 1e-3, SOURCE),
        deviation("IM1d", "rigid: largest relative deviation of the restitution", 1e-3, SOURCE),
    )
    settings = {"dt": f"{VOLLEY.time_step:g}"}
    return on_one_scene(VOLLEY.name, "Rigid spheres, Walton's map", VOLLEY.scene, _measure, checks, settings=settings)
