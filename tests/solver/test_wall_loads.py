"""Forces and torques on walls and the work that moving walls do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, grains, resting_overlap

from dembench.scene import Box, Cylinder, Motion, Plane, Scene
from dembench.solver import Simulation, SolverError

DRIVERS: dict[str, dict[str, Any]] = {
    "half": {},
    "full": {"lists": "full"},
    "rigid": {"method": "impulse", "rows": "rigid"},
    "compliant": {"method": "impulse", "rows": "compliant"},
}
GRAVITY = (0, 0, -9.81)
DRUM = Cylinder(
    name="drum",
    material="grain",
    start=(0, -0.02, 0.1),
    end=(0, 0.02, 0.1),
    radius=0.1,
    motion=Motion(angular_velocity=(0, -10.0, 0), centre=(0, 0, 0.1)),
)


def run(scene: Scene, driver: str, dt: float = 4e-6) -> Simulation:
    return Simulation(scene, dt, wall_loads=True, **DRIVERS[driver])


@pytest.mark.parametrize("driver", list(DRIVERS))
def test_grains_at_rest_weigh_on_the_floor_and_not_on_the_lid(driver: str) -> None:
    """Three grains, two of them 20 mm off: the floor carries their weight, its torque is weight times arm."""
    rest = RADIUS - resting_overlap(grains([[0, 0, 0]], gravity=GRAVITY))
    lid = Plane(name="lid", material="grain", point=(0, 0, 1.0), normal=(0, 0, -1))
    place = [[0, 0, rest], [0, 0.02, rest], [0.02, 0, rest]]
    simulation = run(grains(place, walls=(FLOOR, lid), gravity=GRAVITY), driver)
    simulation.step(3000)
    weight = simulation.masses[0] * 9.81
    assert simulation.wall_force("floor") == pytest.approx([0, 0, -3 * weight], rel=1e-3, abs=1e-3 * weight)
    assert simulation.wall_torque("floor") == pytest.approx([-0.02 * weight, 0.02 * weight, 0], abs=1e-5 * weight)
    assert not simulation.wall_force("lid").any() and simulation.wall_work("floor") == 0


@pytest.mark.parametrize("driver", ["half", "rigid", "compliant"])
def test_the_work_of_the_walls_is_the_energy_that_grains_gain(driver: str) -> None:
    """A box shakes elastic grains without friction: kinetic energy and the springs hold all work that it has done."""
    place = np.stack(np.meshgrid(*[np.arange(3)] * 3), axis=-1).reshape(-1, 3) * 2.2 * RADIUS
    half = 3.4 * RADIUS
    motion = Motion(amplitude=(RADIUS, 0, 0.5 * RADIUS), frequency=100.0)
    box = Box(name="box", material="grain", lower=(-half,) * 3, upper=(half,) * 3, motion=motion)
    scene = grains(place - 2.2 * RADIUS, walls=(box,), restitution=1.0, friction=0.0, young=1e8)
    simulation = run(scene, driver, 2e-6)
    simulation.step(10000)
    energy = simulation.energy()
    gained = energy.kinetic + energy.elastic
    assert gained > 10 * 27 * 0.5 * simulation.masses[0] * 0.1**2
    # the work of an impact that is under way is known to half a step of ten
    assert simulation.wall_work("box") == pytest.approx(gained, rel=0.02) and energy.wall_work > 0


@pytest.mark.parametrize("driver", list(DRIVERS))
def test_a_drum_drags_a_sliding_grain_with_friction_and_feels_its_torque(driver: str) -> None:
    """Force mu m g along, m g down; torque mu m g R against the turning; power mu m g omega R."""
    rest = RADIUS - resting_overlap(grains([[0, 0, 0]], gravity=GRAVITY))
    simulation = run(grains([[0, 0, rest]], walls=(DRUM,), gravity=GRAVITY, friction=0.2), driver)
    simulation.step(1000)
    weight = simulation.masses[0] * 9.81
    work = simulation.wall_work("drum")
    simulation.step(500)
    assert simulation.wall_force("drum") == pytest.approx([-0.2 * weight, 0, -weight], rel=0.01, abs=0.01 * weight)
    assert simulation.wall_torque("drum") == pytest.approx([0, 0.2 * weight * 0.1, 0], rel=0.01, abs=1e-5 * weight)
    power = (simulation.wall_work("drum") - work) / (500 * 4e-6)
    assert power == pytest.approx(0.2 * weight * 10 * 0.1, rel=0.01)


@pytest.mark.parametrize("settings", [{}, {"method": "impulse", "rows": "rigid"}], ids=["soft spheres", "rigid rows"])
def test_threads_add_up(settings: dict[str, str]) -> None:
    place = [[3 * RADIUS * k, 0, 0.999 * RADIUS] for k in range(130)]
    scene = grains(place, walls=(FLOOR,), gravity=GRAVITY)
    one, two = (Simulation(scene, 4e-6, threads=n, wall_loads=True, **settings) for n in (1, 2))
    for simulation in (one, two):
        simulation.step(20)
    assert two.wall_force("floor") == pytest.approx(one.wall_force("floor"), rel=1e-6)


def test_what_is_not_there_or_not_summed_is_named() -> None:
    with pytest.raises(SolverError, match=r"not summed; accepted is Simulation\(\.\.\., wall_loads=True\)"):
        Simulation(grains([[0, 0, 1]], walls=(FLOOR,)), 4e-6).wall_force("floor")
    with pytest.raises(SolverError, match="wall 'roof' is not known; accepted are floor"):
        Simulation(grains([[0, 0, 1]], walls=(FLOOR,)), 4e-6, wall_loads=True).wall_work("roof")
