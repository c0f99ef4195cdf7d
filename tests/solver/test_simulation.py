"""The simulation used alone: built from arrays, read and set between steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest

from dembench.scene import HertzMindlin
from dembench.solver import Simulation, SolverError

FLOOR = ((0, 0, 0), (0, 0, 1))
G = 9.81
METHODS = ["soft-sphere", "impulse"]


def drops(method: str, height: Any = (1.0, 2.0), **changes: Any) -> Simulation:
    """Spheres of radius 0.1 m above a floor, far from each other."""
    position = [[k, 0, z] for k, z in enumerate(height)]
    law = HertzMindlin() if method == "soft-sphere" else None
    given = {"law": law, "walls": [FLOOR], "young": 1e8, "restitution": 0.5, "friction": 0.3, "dt": 1e-4, **changes}
    return Simulation.from_arrays(position, 0.1, **given)


@pytest.mark.parametrize("method", METHODS)
def test_a_drop_from_arrays_falls_and_bounces(method: str) -> None:
    """It meets the floor after sqrt(2 h / g) and rises with e times its speed; the soft contact lasts some 5 ms."""
    simulation = drops(method)
    assert np.array_equal(simulation.position, [[0, 0, 1], [1, 0, 2]])
    simulation.step(5000)
    fall = np.sqrt(2 * 0.9 / G)
    assert simulation.velocity[0, 2] == pytest.approx(0.5 * G * fall - G * (0.5 - fall), abs=0.1)
    assert simulation.velocity[1, 2] == pytest.approx(-G * 0.5, rel=1e-6)
    assert simulation.time == pytest.approx(0.5) and simulation.steps == 5000


@pytest.mark.parametrize("method", METHODS)
def test_position_velocity_and_spin_can_be_set_between_steps(method: str) -> None:
    """Free flight from the new state: x + v t + g t^2 / 2 in symplectic or Verlet form differ by g t dt / 2."""
    simulation = drops(method)
    simulation.step(10)
    simulation.position = [[0, 0, 5.0], [0.15, 0, 9.0]]
    simulation.velocity = [[1.0, 2.0, 3.0], [0, 0, 0]]
    simulation.angular_velocity = [[0, 0, 7.0], [1.0, 0, 0]]
    assert np.array_equal(simulation.velocity[0], [1, 2, 3])
    simulation.step(1000)
    expected = [0.1, 0.2, 5 + 0.3 - G * 0.01 / 2]
    assert simulation.position[0] == pytest.approx(expected, abs=G * 0.1 * 1e-4 / 2 * 1.01)
    assert simulation.velocity[0] == pytest.approx([1, 2, 3 - G * 0.1], abs=1e-9)
    assert np.array_equal(simulation.angular_velocity, [[0, 0, 7.0], [1.0, 0, 0]])


@pytest.mark.parametrize("method", METHODS)
def test_a_body_that_is_moved_next_to_another_meets_it(method: str) -> None:
    """The lists are those of the new positions: two equal spheres that meet head on at e = 1 exchange velocities."""
    simulation = drops(method, gravity=(0, 0, 0), restitution=1.0, friction=0.0, height=(1.0, 2.0, 3.0))
    simulation.step(5)
    simulation.position = [[0, 0, 1.0], [7, 0, 7], [0, 0, 1.2001]]
    simulation.velocity = [[0, 0, 0.1], [0, 0, 0], [0, 0, -0.1]]
    simulation.step(1000)
    assert simulation.velocity == pytest.approx(np.array([[0, 0, -0.1], [0, 0, 0], [0, 0, 0.1]]), abs=1e-4)


@pytest.mark.parametrize("name", ["position", "velocity", "angular_velocity"])
def test_what_is_no_state_is_refused_with_the_particle(name: str) -> None:
    simulation = drops("impulse")
    before = simulation.position
    with pytest.raises(SolverError, match=rf"{name}: shape \(3,\) is given, accepted is \(2, 3\)"):
        setattr(simulation, name, [0, 0, 1.0])
    with pytest.raises(SolverError, match=rf"{name}: particle 1 has the value .*nan.*; accepted are finite numbers"):
        setattr(simulation, name, [[0, 0, 1], [0, float("nan"), 0]])
    assert np.array_equal(simulation.position, before)


@pytest.mark.parametrize("method", METHODS)
def test_held_bodies(method: str) -> None:
    """Fixed: at rest under load; kinematic: keeps velocity and spin, also a new one; rotation-locked: never turns."""
    simulation = Simulation.from_arrays(
        [[0, 0, 0.1], [0, 0, 0.2999], [3, 0, 0.1], [6, 0, 0.1]],
        0.1,
        velocity=[[1.0, 0, 0], [0, 0, 0], [0.5, 0, 0], [1.0, 0, 0]],
        angular_velocity=[[0, 0, 1.0], [0, 0, 0], [0, 2.0, 0], [0, 3.0, 0]],
        fixed=[0],
        kinematic=[2],
        rotation_locked=[3],
        law=HertzMindlin() if method == "soft-sphere" else None,
        young=1e6,
        restitution=0.5,
        friction=0.4,
        walls=[FLOOR],
        dt=1e-4,
    )
    simulation.step(1000)
    assert np.array_equal(simulation.position[0], [0, 0, 0.1])
    assert not simulation.velocity[0].any() and not simulation.angular_velocity[0].any()
    assert simulation.position[2] == pytest.approx([3.05, 0, 0.1], abs=1e-12)
    assert np.array_equal(simulation.angular_velocity[2], [0, 2.0, 0])
    assert not simulation.angular_velocity[3].any()
    # without a spin it slides: mu g slows it down all the time
    assert simulation.velocity[3, 0] == pytest.approx(1 - 0.4 * G * 0.1, abs=0.01)
    simulation.velocity = [[1.0, 0, 0], [0, 0, 0], [0, 0.25, 0], [0, 0, 0]]
    simulation.angular_velocity = np.ones((4, 3))
    assert not simulation.velocity[0].any() and not simulation.angular_velocity[[0, 3]].any()
    simulation.step(1000)
    assert simulation.position[2] == pytest.approx([3.05, 0.025, 0.1], abs=1e-12)


def test_progress_is_told() -> None:
    """Also where nothing happens that would need new lists, and with the bits of a run that is not watched."""
    told: list[int] = []
    watched, silent = drops("soft-sphere"), drops("soft-sphere")
    watched.step(2000, told.append)
    silent.step(2000)
    assert len(told) > 5 and told[-1] == 2000 and told == sorted(told)
    assert watched.position.tobytes() == silent.position.tobytes()


def test_the_state_as_table_and_for_paraview(tmp_path: Path) -> None:
    simulation = drops("soft-sphere")
    for _ in range(2):
        simulation.export_vtkhdf(tmp_path / "drops.vtkhdf")
        simulation.step(10)
    simulation.export_csv(tmp_path / "drops.csv")
    table = pd.read_csv(tmp_path / "drops.csv")
    assert list(table["id"]) == [0, 1] and list(table["radius [m]"]) == [0.1, 0.1]
    assert np.array_equal(table[["position_x [m]", "position_y [m]", "position_z [m]"]], simulation.position)
    with h5py.File(tmp_path / "drops.vtkhdf") as file:
        assert np.array_equal(file["VTKHDF/Steps/Values"], [0, 10 * simulation.dt])
        assert set(file["VTKHDF/PointData"]) == {"id", "species", "radius", "velocity", "angular_velocity"}
