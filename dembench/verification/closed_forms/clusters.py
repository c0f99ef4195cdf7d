"""Clusters of spheres that fall together in empty space: conservation (SR12, SR15) and invariance (SR13).

One cluster is there several times in one scene: elsewhere, turned, with its bodies in the opposite order, and twice as
large. They must do the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from dembench.results import Result
from dembench.results.schema import SnapshotSeries
from dembench.scene import Scene
from dembench.verification.checks import Check, Experiment, at_most, deviation, on_one_scene
from dembench.verification.scenes import MOTION, Body, Kind, every, scene_of

RADIUS = 0.01
SCALE = 2.0
ROUGH = Kind(1e8, 2500, RADIUS, 0.25, restitution=0.8, friction=0.4)
KINDS = {
    "rough": ROUGH,
    "large": Kind(1e8 * SCALE**2, 2500, RADIUS * SCALE, 0.25, restitution=0.8, friction=0.4),
    "elastic": Kind(1e8, 2500, RADIUS, 0.25),
}
"""The large kind has a modulus larger by the square of the scale: with equal times all lengths grow alike."""
SHELL = 12
"""Spheres around the one in the middle."""
SPEED, SPIN = 1.0, 30.0
STEP, END = 4e-6, 0.016
TURN = Rotation.from_rotvec(np.radians(37) * np.array([1.0, 2.0, 2.0]) / 3)
ROOM = 30 * RADIUS
"""Distance of the clusters [m]."""


@dataclass(frozen=True)
class Cluster:
    """Spheres at one time.

    Attributes:
        position, velocity, spin: [m], [m/s], [rad/s], shape (n, 3).
    """

    position: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray

    def turned(self) -> Cluster:
        """Turned about the origin by 37 degrees."""
        return Cluster(*(TURN.apply(a) for a in (self.position, self.velocity, self.spin)))

    def backwards(self) -> Cluster:
        """With the bodies in the opposite order."""
        return Cluster(self.position[::-1], self.velocity[::-1], self.spin[::-1])

    def scaled(self) -> Cluster:
        """With all lengths larger by `SCALE`."""
        return Cluster(SCALE * self.position, SCALE * self.velocity, self.spin)

    def moved(self, by: np.ndarray) -> Cluster:
        """Elsewhere [m]."""
        return Cluster(self.position + by, self.velocity, self.spin)


def cluster() -> Cluster:
    """The corners of an icosahedron, not quite, that fall on a sphere in the middle, each with a spin of its own."""
    golden = 0.5 * (1 + np.sqrt(5))
    corners = np.array([(0, a, b * golden) for a in (-1, 1) for b in (-1, 1)])
    corners = np.vstack([np.roll(corners, k, axis=1) for k in range(3)]) / np.sqrt(1 + golden**2)
    chance = np.random.default_rng(7)
    distance = RADIUS * chance.uniform(3.2, 5.2, SHELL)[:, None]
    inward = -SPEED * corners + 0.3 * SPEED * chance.uniform(-1, 1, (SHELL, 3))
    middle = np.zeros((1, 3))
    spin = SPIN * chance.uniform(-1, 1, (SHELL + 1, 3))
    return Cluster(np.vstack([distance * corners, middle]), np.vstack([inward, middle]), spin)


def _copies() -> list[tuple[str, Cluster]]:
    """Kind and bodies of each cluster: as it is, elsewhere, turned, backwards, scaled, elastic."""
    one = cluster()
    changed = [one, one, one.turned(), one.backwards(), one.scaled(), one]
    kinds = ["rough", "rough", "rough", "rough", "large", "elastic"]
    places = ROOM * np.array([[0, 0, 0], [7, 1, 0], [2, 0, 0], [3.1, 0, 0], [0, 3, 0], [0, 0, 3]])
    return [(kind, c.moved(place)) for kind, c, place in zip(kinds, changed, places, strict=True)]


def scene() -> Scene:
    """All clusters."""
    bodies = [
        Body(kind, tuple(x), tuple(v), tuple(w))
        for kind, c in _copies()
        for x, v, w in zip(c.position, c.velocity, c.spin, strict=True)
    ]
    return scene_of("clusters", KINDS, bodies, time_step=STEP, times=every(250 * STEP, END))


def _measure(result: Result) -> Mapping[str, float]:
    seen, n = result.snapshots[MOTION], SHELL + 1
    masses, moments = result.scene.masses(), result.scene.moments()[:, 0]
    ends = [
        Cluster(seen.position[-1, part], seen.velocity[-1, part], seen.angular_velocity[-1, part])
        for part in (slice(k * n, (k + 1) * n) for k in range(len(_copies())))
    ]
    first, rough, elastic = ends[0], slice(0, n), slice(5 * n, 6 * n)
    expected = (first, first.turned(), first.backwards(), first.scaled())
    energy = _energy(seen, masses, moments)
    dissipated = energy[:, rough].sum(axis=1)
    return {
        "SR12a": _momentum(seen, masses, rough),
        "SR12b": _angular_momentum(seen, masses, moments, rough),
        **{f"SR13{k}": _apart(end, known) for k, end, known in zip("abcd", ends[1:5], expected, strict=True)},
        "SR15a": float(energy[-1, elastic].sum() / energy[0, elastic].sum()),
        "SR15b": float(dissipated[-1] / dissipated[0]),
        "SR15c": float(energy[:, elastic].sum(axis=1).min() / energy[0, elastic].sum()),
    }


def _momentum(seen: SnapshotSeries, masses: np.ndarray, part: slice) -> float:
    """Largest change of the momentum of some bodies over the sum of its absolute values at the start [-]."""
    parts = masses[part, None] * seen.velocity[:, part]
    change = np.linalg.norm(parts.sum(axis=1) - parts[0].sum(axis=0), axis=1)
    return float(change.max() / np.linalg.norm(parts[0], axis=1).sum())


def _angular_momentum(seen: SnapshotSeries, masses: np.ndarray, moments: np.ndarray, part: slice) -> float:
    """Largest change of the angular momentum over the sum of its absolute values at the start [-]."""
    centre = seen.position[0, part].mean(axis=0)
    orbit = masses[part, None] * np.cross(seen.position[:, part] - centre, seen.velocity[:, part])
    own = moments[part, None] * seen.angular_velocity[:, part]
    total = (orbit + own).sum(axis=1)
    size = (np.linalg.norm(orbit[0], axis=1) + np.linalg.norm(own[0], axis=1)).sum()
    return float(np.linalg.norm(total - total[0], axis=1).max() / size)


def _energy(seen: SnapshotSeries, masses: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Kinetic energy of every body at every time [J], shape (t, n)."""
    moving, turning = (seen.velocity**2).sum(axis=2), (seen.angular_velocity**2).sum(axis=2)
    return np.asarray(0.5 * (masses * moving + moments * turning))


