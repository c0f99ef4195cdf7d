"""A scene from plain arrays and numbers: what a script has at hand, without a class for every property."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from dembench.scene.bodies import Bodies
from dembench.scene.materials import Law, Material, PairLaw, Rigid
from dembench.scene.observables import Observable
from dembench.scene.scene import Constraint, Domain, Scene, Sink, Species
from dembench.scene.walls import Plane, WallShape

UNBOUNDED = Domain(lower=(-1e9,) * 3, upper=(1e9,) * 3)
"""The domain of a scene that gives none [m]."""
MOST_DENSITIES = 64
"""At most this many densities of one material: the table of pairs grows with their square."""


def scene_from_arrays(
    position: Any,
    radius: Any,
    *,
    velocity: Any = None,
    angular_velocity: Any = None,
    material: Any = 0,
    materials: Sequence[str] = ("grain",),
    density: float | Sequence[float] = 1000.0,
    mass: Any = None,
    young: float | Sequence[float] = 1e7,
    poisson: float | Sequence[float] = 0.25,
    restitution: float = 1.0,
    friction: float = 0.0,
    tangential_restitution: float | None = None,
    rolling_friction: float = 0.0,
    pairs: Mapping[tuple[str, str], Mapping[str, float]] | None = None,
    walls: Iterable[WallShape | tuple[Any, Any]] = (),
    gravity: Any = (0.0, 0.0, -9.81),
    law: Law | None = None,
    fixed: Iterable[int] = (),
    kinematic: Iterable[int] = (),
    rotation_locked: Iterable[int] = (),
    sinks: Iterable[Sink] = (),
    domain: Domain = UNBOUNDED,
    observables: Iterable[Observable] = (),
    duration: float = 1.0,
    name: str = "scene",
) -> Scene:
    """A scene of spheres.

    Args:
        position: Centres [m], shape (n, 3).
        radius: Radii [m], a number or shape (n,).
        velocity, angular_velocity: [m/s], [rad/s], shape (n, 3); None means at rest.
        material: Index of each body's material among `materials`, a number or shape (n,).
        materials: Names of the materials of particles and walls.
        density, young, poisson: Density [kg/m^3], Young's modulus [Pa] and Poisson's ratio, a number for all or one per
            material. Rigid contacts do not use the moduli.
        mass: Masses [kg], a number or shape (n,), in place of the densities.
        restitution, friction, tangential_restitution, rolling_friction: See `PairLaw`; for all pairs of materials.
        pairs: Those properties of single pairs, e.g. {("grain", "floor"): {"friction": 0.2}}.
        walls: Wall shapes, or a plane as (point [m], normal into the void), which is of the first material.
        gravity: Acceleration [m/s^2].
        law: Contact law; None means rigid contacts.
        fixed, kinematic, rotation_locked: Indices of bodies that never move, keep their velocity and spin, never turn.
        sinks, domain, observables, duration, name: See `Scene`.

    Raises:
        ValueError: A shape or a value is not accepted; the message names the field.
    """
    n = len(Bodies(position=position))
    radii, kind = _per_body("radius", radius, n), _per_body("material", material, n).astype(int)
    if n and not (kind.min() >= 0 and kind.max() < len(materials)):
        raise ValueError(f"material: {kind.min()} to {kind.max()} are given; accepted are 0 to {len(materials) - 1}")
    per_material = {"density": density, "young": young, "poisson": poisson}
    table = [
        Material(name=materials[k], **dict(zip(per_material, row, strict=True)))
        for k, row in enumerate(zip(*(_per_material(f, v, materials) for f, v in per_material.items()), strict=True))
    ]
    densities = np.array([m.density for m in table])[kind]
    if mass is not None:
        densities = _per_body("mass", mass, n) / (4 / 3 * math.pi * radii**3)
    grades = [grade for k, own in enumerate(table) for grade in _grades(own, densities[kind == k])]
    of_body = np.zeros(n, dtype=np.int32)
    for k, (own, grade) in enumerate(grades):
        of_body[(kind == table.index(own)) & (densities == grade.density)] = k
    usual = {
        "restitution": restitution,
        "friction": friction,
        "tangential_restitution": tangential_restitution,
        "rolling_friction": rolling_friction,
    }
    alike = all(np.ptp(radii[of_body == k]) == 0 for k in np.unique(of_body))
    held = {"fixed": fixed, "kinematic": kinematic, "rotation-locked": rotation_locked}
    return Scene(
        name=name,
        law=law or Rigid(),
        materials=tuple(grade for _own, grade in grades),
        pair_laws=_pair_laws([(own.name, grade.name) for own, grade in grades], usual, pairs or {}),
        species=tuple(
            Species(name=grade.name, material=grade.name, radius=next(iter(radii[of_body == k]), 1.0))
            for k, (_own, grade) in enumerate(grades)
        ),
        walls=tuple(_wall(k, wall, materials[0]) for k, wall in enumerate(walls)),
        bodies=Bodies(
            position=position,
            species=of_body,
            velocity=velocity,
            angular_velocity=angular_velocity,
            radius=None if alike else radii,
        ),
        domain=domain,
        gravity=tuple(gravity),
        duration=duration,
        constraints=tuple(Constraint(kind=kind, bodies=ids) for kind, given in held.items() if (ids := tuple(given))),
        sinks=tuple(sinks),
        observables=tuple(observables),
    )


def _grades(own: Material, densities: np.ndarray) -> list[tuple[Material, Material]]:
    """A material with one copy of itself for every density that its bodies have; the first keeps the name."""
    found = np.unique(densities) if len(densities) else [own.density]
    if len(found) > MOST_DENSITIES:
        raise ValueError(f"mass: {len(found)} densities of material {own.name}; accepted are up to {MOST_DENSITIES}")
    names = [own.name, *(f"{own.name}_{k}" for k in range(1, len(found)))]
    return [(own, own.model_copy(update={"name": n, "density": d})) for n, d in zip(names, found, strict=True)]


def _pair_laws(
    names: list[tuple[str, str]], usual: dict[str, Any], pairs: Mapping[tuple[str, str], Mapping[str, float]]
) -> tuple[PairLaw, ...]:
    """Laws of all pairs of (material as given, its copy)."""
    special = {frozenset(pair): values for pair, values in pairs.items()}
    for pair in special:
        if not pair <= {own for own, _grade in names}:
            known = ", ".join(dict.fromkeys(own for own, _grade in names))
            raise ValueError(f"pairs: {'-'.join(sorted(pair))} is no pair of the materials {known}")
    return tuple(
        PairLaw(a=a, b=b, **{**usual, **special.get(frozenset((p, q)), {})})
        for (p, a), (q, b) in combinations_with_replacement(names, 2)
    )


def _per_body(field: str, value: Any, n: int) -> np.ndarray:
    array = np.asarray(value, dtype=np.float64)
    if array.shape not in ((), (n,)):
        raise ValueError(f"{field}: expected a number or shape ({n},), got {array.shape}")
    bad = np.flatnonzero(~np.isfinite(np.atleast_1d(array)))
    if len(bad):
        raise ValueError(f"{field}: particle {bad[0]} has the value {np.atleast_1d(array)[bad[0]]}; expected a number")
    return np.broadcast_to(array, (n,))


def _per_material(field: str, value: Any, materials: Sequence[str]) -> np.ndarray:
    array = np.asarray(value, dtype=np.float64)
    if array.shape not in ((), (len(materials),)):
        raise ValueError(f"{field}: expected a number or one per material ({len(materials)}), got {array.shape}")
    return np.broadcast_to(array, (len(materials),))


def _wall(k: int, wall: WallShape | tuple[Any, Any], material: str) -> WallShape:
    if not isinstance(wall, tuple):
        return wall
    point, normal = wall
    return Plane(name=f"plane{k}", material=material, point=tuple(point), normal=tuple(normal))
