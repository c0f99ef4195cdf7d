"""Rolling friction: closed forms of one sphere on a plane, two spheres, and rest without jitter."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import DENSITY, FLOOR, RADIUS, grains, resting_overlap

from dembench.scene import PairLaw, Scene
from dembench.solver import Simulation

GRAVITY = 9.81


def on_plane(angle: float, rolling: float, friction: float = 1.0, **changes: Any) -> Scene:
    """A grain on a plane that gravity makes an incline of this angle [rad], downhill +x; stiff: the lever is r."""
    fields: dict[str, Any] = {
        "pair_laws": (PairLaw(a="grain", b="grain", restitution=0.3, friction=friction, rolling_friction=rolling),),
        "gravity": (GRAVITY * np.sin(angle), 0.0, -GRAVITY * np.cos(angle)),
        "young": 1e8,
        "walls": (FLOOR,),
        **changes,
    }
    rest = RADIUS - resting_overlap(grains([[0, 0, 0]], **{**fields, "gravity": (0, 0, fields["gravity"][2])}))
    return grains([[0, 0, rest]], **fields)


@pytest.mark.parametrize("rolling", [0.05, 0.2])
def test_sr2_a_sphere_rolls_down_an_incline_slowed_by_rolling_friction(rolling: float) -> None:
    """SR2: a = (5/7) g (sin - mu_r cos)."""
    theta = 0.4
    simulation = Simulation(on_plane(theta, rolling), 2e-6)
    simulation.step(20000)
    speed = 5 / 7 * GRAVITY * (np.sin(theta) - rolling * np.cos(theta)) * simulation.time
    # the shear spring takes up the load within the first 1e-3 of the time; the lever is r - overlap/2
    assert simulation.velocity[0] == pytest.approx([speed, 0, 0], rel=2e-3, abs=1e-5)
    assert simulation.angular_velocity[0, 1] * RADIUS == pytest.approx(speed, rel=2e-3)


@pytest.mark.parametrize("ratio", [1.05, 2.0])
def test_sr2_a_sphere_rests_where_rolling_friction_holds_it(ratio: float) -> None:
    """SR2: rest for mu_r above tan(theta), once the speed from the loading of the springs is gone."""
    theta = 0.2
    simulation = Simulation(on_plane(theta, ratio * np.tan(theta)), 2e-6)
    simulation.step(10000)
    start = simulation.position[0, 0]
    largest = 0.0
    for _ in range(20):
        simulation.step(500)
        largest = max(largest, float(np.abs(simulation.angular_velocity).max()))
    assert abs(simulation.position[0, 0] - start) < 1e-6 * RADIUS
    assert largest * RADIUS < 1e-2 * GRAVITY * simulation.dt


def test_sr2_a_spinning_sphere_spins_down() -> None:
    """SR2 on a flat floor without sliding friction: w = w0 - 5 mu_r g t/(2 r), then rest; twisting is not rolling."""
    scene = on_plane(0.0, 0.1, friction=0.0)
    bodies = scene.bodies.model_copy(update={"angular_velocity": np.array([[30.0, 40.0, 10.0]])})
    simulation = Simulation(scene.model_copy(update={"bodies": bodies}), 2e-6)
    rate = 2.5 * 0.1 * GRAVITY / RADIUS
    for share in (0.25, 0.5, 0.75):
        simulation.step(round(share * 50 / rate / simulation.dt) - simulation.steps)
        left = 50 - rate * simulation.time
        assert simulation.angular_velocity[0] == pytest.approx([0.6 * left, 0.8 * left, 10], rel=1e-3)
    simulation.step(round(1.1 * 50 / rate / simulation.dt) - simulation.steps)
    assert np.abs(simulation.angular_velocity[0, :2]).max() < 1e-3
    assert simulation.angular_velocity[0, 2] == pytest.approx(10, rel=1e-6)


@pytest.mark.parametrize("lists", ["half", "full"])
def test_rolling_friction_keeps_the_spin_of_a_pair(lists: str) -> None:
    """Two spheres of different size meet head-on with opposite spins: equal torques, of mu_r R* times the impulse."""
    law = PairLaw(a="grain", b="grain", restitution=0.8, friction=0.0, rolling_friction=0.1)
    radius = np.array([1.0, 1.5]) * RADIUS
    scene = grains(
        [[-1.0 * RADIUS, 0, 0], [1.51 * RADIUS, 0, 0]],
        [[0.2, 0, 0], [-0.2, 0, 0]],
        [[0, 3000.0, 0], [5.0, -3000.0, 0]],
        radius=radius,
        species=[0, 1],
        pair_laws=(law,),
    )
    simulation = Simulation(scene, precision="float64", lists=lists)
    simulation.step(500)
    mass = DENSITY * 4 / 3 * np.pi * radius**3
    inertia = 0.4 * mass * radius**2
    impulse = 1.8 * 0.4 * mass.prod() / mass.sum()
    change = inertia * (simulation.angular_velocity[:, 1] - [3000, -3000])
    moment = 0.1 * impulse * radius.prod() / radius.sum()
    # the tension of the reference law counts by its size: a little more than mu_r R* times the impulse
    assert change == pytest.approx([-moment, moment], rel=3e-2)
    assert change.sum() == pytest.approx(0, abs=1e-9 * moment)
    assert simulation.angular_velocity[1, 0] == pytest.approx(5, rel=1e-12)
