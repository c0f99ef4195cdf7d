"""What the sections of the catalogue share: lattices, Hertz's closed forms and simple measures."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from dembench.results import Result
from dembench.results.schema import SnapshotSeries
from dembench.scene import Domain, Scene
from dembench.verification.scenes import MOTION, Kind

CONTACT_TIME = 2.9432
"""Contact time of Hertz's elastic impact in largest overlaps over speed of approach [-]."""


# ---- Hertz's contact of two alike spheres, or of one on an unyielding wall


def rayleigh(kind: Kind) -> float:
    """Rayleigh time pi r sqrt(rho/G)/(0.1631 nu + 0.8766) [s]."""
    shear = kind.young / (2 * (1 + kind.poisson))
    return math.pi * kind.radius * math.sqrt(kind.density / shear) / (0.1631 * kind.poisson + 0.8766)


def impact_overlap(kind: Kind, speed: float) -> float:
    """Largest overlap of two alike elastic spheres that meet at a relative speed [m/s]: (5 m* v^2/(4 k))^(2/5) [m].

    Source: Hertz; k = (4/3) E* sqrt(R*) with E* = E/(2 (1 - nu^2)), R* = r/2, m* = m/2.
    """
    k = 4 / 3 * kind.modulus / 2 * math.sqrt(kind.radius / 2)
    return (5 * kind.mass / 2 * speed**2 / (4 * k)) ** 0.4


def contact_time(kind: Kind, speed: float) -> float:
    """Duration of the elastic impact of two alike spheres at a relative speed [m/s], 2.9432 a_max/v [s]."""
    return CONTACT_TIME * impact_overlap(kind, speed) / speed


def resting_overlap(kind: Kind, force: float, *, wall: bool) -> float:
    """Overlap [m] under a force [N] with an unyielding wall or with its like: (3 F/(4 E* sqrt(R*)))^(2/3)."""
    modulus, radius = (kind.modulus, kind.radius) if wall else (kind.modulus / 2, kind.radius / 2)
    return (0.75 * force / (modulus * math.sqrt(radius))) ** (2 / 3)


# ---- scenes


def fitted(step: float, interval: float) -> float:
    """The largest step not above `step` [s] that divides an interval [s]."""
    return interval / math.ceil(interval / step * (1 - 1e-9))


def changed(scene: Scene, **changes: Any) -> Scene:
    """A scene with other fields, checked again."""
    return Scene(**{**{name: getattr(scene, name) for name in Scene.model_fields}, **changes})


def closed_step(scene: Callable[[], Scene]) -> dict[str, str]:
    """Settings by which every engine takes the step of the scene, those with steps of their own, too."""
    return {"dt": repr(scene().time_step)}


def within(scene: Scene, lower: Sequence[float], upper: Sequence[float]) -> Scene:
    """A scene whose domain has these corners [m]."""
    return changed(scene, domain=Domain(lower=tuple(lower), upper=tuple(upper)))


def lattice(counts: tuple[int, int, int], spacing: float = 1.0) -> np.ndarray:
    """Points of a simple cubic lattice from the origin [m], shape (n, 3), x fastest."""
    nx, ny, nz = counts
    return spacing * np.array([[i, j, k] for k in range(nz) for j in range(ny) for i in range(nx)], dtype=float)


# ---- measures


def motion(result: Result) -> SnapshotSeries:
    """All bodies at the recorded times."""
    return result.snapshots[MOTION]


def speeds(seen: SnapshotSeries) -> np.ndarray:
    """Speeds [m/s], shape (t, n)."""
    return np.linalg.norm(seen.velocity, axis=2)


def kinetic_energy(result: Result) -> np.ndarray:
    """Translational and rotational energy of spheres at the recorded times [J], shape (t,)."""
    seen, mass, radius = motion(result), result.scene.masses(), result.scene.radii()
    spinning = 0.4 * mass * radius**2 * (seen.angular_velocity**2).sum(axis=2)
    return 0.5 * (mass * (seen.velocity**2).sum(axis=2) + spinning).sum(axis=1)


def finite_share(results: Mapping[str, Result], trials: int) -> float:
    """Share of trials that came to their end [-]."""
    return len(results) / trials
