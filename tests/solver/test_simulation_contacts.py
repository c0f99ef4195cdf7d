"""Inspection of contacts: forces, points and slip of a state against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import FLOOR, POISSON, RADIUS, YOUNG, grains, hertz, resting_overlap
from test_simulation_saving import shaken

from dembench.scene import Box, Motion, Plane
from dembench.solver import Simulation, SolverError

G = 9.81
MASS = 2500 * 4 / 3 * np.pi * RADIUS**3


def test_a_pair_under_load() -> None:
    """Hertz's force at 1 % overlap along the axis; the surfaces slide past each other by v + 2 R w at its middle."""
    gap = 1.98 * RADIUS
    scene = grains(
        [[0, 0, gap], [0, 0, 0]], [[0.1, 0, 0], [0, 0, 0]], [[0, 50.0, 0], [0, 50.0, 0]], restitution=1.0, friction=0.3
    )
    found = Simulation(scene, 1e-7, precision="float64").contacts()
    assert (found.i.tolist(), found.j.tolist(), found.wall.tolist(), len(found)) == ([0], [1], [-1], 1)
    assert found.normal[0] == pytest.approx([0, 0, 1])
    assert found.overlap[0] == pytest.approx(0.02 * RADIUS, rel=1e-9)
    assert found.point[0] == pytest.approx([0, 0, 0.99 * RADIUS])
    assert found.normal_force[0] == pytest.approx(hertz(scene, 0.02 * RADIUS, RADIUS / 2), rel=1e-9)
    assert found.slip[0] == pytest.approx([0.1 - 2 * 50 * 0.99 * RADIUS, 0, 0], abs=1e-12)
    # the spring has grown by one step: 8 G* sqrt(R* d) slip dt
    stiffness = 8 * YOUNG / (4 * (2 - POISSON) * (1 + POISSON)) * np.sqrt(RADIUS / 2 * 0.02 * RADIUS)
    assert found.tangential_force[0] == pytest.approx([-stiffness * found.slip[0, 0] * 1e-7, 0, 0], rel=1e-9)
    assert found.energy[0] == pytest.approx(0.4 * 0.02 * RADIUS * found.normal_force[0], rel=1e-9)


@pytest.mark.parametrize("settings", [{}, {"threads": 2}], ids=["one thread", "two threads"])
def test_contact_forces_and_weight_are_mass_times_acceleration(settings: dict[str, Any]) -> None:
    """Newton's second law of every body, ball and drum included: the change of velocity over one step of 1 ns."""
    scene = shaken()
    drum = scene.walls[0]
    position = drum.start + 0.88 * (scene.bodies.position - drum.start)
    position[0] = [drum.start[0], position[0, 1], drum.start[2] - drum.radius + 0.98 * RADIUS]
    squeezed = scene.model_copy(update={"bodies": scene.bodies.model_copy(update={"position": position})})
    simulation = Simulation(squeezed, 1e-9, precision="float64", **settings)
    simulation.step(2000)
    found, before = simulation.contacts(), simulation.velocity
    force = found.sum_by_body(simulation.ids) + simulation.masses[:, None] * np.array(scene.gravity)
    simulation.step()
    change = (simulation.velocity - before) * simulation.masses[:, None] / simulation.dt
    assert len(found) > 50 and (found.wall >= 0).any() and (found.j == 200).any()
    assert np.abs(found.tangential_force).max() > 0.01 * found.normal_force.max()
    assert force == pytest.approx(change, abs=1e-4 * np.abs(force).max())


def test_contacts_leave_the_run_as_it_is() -> None:
    ends = []
    for look in (False, True):
        simulation = Simulation(shaken(), 1e-6)
        for _ in range(4):
            simulation.step(50)
            if look:
                simulation.contacts()
        ends.append(simulation.velocity.tobytes())
    assert ends[0] == ends[1]


