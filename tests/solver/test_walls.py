"""Walls: planes, corners, mantles of revolution and walls that move in themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, grains, hertz, resting_overlap
from scipy.optimize import minimize

from dembench.scene import Cylinder, Frustum, Motion, Plane
from dembench.solver import Simulation

GRAVITY = (0, 0, -9.81)


def test_free_fall_is_exact() -> None:
    """Velocity Verlet has no error on a parabola; 1e4 steps leave rounding."""
    scene = grains([[0, 0, 1.0]], [[0.1, 0, 0.2]], [[0, 30, 0]], walls=(FLOOR,), gravity=(1.0, 0, -9.81))
    simulation = Simulation(scene, 1e-5)
    simulation.step(10000)
    t = simulation.time
    assert t == pytest.approx(0.1, rel=1e-12)
    exact = np.array([0, 0, 1.0]) + np.array([0.1, 0, 0.2]) * t + 0.5 * np.array([1.0, 0, -9.81]) * t**2
    assert simulation.position[0] == pytest.approx(exact, abs=1e-13)
    assert simulation.velocity[0] == pytest.approx([0.1 + t, 0, 0.2 - 9.81 * t], abs=1e-12)
    assert simulation.angular_velocity[0] == pytest.approx([0, 30, 0], abs=1e-6)


def test_a_grain_comes_to_rest_with_the_overlap_of_its_weight() -> None:
    scene = grains([[0, 0, RADIUS]], walls=(FLOOR,), gravity=GRAVITY)
    simulation = Simulation(scene, 4e-6)
    simulation.step(10000)
    assert RADIUS - simulation.position[0, 2] == pytest.approx(resting_overlap(scene), rel=1e-5)
    assert np.abs(simulation.velocity).max() < 1e-8


def test_a_dropped_grain_bounces_to_the_height_of_the_restitution() -> None:
    """Rises to e^2 of the drop height; the weight during the contact changes e by a few 1e-4."""
    drop = 0.01
    scene = grains([[0, 0, RADIUS + drop]], walls=(FLOOR,), gravity=GRAVITY, restitution=0.7, young=1e8)
    simulation = Simulation(scene, 1e-6)
    simulation.step(round(np.sqrt(2 * drop / 9.81) / 1e-6) + 1000)
    highest = 0.0
    for _ in range(100):
        simulation.step(400)
        highest = max(highest, simulation.position[0, 2] - RADIUS)
    assert highest / drop == pytest.approx(0.49, rel=5e-3)


WALLS = {
    "cylinder": Cylinder(
        name="tube", material="grain", start=(0.002, 0, 0.001), end=(0.010, 0.006, 0.013), radius=0.008
    ),
    "cylinder from outside": Cylinder(
        name="tube", material="grain", start=(0.002, 0, 0.001), end=(0.010, 0.006, 0.013), radius=0.005, outside=True
    ),
    "frustum": Frustum(
        name="cone", material="grain", start=(0, 0, 0), end=(0.003, 0.002, 0.012), radius_start=0.004, radius_end=0.011
    ),
    "frustum from outside": Frustum(
        name="cone",
        material="grain",
        start=(0, 0, 0),
        end=(0.003, 0.002, 0.012),
        radius_start=0.009,
        radius_end=0.004,
        outside=True,
    ),
}


@pytest.mark.parametrize("name", list(WALLS))
def test_contact_with_a_mantle_is_with_its_nearest_point(name: str) -> None:
    """Overlap and direction from the force of one step, rims included, against the nearest point found by search."""
    wall = WALLS[name]
    position, nearest, distance = _near_mantle(wall, 40)
    assert (distance[20:] < RADIUS).sum() > 5, "some must touch a rim"
    dt = 1e-9
    for x, foot, away in zip(position, nearest, distance, strict=True):
        scene = grains([x], walls=(wall,), friction=0.0)
        simulation = Simulation(scene, dt, precision="float64")
        simulation.step()
        force = simulation.velocity[0] / dt * scene.masses()[0]
        expected = hertz(scene, max(0.0, RADIUS - away), RADIUS) * (x - foot) / away
        # the search knows the overlap to 1e-7 of the radius
        assert force == pytest.approx(expected, abs=1e-4 * np.linalg.norm(expected))


def _near_mantle(wall: Any, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points in the void near the mantle (the second half: beyond a rim), their nearest points on it, the distances."""
    random = np.random.default_rng(7)
    start, end = np.array(wall.start), np.array(wall.end)
    axis = (end - start) / np.linalg.norm(end - start)
    u = np.cross(axis, [1.0, 0, 0])
    u /= np.linalg.norm(u)
    w = np.cross(axis, u)
    r0, r1 = wall._radii()
    side = 1 if wall.outside else -1

    def point(s: float, angle: float) -> np.ndarray:
        ring = np.cos(angle) * u + np.sin(angle) * w
        return start + s * (end - start) + (r0 + s * (r1 - r0)) * ring

    grid = np.array([(s, a) for s in np.linspace(0, 1, 21) for a in np.linspace(0, 2 * np.pi, 61)])
    surface = np.array([point(*q) for q in grid])
    found: list[tuple[np.ndarray, np.ndarray, float]] = []
    for k in range(n):
        angle = random.uniform(0, 2 * np.pi)
        ring = np.cos(angle) * u + np.sin(angle) * w
        slope = (r1 - r0) * axis - np.linalg.norm(end - start) * ring
        normal = side * -slope / np.linalg.norm(slope)
        if k < n // 2:
            x = point(random.uniform(0.05, 0.95), angle) + random.uniform(0.7, 1.1) * RADIUS * normal
        else:
            s, outwards = (0.0, -1) if k % 2 else (1.0, 1)
            x = point(s, angle) + RADIUS * (
                random.uniform(0.3, 0.8) * outwards * axis + random.uniform(-0.7, 0.7) * ring
            )
        first = grid[np.argmin(((surface - x) ** 2).sum(axis=1))]
        best = minimize(
            lambda q, x=x: 1e6 * np.sum((point(*q) - x) ** 2), first, bounds=((0, 1), (-1, 8)), options={"ftol": 1e-15}
        )
        foot = point(*best.x)
        found.append((x, foot, float(np.linalg.norm(x - foot))))
    x, foot, distance = zip(*found, strict=True)
    return np.array(x), np.array(foot), np.array(distance)


