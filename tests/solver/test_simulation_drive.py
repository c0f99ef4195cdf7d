"""Forces, torques and springs from outside, and the balance of energy that they enter."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, gas, grains, resting_overlap
from test_simulation_bodies import METHODS, each_method

from dembench.scene import Bodies, Box, Constraint, Scene
from dembench.solver import Simulation, SolverError

G = 9.81
MASS = 2500 * 4 / 3 * np.pi * RADIUS**3


def two(method: str, **changes: Any) -> Simulation:
    scene = grains([[0, 0, 0], [1, 0, 0]], **changes)
    return Simulation(scene, **METHODS[method], precision="float64")


@each_method
def test_constant_forces_and_torques(method: str) -> None:
    """v = F t / m and w = T t / (2/5 m r^2); their work is the kinetic energy."""
    simulation = two(method)
    simulation.set_force([[0, 0, 0], [1e-6, 0, -2e-6]])
    simulation.set_torque([[0, 3e-10, 0], [0, 0, 0]])
    simulation.step(1000)
    t = simulation.time
    assert simulation.velocity == pytest.approx(np.array([[0, 0, 0], [1e-6, 0, -2e-6]]) * t / MASS, rel=1e-9)
    spin = 3e-10 * t / (0.4 * MASS * RADIUS**2)
    assert simulation.angular_velocity == pytest.approx(np.array([[0, spin, 0], [0, 0, 0]]), rel=1e-9)
    assert simulation.drive.work == pytest.approx(simulation.kinetic_energy(), rel=1e-9)
    simulation.set_force(np.zeros((2, 3)))
    before = simulation.velocity
    simulation.step(10)
    assert np.array_equal(simulation.velocity, before)


@each_method
def test_a_spring_swings_at_its_frequency(method: str) -> None:
    """x = cos(w t) with w^2 = k / m over five periods; a step with rigid rows is symplectic, of first order."""
    simulation = two(method, gravity=(0, 0, 0))
    period = 1000 * simulation.dt
    stiffness = MASS * (2 * np.pi / period) ** 2
    k = simulation.add_spring(1, stiffness, (1 - 0.1 * RADIUS, 0, 0))
    assert simulation.spring_force(k) == pytest.approx([-stiffness * 0.1 * RADIUS, 0, 0])
    simulation.step(5100)
    swing = (simulation.position[1, 0] - 1) / (0.1 * RADIUS) + 1
    first_order = 0.5 * 2 * np.pi / 1000
    assert swing == pytest.approx(np.cos(2 * np.pi * 5.1), abs=1.1 * first_order if method == "rigid" else 1e-3)


def lowered(scene: Scene) -> Bodies:
    """The only grain of a scene at its resting overlap with the floor."""
    return scene.bodies.model_copy(update={"position": scene.bodies.position - [0, 0, resting_overlap(scene)]})


@each_method
def test_a_spring_drags_a_block_against_friction(method: str) -> None:
    """A body that cannot turn, drawn at constant speed: the spring bears mu m g and does the work of friction.

    The spring is damped critically, so that a tenth of the first percent of deviation is left after 4 ms.
    """
    dt = METHODS[method]["dt"]
    scene = grains(
        [[0, 0, RADIUS]],
        [[0.05, 0, 0]],
        walls=(FLOOR,),
        gravity=(0, 0, -G),
        constraints=(Constraint(kind="rotation-locked", bodies=(0,)),),
        young=1e8,
        friction=0.4,
    )
    if method != "rigid":
        scene = scene.model_copy(update={"bodies": lowered(scene)})
    simulation = Simulation(scene, **METHODS[method], precision="float64")
    stiffness, friction = MASS * 1e6, 0.4 * MASS * G
    anchor = (friction / stiffness, 0, simulation.position[0, 2])
    k = simulation.add_spring(0, stiffness, anchor, (0.05, 0, 0), 2 * MASS * 1000)
    simulation.step(round(0.004 / dt))
    assert simulation.spring_force(k)[0] == pytest.approx(friction, rel=2e-3)
    assert simulation.velocity[0, 0] == pytest.approx(0.05, rel=1e-3)
    work, way = simulation.drive.work, simulation.position[0, 0]
    simulation.step(round(0.004 / dt))
    assert simulation.drive.work - work == pytest.approx(friction * (simulation.position[0, 0] - way), rel=1e-3)


@each_method
def test_a_load_far_above_the_weight_rests(method: str) -> None:
    """Pressed with 50 times its weight a grain stays down: what the force adds in a step is no impact."""
    scene = grains([[0, 0, RADIUS]], walls=(FLOOR,), gravity=(0, 0, -G), young=1e8, restitution=0.9)
    simulation = Simulation(scene, **METHODS[method])
    simulation.set_force([[0, 0, -50 * MASS * G]])
    simulation.step(round(0.005 / simulation.dt))
    assert abs(simulation.velocity[0, 2]) < 0.01
    assert simulation.position[0, 2] == pytest.approx(RADIUS, rel=0.01)


@each_method
def test_a_driven_run_resumes_with_the_same_bits(method: str, tmp_path: Path) -> None:
    simulation = two(method)
    simulation.add_spring(1, 1e-3, (1, 0, 0.01), (0, 0, 0.1), 1e-6)
    simulation.set_torque([[0, 1e-12, 0], [0, 0, 0]])
    simulation.step(30)
    simulation.save(tmp_path / "state.npz")
    resumed = Simulation.load(tmp_path / "state.npz")
    for other in (simulation, resumed):
        other.step(30)
        other.insert([[3, 0, 0]])
        other.remove(1)
        other.step(3)
    assert resumed.velocity.tobytes() == simulation.velocity.tobytes()
    assert resumed.drive.work == simulation.drive.work
    assert not simulation.spring_force(0).any(), "its body is gone"


def test_an_elastic_collision_keeps_the_energy() -> None:
    """Two grains of e = 1 with friction off: kinetic energy goes into the contact and comes back."""
    scene = grains([[0, 0, 0], [0, 0, 2.001 * RADIUS]], [[0, 0, 1.0], [0, 0, 0]], restitution=1.0, friction=0.0)
    simulation = Simulation(scene, 1e-6, precision="float64")
    begin, most = simulation.energy(), 0.0
    for _ in range(40):
        simulation.step(10)
        now = simulation.energy()
        most = max(most, now.elastic)
        assert now.total() == pytest.approx(begin.total(), rel=1e-3)
        assert abs(now.dissipated) < 1e-3 * begin.total()
    # at the closest approach the energy of the relative motion, half of all, is in the contact
    assert most == pytest.approx(0.5 * begin.total(), rel=0.02)
    assert now.elastic == 0


@pytest.mark.parametrize("method", ["soft-sphere", "rigid"])
def test_what_a_heap_dissipates_never_comes_back(method: str) -> None:
    """Grains collide in a box as they fall, and then one of them is pushed through the others."""
    position, velocity, _spin = gas(27, speed=0.3, spacing=2.3)
    low, high = position.min(axis=0) - 1.1 * RADIUS, position.max(axis=0) + 1.1 * RADIUS
    box = Box(name="box", material="grain", lower=tuple(low), upper=(high[0], high[1], 1.0))
    scene = grains(position, velocity, walls=(box,), gravity=(0, 0, -G), young=1e7)
    dt = 5e-6 if method == "soft-sphere" else 2e-5
    simulation = Simulation(scene, **{**METHODS[method], "dt": dt}, precision="float64")
    begin = simulation.energy()
    simulation.step(round(0.02 / dt))
    push = np.zeros((27, 3))
    push[7] = [2 * MASS * G, 0, 0]
    simulation.set_force(push)
    last = simulation.energy()
    assert last.dissipated > 0.5 * begin.kinetic
    for _ in range(10):
        simulation.step(round(5e-4 / dt))
        now = simulation.energy()
        assert now.dissipated >= last.dissipated - 1e-3 * begin.kinetic
        last = now
    assert now.external_work > 1e-4 * begin.kinetic


def test_the_balance_begins_anew_after_a_change_from_outside() -> None:
    simulation = two("soft-sphere")
    assert simulation.energy().dissipated == 0
    simulation.velocity = [[0, 0, 1.0], [0, 0, 0]]
    assert simulation.energy().dissipated == 0
    simulation.step(10)
    assert simulation.energy().dissipated == pytest.approx(0, abs=1e-12 * MASS)


def test_what_cannot_act_is_refused() -> None:
    simulation = two("soft-sphere")
    with pytest.raises(SolverError, match=r"force: shape \(3,\) is given, accepted is \(2, 3\)"):
        simulation.set_force([0, 0, 1.0])
    with pytest.raises(SolverError, match="torque: particle 1 has the value"):
        simulation.set_torque([[0, 0, 1.0], [0, 0, float("inf")]])
    with pytest.raises(SolverError, match="body: there is no body 2"):
        simulation.add_spring(2, 1.0, (0, 0, 0))
    with pytest.raises(SolverError, match="stiffness: -1"):
        simulation.add_spring(1, -1.0, (0, 0, 0))
    with pytest.raises(SolverError, match=r"anchor: .* is given; accepted are three finite numbers"):
        simulation.add_spring(1, 1.0, (0, 0))
    with pytest.raises(SolverError, match="half lists only"):
        Simulation(grains([[0, 0, 0]]), 1e-6, lists="full").set_force([[0, 0, 1.0]])
