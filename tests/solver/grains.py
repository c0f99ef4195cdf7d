"""Scenes of a few grains, for closed forms of one contact, of a few, and for small piles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dembench.scene import Bodies, Box, Domain, HertzMindlin, Material, PairLaw, Plane, Scene, Species

RADIUS, DENSITY, YOUNG, POISSON = 1e-3, 2500.0, 1e7, 0.2
FLOOR = Plane(name="floor", material="grain", point=(0, 0, 0), normal=(0, 0, 1))


def grains(
    position: Any,
    velocity: Any = None,
    spin: Any = None,
    *,
    radius: float | Sequence[float] = RADIUS,
    species: Any = None,
    young: float = YOUNG,
    poisson: float = POISSON,
    density: float = DENSITY,
    restitution: float = 0.5,
    friction: float = 0.3,
    variant: str = "reference",
    kinds: tuple[Species, ...] = (),
    dt: float = 1e-6,
    **changes: Any,
) -> Scene:
    """Grains of one material [SI units] without gravity; several radii make several species, chosen by `species`.

    `kinds` replaces the species where they are of several materials; `changes` are other fields of the scene.
    """
    radii = [radius] if isinstance(radius, int | float) else list(radius)
    fields: dict[str, Any] = {
        "name": "grains",
        "law": HertzMindlin(variant=variant),
        "materials": (Material(name="grain", density=density, young=young, poisson=poisson),),
        "pair_laws": (PairLaw(a="grain", b="grain", restitution=restitution, friction=friction),),
        "species": kinds or tuple(Species(name=f"g{k}", material="grain", radius=r) for k, r in enumerate(radii)),
        "bodies": Bodies(position=position, velocity=velocity, angular_velocity=spin, species=species),
        "domain": Domain(lower=(-1e6,) * 3, upper=(1e6,) * 3),
        "gravity": (0, 0, 0),
        "duration": 0.016,
        "time_step": dt,
    }
    return Scene(**{**fields, **changes})


def gas(
    n: int, seed: int = 0, speed: float = 1.0, radius: float = RADIUS, spacing: float = 2.5
) -> tuple[Any, Any, Any]:
    """Positions [m], velocities [m/s] and spins [rad/s] of n grains on a jittered lattice that fly at random."""
    random = np.random.default_rng(seed)
    edge = int(np.ceil(n ** (1 / 3)))
    lattice = np.stack(np.meshgrid(*[np.arange(edge)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)[:n]
    position = (lattice * spacing + random.uniform(-0.2, 0.2, (n, 3))) * radius
    return position, speed * random.normal(size=(n, 3)), speed / radius * random.normal(size=(n, 3))


def hertz(scene: Scene, overlap: float, reduced_radius: float) -> float:
    """Hertz force [N] of two grains of the material of `grains` or of a grain on a wall."""
    m = scene.materials[0]
    return 4 / 3 * m.young / (2 * (1 - m.poisson**2)) * np.sqrt(reduced_radius) * overlap**1.5


def resting_overlap(scene: Scene) -> float:
    """Overlap [m] of the first grain at rest on a plane under its own weight."""
    weight = float(scene.masses()[0]) * float(np.linalg.norm(scene.gravity))
    return (weight / hertz(scene, 1.0, float(scene.radii()[0]))) ** (2 / 3)


def pairs(n: int = 50) -> Scene:
    """Pairs of grains far from each other that meet, slide and overlap, each in its own way."""
    random = np.random.default_rng(5)
    first = 10 * RADIUS * np.array([(k % 7, k // 7, 0) for k in range(n)], float)
    towards = random.normal(size=(n, 3))
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    second = first + random.uniform(1.98, 2.02, (n, 1)) * RADIUS * towards
    position, shape = np.stack([first, second], axis=1).reshape(-1, 3), (2 * n, 3)
    velocity, spin = random.normal(scale=0.2, size=shape), random.normal(scale=100, size=shape)
    return grains(position, velocity, spin, gravity=(0, 0, -9.81))


def crowd(n: int = 1728, **changes: Any) -> Scene:
    """Grains close together in a box, with a ball of five radii among them."""
    position, velocity, spin = gas(n, speed=0.5, spacing=2.02)
    low, high = position.min(axis=0) - RADIUS, position.max(axis=0) + RADIUS
    centre = (low + high) / 2
    far = np.linalg.norm(position - centre, axis=1) > 6.1 * RADIUS
    return grains(
        [*position[far], centre],
        [*velocity[far], np.zeros(3)],
        [*spin[far], np.zeros(3)],
        radius=(RADIUS, 5 * RADIUS),
        species=[*np.zeros(far.sum(), int), 1],
        walls=(Box(name="box", material="grain", lower=tuple(low), upper=tuple(high)),),
        **changes,
    )