def test_a_conveyor_takes_a_grain_along_until_it_rolls() -> None:
    """A plane that slides with V: the grain ends with 2/7 V, rolling backwards with 5/7 V/r."""
    motion = Motion(velocity=(0.1, 0, 0))
    belt = Plane(name="belt", material="grain", point=(0, 0, 0), normal=(0, 0, 1), motion=motion)
    rest = RADIUS - resting_overlap(grains([[0, 0, 0]], gravity=GRAVITY))
    scene = grains([[0, 0, rest]], walls=(belt,), gravity=GRAVITY, friction=0.5)
    simulation = Simulation(scene, 4e-6)
    simulation.step(5000)
    # the lever is r less half the overlap, 5e-4 of r
    assert simulation.velocity[0] == pytest.approx([2 / 7 * 0.1, 0, 0], abs=1e-4)
    assert simulation.angular_velocity[0] == pytest.approx([0, -5 / 7 * 0.1 / RADIUS, 0], rel=2e-3, abs=1e-3)


def test_a_turning_drum_drags_a_grain_that_slides() -> None:
    """At the bottom the wall moves with w x R: friction gives mu g along it and a spin of 5/2 mu g/r per second."""
    drum = Cylinder(
        name="drum",
        material="grain",
        start=(0, -0.02, 0.1),
        end=(0, 0.02, 0.1),
        radius=0.1,
        motion=Motion(angular_velocity=(0, -10.0, 0), centre=(0, 0, 0.1)),
    )
    rest = RADIUS - resting_overlap(grains([[0, 0, 0]], gravity=GRAVITY))
    scene = grains([[0, 0, rest]], walls=(drum,), gravity=GRAVITY, friction=0.2)
    simulation = Simulation(scene, 4e-6)
    # after the first millisecond the dashpot of the sticking start is over; the wall moves with 1 m/s along +x
    simulation.step(250)
    v, w = simulation.velocity[0], simulation.angular_velocity[0]
    simulation.step(1000)
    gained = 0.2 * 9.81 * 1000 * 4e-6
    assert simulation.velocity[0] - v == pytest.approx([gained, 0, 0], rel=0.01, abs=1e-4)
    assert simulation.angular_velocity[0] - w == pytest.approx([0, -2.5 * gained / RADIUS, 0], rel=0.01, abs=1e-3)
