"""The scene: an engine-neutral description of what is simulated and what is recorded. Pure data, SI units."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Iterable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, TypeAdapter, model_validator

from dembench.scene.base import Model, Name, Positive, Vector
from dembench.scene.bodies import Bodies
from dembench.scene.materials import HertzMindlin, Law, Material, PairLaw
from dembench.scene.observables import Observable, Region, Snapshot, Trajectory, WallForce
from dembench.scene.shapes import Shape
from dembench.scene.walls import WallShape


class Species(Model):
    """A kind of particle.

    Attributes:
        name: Identifier.
        material: Name of a material of the scene.
        radius: Radius of the sphere [m]; with a shape the radius about its centre of mass that holds it, found where
            it is left out.
        shape: Shape of particles that are no spheres.
    """

    name: Name
    material: Name
    radius: Positive
    shape: Shape | None = None

    @model_validator(mode="before")
    @classmethod
    def _bounded(cls, data: Any) -> Any:
        if isinstance(data, dict) and data.get("shape") is not None and "radius" not in data:
            shape = TypeAdapter(Shape).validate_python(data["shape"])
            return {**data, "shape": shape, "radius": shape.bounding_radius}
        return data

    @model_validator(mode="after")
    def _same_bound(self) -> Species:
        if self.shape is not None and abs(self.radius / self.shape.bounding_radius - 1) > 1e-6:
            raise ValueError(
                f"radius {self.radius:g} m is not the bounding radius of the shape, {self.shape.bounding_radius:g} m; "
                "leave it out"
            )
        return self

    def volume(self) -> float:
        """Volume of a particle [m^3]."""
        return self.shape.solid.volume if self.shape else 4 / 3 * math.pi * self.radius**3

    def moments(self) -> np.ndarray:
        """Principal moments of inertia of a particle of density 1 [m^5], shape (3,)."""
        return self.shape.solid.moments if self.shape else np.full(3, 8 / 15 * math.pi * self.radius**5)


class Constraint(Model):
    """A restriction on some bodies.

    Attributes:
        kind: `fixed` (never moves), `kinematic` (keeps its initial velocity and spin), `rotation-locked`.
        bodies: Indices of the bodies.
    """

    kind: Literal["fixed", "kinematic", "rotation-locked"]
    bodies: Annotated[tuple[int, ...], Field(min_length=1)]


class Sink(Model):
    """A region where particles leave the scene."""

    name: Name
    region: Region


class Domain(Model):
    """The simulated volume: a particle that leaves it is lost, unless that direction is periodic.

    Attributes:
        lower, upper: Corners [m].
        periodic: Whether opposite faces are joined, per axis.
    """

    lower: Vector
    upper: Vector
    periodic: tuple[bool, bool, bool] = (False, False, False)

    @model_validator(mode="after")
    def _ordered(self) -> Domain:
        for axis in range(3):
            if not self.lower[axis] < self.upper[axis]:
                raise ValueError(
                    f"lower {self.lower[axis]:g} must be below upper {self.upper[axis]:g} on axis {'xyz'[axis]}"
                )
        return self


class Scene(Model):
    """An engine-neutral description of a simulation.

    Attributes:
        name: Identifier.
        law: Contact law.
        materials, pair_laws, species, walls: See their classes; every pair of materials that can touch has a pair law.
        bodies: Initial state.
        domain: Simulated volume [m].
        gravity: Acceleration [m/s^2].
        duration: Simulated time [s].
        time_step: Time step of the closed division [s]; None leaves it to `rayleigh_fraction`.
        rayleigh_fraction: Time step of the closed division in Rayleigh time steps where `time_step` is None [-].
        constraints, sinks, observables: See their classes.
    """

    name: Name
    law: Law = HertzMindlin()
    materials: Annotated[tuple[Material, ...], Field(min_length=1)]
    pair_laws: Annotated[tuple[PairLaw, ...], Field(min_length=1)]
    species: Annotated[tuple[Species, ...], Field(min_length=1)]
    walls: tuple[WallShape, ...] = ()
    bodies: Bodies
    domain: Domain
    gravity: Vector = (0.0, 0.0, -9.81)
    duration: Positive
    time_step: Positive | None = None
    rayleigh_fraction: Annotated[float, Field(gt=0, le=0.5)] = 0.1
    constraints: tuple[Constraint, ...] = ()
    sinks: tuple[Sink, ...] = ()
    observables: tuple[Observable, ...] = ()

    @model_validator(mode="after")
    def _consistent(self) -> Scene:
        for field in ("materials", "species", "walls", "sinks", "observables"):
            _unique(field, [item.name for item in getattr(self, field)])
        materials = [m.name for m in self.materials]
        for kind, items in (("species", self.species), ("wall", self.walls)):
            for item in items:
                _known(f"material of {kind} {item.name}", item.material, materials)
        for law in self.pair_laws:
            _known("pair law", law.a, materials)
            _known("pair law", law.b, materials)
        pairs = [tuple(sorted((p.a, p.b))) for p in self.pair_laws]
        _unique("pair_laws", [f"{a}-{b}" for a, b in pairs])
        self._check_pairs(set(pairs))
        self._check_indices()
        for seen in self.observables:
            if isinstance(seen, WallForce):
                _known(f"wall of observable {seen.name}", seen.wall, [w.name for w in self.walls])
        return self

    def _check_pairs(self, given: set[tuple[str, ...]]) -> None:
        used = {s.material for s in self.species}
        touching = itertools.chain(
            itertools.combinations_with_replacement(sorted(used), 2),
            itertools.product(used, {w.material for w in self.walls}),
        )
        missing = sorted({tuple(sorted(pair)) for pair in touching} - given)
        if missing:
            names = ", ".join(f"{a}-{b}" for a, b in missing)
            raise ValueError(
                f"pair_laws: no law for {names}; "
                "give restitution and friction of every pair of materials that can touch"
            )

    def _check_indices(self) -> None:
        n = len(self.bodies)
        species = self.bodies.species
        if n and (species.min() < 0 or species.max() >= len(self.species)):
            bad = int(np.argmax((species < 0) | (species >= len(self.species))))
            raise ValueError(
                f"bodies.species: particle {bad} has species {species[bad]}; accepted are 0 to {len(self.species) - 1}"
            )
        if self.bodies.radius is not None and any(s.shape for s in self.species):
            raise ValueError("bodies.radius: species with a shape have one size; leave the radii out")
        for k, constraint in enumerate(self.constraints):
            for body in constraint.bodies:
                _index(f"constraints[{k}].bodies", body, n)
        for observable in self.observables:
            if isinstance(observable, Trajectory):
                _index(f"body of observable {observable.name}", observable.body, n)

    # ---- properties per body and pair

    def material(self, name: str) -> Material:
        """The material of that name."""
        return next(m for m in self.materials if m.name == name)

    def pair_law(self, a: str, b: str) -> PairLaw:
        """The law of a pair of materials, in either order; KeyError where the scene has none."""
        for law in self.pair_laws:
            if {law.a, law.b} == {a, b}:
                return law
        raise KeyError(f"no pair law for {a}-{b}")

    def radii(self) -> np.ndarray:
        """Radius of every body [m], shape (n,)."""
        if self.bodies.radius is not None:
            return self.bodies.radius
        return np.array([s.radius for s in self.species])[self.bodies.species]

    def extreme_radii(self) -> tuple[float, float]:
        """Smallest and largest radius of the bodies [m]; of the species where there are no bodies."""
        found = self.radii() if len(self.bodies) else np.array([s.radius for s in self.species])
        return float(found.min()), float(found.max())

    def densities(self) -> np.ndarray:
        """Density of every body [kg/m^3], shape (n,)."""
        return np.array([self.material(s.material).density for s in self.species])[self.bodies.species]

    def masses(self) -> np.ndarray:
        """Mass of every body [kg], shape (n,)."""
        if self.bodies.radius is None:
            return self.densities() * np.array([s.volume() for s in self.species])[self.bodies.species]
        return self.densities() * (4 / 3) * math.pi * self.bodies.radius**3

    def moments(self) -> np.ndarray:
        """Principal moments of inertia of every body about its centre [kg m^2], shape (n, 3)."""
        if self.bodies.radius is None:
            return self.densities()[:, None] * np.array([s.moments() for s in self.species])[self.bodies.species]
        return np.tile((0.4 * self.masses() * self.bodies.radius**2)[:, None], 3)

    # ---- time

    def sampling_interval(self) -> float:
        """The largest interval that divides every sampling interval, snapshot time and the duration [s]."""
        times = [self.duration]
        for observable in self.observables:
            if isinstance(observable, Snapshot):
                times += [t for t in observable.times if t > 0]
            else:
                times.append(observable.interval)
            if isinstance(observable, Trajectory):
                times.append(observable.track_interval)
        return _common_divisor(times)

    def fitted_step(self, time_step: float) -> float:
        """The largest step not above `time_step` [s] that divides the sampling interval."""
        interval = self.sampling_interval()
        return interval / math.ceil(interval / time_step * (1 - 1e-9))

    def rayleigh_time(self) -> float:
        """Smallest Rayleigh time step of the species: pi r sqrt(rho/G) / (0.1631 nu + 0.8766) [s]."""
        found = []
        for k, s in enumerate(self.species):
            own = self.radii()[self.bodies.species == k]
            radius = float(own.min()) if len(own) else s.radius
            if s.shape is not None:
                radius = s.shape.contact_radius
            m = self.material(s.material)
            shear = m.young / (2 * (1 + m.poisson))
            found.append(math.pi * radius * math.sqrt(m.density / shear) / (0.1631 * m.poisson + 0.8766))
        return min(found)

    def closed_step(self) -> float:
        """Time step of the closed division, fitted into the sampling interval [s]."""
        return self.fitted_step(self.time_step or self.rayleigh_fraction * self.rayleigh_time())

    def frame_times(self) -> np.ndarray:
        """Times at which all bodies are recorded: those of all observables but the fine tracks, and t = 0 [s]."""
        steps = {0}
        unit = self.sampling_interval()
        for observable in self.observables:
            if isinstance(observable, Snapshot):
                steps |= {round(t / unit) for t in observable.times}
            else:
                steps |= set(self._multiples(observable.interval, unit))
        return np.array(sorted(steps)) * unit

    def track_times(self) -> np.ndarray:
        """Times at which the bodies with a trajectory are recorded [s]."""
        unit = self.sampling_interval()
        tracked = [o.track_interval for o in self.observables if isinstance(o, Trajectory)]
        return np.array(self._multiples(_common_divisor(tracked), unit)) * unit if tracked else np.empty(0)

    def tracked_bodies(self) -> tuple[int, ...]:
        """Indices of the bodies with a trajectory, ascending."""
        return tuple(sorted({o.body for o in self.observables if isinstance(o, Trajectory)}))

    def _multiples(self, interval: float, unit: float) -> Iterable[int]:
        return range(0, round(self.duration / unit) + 1, round(interval / unit))

    def cut(self, duration: float) -> Scene:
        """The same scene with a shorter duration [s], fitted to a multiple of the sampling interval."""
        unit = self.sampling_interval()
        shorter = max(1, round(duration / unit)) * unit
        if shorter > self.duration * (1 + 1e-9):
            raise ValueError(f"time {duration:g} s is longer than the {self.duration:g} s of scene {self.name}")
        kept = [
            o.model_copy(update={"times": tuple(t for t in o.times if t <= shorter)}) if isinstance(o, Snapshot) else o
            for o in self.observables
        ]
        kept = [o for o in kept if not (isinstance(o, Snapshot) and not o.times)]
        return self.model_copy(update={"duration": shorter, "observables": tuple(kept)})

    # ---- identity

    def description(self) -> dict[str, Any]:
        """The scene as plain JSON data without the arrays of the bodies."""
        return self.model_dump(mode="json", exclude={"bodies"})

    def digest(self) -> str:
        """SHA-256 of the scene, the initial state by content."""
        text = json.dumps(self.description(), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256((text + self.bodies.digest()).encode()).hexdigest()


def _unique(field: str, names: list[str]) -> None:
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise ValueError(f"{field}: {', '.join(twice)} is given more than once")


def _known(what: str, name: str, known: list[str]) -> None:
    if name not in known:
        raise ValueError(f"{what}: '{name}' is not known; accepted are {', '.join(known)}")


def _index(what: str, index: int, n: int) -> None:
    if not 0 <= index < n:
        raise ValueError(f"{what}: {index} is no body of this scene; accepted are 0 to {n - 1}")


def _common_divisor(times: list[float]) -> float:
    """Greatest common divisor of times [s], resolved to one part in 1e9 of the smallest."""
    smallest = min(times)
    for parts in itertools.chain(range(1, 1001)):
        unit = smallest / parts
        ratios = np.array(times) / unit
        if np.all(np.abs(ratios - np.round(ratios)) < 1e-7 * ratios):
            return unit
    raise ValueError(
        "sampling intervals, snapshot times and duration have no common divisor: "
        + ", ".join(f"{t:g} s" for t in times)
    )
