"""A million grains at once: memory and steps hold out until they rest."""

from __future__ import annotations

import numpy as np
import pytest
from grains import FLOOR, RADIUS, grains

from dembench.scene import Domain
from dembench.solver import Simulation

ACROSS, LAYERS, PITCH = (200, 250), 20, 2.3
GRAVITY = 9.81


@pytest.mark.slow
def test_a_million_grains_come_to_rest() -> None:
    """Poured loosely on a floor between periodic sides, E = 1e7: within .3 s they lie in a bed of usual density.

    The speeds that are left would lift a grain by less than a hundredth of its radius; beds of frictional spheres have
    solid fractions between random loose (.55) and random close packing (.64), Onoda & Liniger 1990.
    """
    counts = (*ACROSS, LAYERS)
    lattice = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3) + 0.5
    random = np.random.default_rng(0)
    position = RADIUS * (PITCH * lattice + random.uniform(-0.1, 0.1, lattice.shape))
    edges = RADIUS * PITCH * np.array(ACROSS)
    top = float(position[:, 2].max()) + 2 * RADIUS
    domain = Domain(lower=(0, 0, -2 * RADIUS), upper=(*edges, top), periodic=(True, True, False))
    scene = grains(position, walls=(FLOOR,), gravity=(0, 0, -GRAVITY), young=1e7, domain=domain)
    simulation = Simulation(scene, "auto", threads=2)
    simulation.step(round(0.3 / simulation.dt))
    height = simulation.position[:, 2]
    speed = np.sqrt((simulation.velocity**2).sum(axis=1).mean())
    assert speed**2 / (2 * GRAVITY) < 0.01 * RADIUS
    assert height.min() > 0.95 * RADIUS
    inner = (height > 5 * RADIUS) & (height < np.quantile(height, 0.8))
    depth = np.quantile(height, 0.8) - 5 * RADIUS
    fraction = inner.sum() * 4 / 3 * np.pi * RADIUS**3 / (edges.prod() * depth)
    assert 0.55 < fraction < 0.64
    assert simulation.coordination_number() > 4
