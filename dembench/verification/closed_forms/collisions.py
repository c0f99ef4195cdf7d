"""What a collision does: Hertz's closed forms, Coulomb's bound, and the scene's law integrated over time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from dembench.verification.laws import SCENE_LAW, Contacts, Forces, advanced
from dembench.verification.scenes import Kind

STEPS = 200
"""Steps of an elastic contact time in which collisions are integrated; twice as many change e by less than 1e-4."""
GROWING = 100
"""Steps over which the first ones grow to that size: a shear dashpot acts from the touch on, until the spring is at its
bound, so that a fast slip has lost much before; twice as many steps change tangential impulses by less than 1 %."""
LONGEST = 6.0
"""Longest contact, in elastic contact times: at e = 0.05 it takes 1.7 of them."""
SPHERE = 2.5
"""m r^2/I of a homogeneous sphere [-]."""
SLIP = 1 + SPHERE
"""m*/m_t [-]: a tangential impulse changes the slip of spheres by this much more than their relative velocity."""


@dataclass(frozen=True)
class Contact:
    """Constants of a contact of two bodies under Hertz-Mindlin.

    Attributes:
        modulus, shear: E* and G* [Pa].
        radius, mass: Reduced radius [m] and mass [kg].
        arm: Radius of the bodies, from which half the overlap is the lever of friction [m].
        restitution, friction: Of the pair [-].
    """

    modulus: float
    shear: float
    radius: float
    mass: float
    arm: float
    restitution: float
    friction: float

    @classmethod
    def with_wall(cls, kind: Kind) -> Contact:
        """A sphere and an unyielding wall."""
        shear = kind.young / (2 * (1 + kind.poisson) * (2 - kind.poisson))
        return cls(kind.modulus, shear, kind.radius, kind.mass, kind.radius, kind.restitution, kind.friction)

    @classmethod
    def between(cls, kind: Kind, other: Kind) -> Contact:
        """Two spheres, with the restitution and the friction of the first."""
        one, two = cls.with_wall(kind), cls.with_wall(other)
        return cls(
            modulus=_reduced(one.modulus, two.modulus),
            shear=_reduced(one.shear, two.shear),
            radius=_reduced(one.radius, two.radius),
            mass=_reduced(one.mass, two.mass),
            arm=kind.radius,
            restitution=kind.restitution,
            friction=kind.friction,
        )

    @property
    def stiffness(self) -> float:
        """Force over overlap^(3/2) [N/m^1.5]: (4/3) E* sqrt(R*)."""
        return 4 / 3 * self.modulus * math.sqrt(self.radius)

    def overlap(self, force: float) -> float:
        """Overlap at rest under a force [N]: (F/k)^(2/3) [m]."""
        return (force / self.stiffness) ** (2 / 3)

    def largest_overlap(self, speed: float) -> float:
        """Largest overlap of an elastic head-on collision [m]: (5 m* v^2/(4 k))^(2/5). Source: Hertz 1882."""
        return (1.25 * self.mass * speed**2 / self.stiffness) ** 0.4

    def largest_force(self, speed: float) -> float:
        """Largest force of an elastic head-on collision [N]: k a_max^(3/2)."""
        return self.stiffness * self.largest_overlap(speed) ** 1.5

    def duration(self, speed: float) -> float:
        """Duration of an elastic head-on collision [s]: 2 sqrt(pi) Gamma(7/5)/Gamma(9/10) a_max/v = 2.943 a_max/v."""
        constant = 2 * math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9)
        return constant * self.largest_overlap(speed) / speed

    def slides(self, speed: float, slip: float) -> bool:
        """Whether rigid spheres slide through the whole contact: slip above (7/2) mu (1 + e) v."""
        return abs(slip) > SLIP * self.sliding_push(speed)

    def sliding_push(self, speed: float) -> float:
        """Tangential impulse over m* of rigid bodies that slide [m/s]: mu (1 + e) v. Source: Walton 1993."""
        return self.friction * (1 + self.restitution) * speed


@dataclass(frozen=True)
class Impact:
    """What came of a collision.

    Attributes:
        rebound: Normal speed afterwards [m/s].
        push: Tangential impulse over the reduced mass, against the slip [m/s].
        turn: Change of the surface speed by spin, of a body whose mass is the reduced one, against the slip [m/s].
    """

    rebound: float
    push: float
    turn: float


def impact(contact: Contact, speed: float, slip: float) -> Impact:
    """A collision under the scene's law at a normal speed and a slip [m/s]; see `impacts`."""
    return impacts([contact], np.array([speed]), np.array([slip]))[0]


