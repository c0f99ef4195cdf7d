"""The automatic time step of the soft-sphere solver, and what a run with it costs.

Stability of a contact network under central differences: dt < 2/omega_max. For a body of mass m with Z contacts of
normal and tangential stiffness kn and kt, exact dispersion relations of cubic and face-centred lattices give

    tangential, all spheres spinning in phase   omega^2 = (10/3) Z kt/m,   dt = 1.095 sqrt(m/(Z kt))
    normal, without friction                    omega^2 = (2/3) Z kn/m,    dt = 2.449 sqrt(m/(Z kn))

and a pair of reduced mass m* has omega^2 = kn/m* and (7/2) kt/m*. Compare O'Sullivan & Bray 2004, doi
10.1108/02644400410519794. The stiffness is that at the largest expected overlap, walls included.

Accuracy of a collision: 1 % of the restitution needs 8 steps per contact of the fastest impact with midpoint dashpots,
20 with explicit ones, whose force lags.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from dembench.scene import Scene
from dembench.solver.guard import RAYLEIGH_BOUND
from dembench.solver.loads import Loads, Meeting, meetings

SAFETY = 0.8
"""Share of the critical step that is used; damping lowers the critical step."""
STEPS_PER_CONTACT = {True: 8, False: 20}
"""Steps in the shortest contact, by whether the dashpots use the mean velocity of the step."""
PARTICLE_STEPS_PER_SECOND = 2.4e7
"""Throughput of one core for forecasts: half lists, float32, friction. Each of two makes 2.3e7 in the published impact,
start and output included; on settled beds of 25 000 grains it is 3.6e7 with and 5e7 without the ball."""
LEAST_BODIES = 100
"""A step of fewer bodies than this takes as long as one of this many."""

STABILITY, COLLISION, RAYLEIGH = "stability of the contact network", "shortest contact", "Rayleigh time"


@dataclass(frozen=True)
class TimeStep:
    """A time step with its reasons.

    Attributes:
        rayleigh: Rayleigh time of the smallest body [s].
        speed: Fastest impact expected [m/s].
        overlap: Largest overlap expected [m].
        contact_time: Shortest contact [s]; infinite where nothing moves.
        critical: Step beyond which the contact network is unstable [s]; infinite where nothing touches.
        step: The step chosen, fitted into the scene's sampling interval [s].
        bound: What bounds it: `STABILITY`, `COLLISION`, or `RAYLEIGH`, the guard's limit.
        steps: Steps of the whole scene.
        seconds: Forecast of the run time on one core [s].
    """

    rayleigh: float
    speed: float
    overlap: float
    contact_time: float
    critical: float
    step: float
    bound: str
    steps: int
    seconds: float

    def plain(self) -> dict[str, Any]:
        """As JSON data; infinite times are None."""
        return {key: value if value != math.inf else None for key, value in vars(self).items()}


def choose_step(scene: Scene, midpoint: bool = True) -> TimeStep:
    """The time step of a scene: min(0.8 critical, contact time/8 or /20), at most what the guard accepts.

    Args:
        scene: The scene, with a Hertz-Mindlin or a linear law.
        midpoint: Whether the dashpots use the mean velocity of the step.
    """
    loads, kinds, gravity = Loads.of(scene), meetings(scene), math.hypot(*scene.gravity)
    overlaps = [loads.overlap_of(kind, gravity) for kind in kinds]
    contact = min((kind.contact_time(loads.impact) for kind in kinds), default=math.inf)
    critical = _critical(kinds, overlaps)
    rayleigh = scene.rayleigh_time()
    limits = {
        STABILITY: SAFETY * critical,
        COLLISION: contact / STEPS_PER_CONTACT[midpoint],
        # the stiffness of a linear law is not that of the materials
        RAYLEIGH: math.inf if kinds and kinds[0].spring else RAYLEIGH_BOUND * rayleigh,
    }
    bound = min(limits, key=lambda name: limits[name])
    step = scene.fitted_step(min(limits[bound], scene.duration))
    return TimeStep(
        rayleigh=rayleigh,
        speed=loads.impact,
        overlap=max(overlaps, default=0.0),
        contact_time=contact,
        critical=critical,
        step=step,
        bound=bound,
        steps=round(scene.duration / step),
        seconds=seconds_of(scene, step),
    )


def seconds_of(scene: Scene, dt: float) -> float:
    """Forecast of the run time of a scene with a step [s] on one core [s]."""
    return scene.duration / dt * max(len(scene.bodies), LEAST_BODIES) / PARTICLE_STEPS_PER_SECOND


def _critical(kinds: list[Meeting], overlaps: list[float]) -> float:
    """Critical step [s] of the body that has the smallest one."""
    smallest = math.inf
    for species in {kind.species for kind in kinds}:
        normal, tangential, wall_normal, wall_tangential, mass = 0.0, 0.0, 0.0, 0.0, 0.0
        for kind, overlap in zip(kinds, overlaps, strict=True):
            if kind.species != species:
                continue
            kn, kt = kind.stiffness(overlap)
            mass = kind.body
            smallest = min(smallest, _step(2, kind.reduced, kn), _step(2, kind.reduced, 3.5 * kt))
            if kind.reduced == kind.body:
                wall_normal, wall_tangential = max(wall_normal, kn), max(wall_tangential, kt)
            else:
                normal, tangential = max(normal, kind.contacts * kn), max(tangential, kind.contacts * kt)
        smallest = min(smallest, _step(1.095, mass, tangential + wall_tangential))
        smallest = min(smallest, _step(2.449, mass, normal + wall_normal))
    return smallest


def _step(factor: float, mass: float, stiffness: float) -> float:
    return factor * math.sqrt(mass / stiffness) if stiffness else math.inf
