"""Named contact laws, and what each makes of collisions of two spheres: the limit of vanishing time steps.

Notation of `dembench.solver.laws`: overlap d, separation speed vn, slip velocity vt, R*, m*, E*, G*, damping ratio b.

    spring of Hertz    (4/3) E* sqrt(R*) d^(3/2),  S_n = 2 E* sqrt(R* d),  S_t = share 8 G* sqrt(R* d)
    linear spring      k d,                        S_n = k,                S_t = share k 2 (1 - nu)/(2 - nu)
    dashpots           2 sqrt(5/6) b sqrt(S_n m*) vn and 2 sqrt(5/6) b sqrt(S_t m*) vt;  linear: 2 b sqrt(k m*) vn, ...
    shear spring       S_t(d) s with s' = vt, or a force with F' = S_t(d) vt

A law that turns its shear spring into the tangent plane by projection and one that restores its length are the same in
this limit: a step that turns the normal by a shortens the spring by a^2/2, which sums up to nothing.

Sources: Dosta et al. 2024, doi 10.1016/j.cpc.2023.109066, and the sources of the codes that it compares; Tsuji et al.
1992 for the dashpot; Thornton, Cummins & Cleary 2013, doi 10.1016/j.powtec.2012.08.012, for its fit; Walton 1993 for
rigid spheres.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

THORNTON = (-6.918798, -16.41105, 146.8049, -796.4559, 2928.711, -7206.864, 11494.29, -11342.18, 6276.757, -1489.915)
"""Coefficients h1 to h10 of the fit of Thornton et al. 2013."""


@dataclass(frozen=True)
class NamedLaw:
    """A contact law.

    Attributes:
        name: Identifier.
        title: What it is, in a few words.
        known_from: Where it is computed.
        spring: Kind of the normal contact.
        tension: Whether the normal force may pull; otherwise it is never below 0.
        damping: Dashpots that give the restitution where tension is kept (`tsuji`), or where it is not (`thornton`).
        bound: Coulomb bound: friction times the whole normal force, or times its spring alone.
        limited: What the bound limits: the shear spring, beyond which there is no dashpot (`spring`), or spring and
            dashpot together (`sum`); `spring, dashpot kept`: the spring, and the dashpot acts beyond it, too.
        shear: Share of Mindlin's stiffness [-].
        shear_damping: Whether the shear has a dashpot.
        history: What is remembered: the way of the slip, or the force.
        lever: Lever of friction: the radius less half the overlap, or the radius.
    """

    name: str
    title: str
    known_from: str
    spring: Literal["hertz", "linear", "rigid"] = "hertz"
    tension: bool = True
    damping: Literal["tsuji", "thornton"] = "tsuji"
    bound: Literal["whole", "spring"] = "whole"
    limited: Literal["spring", "sum", "spring, dashpot kept"] = "spring"
    shear: float = 1.0
    shear_damping: bool = True
    history: Literal["way", "force"] = "way"
    lever: Literal["reduced", "full"] = "reduced"


LAWS = (
    NamedLaw("hertz-mindlin", "Hertz-Mindlin, tension kept", "LIGGGHTS, the scene's reference"),
    NamedLaw("full-lever", "Hertz-Mindlin, lever is the full radius", "MUSEN, the scene's rescaled", lever="full"),
    NamedLaw("no-tension", "Hertz-Mindlin, tension clipped", "the scene's no-tension", tension=False),
    NamedLaw(
        "thornton",
        "Hertz-Mindlin, tension clipped, Thornton's damping, shear force remembered",
        "Yade",
        tension=False,
        damping="thornton",
        history="force",
    ),
    NamedLaw(
        "two-thirds",
        "Hertz-Mindlin with 2/3 of the shear stiffness, no shear dashpot",
        "MercuryDPM",
        shear=2 / 3,
        shear_damping=False,
        lever="full",
    ),
    NamedLaw(
        "spring-bound",
        "Hertz-Mindlin, friction bound on the spring's force only, dashpot inside it",
        "peclet.dem",
        bound="spring",
        limited="sum",
    ),
    NamedLaw(
        "sliding-dashpot",
        "Hertz-Mindlin, shear dashpot also while sliding",
        "a common slip",
        limited="spring, dashpot kept",
    ),
    NamedLaw("force-history", "Hertz-Mindlin, shear force remembered", "LAMMPS mindlin/force", history="force"),
    NamedLaw("linear", "linear spring-dashpot, as deep at the same speed", "Cundall & Strack", spring="linear"),
    NamedLaw("rigid", "rigid spheres: restitution and Coulomb friction", "Walton", spring="rigid", lever="full"),
)
"""The laws that an engine's answers are compared with; the first is the law of the scenes."""
SCENE_LAW = LAWS[0]


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

    The bound of Coulomb maps a state back after a step, so it is no right side of a differential equation. Between two
    times `steps` steps of Runge and Kutta of fourth order are made, and each cuts the shear spring to its bound.

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
    contact = _Contact(laws, pairs)
    h, n = (time[1] - time[0]) / steps, len(pairs.mass)
    start = [pairs.position.reshape(n, 4), pairs.velocity.reshape(n, 4), pairs.spin, np.zeros((n, 1))]
    state = np.tile(np.concatenate(start, axis=1), (len(laws), 1, 1))
    slides = np.zeros((len(laws), n), bool)
    seen = [state]
    for _ in time[1:]:
        for _ in range(steps):
            a = contact.rate(state, slides)
            b = contact.rate(state + 0.5 * h * a)
            c = contact.rate(state + 0.5 * h * b)
            state, slides = contact.bounded(state + h / 6 * (a + 2 * b + 2 * c + contact.rate(state + h * c)))
        seen.append(state)
    found = np.array(seen)
    shape = (len(time), n, 2, 2)
    return [
        Motion(time, of[:, :, :4].reshape(shape), of[:, :, 4:8].reshape(shape), of[:, :, 8:10])
        for of in np.moveaxis(found, 1, 0)
    ]


