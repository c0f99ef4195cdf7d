"""Impacts of the soft-sphere solver against the differential equations of its own law, for every law by name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, grains
from impacts import Impact

from dembench.scene import HertzMindlin, LinearSpring, Scene
from dembench.solver import Simulation

LAWS = {
    "reference": HertzMindlin(),
    "rescaled": HertzMindlin(variant="rescaled"),
    "no-tension": HertzMindlin(variant="no-tension"),
    "linear": LinearSpring(normal_stiffness=2000.0, tangential_stiffness=1700.0),
}
ANGLES = np.radians([5, 15, 25, 35, 45, 55, 65, 75, 85])
SPEED = 0.5
RESTITUTION, FRICTION = 0.6, 0.25


def shower(law: Any) -> tuple[Scene, list[tuple[int, int | None]]]:
    """Impacts at all angles: on a floor, with and without spin, and between two grains; what meets what."""
    n = len(ANGLES)
    radial = SPEED * np.stack([np.sin(ANGLES), 0 * ANGLES, -np.cos(ANGLES)], axis=1)
    y = 0.01 * np.arange(n)
    low = np.stack([0 * y, y, np.full(n, 1.001 * RADIUS)], axis=1)
    high = low + np.array([0, 0, 0.05])
    offset = np.stack([-1e-3 * RADIUS * np.tan(ANGLES), 0 * y, np.full(n, 2.001 * RADIUS)], axis=1)
    spin = np.stack([0 * y, np.full(n, -150.0), 0 * y], axis=1)
    still = np.zeros((n, 3))
    scene = grains(
        np.vstack([low, low + np.array([0.1, 0, 0]), high, high + offset]),
        np.vstack([radial, radial, still, radial]),
        np.vstack([still, spin, still, spin]),
        friction=FRICTION,
        restitution=RESTITUTION,
        walls=(FLOOR,),
        law=law,
    )
    floor: list[tuple[int, int | None]] = [(k, None) for k in range(2 * n)]
    return scene, [*floor, *((3 * n + k, 2 * n + k) for k in range(n))]


@pytest.mark.parametrize("name", list(LAWS))
def test_im1_oblique_impacts_follow_the_equations_of_the_law(name: str) -> None:
    """IM1, IM3: sphere on plane and on sphere from 5 to 85 degrees, with stick, slip and both; 1e-3 of the speed.

    The step is 1/5000 of a head-on contact; what is left is first order in it, from dashpots that see a velocity half
    a step old.
    """
    scene, meetings = shower(LAWS[name])
    simulation = Simulation(scene, 5e-8, precision="float64")
    simulation.step(40000)
    v, w = simulation.velocity[:, ::2], simulation.angular_velocity[:, 1]
    stuck = []
    for i, j in meetings:
        expected = Impact(scene, i, j)
        stuck.append(expected.stuck)
        velocity = v[i] - (0 if j is None else v[j])
        spins = [w[i], 0.0 if j is None else w[j]]
        assert velocity == pytest.approx(expected.velocity, abs=1e-3 * SPEED), (i, j)
        assert RADIUS * np.array(spins) == pytest.approx(RADIUS * expected.spins, abs=1e-3 * SPEED), (i, j)
    assert min(stuck) < 0.2
    assert max(stuck) > 0.8


def test_co4_oblique_impacts_on_a_plane_in_gross_slip() -> None:
    """Chung and Ooi 2011, test 4: e_t = 1 - mu(1 + e)/tan(th) and w = 2.5 mu(1 + e) V cos(th)/R beyond 32.5 degrees.

    The dashpots act at entry and exit, where the spring sticks: with e = 0.98 that is less than 1 %.
    """
    degrees = np.array([40, 50, 60, 70, 80])
    published_tangential = [0.7829, 0.8471, 0.8948, 0.9337, 0.9679]
    published_spin = [544, 457, 355, 243, 123]
    angle, n = np.radians(degrees), len(degrees)
    y = 0.01 * np.arange(n)
    scene = grains(
        np.stack([0 * y, y, np.full(n, 2.5e-3 * (1 + 1e-6))], axis=1),
        3.9 * np.stack([np.sin(angle), 0 * y, -np.cos(angle)], axis=1),
        radius=2.5e-3,
        young=3.8e11,
        poisson=0.23,
        density=4000,
        friction=0.092,
        restitution=0.98,
        walls=(FLOOR,),
    )
    simulation = Simulation(scene, 5e-9, precision="float64")
    simulation.step(8000)
    v, w = simulation.velocity, simulation.angular_velocity[:, 1]
    assert v[:, 2] == pytest.approx(0.98 * 3.9 * np.cos(angle), rel=2e-3)
    assert v[:, 0] / (3.9 * np.sin(angle)) == pytest.approx(published_tangential, abs=5e-3)
    assert w == pytest.approx(published_spin, rel=1.5e-2)
