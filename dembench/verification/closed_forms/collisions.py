"""What a collision does: Hertz's closed forms, Coulomb's bound, and the scene's law integrated over time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dembench.verification.scenes import Kind

STEPS = 2000
"""Steps of an elastic contact time in which collisions are integrated; twice as many change e by less than 1e-4."""
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
    """A collision under the scene's law (the `reference` variant of `HertzMindlin`), integrated over time.

    m* x'' = k x^(3/2) against the overlap with the dashpot 2 sqrt(5/6) b sqrt(S m*) x', the shear spring with stiffness
    8 G* sqrt(R* x) up to mu |F_n|, its dashpot while it holds; see `dembench.scene.HertzMindlin` and its sources.

    Args:
        contact: Its constants.
        speed: Normal speed of approach [m/s].
        slip: Tangential speed of the surfaces [m/s].
    """
    e, m = contact.restitution, contact.mass
    damping = -math.log(e) / math.hypot(math.log(e), math.pi)
    normal_rate = 2 * math.sqrt(5 / 6) * damping
    h = contact.duration(speed) / STEPS
    k, s_n = contact.stiffness, 2 * contact.modulus * math.sqrt(contact.radius)
    s_t = 8 * contact.shear * math.sqrt(contact.radius)
    overlap, closing, sliding, spring = 0.5 * h * speed, speed, slip, 0.0
    push = turn = 0.0
    for _ in range(int(LONGEST * STEPS)):
        root = math.sqrt(overlap)
        force = k * overlap * root + normal_rate * math.sqrt(s_n * root * m) * closing
        bound = contact.friction * abs(force)
        stiff = s_t * root
        spring += h * sliding
        if stiff * abs(spring) > bound:
            spring = math.copysign(bound / stiff, spring)
            drag = stiff * spring
        else:
            drag = stiff * spring + normal_rate * math.sqrt(stiff * m) * sliding if bound > 0 else 0.0
        lever = 1 - 0.5 * overlap / contact.arm
        push += h * drag / m
        turn += h * SPHERE * lever * drag / m
        sliding -= h * (1 + SPHERE * lever**2) * drag / m
        closing -= h * force / m
        overlap += h * closing
        if overlap <= 0:
            return Impact(-closing, push, turn)
    raise ArithmeticError(f"the bodies have not parted after {LONGEST:g} contact times")


def impacts(contact: Contact, speeds: np.ndarray, slips: np.ndarray) -> list[Impact]:
    """One collision for each normal speed and slip [m/s]."""
    return [impact(contact, float(v), float(s)) for v, s in zip(speeds, slips, strict=True)]


def _reduced(a: float, b: float) -> float:
    return a * b / (a + b)
