"""What no contact may change: momentum, angular momentum, energy that only falls, and the frame, numbers and scale."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import RADIUS, gas, grains

from dembench.scene import Domain, Scene
from dembench.solver import Simulation

N = 64


def colliding(**changes: Any) -> Scene:
    """A cloud that falls together: every grain meets several others."""
    position, velocity, spin = gas(N)
    inwards = position.mean(axis=0) - position
    return grains(position, velocity + 100 * inwards, spin, **{"young": 1e8, **changes})


@pytest.mark.parametrize(("precision", "tolerance"), [("float64", 1e-12), ("float32", 1e-8)])
def test_momentum_and_angular_momentum_are_kept(precision: str, tolerance: float) -> None:
    """The lever of the law, r - overlap/2, puts both forces of a pair on one line and at one point."""
    scene = colliding()
    mass = scene.masses()[:, None]
    inertia = 0.4 * mass * RADIUS**2

    def momenta(s: Simulation) -> tuple[np.ndarray, np.ndarray]:
        angular = np.cross(s.position, mass * s.velocity) + inertia * s.angular_velocity
        return (mass * s.velocity).sum(axis=0), angular.sum(axis=0)

    simulation = Simulation(scene, precision=precision)
    before = momenta(simulation)
    v0 = simulation.velocity
    simulation.step(4000)
    after = momenta(simulation)
    assert np.abs(simulation.velocity - v0).max() > 1, "nothing collided"
    total = float((mass * np.abs(v0)).sum())
    assert after[0] == pytest.approx(before[0], abs=tolerance * total)
    assert after[1] == pytest.approx(before[1], abs=tolerance * total * np.abs(scene.bodies.position).max())


def elastic_energy(scene: Scene, position: np.ndarray) -> float:
    """Energy in the normal springs [J]: 2/5 of force times overlap."""
    i, j = np.triu_indices(len(position), 1)
    overlap = np.maximum(0, 2 * RADIUS - np.linalg.norm(position[i] - position[j], axis=1))
    m = scene.materials[0]
    young = m.young / (2 * (1 - m.poisson**2))
    return float((8 / 15 * young * np.sqrt(RADIUS / 2) * overlap**2.5).sum())


def test_energy_only_falls() -> None:
    """Kinetic energy and that of the normal springs."""
    for friction in (0.0, 0.5):
        scene = colliding(friction=friction, restitution=0.6)
        simulation = Simulation(scene)
        energy = []
        for _ in range(150):
            energy.append(simulation.kinetic_energy() + elastic_energy(scene, simulation.position))
            simulation.step(20)
        assert np.diff(energy).max() < 1e-6 * energy[0]
        assert energy[-1] < 0.8 * energy[0]


def test_energy_of_elastic_grains_stays() -> None:
    """Verlet at 1/40 of a contact: the error of an impact does not add up."""
    scene = colliding(friction=0.0, restitution=1.0)
    simulation = Simulation(scene, precision="float64")
    start = simulation.kinetic_energy()
    simulation.step(4000)
    end = simulation.kinetic_energy() + elastic_energy(scene, simulation.position)
    assert end == pytest.approx(start, rel=2e-5)


def few(**changes: Any) -> Scene:
    """Eight grains that meet in the middle, each in two or three collisions."""
    position, velocity, spin = gas(8, seed=3)
    inwards = position.mean(axis=0) - position
    return grains(position, velocity + 300 * inwards, spin, **{"young": 1e8, **changes})


def after(scene: Scene, steps: int = 3000, dt: float | None = None, **options: Any) -> tuple[np.ndarray, np.ndarray]:
    simulation = Simulation(scene, dt, **options)
    simulation.step(steps)
    return simulation.position, simulation.velocity


@pytest.fixture(scope="module")
def undisturbed() -> tuple[np.ndarray, np.ndarray]:
    x, v = after(few())
    assert np.abs(v - few().bodies.velocity).max() > 0.3
    return x, v


def moved(scene: Scene, **arrays: np.ndarray) -> Scene:
    return scene.model_copy(update={"bodies": scene.bodies.model_copy(update=arrays)})


def test_w12_a_scene_far_from_the_origin_is_the_same_scene(undisturbed: tuple[np.ndarray, np.ndarray]) -> None:
    """At 1e3 m the unit in the last place is 1e-13 m, 1e-7 of an overlap, which collisions amplify."""
    scene = few()
    offset = np.array([1000.0, -1000.0, 1000.0])
    x, v = after(moved(scene, position=scene.bodies.position + offset))
    assert x - offset == pytest.approx(undisturbed[0], abs=1e-5 * RADIUS)
    assert v == pytest.approx(undisturbed[1], abs=1e-5)


def test_sr13_a_moving_frame_changes_nothing(undisturbed: tuple[np.ndarray, np.ndarray]) -> None:
    scene = few()
    wind = np.array([3.0, -5.0, 2.0])
    x, v = after(moved(scene, velocity=scene.bodies.velocity + wind))
    assert v - wind == pytest.approx(undisturbed[1], abs=1e-5)
    assert x - 0.003 * wind == pytest.approx(undisturbed[0], abs=1e-5 * RADIUS)


def test_sr13_numbers_of_grains_mean_nothing(undisturbed: tuple[np.ndarray, np.ndarray]) -> None:
    """Sums in another order differ by rounding."""
    scene = few()
    order = np.random.default_rng(1).permutation(8)
    b = scene.bodies
    shuffled = {k: getattr(b, k)[order] for k in ("position", "velocity", "angular_velocity")}
    x, v = after(moved(scene, **shuffled))
    assert v == pytest.approx(undisturbed[1][order], abs=1e-5)
    assert x == pytest.approx(undisturbed[0][order], abs=1e-5 * RADIUS)


@pytest.mark.parametrize("scale", [1e-6, 1e3])
@pytest.mark.parametrize("method", ["soft-sphere", "impulse"])
def test_d20_a_scaled_scene_has_the_scaled_trajectory(method: str, scale: float) -> None:
    """Lengths and stiffness times s, times and speeds times sqrt(s), the same gravity: no length is built in."""
    gravity = (1.0, 2.0, -9.81)
    dt = 1e-6 if method == "soft-sphere" else 2e-5
    steps = round(3e-3 / dt)
    scene = few(gravity=gravity)
    x, v = after(scene, steps, dt, method=method)
    root = np.sqrt(scale)
    b = scene.bodies
    scaled = few(
        radius=RADIUS * scale, young=1e8 * scale, gravity=gravity, domain=Domain(lower=(-1e9,) * 3, upper=(1e9,) * 3)
    )
    scaled = moved(
        scaled,
        position=b.position * scale,
        velocity=b.velocity * root,
        angular_velocity=b.angular_velocity / root,
    )
    xs, vs = after(scaled, steps, dt * root, method=method)
    assert xs / scale == pytest.approx(x, abs=1e-4 * RADIUS)
    assert vs / root == pytest.approx(v, abs=1e-4)
