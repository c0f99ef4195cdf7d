"""Scenes of a few bodies that are no spheres, with a floor in all of them: they share two compiled kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dembench.scene import Bodies, Domain, Material, PairLaw, Plane, Scene, Species
from dembench.solver import Simulation

DENSITY, GRAVITY = 2500.0, 9.81


def shaped(
    shapes: Sequence[Any],
    position: Any,
    velocity: Any = None,
    spin: Any = None,
    orientation: Any = None,
    *,
    species: Any = None,
    restitution: float = 0.5,
    friction: float = 0.3,
    floor_friction: float | None = None,
    floor: float | None = 0.0,
    young: float = 1e7,
    **changes: Any,
) -> Scene:
    """Bodies of shapes, or of spheres where a shape is a radius [m]; `floor` [m], None for one far below."""
    pairs = [("stone", "stone", friction), ("stone", "plate", friction if floor_friction is None else floor_friction)]
    fields: dict[str, Any] = {
        "name": "shaped",
        "materials": tuple(
            Material(name=name, density=DENSITY, young=young, poisson=0.2) for name in ("stone", "plate")
        ),
        "pair_laws": tuple(PairLaw(a=a, b=b, restitution=restitution, friction=mu) for a, b, mu in pairs),
        "species": tuple(
            Species(name=f"s{k}", material="stone", **({"radius": s} if isinstance(s, float) else {"shape": s}))
            for k, s in enumerate(shapes)
        ),
        "walls": (
            Plane(name="floor", material="plate", point=(0, 0, -100 if floor is None else floor), normal=(0, 0, 1)),
        ),
        "bodies": Bodies(
            position=position,
            velocity=velocity,
            angular_velocity=spin,
            orientation=orientation,
            species=list(range(len(shapes))) if species is None else species,
        ),
        "domain": Domain(lower=(-1e3,) * 3, upper=(1e3,) * 3),
        "gravity": (0, 0, 0) if floor is None else (0, 0, -GRAVITY),
        "duration": 1.0,
        "time_step": 1e-5,
    }
    return Scene(**{**fields, **changes})


def run(scene: Scene, time: float, method: str, dt: float, **arguments: Any) -> Simulation:
    """The simulation of a scene after a time [s]."""
    simulation = Simulation(scene, dt, method=method, **arguments)
    simulation.step(round(time / dt))
    return simulation


def momenta(simulation: Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Momentum [kg m/s] and angular momentum about the origin [kg m^2/s] of all bodies, shape (3,) each."""
    momentum = simulation.masses[:, None] * simulation.velocity
    own = np.array([i @ w for i, w in zip(inertia(simulation), simulation.angular_velocity, strict=True)])
    return momentum.sum(axis=0), (np.cross(simulation.position, momentum) + own).sum(axis=0)


def inertia(simulation: Simulation) -> np.ndarray:
    """Inertia tensors of all bodies in space [kg m^2], shape (n, 3, 3)."""
    scene, found = simulation.scene, []
    turns = Rotation.from_quat(simulation.orientation).as_matrix()
    for k, turn, moments in zip(scene.bodies.species, turns, scene.moments(), strict=True):
        shape = scene.species[k].shape
        axes = turn @ (shape.solid.axes if shape else np.eye(3))
        found.append(axes @ np.diag(moments) @ axes.T)
    return np.array(found)


def energy(simulation: Simulation) -> float:
    """Kinetic energy and energy of height [J]."""
    height = -simulation.position @ np.array(simulation.scene.gravity)
    return simulation.kinetic_energy() + float(simulation.masses @ height)