def impacts(contacts: Sequence[Contact], speeds: np.ndarray, slips: np.ndarray) -> list[Impact]:
    """Collisions under the scene's law (the `reference` variant of `HertzMindlin`), integrated over time.

    The normal stays: it does not turn with the bodies while they touch.

    Args:
        contacts: Their constants.
        speeds: Normal speeds of approach [m/s], shape (n,).
        slips: Tangential speeds of the surfaces [m/s], shape (n,).

    Raises:
        ArithmeticError: Bodies do not part.
    """
    touching = _Touching(contacts, speeds)
    state, slides = touching.start(speeds, slips), np.zeros((1, len(contacts)), bool)
    h = np.array([c.duration(float(v)) for c, v in zip(contacts, speeds, strict=True)])[:, None] / STEPS
    for k in range(int(LONGEST * STEPS)):
        state, slides = advanced(touching, state, slides, h * min(1.0, (k + 1) / GROWING))
        if (state[..., 0] <= 0).all():
            return [Impact(-closing, push, turn) for _, closing, _, push, turn, _ in state[0].tolist()]
    raise ArithmeticError(f"bodies have not parted after {LONGEST:g} contact times")


class _Touching:
    """Contacts whose state has the columns overlap, closing speed, slip, `push` and `turn` of `Impact`, and memory."""

    def __init__(self, contacts: Sequence[Contact], speeds: np.ndarray):
        def of(values: Iterable[float]) -> np.ndarray:
            return np.array(list(values))

        self.mass, self.arm = of(c.mass for c in contacts), of(c.arm for c in contacts)
        self.forces = Forces(
            [SCENE_LAW],
            Contacts(
                hertz=of(c.stiffness for c in contacts),
                mindlin=of(8 * c.shear * math.sqrt(c.radius) for c in contacts),
                mass=self.mass,
                restitution=of(c.restitution for c in contacts),
                friction=of(c.friction for c in contacts),
                deepest=of(c.largest_overlap(float(v)) for c, v in zip(contacts, speeds, strict=True)),
                ratio=of(4 * c.shear / c.modulus for c in contacts),
            ),
        )

    def start(self, speeds: np.ndarray, slips: np.ndarray) -> np.ndarray:
        """The state at the touch."""
        nothing = np.zeros(len(speeds))
        return np.stack([nothing, speeds, slips, nothing, nothing, nothing], axis=-1)[None]

    def rate(self, state: np.ndarray, slides: np.ndarray | None = None) -> np.ndarray:
        overlap, closing, slip = np.maximum(state[..., 0], 0.0), state[..., 1], state[..., 2]
        force, drag, remembered = self.forces.of(overlap, -closing, slip, state[..., 5], slides)
        lever, pushed = 1 - self.forces.half * overlap / self.arm, drag / self.mass
        turned = SPHERE * lever * pushed
        slowed = pushed + lever * turned
        return np.stack([closing, -force / self.mass, -slowed, pushed, turned, remembered], axis=-1)

    def bounded(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        overlap = np.maximum(state[..., 0], 0.0)
        state[..., 5], slides = self.forces.cut(overlap, -state[..., 1], state[..., 2], state[..., 5])
        return state, slides


def _reduced(a: float, b: float) -> float:
    return a * b / (a + b)
