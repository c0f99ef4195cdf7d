"""The time-step guard: a step beyond the stability bounds is refused, or marked where the user insists."""

from __future__ import annotations

import numpy as np

from dembench.scene import LinearSpring, Scene
from dembench.solver.loads import meetings

RAYLEIGH_BOUND = 0.6
"""Largest step in Rayleigh time steps; linear stability of a 12-contact bed at 1 % overlap allows about 0.4 to 0.7."""
CONTACT_BOUND = 0.35
"""Largest step in contact times of the fastest impact; explicit integration blows up at 0.35 to 0.45."""


class SolverError(RuntimeError):
    """The solver cannot go on or cannot start: the message says where and what to change.

    Attributes:
        reason: Kind of failure in one word or two.
    """

    def __init__(self, message: str, reason: str = "engine error"):
        super().__init__(message)
        self.reason = reason


def check_step(scene: Scene, dt: float, allow: bool) -> list[str]:
    """Warnings about a step [s] that is beyond a bound; the stiffness of a linear law is not that of the materials.

    Raises:
        SolverError: The step is beyond a bound and `allow` is False.
    """
    limits = {}
    if not isinstance(scene.law, LinearSpring):
        limits[f"{RAYLEIGH_BOUND:g} Rayleigh time steps"] = RAYLEIGH_BOUND * scene.rayleigh_time()
    limits[f"{CONTACT_BOUND:g} contact times of the fastest body"] = CONTACT_BOUND * shortest_contact(scene)
    found = [f"dt {dt:.3g} s is above {text} ({limit:.3g} s)" for text, limit in limits.items() if dt > limit]
    if found and not allow:
        raise SolverError("; ".join(found) + "; choose a smaller dt, or allow an unstable step")
    return found


def shortest_contact(scene: Scene) -> float:
    """Shortest contact time at the largest initial speed, of the lightest bodies [s]; see `Meeting.contact_time`."""
    speed = float(np.linalg.norm(scene.bodies.velocity, axis=1).max(initial=0))
    return min((kind.contact_time(speed) for kind in meetings(scene)), default=float("inf"))
