"""Rigid rows on several threads: what crosses their ranges is solved as what does not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, gas, grains, pairs

from dembench.scene import Scene
from dembench.solver import Simulation


def rigid(scene: Scene, dt: float, **settings: Any) -> Simulation:
    return Simulation(scene, dt, method="impulse", rows="rigid", **settings)


@pytest.mark.parametrize("threads", [3, 5])
def test_pairs_across_ranges_are_solved_as_those_within(threads: int) -> None:
    """Pairs far from each other, in which nothing depends on the order of rows; some are cut by the ranges."""
    scene = pairs(200)
    one, several = (rigid(scene, 1e-4, precision="float64", threads=k) for k in (1, threads))
    across = 0
    for simulation in (one, several):
        simulation.step(2)
        across = int(simulation.state.pair_count.numpy()[1::2].sum())
    assert across > 0, "no pair was cut"
    assert several.counters()["rows"] == one.counters()["rows"] > 20
    for values in ("position", "velocity", "angular_velocity"):
        a, b = getattr(one, values), getattr(several, values)
        assert np.abs(a - b).max() <= 1e-13 * np.abs(a).max(), values


def test_momentum_stays_and_bits_repeat() -> None:
    """However the run is cut into launches; energy goes, as half of it goes in every collision."""
    position, velocity, spin = gas(512, spacing=2.2)
    scene = grains(position, velocity, spin, restitution=0.6)
    ends = []
    for block in (300, 7):
        simulation, made = rigid(scene, 1e-5, threads=2), 0
        while made < 300:
            simulation.step(min(block, 300 - made))
            made += min(block, 300 - made)
        before, after = (scene.masses() @ v for v in (scene.bodies.velocity, simulation.velocity))
        assert np.abs(after - before).max() < 1e-6 * (scene.masses() @ np.linalg.norm(velocity, axis=1))
        assert simulation.kinetic_energy() < 0.9 * 0.5 * float(scene.masses() @ (velocity**2).sum(axis=1))
        ends.append([a.tobytes() for a in (simulation.position, simulation.velocity, simulation.angular_velocity)])
    assert ends[0] == ends[1]


def test_a_blow_runs_through_all_ranges() -> None:
    """200 balls in a row, one more comes and the last one leaves with its speed: Newton's cradle over three ranges."""
    n = 200
    along = np.append(-2.5, 2.0 * np.arange(n)) * RADIUS
    position = np.stack([along, *np.zeros((2, n + 1))], axis=1)
    velocity = np.zeros((n + 1, 3))
    velocity[0, 0] = 1.0
    scene = grains(position, velocity, restitution=1.0, friction=0.0)
    simulation = rigid(scene, 1e-3, threads=3, velocity_sweeps=20, precision="float64")
    simulation.step(2)
    expected = np.append(np.zeros(n), 1.0)
    assert simulation.velocity[:, 0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("threads", [1, 2])
def test_the_floor_carries_a_column_that_several_threads_share(threads: int) -> None:
    """Towers of 25 grains whose upper half belongs to another thread: the weight comes down through the bridge."""
    sites = np.stack(np.meshgrid(np.arange(3), np.arange(3), np.arange(25), indexing="ij"), axis=-1).reshape(-1, 3)
    position = RADIUS * (sites * [4, 4, 2] + [0, 0, 1])
    scene = grains(position, walls=(FLOOR,), gravity=(0, 0, -9.81))
    simulation = rigid(scene, 1e-4, threads=threads, wall_loads=True)
    simulation.step(20)
    weight = 9.81 * float(scene.masses().sum())
    assert simulation.wall_force("floor") == pytest.approx([0, 0, -weight], abs=0.01 * weight)
    assert np.abs(simulation.velocity).max() < 0.05 * 9.81 * 1e-4
    assert len(simulation.contacts()) == 225
