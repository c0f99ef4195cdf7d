"""Aspects of a contact law: what is compared of colliding pairs, and how far two motions of them are apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from dembench.results import Result
from dembench.scene import Scene
from dembench.verification.laws import LAWS, NamedLaw
from dembench.verification.passport import scenes
from dembench.verification.passport.pairs import Motion, Pairs, motions
from dembench.verification.passport.scenes import MOTION, of_family

SUBSTEPS = 4
"""Steps of the laws between two recorded times."""


@dataclass(frozen=True)
class Aspect:
    """One side of a contact law.

    Attributes:
        name: Identifier.
        title: What is compared.
        scale: What a distance of one is, in words.
        values: Gives numbers or curves of a motion of pairs, in its scale, shape (...).
        slips: Whether it is about gross slip.
    """

    name: str
    title: str
    scale: str
    values: Callable[[Pairs, Motion], np.ndarray]
    slips: bool = False

    def distance(self, pairs: Pairs, a: Motion, b: Motion) -> float:
        """Root mean square of the differences between two motions [-]."""
        return float(np.sqrt(np.mean((self.values(pairs, a) - self.values(pairs, b)) ** 2)))


def separation(motion: Motion) -> np.ndarray:
    """Velocity of sphere 1 of every pair against sphere 0 [m/s], shape (t, n, 2)."""
    return motion.velocity[:, :, 1] - motion.velocity[:, :, 0]


def overlap(pairs: Pairs, motion: Motion) -> np.ndarray:
    """Overlap, none below 0 [m], shape (t, n)."""
    apart = motion.position[:, :, 1] - motion.position[:, :, 0]
    return np.maximum(pairs.radius.sum(axis=1) - np.hypot(apart[..., 0], apart[..., 1]), 0.0)


def restitution(pairs: Pairs, motion: Motion) -> np.ndarray:
    """Speed along x after the contact over that before [-], shape (n,)."""
    return separation(motion)[-1, :, 0] / pairs.approach


def friction(pairs: Pairs, motion: Motion) -> np.ndarray:
    """Change of the tangential over the normal velocity, the effective coefficient in gross slip [-], shape (n,)."""
    change = np.abs(separation(motion)[-1] - separation(motion)[0])
    return np.asarray(change[:, 1] / change[:, 0])


def levers(pairs: Pairs, motion: Motion, own: list[int]) -> np.ndarray:
    """Change of angular momentum over change of momentum along y and radius, of some pairs [-], shape (own,)."""
    turned = (pairs.inertia * (motion.spin[-1] - motion.spin[0])).sum(axis=1)
    pushed = pairs.reduced_mass * (separation(motion)[-1] - separation(motion)[0])[:, 1]
    return np.asarray(-turned[own] / pushed[own] / pairs.radius.sum(axis=1)[own])


def forces(pairs: Pairs, motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean forces between two recorded times, from m dv/dt, with the overlap between them.

    Returns:
        Overlap [m], normal and tangential force on sphere 1 [N] in the tangent frame of that time, shape (t - 1, n).
    """
    apart = motion.position[:, :, 1] - motion.position[:, :, 0]
    middle = 0.5 * (apart[1:] + apart[:-1])
    n = middle / np.linalg.norm(middle, axis=2, keepdims=True)
    step = np.diff(motion.time)[:, None, None]
    force = pairs.reduced_mass[:, None] * np.diff(separation(motion), axis=0) / step
    depth = overlap(pairs, motion)
    return (
        0.5 * (depth[1:] + depth[:-1]),
        (force * n).sum(axis=2),
        n[..., 0] * force[..., 1] - n[..., 1] * force[..., 0],
    )


def _restitutions(pairs: Pairs, motion: Motion) -> np.ndarray:
    return restitution(pairs, motion)[of_family("normal")]


def _overlaps(pairs: Pairs, motion: Motion) -> np.ndarray:
    own = of_family("normal", "speed", "size")
    return overlap(pairs, motion)[:, own] / pairs.deepest[own]


def _sliding(pairs: Pairs, motion: Motion) -> np.ndarray:
    own = of_family("sliding", "bound")
    return friction(pairs, motion)[own] / pairs.friction[own]


def _shear(pairs: Pairs, motion: Motion) -> np.ndarray:
    own = of_family("rough")
    return separation(motion)[:, own, 1] / separation(motion)[0, own, 1]