def test_a_column_at_rest_carries_its_weight() -> None:
    """The contact below grain k of 5 bears (5 - k) m g, and the coordination number is that of a chain."""
    n = 5
    height = RADIUS + 2 * RADIUS * np.arange(n) * (1 - 1e-4)
    scene = grains(np.column_stack([0 * height, 0 * height, height]), gravity=(0, 0, -G), walls=(FLOOR,), young=1e6)
    simulation = Simulation(scene, 5e-6, precision="float64")
    simulation.step(60000)
    found = simulation.contacts()
    assert found.i.tolist() == [0, 0, 1, 2, 3] and found.j.tolist() == [-1, 1, 2, 3, 4]
    assert [found.walls[k] for k in found.wall[found.wall >= 0]] == ["floor"]
    assert found.normal_force == pytest.approx(np.array([5, 4, 3, 2, 1]) * MASS * G, rel=1e-3)
    assert found.overlap[0] == pytest.approx(resting_overlap(scene) * 5 ** (2 / 3), rel=1e-3)
    assert found.normal[:, 2] == pytest.approx([1, -1, -1, -1, -1]), "from the wall, or from j, to i"
    assert np.abs(found.tangential_force).max() < 1e-9 * MASS * G
    assert simulation.coordination_number() == pytest.approx(2 * 4 / 5)


@pytest.mark.parametrize("rows", ["compliant", "rigid"])
def test_the_contacts_of_impulses_carry_the_weight(rows: str) -> None:
    """The forces on each of five stacked grains add up to its weight; the elastic energy is that of the law."""
    overlap = (5 - np.arange(5)) ** (2 / 3) * (0.5 if rows == "compliant" else 0.0)
    scene = grains([[0, 0, RADIUS]], gravity=(0, 0, -G), walls=(FLOOR,), young=1e6)
    height = RADIUS + 2 * RADIUS * np.arange(5) - np.cumsum(overlap) * resting_overlap(scene)
    scene = grains(np.column_stack([0 * height, 0 * height, height]), gravity=(0, 0, -G), walls=(FLOOR,), young=1e6)
    simulation = Simulation(scene, 2e-5, method="impulse", rows=rows, precision="float64")
    simulation.step(6000)
    found = simulation.contacts()
    carried = found.sum_by_body(simulation.ids)
    assert carried == pytest.approx(np.tile([0, 0, MASS * G], (5, 1)), abs=0.02 * MASS * G)
    assert found.normal_force == pytest.approx(np.array([5, 4, 3, 2, 1]) * MASS * G, rel=0.02)
    if rows == "rigid":
        assert not found.energy.any()
    else:
        assert found.energy == pytest.approx(0.4 * found.normal_force * found.overlap, rel=0.05)


def test_the_slip_at_a_wall_that_moves() -> None:
    """A grain at rest on a belt slips by the speed of the belt; a corner gives one contact per face."""
    belt = Plane(
        name="belt",
        material="grain",
        point=(0, 0, 0),
        normal=(0, 0, 1),
        motion=Motion(velocity=(0.3, 0, 0), surface=True),
    )
    corner = Box(name="corner", material="grain", lower=(0.01, -1, -1), upper=(1, 1, 1), open_faces=("z-",))
    scene = grains([[0.5, 0, 0.99 * RADIUS], [0.01 + 0.98 * RADIUS, 0, 0.99 * RADIUS]], walls=(belt, corner))
    found = Simulation(scene, 1e-7).contacts()
    assert found.i.tolist() == [0, 1, 1] and found.j.tolist() == [-1, -1, -1]
    assert [found.walls[k] for k in found.wall] == ["belt", "belt", "corner"]
    assert found.slip == pytest.approx(np.array([[-0.3, 0, 0], [-0.3, 0, 0], [0, 0, 0]]), abs=1e-9)


def test_no_contact_and_no_half_lists() -> None:
    apart = grains([[0, 0, 0], [0, 0, 3 * RADIUS]])
    simulation = Simulation(apart, 1e-6)
    assert len(simulation.contacts()) == 0 and simulation.coordination_number() == 0
    assert simulation.contacts().sum_by_body(simulation.ids).shape == (2, 3)
    with pytest.raises(SolverError, match="half lists only"):
        Simulation(apart, 1e-6, lists="full").contacts()


def test_counters_tell_the_contacts() -> None:
    """The same numbers as the inspection finds, once a step has loaded the springs."""
    simulation = Simulation(shaken(), 1e-6)
    simulation.step(600)
    found, counted = simulation.contacts(), simulation.counters()
    assert counted["pairs in contact"] == np.count_nonzero(found.j >= 0) > 3
    assert counted["contacts with walls"] == np.count_nonzero(found.wall >= 0)
    assert counted["listed pairs"] > counted["pairs in contact"]
