"""Walls that move: by velocity, turning and oscillating; D39 of the verification catalogue."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import RADIUS, grains

from dembench.scene import Box, Motion, Plane
from dembench.solver import Simulation

DRIVERS: dict[str, dict[str, Any]] = {
    "half": {},
    "full": {"lists": "full"},
    "rigid": {"method": "impulse", "rows": "rigid"},
    "compliant": {"method": "impulse", "substeps": 1},
}


@pytest.mark.parametrize("driver", list(DRIVERS))
def test_d39_a_grain_leaves_a_moving_plate_with_the_restitution_of_their_approach(driver: str) -> None:
    """A plate comes with V from far beyond the lists at a grain at rest: it leaves with (1 + e) V.

    The velocity Verlet step resolves the contact of 220 steps to 1e-3 of V; an impulse has no contact time.
    """
    plate = Plane(name="plate", material="grain", point=(0, 0, 0), normal=(0, 0, 1), motion=Motion(velocity=(0, 0, 1)))
    scene = grains([[0, 0, 5.3 * RADIUS]], walls=(plate,), young=1e8, restitution=0.6)
    simulation = Simulation(scene, 4e-7, **DRIVERS[driver])
    while simulation.time < 6e-3:
        simulation.step(100)
    assert simulation.velocity[0] == pytest.approx([0, 0, 1.6], abs=2e-3)


@pytest.mark.parametrize("driver", list(DRIVERS))
def test_d39_a_box_that_turns_and_travels_takes_its_ball_along(driver: str) -> None:
    """A closed box with a tight ball: after a quarter of a turn and 40 of its own lengths the ball is where it should.

    The ball has a play of 1 % of its radius in the box; the centre of the box follows the closed form of the motion.
    """
    half = 1.01 * RADIUS
    arm, speed, rate = 20 * RADIUS, 2.0, 50.0
    box = Box(
        name="box",
        material="grain",
        lower=(arm - half, -half, -half),
        upper=(arm + half, half, half),
        motion=Motion(velocity=(0, 0, speed), angular_velocity=(0, 0, rate), centre=(0, 0, 0)),
    )
    start = [[0, rate * arm, speed]]
    scene = grains([[arm, 0, 0]], start, walls=(box,), young=1e8, restitution=0.2, friction=0.0)
    simulation = Simulation(scene, 2e-6, **DRIVERS[driver])
    simulation.step(round(np.pi / 2 / rate / 2e-6))
    t = simulation.time
    centre = np.array([arm * np.cos(rate * t), arm * np.sin(rate * t), speed * t])
    assert t == pytest.approx(np.pi / 2 / rate, rel=1e-4)
    assert np.abs(simulation.position[0] - centre).max() < 0.03 * RADIUS
