"""The layer at a drum: rigid rotation, rest and rolling have closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from dembench.scene import Cylinder, Motion, Plane
from dembench.solver import Simulation, SolverError
from dembench.solver.diagnostics import wall_layer

DRUM, RADIUS, RATE = 0.1, 0.004, 3.0


def drum() -> Cylinder:
    motion = Motion(angular_velocity=(0, RATE, 0), centre=(0.2, 0, 0))
    return Cylinder(
        name="drum", material="grain", start=(0.2, -0.05, 0), end=(0.2, 0.05, 0), radius=DRUM, motion=motion
    )


def ring(gap: float) -> np.ndarray:
    """Centres of 12 grains at a gap from the mantle, and of one on the axis."""
    angle = np.arange(12) * np.pi / 6
    at = DRUM - RADIUS - gap
    return np.vstack([np.column_stack([0.2 + at * np.cos(angle), 0 * angle, at * np.sin(angle)]), [[0.2, 0, 0]]])


def test_a_layer_that_turns_with_the_drum() -> None:
    """v = w x r: co-rotation 1. The wall passes the surface of a grain by w times the gap; by the radius more where the
    grain does not turn itself.
    """
    x = ring(1e-3)
    turning = np.tile([0, RATE, 0], (13, 1))
    velocity = np.cross(turning, x - [0.2, 0, 0])
    layer = wall_layer(drum(), 2e-3, x, velocity, turning, np.full(13, RADIUS))
    assert layer.bodies.tolist() == list(range(12)), "the grain on the axis is no part of it"
    assert layer.corotation == pytest.approx(1, rel=1e-9)
    assert layer.slip == pytest.approx(RATE * 1e-3, rel=1e-6)
    still = wall_layer(drum(), 2e-3, x, velocity, 0 * turning, np.full(13, RADIUS))
    assert still.slip == pytest.approx(RATE * (RADIUS + 1e-3), rel=1e-6)


def test_a_layer_at_rest_and_one_that_rolls() -> None:
    """At rest the wall passes at w R; a grain that turns in place at w R / r rolls on it without slip."""
    x, rest = ring(0.0), np.zeros((13, 3))
    radius = np.full(13, RADIUS)
    layer = wall_layer(drum(), 1e-6, x, rest, rest, radius)
    assert layer.corotation == 0 and layer.slip == pytest.approx(RATE * DRUM, rel=1e-6)
    rolling = wall_layer(drum(), 1e-6, x, rest, np.tile([0, RATE * DRUM / RADIUS, 0], (13, 1)), radius)
    assert rolling.slip == pytest.approx(0, abs=1e-6 * RATE * DRUM)


def test_the_layer_on_a_belt_from_a_simulation() -> None:
    belt = Plane(
        name="belt",
        material="grain",
        point=(0, 0, 0),
        normal=(0, 0, 1),
        motion=Motion(velocity=(0.4, 0, 0), surface=True),
    )
    position = [[0, 0, 0.1], [1, 0, 0.1], [2, 0, 0.5]]
    velocity = [[0.1, 0, 0], [0.3, 0, 0], [9.0, 0, 0]]
    simulation = Simulation.from_arrays(position, 0.1, velocity=velocity, walls=[belt], dt=1e-4)
    layer = simulation.wall_layer("belt", 0.01)
    assert layer.bodies.tolist() == [0, 1]
    assert layer.corotation == pytest.approx(0.5) and layer.slip == pytest.approx(0.2)
    assert np.isnan(wall_layer(belt, 0.01, *[np.array([[0, 0, 5.0]])] * 3, np.array([0.1])).slip)
    with pytest.raises(ValueError, match="wall belt does not move"):
        wall_layer(belt.model_copy(update={"motion": None}), 0.01, *[np.zeros((1, 3))] * 3, np.array([0.1]))
    with pytest.raises(SolverError, match="there is no wall 'drum'; accepted are belt"):
        simulation.wall_layer("drum", 0.01)
