"""Named contact laws: their forces, and the step by which motions under them are integrated.

Notation of `dembench.solver.laws`: overlap d, separation speed vn, slip velocity vt, R*, m*, E*, G*, damping ratio b.

    spring of Hertz    (4/3) E* sqrt(R*) d^(3/2),  S_n = 2 E* sqrt(R* d),  S_t = share 8 G* sqrt(R* d)
    linear spring      k d,                        S_n = k,                S_t = share k 2 (1 - nu)/(2 - nu)
    dashpots           2 sqrt(5/6) b sqrt(S_n m*) vn and 2 sqrt(5/6) b sqrt(S_t m*) vt;  linear: 2 b sqrt(k m*) vn, ...
    shear spring       S_t(d) s with s' = vt, or a force with F' = S_t(d) vt

Sources: Dosta et al. 2024, doi 10.1016/j.cpc.2023.109066, and the sources of the codes that it compares; Tsuji et al.
1992 for the dashpot; Thornton, Cummins & Cleary 2013, doi 10.1016/j.powtec.2012.08.012, for its fit; Walton 1993 for
rigid spheres.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, Protocol

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
            dashpot together (`sum`), and then the spring alone or, `sum, spring wound back`, so that their sum is the
            bound; `spring, dashpot kept`: the spring, and the dashpot acts beyond it, too.
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
    limited: Literal["spring", "sum", "sum, spring wound back", "spring, dashpot kept"] = "spring"
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
        "wound-spring",
        "Hertz-Mindlin, shear spring wound back until it and its dashpot meet the friction bound",
        "LAMMPS mindlin",
        limited="sum, spring wound back",
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
class Contacts:
    """Constants of contacts, shape (n,) each.

    Attributes:
        hertz: (4/3) E* sqrt(R*) [N/m^1.5].
        mindlin: 8 G* sqrt(R*) [N/m^1.5].
        mass: Reduced mass m* [kg].
        restitution, friction: [-].
        deepest: Largest overlap of elastic bodies, at which a linear spring holds as much energy [m].
        ratio: Shear over normal stiffness of a linear spring, 2 (1 - nu)/(2 - nu) [-].
    """

    hertz: np.ndarray
    mindlin: np.ndarray
    mass: np.ndarray
    restitution: np.ndarray
    friction: np.ndarray
    deepest: np.ndarray
    ratio: np.ndarray


class Forces:
    """Forces of soft laws in contacts; all arrays have the shape (laws, n), or (laws, 1) where they are of a law."""

    def __init__(self, laws: Sequence[NamedLaw], contacts: Contacts):
        def of_laws(values: Iterable[float]) -> np.ndarray:
            return np.array(list(values), dtype=float)[:, None]

        mass = contacts.mass
        self.friction = contacts.friction
        self.linear = of_laws(law.spring == "linear" for law in laws)
        self.clipped = of_laws(law.tension is False for law in laws) > 0
        self.half = of_laws(0.5 * (law.lever == "reduced") for law in laws)
        self.force_kept = of_laws(law.history == "force" for law in laws) > 0
        self.by_spring = of_laws(law.bound == "spring" for law in laws) > 0
        self.wound_back = of_laws(law.limited == "sum, spring wound back" for law in laws) > 0
        self.sum_limited = self.wound_back | (of_laws(law.limited == "sum" for law in laws) > 0)
        self.dashpot_kept = of_laws(law.limited == "spring, dashpot kept" for law in laws) > 0
        share = of_laws(law.shear for law in laws)
        usual = damping_ratio(contacts.restitution)
        fitted = np.array([thornton_damping(float(e)) for e in contacts.restitution])
        damping = 2 * np.where(of_laws(law.damping == "thornton" for law in laws) > 0, fitted, usual)
        linear = self.linear > 0
        stiff = 0.8 * contacts.hertz * np.sqrt(contacts.deepest)  # as much energy at the same depth
        self.kn = np.where(linear, stiff, contacts.hertz)
        self.kt = share * np.where(linear, stiff * contacts.ratio, contacts.mindlin)
        self.dn = damping * np.where(linear, np.sqrt(stiff * mass), np.sqrt(5 / 6 * 1.5 * contacts.hertz * mass))
        self.dt = damping * np.where(linear, 1.0, np.sqrt(5 / 6)) * np.sqrt(self.kt * mass)
        self.dt *= of_laws(law.shear_damping for law in laws)

    def of(
        self, overlap: np.ndarray, vn: np.ndarray, vt: np.ndarray, memory: np.ndarray, slides: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Normal force, shear force against the slip, and rate of change of the shear's memory.

        Args:
            overlap: [m], none below 0.
            vn, vt: Separation speed and slip velocity [m/s].
            memory: Way of the shear [m], or its force [N] for a law that remembers the force.
            slides: Which slide; None where their springs say it, which are beyond their bounds.
        """
        fn, stiffness, dashpot, bound = self._parts(overlap, vn)
        spring = np.where(self.force_kept, 1.0, stiffness) * memory
        if slides is None:
            slides = np.abs(spring) > bound
        cut, damper = np.clip(spring, -bound, bound), dashpot * vt * (bound > 0)
        shear = cut + np.where(slides & ~self.dashpot_kept, 0.0, damper)
        shear = np.where(self.sum_limited, np.clip(spring + damper, -bound, bound), shear)
        return fn, shear, vt * np.where(self.force_kept, stiffness, 1.0) * (overlap > 0)

    def cut(
        self, overlap: np.ndarray, vn: np.ndarray, vt: np.ndarray, memory: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The shear's memory cut to its bound, to nothing where bodies part; and which slide. Arguments as in `of`."""
        _, stiffness, dashpot, bound = self._parts(overlap, vn)
        scale = np.where(self.force_kept | (overlap <= 0), 1.0, stiffness)
        damper = np.where(self.wound_back & (bound > 0), dashpot * vt, 0.0)
        force = scale * memory + damper
        slides = np.abs(force) > bound
        kept = np.where(slides, (np.clip(force, -bound, bound) - damper) / scale, memory)
        return np.where(overlap > 0, kept, 0.0), slides

    def _parts(self, overlap: np.ndarray, vn: np.ndarray) -> tuple[np.ndarray, ...]:
        """Normal force, stiffness of the shear spring, its dashpot, bound; all 0 where bodies do not touch."""
        root = np.where(self.linear, overlap > 0, np.sqrt(overlap))
        spring, quarter = self.kn * overlap * root, np.sqrt(root)
        fn = spring - self.dn * quarter * vn
        fn = np.where(self.clipped, np.maximum(fn, 0.0), fn)
        bound = self.friction * np.where(self.by_spring, spring, np.abs(fn))
        return fn, self.kt * root, self.dt * quarter, bound


class Moving(Protocol):
    """Bodies in contact whose motion is integrated; a state is an array of the shape (laws, n, columns)."""

    def rate(self, state: np.ndarray, slides: np.ndarray | None = None) -> np.ndarray:
        """The rate of change of a state; `slides` as in `Forces.of`."""

    def bounded(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The state with the memory of its shear cut to the bound, and which slide."""


def advanced(
    moving: Moving, state: np.ndarray, slides: np.ndarray, h: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """State after a time h [s] and which slide: Runge and Kutta's step of fourth order, cut to the bound after it.

    The bound of Coulomb maps a state back after a step, so it is no right side of a differential equation.
    """
    a = moving.rate(state, slides)
    b = moving.rate(state + 0.5 * h * a)
    c = moving.rate(state + 0.5 * h * b)
    return moving.bounded(state + h / 6 * (a + 2 * b + 2 * c + moving.rate(state + h * c)))


def damping_ratio(restitution: np.ndarray | float) -> np.ndarray:
    """b = -ln e / sqrt(ln^2 e + pi^2) (Tsuji et al. 1992)."""
    log = np.log(restitution)
    return np.asarray(-log / np.hypot(log, np.pi))


@cache
def thornton_damping(e: float) -> float:
    """Damping ratio that gives a restitution where tension is clipped, by the fit of Thornton et al. 2013.

    Their dashpot is 2 b sqrt(S_n m*); the ratio is that of the named laws, whose is 2 sqrt(5/6) b sqrt(S_n m*).
    """
    a = e * sum(h * e**k for k, h in enumerate(THORNTON))
    return float(np.sqrt(1.2 * (1 / (1 - (1 + e) ** 2 * np.exp(a)) - 1)))
