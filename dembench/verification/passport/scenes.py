"""Scenes of the passport: pairs of spheres that collide, every sweep in one scene, without gravity."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from dembench.scene import Bodies, Domain, Material, PairLaw, Scene, Snapshot, Species
from dembench.verification.passport.pairs import Pairs

RADIUS = 0.01
SPEED = 1.0
"""Normal speed of most pairs [m/s]."""
SOFT, HARD = Material(name="soft", density=2500, young=1e7, poisson=0.25), (4e7, 0.4, 5000.0)
"""The material of most spheres: as soft as overlaps of 7 % of the radius need, so that levers can be told apart; and
Young's modulus, Poisson's ratio and density of another."""
RESTITUTIONS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.98)
FRICTION = 0.2
FAST = (150.0, 150.0)
"""Spins of pairs that slide through the whole contact, three times as fast as they approach [rad/s]."""
SLOPES = (0.2, 0.5, 0.8, 1.2, 2.0)
"""Tangential over normal speeds of pairs that stick and slide."""
ROUGH = 5.0
"""Friction of pairs that never slide."""
MIXED = {("soft", "hard"): (0.3, 0.6), ("hard", "hard"): (0.8, 0.1), ("soft", "soft"): (0.6, 0.3)}
"""Restitution and friction of the pairs of two materials: what no rule of combination gives."""
STEPS = 400
"""Time steps of a contact of elastic spheres."""
EVERY = 4
"""Time steps between two recorded times."""
LONG = 3.0
"""Duration in contact times of elastic spheres [-]."""
FIRST = 6.5
"""Time steps before the touch."""
MOTION = "motion"


@dataclass(frozen=True)
class Collision:
    """One pair of the scene.

    Attributes:
        family: What it is for.
        materials: Names of the materials of both spheres.
        radii: Of both [m].
        normal, tangential: Relative speeds [m/s].
        spins: About z [rad/s].
    """

    family: str
    materials: tuple[str, str]
    radii: tuple[float, float] = (RADIUS, RADIUS)
    normal: float = SPEED
    tangential: float = 0.0
    spins: tuple[float, float] = (0.0, 0.0)


def plain(e: float, mu: float) -> str:
    """Name of the soft material whose spheres have this restitution and friction among themselves."""
    return f"e{round(1000 * e)}m{round(1000 * mu)}"


@cache
def collisions() -> tuple[Collision, ...]:
    """All pairs."""
    found = [Collision("normal", (plain(e, FRICTION),) * 2) for e in RESTITUTIONS]
    found += [Collision("speed", (plain(0.9, FRICTION),) * 2, normal=v) for v in (0.3, 2.0)]
    found += [Collision("size", (plain(0.9, FRICTION),) * 2, radii=(RADIUS, 2 * RADIUS))]
    found += [Collision("sliding", (plain(e, FRICTION),) * 2, spins=FAST) for e in RESTITUTIONS]
    found += [Collision("bound", (plain(0.8, mu),) * 2, spins=FAST) for mu in (0.05, 0.4)]
    found += [Collision("oblique", (plain(e, FRICTION),) * 2, tangential=slope) for e in (0.5, 0.9) for slope in SLOPES]
    found += [Collision("rough", (plain(e, ROUGH),) * 2, tangential=s) for e in (0.5, 0.98) for s in (0.2, 0.5, 1.0)]
    found += [
        Collision("mixed", pair, radii=radii, tangential=t)
        for pair, radii in zip(MIXED, ((RADIUS, RADIUS), (RADIUS, RADIUS), (RADIUS, 1.5 * RADIUS)), strict=True)
        for t in (0.5, 3.0)
    ]
    return tuple(found)


def of_family(*families: str) -> list[int]:
    """Numbers of the pairs of some families."""
    return [k for k, c in enumerate(collisions()) if c.family in families]


def contact_time() -> float:
    """Time that two elastic spheres of the plain kind touch: 2.9432 d/v with the deepest overlap d (Hertz) [s]."""
    young = SOFT.young / (2 * (1 - SOFT.poisson**2))
    mass = 0.5 * SOFT.density * 4 / 3 * math.pi * RADIUS**3
    deepest = (1.25 * mass * SPEED**2 / (4 / 3 * young * math.sqrt(RADIUS / 2))) ** 0.4
    return 2.9432 * deepest / SPEED


DT = float(f"{contact_time() / STEPS:.2g}")
"""Time step [s]."""


def pairs_in_contact() -> Scene:
    """All pairs, one above the other along z, each in a plane x-y; bodies 2 k and 2 k + 1 are pair k."""
    all_pairs = collisions()
    names = sorted({name for c in all_pairs for name in c.materials})
    own = {plain(e, mu): (e, mu) for e in (*RESTITUTIONS,) for mu in (0.05, FRICTION, 0.4, ROUGH)}
    mixed = {frozenset(pair): law for pair, law in MIXED.items()}
    laws = []
    together = {tuple(sorted(c.materials)) for c in all_pairs}
    for a, b in sorted(itertools.combinations_with_replacement(names, 2), key=lambda pair: pair not in together):
        e, mu = mixed.get(frozenset((a, b))) or (own[a] if a == b else (0.5, FRICTION))
        laws.append(PairLaw(a=a, b=b, restitution=e, friction=mu))
    kinds = sorted({(m, r) for c in all_pairs for m, r in zip(c.materials, c.radii, strict=True)})
    position, velocity, spin, species = [], [], [], []
    height = 0.0
    for c in all_pairs:
        height += 2.5 * max(c.radii)
        before = FIRST * DT
        reach = sum(c.radii)
        shift = 0.5 * c.tangential * before
        position.append([[0, shift, height], [reach + c.normal * before, -shift, height]])
        velocity.append([[c.normal / 2, -c.tangential / 2, 0], [-c.normal / 2, c.tangential / 2, 0]])
        spin.append([[0, 0, w] for w in c.spins])
        species.append([kinds.index(kind) for kind in zip(c.materials, c.radii, strict=True)])
        height += 2.5 * max(c.radii)
    times = DT * EVERY * np.arange(round(LONG * STEPS / EVERY) + 1)
    return Scene(
        name="passport_pairs",
        materials=tuple(_material(name) for name in names),
        pair_laws=tuple(laws),
        species=tuple(Species(name=f"{m}r{round(1e4 * r)}", material=m, radius=r) for m, r in kinds),
        bodies=Bodies(
            position=np.reshape(position, (-1, 3)),
            velocity=np.reshape(velocity, (-1, 3)),
            angular_velocity=np.reshape(spin, (-1, 3)),
            species=np.ravel(species),
        ),
        domain=Domain(lower=(-0.2, -0.2, -0.1), upper=(0.2, 0.2, height + 0.1)),
        gravity=(0, 0, 0),
        duration=float(times[-1]),
        time_step=DT,
        observables=(Snapshot(name=MOTION, times=tuple(float(t) for t in times)),),
    )


ROLLING = (0.01, 0.05, 0.1)
"""Coefficients of rolling friction."""
ROLLING_SPIN = 100.0
"""Opposite spins of spheres that roll on each other and do not slip [rad/s]."""


def rolling_pairs() -> Scene:
    """Head-on pairs with opposite spins, one for each coefficient of rolling friction."""
    names = [f"r{round(1000 * c)}" for c in ROLLING]
    own = dict(zip(names, ROLLING, strict=True))
    laws = [
        PairLaw(a=a, b=b, restitution=0.9, friction=FRICTION, rolling_friction=own[a] if a == b else 0.0)
        for a, b in itertools.combinations_with_replacement(names, 2)
    ]
    half = RADIUS + 0.5 * SPEED * FIRST * DT
    n = len(names)
    duration = DT * EVERY * round(LONG * STEPS / EVERY)
    return Scene(
        name="passport_rolling",
        materials=tuple(_material(name) for name in names),
        pair_laws=tuple(laws),
        species=tuple(Species(name=name, material=name, radius=RADIUS) for name in names),
        bodies=Bodies(
            position=[[side * half, 0, 5 * RADIUS * k] for k in range(n) for side in (-1, 1)],
            velocity=[[-side * SPEED / 2, 0, 0] for _ in names for side in (-1, 1)],
            angular_velocity=[[0, 0, -side * ROLLING_SPIN] for _ in names for side in (-1, 1)],
            species=np.repeat(np.arange(n), 2),
        ),
        domain=Domain(lower=(-0.2, -0.2, -0.1), upper=(0.2, 0.2, 5 * RADIUS * n + 0.1)),
        gravity=(0, 0, 0),
        duration=duration,
        time_step=DT,
        observables=(Snapshot(name=MOTION, times=(0.0, duration)),),
    )


def _material(name: str) -> Material:
    if name == "hard":
        young, poisson, density = HARD
        return Material(name=name, density=density, young=young, poisson=poisson)
    return SOFT.model_copy(update={"name": name})


def pairs_of(scene: Scene) -> Pairs:
    """The pairs of a scene of these, for the laws."""
    n = len(scene.bodies) // 2
    names = np.array([s.material for s in scene.species])[scene.bodies.species].reshape(n, 2)
    materials = {m.name: m for m in scene.materials}
    both = [(materials[a], materials[b]) for a, b in names]
    laws = [scene.pair_law(a, b) for a, b in names]
    return Pairs(
        radius=scene.radii().reshape(n, 2),
        mass=scene.masses().reshape(n, 2),
        young=np.array([1 / sum((1 - m.poisson**2) / m.young for m in pair) for pair in both]),
        shear=np.array([1 / sum((2 - m.poisson) * 2 * (1 + m.poisson) / m.young for m in pair) for pair in both]),
        poisson=np.array([pair[0].poisson for pair in both]),
        restitution=np.array([law.restitution for law in laws]),
        friction=np.array([law.friction for law in laws]),
        position=scene.bodies.position.reshape(n, 2, 3)[:, :, :2],
        velocity=scene.bodies.velocity.reshape(n, 2, 3)[:, :, :2],
        spin=scene.bodies.angular_velocity.reshape(n, 2, 3)[:, :, 2],
    )
