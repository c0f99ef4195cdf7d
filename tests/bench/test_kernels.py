"""Times of the solver's kernels beside the reference workload: `make bench` compares them with a baseline.

Every round is CPU time of a piece of work of some ten milliseconds, and the reference workload is done between two
rounds, so that both meet the same machine.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, gas, grains
from walling import distances

from dembench.runs.workload import Workload, reference_time
from dembench.scene import Box, Cylinder, Rigid, Scene
from dembench.solver import Simulation

pytestmark = [pytest.mark.slow, pytest.mark.benchmark(timer=time.process_time)]

ROUNDS = 16
GRAINS = 512


@cache
def workload() -> Workload:
    """The reference workload, made once."""
    return Workload()


@pytest.fixture
def timed(benchmark: Any) -> Callable[[str, Callable[[], Any]], None]:
    """Times a function and states its ratios to the reference workload."""

    def run(title: str, work: Callable[[], Any]) -> None:
        beside = []
        benchmark.pedantic(work, setup=lambda: beside.append(workload().measure()), rounds=ROUNDS, warmup_rounds=1)
        reference = reference_time(beside)
        benchmark.extra_info["title"] = title
        benchmark.extra_info["ratios"] = [seconds / reference for seconds in benchmark.stats.stats.data]

    return run


def dense(**changes: Any) -> Scene:
    """Grains at rest on a floor, on a cubic lattice in which neighbours overlap by a thousandth of their radius."""
    steps = np.arange(round(GRAINS ** (1 / 3)))
    lattice = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    return grains((1.999 * lattice + [0, 0, 0.9995]) * RADIUS, walls=(FLOOR,), gravity=(0, 0, -9.81), **changes)


def stepping(simulation: Simulation, steps: int) -> Callable[[], Any]:
    """Steps that start from the same state: the work of every round is the same."""
    position, velocity, spin = simulation.position, simulation.velocity, simulation.angular_velocity

    def work() -> None:
        simulation.position, simulation.velocity, simulation.angular_velocity = position, velocity, spin
        simulation.step(steps)

    return work


def test_soft_step(timed: Callable[..., None]) -> None:
    timed("400 steps of 512 soft spheres in a lattice", stepping(Simulation(dense()), 400))


def test_compliant_step(timed: Callable[..., None]) -> None:
    simulation = Simulation(dense(), dt=2e-5, method="impulse")
    timed("80 steps of 512 spheres with compliant rows", stepping(simulation, 80))


def test_rigid_step(timed: Callable[..., None]) -> None:
    simulation = Simulation(dense(law=Rigid()), dt=2e-4)
    timed("40 steps of 512 rigid spheres", stepping(simulation, 40))


def test_neighbour_build(timed: Callable[..., None]) -> None:
    position, _, _ = gas(8 * GRAINS)
    simulation = Simulation(grains(position))

    def work() -> None:
        for _ in range(30):
            simulation.state.rebuild()

    timed("30 rebuilds of the lists of 4096 grains", work)


def test_wall_distance(timed: Callable[..., None]) -> None:
    points = np.random.default_rng(0).uniform(0.1, 0.9, (100_000, 3))
    box = Box(name="box", material="grain", lower=(0, 0, 0), upper=(1, 1, 1))
    barrel = Cylinder(name="barrel", material="grain", radius=0.8, start=(0.5, 0.5, 0), end=(0.5, 0.5, 1))
    timed("distances of 100,000 points to a box and a cylinder", lambda: distances((box, barrel), points))
