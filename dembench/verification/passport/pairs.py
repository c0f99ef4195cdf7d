"""What named laws make of collisions of two spheres: the limit of vanishing time steps.

A law that turns its shear spring into the tangent plane by projection and one that restores its length are the same in
this limit: a step that turns the normal by a shortens the spring by a^2/2, which sums up to nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from dembench.verification.laws import Contacts, Forces, NamedLaw, advanced, damping_ratio


@dataclass(frozen=True)
class Pairs:
    """Collisions of two spheres in the plane x-y, without gravity; sphere 0 of a pair is at the smaller x.

    Attributes:
        radius, mass: [m], [kg], shape (n, 2).
        young, shear: Reduced moduli E* and G* [Pa], shape (n,).
        poisson: Poisson's ratio, of the first sphere [-], shape (n,).
        restitution, friction: [-], shape (n,).
        position, velocity: At the start [m], [m/s], shape (n, 2, 2): pair, sphere, x and y.
        spin: About z [rad/s], shape (n, 2).
    """

    radius: np.ndarray
    mass: np.ndarray
    young: np.ndarray
    shear: np.ndarray
    poisson: np.ndarray
    restitution: np.ndarray
    friction: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray

    @property
    def reduced_radius(self) -> np.ndarray:
        """R* [m], shape (n,)."""
        return self.radius.prod(axis=1) / self.radius.sum(axis=1)

    @property
    def reduced_mass(self) -> np.ndarray:
        """Reduced mass m* [kg], shape (n,)."""
        return self.mass.prod(axis=1) / self.mass.sum(axis=1)

    @property
    def inertia(self) -> np.ndarray:
        """Moments of inertia [kg m^2], shape (n, 2)."""
        return 0.4 * self.mass * self.radius**2

    @property
    def approach(self) -> np.ndarray:
        """Normal speed before the touch [m/s], shape (n,)."""
        return self.velocity[:, 0, 0] - self.velocity[:, 1, 0]

    @property
    def hertz(self) -> np.ndarray:
        """k = (4/3) E* sqrt(R*) of Hertz [N/m^1.5], shape (n,)."""
        return 4 / 3 * self.young * np.sqrt(self.reduced_radius)

    @property
    def deepest(self) -> np.ndarray:
        """Largest overlap of elastic spheres after Hertz, (5 m* v^2/(4 k))^(2/5) [m], shape (n,)."""
        return (1.25 * self.reduced_mass * self.approach**2 / self.hertz) ** 0.4

    @property
    def contacts(self) -> Contacts:
        """Constants of the contacts."""
        return Contacts(
            hertz=self.hertz,
            mindlin=8 * self.shear * np.sqrt(self.reduced_radius),
            mass=self.reduced_mass,
            restitution=self.restitution,
            friction=self.friction,
            deepest=self.deepest,
            ratio=2 * (1 - self.poisson) / (2 - self.poisson),
        )


@dataclass(frozen=True)
class Motion:
    """The spheres of all pairs at some times.

    Attributes:
        time: [s], shape (t,).
        position, velocity: [m], [m/s], shape (t, n, 2, 2): time, pair, sphere, x and y.
        spin: About z [rad/s], shape (t, n, 2).
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray


def motions(laws: Sequence[NamedLaw], pairs: Pairs, time: np.ndarray, steps: int = 2) -> list[Motion]:
    """What laws make of pairs, all at once.

    Args:
        laws: The laws.
        pairs: The pairs at the first time.
        time: Equally spaced times [s], shape (t,).
        steps: Steps between two times.
    """
    soft = [law for law in laws if law.spring != "rigid"]
    found = dict(zip((law.name for law in soft), _soft(soft, pairs, time, steps), strict=True)) if soft else {}
    return [found[law.name] if law.name in found else _rigid(pairs, time) for law in laws]


def _soft(laws: Sequence[NamedLaw], pairs: Pairs, time: np.ndarray, steps: int) -> list[Motion]:
    colliding = _Colliding(laws, pairs)
    h, n = (time[1] - time[0]) / steps, len(pairs.mass)
    start = [pairs.position.reshape(n, 4), pairs.velocity.reshape(n, 4), pairs.spin, np.zeros((n, 1))]
    state = np.tile(np.concatenate(start, axis=1), (len(laws), 1, 1))
    slides = np.zeros((len(laws), n), bool)
    seen = [state]
    for _ in time[1:]:
        for _ in range(steps):
            state, slides = advanced(colliding, state, slides, h)
        seen.append(state)
    found = np.array(seen)
    shape = (len(time), n, 2, 2)
    return [
        Motion(time, of[:, :, :4].reshape(shape), of[:, :, 4:8].reshape(shape), of[:, :, 8:10])
        for of in np.moveaxis(found, 1, 0)
    ]