def _apart(found: Cluster, known: Cluster) -> float:
    """Largest difference of velocities and of surface speeds, over the largest velocity [-]."""
    size = np.abs(known.velocity).max()
    radius = RADIUS * size / SPEED
    moving, turning = np.abs(found.velocity - known.velocity).max(), np.abs(found.spin - known.spin).max()
    return float(max(moving, radius * turning) / size)


def experiments() -> tuple[Experiment, ...]:
    """The experiment."""
    alike = "largest deviation of a velocity from that of the first cluster"
    checks = (
        deviation("SR12a", "largest change of momentum", 1e-5, "momentum; 1e-5 for single precision"),
        deviation("SR12b", "largest change of angular momentum", 1e-5, "angular momentum; 1e-5 for single precision"),
        deviation("SR13a", f"elsewhere: {alike}", 1e-4, "invariance under translation"),
        deviation("SR13b", f"turned by 37°: {alike}", 1e-4, "invariance under rotation"),
        deviation("SR13c", f"in the opposite order: {alike}", 1e-4, "invariance under renumbering"),
        deviation("SR13d", f"twice as large: {alike}", 1e-4, "similarity: E grows with the square of all lengths"),
        Check("SR15a", "elastic cluster: kinetic energy at the end", "1", 1.0, 1e-3, "energy"),
        at_most("SR15b", "dissipating cluster: kinetic energy at the end", "1", 1.0, "energy"),
        at_most("SR15c", "elastic cluster: kinetic energy at its lowest", "1", 1.0, "energy"),
    )
    settings = {"dt": f"{STEP:g}"}
    return (on_one_scene("clusters", "Clusters in empty space", scene, _measure, checks, settings=settings),)
