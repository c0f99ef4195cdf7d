"""The time-step guard: a step beyond the stability bounds is refused, or marked where the user insists."""

from __future__ import annotations

import math

import numpy as np

from dembench.scene import Scene
from dembench.solver.laws import Elastic

RAYLEIGH_BOUND = 0.6
"""Largest step in Rayleigh time steps; linear stability of a 12-contact bed at 1 % overlap allows about 0.4 to 0.7."""
CONTACT_BOUND = 0.35
"""Largest step in Hertz contact times of the fastest impact; explicit integration blows up at 0.35 to 0.45."""


class SolverError(RuntimeError):
    """The solver cannot go on or cannot start: the message says where and what to change.

    Attributes:
        reason: Kind of failure in one word or two.
    """

    def __init__(self, message: str, reason: str = "engine error"):
        super().__init__(message)
        self.reason = reason


def check_step(scene: Scene, dt: float, allow: bool) -> list[str]:
    """Warnings about a step [s] that is beyond a bound.

    Raises:
        SolverError: The step is beyond a bound and `allow` is False.
    """
    limits = {
        f"{RAYLEIGH_BOUND:g} Rayleigh time steps": RAYLEIGH_BOUND * scene.rayleigh_time(),
        f"{CONTACT_BOUND:g} contact times of the fastest body": CONTACT_BOUND * shortest_contact(scene),
    }
    found = [f"dt {dt:.3g} s is above {text} ({limit:.3g} s)" for text, limit in limits.items() if dt > limit]
    if found and not allow:
        raise SolverError("; ".join(found) + "; choose a smaller dt, or allow an unstable step")
    return found


def shortest_contact(scene: Scene) -> float:
    """Shortest Hertz contact time at the largest initial speed v: 2.868 (m*^2 / (R* E*^2 v))^(1/5) [s].

    Evaluated for the lightest body of every species against every wall and species; infinite where nothing moves.
    """
    speed = float(np.linalg.norm(scene.bodies.velocity, axis=1).max(initial=0))
    if speed == 0:
        return math.inf
    radii, masses = scene.radii(), scene.masses()
    shortest = math.inf
    lightest = {k: int(i[np.argmin(masses[i])]) for k in range(len(scene.species)) if len(i := _members(scene, k))}
    for k, i in lightest.items():
        a = scene.species[k].material
        partners = [(scene.species[q].material, radii[j], masses[j]) for q, j in lightest.items()]
        partners += [(w.material, math.inf, math.inf) for w in scene.walls]
        for b, radius, mass in partners:
            elastic = Elastic.of(scene.material(a), scene.material(b), scene.pair_law(a, b))
            r, m = 1 / (1 / radii[i] + 1 / radius), 1 / (1 / masses[i] + 1 / mass)
            shortest = min(shortest, 2.868 * (m * m / (r * elastic.young**2 * speed)) ** 0.2)
    return shortest


def _members(scene: Scene, species: int) -> np.ndarray:
    return np.flatnonzero(scene.bodies.species == species)