class _Colliding:
    """Pairs whose state has the columns x0 y0 x1 y1, their velocities, both spins and the memory of the shear."""

    def __init__(self, laws: Sequence[NamedLaw], pairs: Pairs):
        self.pairs, self.forces = pairs, Forces(laws, pairs.contacts)
        self.reach, self.inertia = pairs.radius.sum(axis=1), pairs.inertia

    def rate(self, state: np.ndarray, slides: np.ndarray | None = None) -> np.ndarray:
        n, overlap, vn, vt, arms = self._geometry(state)
        fn, shear, remembered = self.forces.of(overlap, vn, vt, state[..., 10], slides)
        tangent = np.stack([-n[..., 1], n[..., 0]], axis=-1)
        force = fn[..., None] * n - shear[..., None] * tangent  # on sphere 1
        change = np.empty_like(state)
        change[..., :4] = state[..., 4:8]
        change[..., 4:6] = -force / self.pairs.mass[:, :1]
        change[..., 6:8] = force / self.pairs.mass[:, 1:]
        change[..., 8:10] = arms * shear[..., None] / self.inertia
        change[..., 10] = remembered
        return change

    def bounded(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        _, overlap, vn, vt, _ = self._geometry(state)
        state[..., 10], slides = self.forces.cut(overlap, vn, vt, state[..., 10])
        return state, slides

    def _geometry(self, state: np.ndarray) -> tuple[np.ndarray, ...]:
        """Normal from sphere 0 to 1, overlap (none below 0), separation speed, slip of 1 on 0, levers."""
        apart = state[..., 2:4] - state[..., 0:2]
        length = np.hypot(apart[..., 0], apart[..., 1])
        n = apart / length[..., None]
        overlap = np.maximum(self.reach - length, 0.0)
        v = state[..., 6:8] - state[..., 4:6]
        arms = self.pairs.radius - (self.forces.half * overlap)[..., None]
        slip = n[..., 0] * v[..., 1] - n[..., 1] * v[..., 0] - (arms * state[..., 8:10]).sum(axis=-1)
        return n, overlap, (n * v).sum(axis=-1), slip, arms


def _rigid(pairs: Pairs, time: np.ndarray) -> Motion:
    """Rigid spheres after Walton, whose tangential restitution is 0: they stick after the touch, or slide."""
    mass, arms = pairs.reduced_mass, pairs.radius
    flight = (pairs.position[:, 1, 0] - pairs.position[:, 0, 0] - arms.sum(axis=1)) / pairs.approach
    normal = (1 + pairs.restitution) * pairs.approach * mass
    slip = pairs.velocity[:, 1, 1] - pairs.velocity[:, 0, 1] - (arms * pairs.spin).sum(axis=1)
    sticking = slip / (1 / mass + (arms**2 / pairs.inertia).sum(axis=1))
    friction = np.clip(sticking, -pairs.friction * normal, pairs.friction * normal)
    impulse = np.stack([normal, -friction], axis=1)
    change = np.stack([-impulse, impulse], axis=1) / pairs.mass[:, :, None]
    after = np.maximum(time[:, None] - flight, 0.0)
    touched = time[:, None] >= flight
    return Motion(
        time,
        pairs.position + pairs.velocity * time[:, None, None, None] + change * after[:, :, None, None],
        pairs.velocity + change * touched[:, :, None, None],
        pairs.spin + arms * friction[:, None] / pairs.inertia * touched[:, :, None],
    )


@cache
def clipped_restitution(e: float) -> float:
    """Restitution of a law whose damping gives `e` with tension, where tension is clipped.

    Schwager & Poeschel 2007, doi 10.1007/s10035-007-0065-z, for the linear spring; the spring of Hertz with the
    dashpot of Tsuji et al. gives the same.
    """
    b = float(damping_ratio(e))
    root = float(np.sqrt(1 - b * b))
    return float(np.exp(-b / root * (np.pi - np.arctan2(2 * b * root, 1 - 2 * b * b))))