class _Contact:
    """Constants of laws for pairs, and rates of change of their states.

    A state has the columns x0 y0 x1 y1, their velocities, both spins and the shear: shape (laws, n, 11). All else has
    the shape (laws, n), or (laws, 1) where it is that of a law.
    """

    def __init__(self, laws: Sequence[NamedLaw], pairs: Pairs):
        def of_laws(values: Iterable[float]) -> np.ndarray:
            return np.array(list(values), dtype=float)[:, None]

        self.pairs, mass = pairs, pairs.reduced_mass
        self.linear = of_laws(law.spring == "linear" for law in laws)
        self.clipped = of_laws(law.tension is False for law in laws) > 0
        self.half = of_laws(0.5 * (law.lever == "reduced") for law in laws)
        self.force_kept = of_laws(law.history == "force" for law in laws) > 0
        self.by_spring = of_laws(law.bound == "spring" for law in laws) > 0
        self.sum_limited = of_laws(law.limited == "sum" for law in laws) > 0
        self.dashpot_kept = of_laws(law.limited == "spring, dashpot kept" for law in laws) > 0
        share = of_laws(law.shear for law in laws)
        usual = damping_ratio(pairs.restitution)
        fitted = np.array([thornton_damping(float(e)) for e in pairs.restitution])
        damping = 2 * np.where(of_laws(law.damping == "thornton" for law in laws) > 0, fitted, usual)
        linear = self.linear > 0
        stiff = 0.8 * pairs.hertz * np.sqrt(pairs.deepest)  # as much energy at the same depth
        self.kn = np.where(linear, stiff, pairs.hertz)
        shear = 8 * pairs.shear * np.sqrt(pairs.reduced_radius)
        self.kt = share * np.where(linear, stiff * 2 * (1 - pairs.poisson) / (2 - pairs.poisson), shear)
        self.dn = damping * np.where(linear, np.sqrt(stiff * mass), np.sqrt(5 / 6 * 1.5 * pairs.hertz * mass))
        self.dt = damping * np.where(linear, 1.0, np.sqrt(5 / 6)) * np.sqrt(self.kt * mass)
        self.dt *= of_laws(law.shear_damping for law in laws)
        self.reach, self.inertia = pairs.radius.sum(axis=1), pairs.inertia

    def rate(self, state: np.ndarray, slides: np.ndarray | None = None) -> np.ndarray:
        """The rate of change of states.

        Args:
            state: The states.
            slides: Which slide; None where their springs say it, which are beyond their bounds.
        """
        n, overlap, vn, vt, arms = self._geometry(state)
        fn, stiffness, dashpot, bound = self._forces(overlap, vn)
        scale = np.where(self.force_kept, 1.0, stiffness)
        spring = scale * state[..., 10]
        if slides is None:
            slides = np.abs(spring) > bound
        cut, damper = np.clip(spring, -bound, bound), dashpot * vt * (bound > 0)
        shear = cut + np.where(slides & ~self.dashpot_kept, 0.0, damper)
        shear = np.where(self.sum_limited, np.clip(spring + damper, -bound, bound), shear)
        tangent = np.stack([-n[..., 1], n[..., 0]], axis=-1)
        force = fn[..., None] * n - shear[..., None] * tangent  # on sphere 1
        change = np.empty_like(state)
        change[..., :4] = state[..., 4:8]
        change[..., 4:6] = -force / self.pairs.mass[:, :1]
        change[..., 6:8] = force / self.pairs.mass[:, 1:]
        change[..., 8:10] = arms * shear[..., None] / self.inertia
        change[..., 10] = vt * np.where(self.force_kept, stiffness, 1.0) * (overlap > 0)
        return change

    def bounded(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States whose shear springs are cut to their bounds, to nothing where spheres part; and which slide."""
        _, overlap, vn, _, _ = self._geometry(state)
        _, stiffness, _, bound = self._forces(overlap, vn)
        limit = bound / np.where(self.force_kept | (overlap <= 0), 1.0, stiffness)
        slides = np.abs(state[..., 10]) > limit
        state[..., 10] = np.where(overlap > 0, np.clip(state[..., 10], -limit, limit), 0.0)
        return state, slides

    def _geometry(self, state: np.ndarray) -> tuple[np.ndarray, ...]:
        """Normal from sphere 0 to 1, overlap (none below 0), separation speed, slip of 1 on 0, levers."""
        apart = state[..., 2:4] - state[..., 0:2]
        length = np.hypot(apart[..., 0], apart[..., 1])
        n = apart / length[..., None]
        overlap = np.maximum(self.reach - length, 0.0)
        v = state[..., 6:8] - state[..., 4:6]
        arms = self.pairs.radius - (self.half * overlap)[..., None]
        slip = n[..., 0] * v[..., 1] - n[..., 1] * v[..., 0] - (arms * state[..., 8:10]).sum(axis=-1)
        return n, overlap, (n * v).sum(axis=-1), slip, arms

    def _forces(self, overlap: np.ndarray, vn: np.ndarray) -> tuple[np.ndarray, ...]:
        """Normal force, stiffness of the shear spring, its dashpot, bound; all 0 where spheres do not touch."""
        root = np.where(self.linear, overlap > 0, np.sqrt(overlap))
        spring, quarter = self.kn * overlap * root, np.sqrt(root)
        fn = spring - self.dn * quarter * vn
        fn = np.where(self.clipped, np.maximum(fn, 0.0), fn)
        bound = self.pairs.friction * np.where(self.by_spring, spring, np.abs(fn))
        return fn, self.kt * root, self.dt * quarter, bound


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


def damping_ratio(restitution: np.ndarray) -> np.ndarray:
    """b = -ln e / sqrt(ln^2 e + pi^2) (Tsuji et al. 1992)."""
    log = np.log(restitution)
    return np.asarray(-log / np.hypot(log, np.pi))


@cache
def thornton_damping(e: float) -> float:
    """Damping ratio that gives a restitution where tension is clipped, by the fit of Thornton et al. 2013."""
    a = e * sum(h * e**k for k, h in enumerate(THORNTON))
    return float(np.sqrt(1 / (1 - (1 + e) ** 2 * np.exp(a)) - 1))


@cache
def clipped_restitution(e: float) -> float:
    """Restitution of a law whose damping gives `e` with tension, where tension is clipped.

    Schwager & Poeschel 2007, doi 10.1007/s10035-007-0065-z, for the linear spring; the spring of Hertz with the
    dashpot of Tsuji et al. gives the same.
    """
    b = float(damping_ratio(np.array(e)))
    root = float(np.sqrt(1 - b * b))
    return float(np.exp(-b / root * (np.pi - np.arctan2(2 * b * root, 1 - 2 * b * b))))
