"""Collisions of rigid rows: Walton's law with tangential restitution, and blows that travel through touching grains."""

from __future__ import annotations

import numpy as np
import pytest
from grains import FLOOR, RADIUS, grains

from dembench.scene import PairLaw
from dembench.solver import Simulation

DT = 5e-5


@pytest.mark.parametrize("fall", [0.0, 9.81])
@pytest.mark.parametrize("beta", [-1.0, 0.0, 0.44, 1.0])
@pytest.mark.parametrize("tangential", [0.05, 0.3, 0.6, 2.0])
@pytest.mark.parametrize("partner", ["wall", "sphere"])
def test_oblique_impact_is_waltons(partner: str, tangential: float, beta: float, fall: float) -> None:
    """e = 0.87, mu = 0.25: stick where (2/7)(1 + beta)|vt| <= mu (1 + e)|vn|, then vt' = -beta vt at the contact,
    else the change of vt is mu (1 + e) vn for the centre (IM1 of Walton; half of both for each of two equal spheres).

    The impulse is exact; 1e-3 is what the change of the normal within a step of approach leaves in a pair.
    """
    e, mu, share = 0.87, 0.25, 1.0 if partner == "wall" else 0.5
    law = PairLaw(a="grain", b="grain", restitution=e, friction=mu, tangential_restitution=beta)
    gravity = (0, 0, -fall)
    if partner == "wall":
        scene = grains(
            [[0, 0, 1.0001 * RADIUS]], [[tangential, 0, -1.0]], walls=(FLOOR,), pair_laws=(law,), gravity=gravity
        )
    else:
        scene = grains(
            [[0, 0, 2.0001 * RADIUS], [0, 0, 0]],
            [[tangential, 0, -1.0], [0, 0, 0]],
            pair_laws=(law,),
            gravity=gravity,
        )
    simulation = Simulation(scene, DT, method="impulse", rows="rigid")
    simulation.step()
    approach = 1.0 + (fall * DT if partner == "wall" else 0)
    impulse = share * min(mu * (1 + e) * approach, 2 / 7 * (1 + beta) * tangential)
    v, w = simulation.velocity[0] - [0, 0, -fall * DT], simulation.angular_velocity[0]
    assert v[0] == pytest.approx(tangential - impulse, abs=1e-3)
    assert v[2] == pytest.approx(-1.0 + share * (1 + e) * approach, abs=1e-3)
    assert w[1] * RADIUS == pytest.approx(2.5 * impulse, abs=1e-3)
    assert np.abs(w[[0, 2]]).max() * RADIUS < 1e-6


@pytest.mark.parametrize("impact", [0.0, 0.6, 0.99, 1.01])
def test_d10_a_fast_pair_is_deflected_where_its_ways_meet(impact: float) -> None:
    """Elastic spheres turn by 2 acos(b/d) with the impact parameter b and keep their angular momentum; those with b > d
    pass. A step of 0.2 r turns the line of centres by up to 11 degrees before the touch, wherever in the step that is.

    Two that move sideways by less than 0.5 % of d before the touch collide along the line of the start: 0.6 degrees.
    """
    speed, dt, count = 100.0, 2e-3, 7
    pairs = [(side * (2.5 + 0.0137 * k), side * impact, 10.0 * k) for k in range(count) for side in (-1.0, 1.0)]
    position = np.array(pairs)
    velocity = np.where(position[:, :1] < 0, 1, -1) * np.array([speed / 2, 0, 0])
    scene = grains(position, velocity, radius=1.0, restitution=1.0, friction=0.0)
    simulation = Simulation(scene, dt, method="impulse", rows="rigid")
    simulation.step(40)
    x, v = simulation.position, simulation.velocity
    away = (v[1::2] - v[::2]) / speed
    turn = 2 * np.degrees(np.arccos(min(impact, 1.0)))
    assert np.degrees(np.arctan2(away[:, 1], -away[:, 0])) == pytest.approx(turn, abs=0.6)
    assert np.linalg.norm(away, axis=1) == pytest.approx(1, abs=1e-6)
    momentum = np.cross(x[1::2] - x[::2], v[1::2] - v[::2])[:, 2]
    assert momentum == pytest.approx(2 * impact * speed, abs=0.02 * speed)


def test_d12_a_plastic_grain_stays_where_it_lands() -> None:
    """e = 0, on a floor and on another grain: no bounce above the speed at which the sweeps stop, 0.04 g dt."""
    scene = grains(
        [[0, 0, RADIUS], [0, 0, 4 * RADIUS], [0.02, 0, 2 * RADIUS]],
        [[0, 0, 0], [0, 0, -1.0], [0, 0, -1.0]],
        walls=(FLOOR,),
        restitution=0.0,
        gravity=(0, 0, -9.81),
    )
    simulation = Simulation(scene, DT, method="impulse", rows="rigid")
    for _ in range(200):
        simulation.step()
        assert simulation.velocity[:, 2].max() < 0.04 * 9.81 * DT
    assert np.abs(simulation.velocity).max() < 9.81 * DT
    assert simulation.position[:, 2] == pytest.approx([RADIUS, 3 * RADIUS, RADIUS], abs=1e-3 * RADIUS)


@pytest.mark.parametrize("count", [2, 100])
def test_d21_grains_on_one_point_part(count: int) -> None:
    """They separate without speed, along directions that a repeated run finds again."""
    ends = []
    for _ in range(2):
        scene = grains(np.full((count, 3), 0.1))
        simulation = Simulation(scene, DT, method="impulse", rows="rigid", position_sweeps=100)
        simulation.step(100)
        ends.append(simulation.position)
        assert np.abs(simulation.velocity).max() < 1e-9
    x = ends[0]
    i, j = np.triu_indices(count, 1)
    assert np.linalg.norm(x[i] - x[j], axis=1).min() > 2 * RADIUS * (1 - 1e-3)
    assert (ends[0] == ends[1]).all()


@pytest.mark.parametrize("height", [4.93, 5.0, 5.08])
def test_a_bounce_does_not_depend_on_where_in_a_step_it_falls(height: float) -> None:
    """A unit sphere falls 5 m in steps of 2 ms, e = 0.7, and rises to e^2 of it.

    It turns at the floor, not where the step of the contact began, up to 2 cm above it. What is left is the speed of
    the impact, known to within half a step of free fall: (1 + 1/e) g dt/v, 0.5 % of the height.
    """
    dt, e = 2e-3, 0.7
    scene = grains(
        [[0, 0, 1 + height]],
        radius=1.0,
        density=3 / (4 * np.pi),
        walls=(FLOOR,),
        gravity=(0, 0, -9.8),
        restitution=e,
        friction=0.0,
    )
    simulation = Simulation(scene, dt, method="impulse", rows="rigid")
    apex = fall = np.sqrt(2 * height / 9.8)
    simulation.step(round((fall + e * apex) / dt))
    assert simulation.position[0, 2] - 1 == pytest.approx(e**2 * height, rel=5e-3)