def _oblique(pairs: Pairs, motion: Motion) -> np.ndarray:
    own = of_family("oblique")
    limit = pairs.friction * pairs.approach * (1 + pairs.restitution)
    return separation(motion)[-1, own, 1] / limit[own]


def _levers(pairs: Pairs, motion: Motion) -> np.ndarray:
    return levers(pairs, motion, of_family("sliding", "bound"))


def _mixed(pairs: Pairs, motion: Motion) -> np.ndarray:
    own = of_family("mixed")
    return separation(motion)[-1, own] / pairs.approach[own, None]


ASPECTS = (
    Aspect("restitution", "restitution after head-on impacts, e from 0.1 to 0.98", "1", _restitutions),
    Aspect("normal", "overlap against time: three speeds, two sizes", "deepest overlap of elastic spheres", _overlaps),
    Aspect(
        "sliding", "effective friction in gross slip, e from 0.1 to 0.98", "coefficient of friction", _sliding, True
    ),
    Aspect("shear", "tangential velocity against time where nothing slides", "its value before", _shear),
    Aspect("oblique", "tangential velocity after sticking and sliding", "μ (1 + e) v", _oblique),
    Aspect("lever", "angular momentum per tangential momentum", "radius", _levers),
    Aspect("mixing", "rebounds of two materials with a table of pairs", "normal speed", _mixed),
)
"""What is compared, each in a scale of its own."""


def motion_of(result: Result) -> Motion:
    """The spheres of all pairs of a result."""
    seen = result.snapshots[MOTION]
    shape = (len(seen.time), -1, 2)
    return Motion(
        seen.time,
        seen.position[:, :, :2].reshape(*shape, 2),
        seen.velocity[:, :, :2].reshape(*shape, 2),
        seen.angular_velocity[:, :, 2].reshape(shape),
    )


@cache
def scene() -> Scene:
    """The scene of all pairs."""
    return scenes.pairs_in_contact()


@cache
def pairs() -> Pairs:
    """The pairs of the scene."""
    return scenes.pairs_of(scene())


@cache
def predicted() -> dict[str, Motion]:
    """What every named law makes of the scene, by its name."""
    times = scene().frame_times()
    return {law.name: m for law, m in zip(LAWS, motions(LAWS, pairs(), times, SUBSTEPS), strict=True)}


@cache
def rolling_losses() -> np.ndarray:
    """Spin that a constant torque mu_r R* |Fn| takes from each pair of `scenes.rolling_pairs` [rad/s], shape (n,).

    Ai, Chen, Rotter & Ooi 2011, doi 10.1016/j.powtec.2010.09.030, model A; Fn is that of the scene's law.
    """
    scene = scenes.rolling_pairs()
    own = scenes.pairs_of(scene)
    times = np.linspace(0, scene.duration, len(predicted()[LAWS[0].name].time))
    (seen,) = motions(LAWS[:1], own, times, SUBSTEPS)
    impulse = np.abs(forces(own, seen)[1]).sum(axis=0) * times[1]
    coefficients = np.array(scenes.ROLLING)
    return np.asarray(coefficients * own.reduced_radius * impulse / own.inertia[:, 0])


def rolling(result: Result) -> np.ndarray:
    """Spin lost by each pair of `scenes.rolling_pairs`, mean of both spheres [rad/s], shape (n,)."""
    spin = result.snapshots[MOTION].angular_velocity[:, :, 2].reshape(2, -1, 2)
    return np.asarray((np.abs(spin[0]) - np.abs(spin[1])).mean(axis=1))


def distances(motion: Motion) -> dict[str, dict[str, float]]:
    """Distances of a motion to the named laws: by law, then by aspect [-].

    Raises:
        ValueError: The motion has other times than the scene asks for.
    """
    if len(motion.time) != len(scene().frame_times()):
        raise ValueError(f"{len(motion.time)} times are recorded, not {len(scene().frame_times())}")
    return {
        name: {aspect.name: aspect.distance(pairs(), motion, law) for aspect in ASPECTS}
        for name, law in predicted().items()
    }


def together(by_aspect: dict[str, float]) -> float:
    """Distance to a law: root mean square of those in all aspects [-]."""
    return float(np.sqrt(np.mean(np.square(list(by_aspect.values())))))


def nearest(found: dict[str, dict[str, float]]) -> NamedLaw:
    """The law with the smallest distance."""
    return min(LAWS, key=lambda law: together(found[law.name]))
