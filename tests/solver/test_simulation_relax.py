"""Overlapping starts come apart under a limit of the speed."""

from __future__ import annotations

import numpy as np
import pytest
from grains import RADIUS, gas, grains
from test_simulation_bodies import METHODS, each_method

from dembench.scene import Box, Domain
from dembench.solver import Simulation, SolverError

G = 9.81


@each_method
def test_d11_two_free_spheres_at_half_their_distance(method: str) -> None:
    """They part at no more than sqrt(2 g d), keep their centre of mass and end at rest, 1 % of a radius inside."""
    scene = grains([[0, 0, 0], [0, 0, RADIUS]], gravity=(0, 0, 0), young=1e8)
    simulation = Simulation(scene, **METHODS[method])
    limit = np.sqrt(2 * G * 2 * RADIUS)
    simulation.relax(speed_limit=limit)
    assert not simulation.velocity.any(), "at rest afterwards"
    position = simulation.position
    assert np.linalg.norm(position[1] - position[0]) >= 1.99 * RADIUS
    assert position.mean(axis=0) == pytest.approx([0, 0, RADIUS / 2], abs=1e-6 * RADIUS)
    simulation.step(200)
    assert np.linalg.norm(simulation.velocity, axis=1).max() <= limit


@pytest.mark.parametrize("method", ["soft-sphere", "rigid"])
def test_d11_a_block_in_a_box(method: str) -> None:
    """64 grains at half their distance in a box: none leaves it, none is faster than sqrt(2 g d) afterwards."""
    position, _velocity, _spin = gas(64, spacing=1.0)
    position -= position.min(axis=0)
    high = position.max(axis=0)
    box = Box(
        name="box",
        material="grain",
        lower=(-3 * RADIUS, -3 * RADIUS, -1.2 * RADIUS),
        upper=(high[0] + 3 * RADIUS, high[1] + 3 * RADIUS, 1.0),
    )
    scene = grains(position, walls=(box,), gravity=(0, 0, -G), young=1e7)
    dt = 5e-6 if method == "soft-sphere" else 5e-5
    simulation = Simulation(scene, **{**METHODS[method], "dt": dt})
    assert simulation.overlap() > 1.2 * RADIUS
    simulation.relax()
    assert simulation.overlap() <= 0.01 * RADIUS
    assert (box.signed_distance(simulation.position) > 0.9 * RADIUS).all()
    fastest = 0.0
    for _ in range(20):
        simulation.step(50)
        fastest = max(fastest, float(np.linalg.norm(simulation.velocity, axis=1).max()))
    assert fastest <= np.sqrt(2 * G * 2 * RADIUS)


@pytest.mark.parametrize("method", ["soft-sphere", "rigid"])
def test_d21_coincident_centres_part_the_same_way_every_time(method: str) -> None:
    """Two and four bodies on one point: a diameter apart afterwards, with the same bits every time."""
    for count in (2, 4):
        ends = []
        for _ in range(2):
            scene = grains([[0, 0, 0]] * count, gravity=(0, 0, 0), young=1e8)
            simulation = Simulation(scene, **{**METHODS[method], "dt": 5e-6})
            simulation.relax(speed_limit=1.0, until=0.02)
            ends.append(simulation.position)
        assert np.isfinite(ends[0]).all() and ends[0].tobytes() == ends[1].tobytes()
        gap = np.linalg.norm(ends[0][:, None] - ends[0], axis=2)[np.triu_indices(count, 1)]
        assert (gap >= 1.98 * RADIUS).all()


def test_what_cannot_relax_is_told() -> None:
    """Five grains in a box for one."""
    box = Box(name="box", material="grain", lower=(-1.1 * RADIUS,) * 3, upper=(1.1 * RADIUS,) * 3)
    scene = grains([[0, 0, 1e-4 * k] for k in range(5)], walls=(box,), young=1e7)
    simulation = Simulation(scene, 1e-6)
    with pytest.raises(SolverError, match=r"bodies still overlap by .* after 40 steps of relaxation"):
        simulation.relax(steps=40)
    with pytest.raises(SolverError, match="speed_limit: -1"):
        simulation.relax(speed_limit=-1.0)


def test_room_is_sought_across_a_periodic_face() -> None:
    """A new body near one face would overlap one near the other."""
    domain = Domain(lower=(0, -1, -1), upper=(0.05, 1, 1), periodic=(True, False, False))
    simulation = Simulation(grains([[0.5 * RADIUS, 0, 0]], domain=domain), 1e-6)
    with pytest.raises(SolverError, match=r"particles 1 and 0 would overlap by 50.00%"):
        simulation.insert([[0.05 - RADIUS, 0, 0]])
    assert simulation.insert([[0.05 - 2 * RADIUS, 0, 0]]).tolist() == [1]
