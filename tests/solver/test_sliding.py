"""Sliding, rolling and spinning on a plane: closed forms of one sphere with friction."""

from __future__ import annotations

import numpy as np
import pytest
from grains import FLOOR, RADIUS, grains, resting_overlap
from reference import AllPairs

from dembench.scene import Constraint, Scene
from dembench.solver import Simulation


def on_plane(
    angle: float, friction: float, velocity: tuple[float, float, float] = (0, 0, 0), **changes: object
) -> Scene:
    """A grain at rest on a plane that gravity makes an incline of this angle [rad]: downhill is +x."""
    gravity = (9.81 * np.sin(angle), 0.0, -9.81 * np.cos(angle))
    weight = grains([[0, 0, 0]], gravity=(0, 0, gravity[2]))
    rest = RADIUS - resting_overlap(weight)
    return grains([[0, 0, rest]], [velocity], walls=(FLOOR,), gravity=gravity, friction=friction, **changes)


def test_a_sliding_sphere_ends_rolling_with_five_sevenths_of_its_speed() -> None:
    simulation = Simulation(on_plane(0.0, 0.3, (0.1, 0, 0)), 4e-6)
    simulation.step(5000)
    # lever r - overlap/2 makes 1e-4 of difference
    assert simulation.velocity[0, 0] == pytest.approx(5 / 7 * 0.1, rel=5e-4)
    assert simulation.angular_velocity[0, 1] * RADIUS == pytest.approx(5 / 7 * 0.1, rel=2e-3)


@pytest.mark.parametrize("theta", [0.3, 0.8])
def test_a_sphere_rolls_down_where_friction_suffices(theta: float) -> None:
    """a = 5/7 g sin(theta) for mu > 2/7 tan(theta), and no slip."""
    friction = 1.1 * 2 / 7 * np.tan(theta)
    simulation = Simulation(on_plane(theta, friction), 4e-6)
    simulation.step(10000)
    speed = 5 / 7 * 9.81 * np.sin(theta) * simulation.time
    assert simulation.velocity[0] == pytest.approx([speed, 0, 0], rel=1e-3, abs=1e-5)
    assert simulation.angular_velocity[0, 1] * RADIUS == pytest.approx(speed, rel=2e-3)


def test_a_sphere_slides_and_spins_up_where_friction_does_not_suffice() -> None:
    """a = g (sin - mu cos), angular acceleration 5 mu g cos/(2 r)."""
    theta = 0.8
    friction = 0.5 * 2 / 7 * np.tan(theta)
    simulation = Simulation(on_plane(theta, friction), 4e-6)
    simulation.step(10000)
    t = simulation.time
    assert simulation.velocity[0, 0] == pytest.approx(9.81 * (np.sin(theta) - friction * np.cos(theta)) * t, rel=1e-3)
    assert simulation.angular_velocity[0, 1] == pytest.approx(
        2.5 * friction * 9.81 * np.cos(theta) * t / RADIUS, rel=2e-3
    )


@pytest.mark.parametrize("ratio", [0.95, 1.05])
def test_a_block_sticks_below_the_friction_angle_and_slides_above(ratio: float) -> None:
    """Without rotation: at rest for tan(theta) < mu, but for the shear spring; else a = g (sin - mu cos)."""
    theta = np.arctan(ratio * 0.5)
    scene = on_plane(theta, 0.5, constraints=(Constraint(kind="rotation-locked", bodies=(0,)),))
    simulation = Simulation(scene, 4e-6)
    simulation.step(10000)
    start, before = simulation.position[0, 0], simulation.velocity[0, 0]
    simulation.step(10000)
    gained = (simulation.velocity[0, 0] - before) / (10000 * 4e-6)
    if ratio < 1:
        assert np.abs(simulation.velocity).max() < 1e-8
        assert simulation.position[0, 0] == pytest.approx(start, abs=1e-6 * RADIUS)
    else:
        assert gained == pytest.approx(9.81 * (np.sin(theta) - 0.5 * np.cos(theta)), rel=1e-3)
    assert (simulation.angular_velocity == 0).all()


@pytest.mark.parametrize(("young", "poisson", "density"), [(7e10, 0.33, 2700), (1.2e11, 0.35, 8900)])
def test_a_spinning_sphere_on_a_plane_leaves_with_the_friction_impulse(
    young: float, poisson: float, density: float
) -> None:
    """Chung and Ooi 2011, test 6, in gross slip with e = 1: tangential speed 2 mu Vn, spin less by 5 mu Vn/R."""
    scene = grains(
        [[0, 0, 0.1 + 1e-6]],
        [[0, 0, -0.2]],
        [[0, 20.0, 0]],
        walls=(FLOOR,),
        radius=0.1,
        young=young,
        poisson=poisson,
        density=density,
        restitution=1.0,
        friction=0.4,
    )
    simulation = Simulation(scene, 1e-6)
    simulation.step(3000)
    assert simulation.velocity[0] == pytest.approx([0.16, 0, 0.2], rel=1e-3, abs=1e-6)
    assert simulation.angular_velocity[0] == pytest.approx([0, 20 - 4, 0], rel=1e-3, abs=1e-5)


def test_a_spinning_sphere_with_damping_follows_the_law() -> None:
    """The same test with its e = 0.5: the dashpots of the law add to mu (1 + e) Vn, so plain numpy is the measure."""
    scene = grains(
        [[0, 0, 0.1 + 1e-6]],
        [[0, 0, -0.2]],
        [[0, 20.0, 0]],
        walls=(FLOOR,),
        radius=0.1,
        young=7e10,
        poisson=0.33,
        density=2700,
        friction=0.4,
    )
    simulation, reference = Simulation(scene, 2e-6), AllPairs(scene, 2e-6)
    simulation.step(1000)
    reference.step(1000)
    assert simulation.velocity == pytest.approx(reference.v, rel=1e-5, abs=1e-7)
    assert simulation.angular_velocity == pytest.approx(reference.w, rel=1e-5, abs=1e-5)
    assert simulation.velocity[0, 0] > 1.1 * 0.12
