"""Physics on the published bed of 25 000 grains; minutes long."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

from dembench.cases.registry import parse_case
from dembench.engines.registry import engine
from dembench.scene import Bodies, Scene
from dembench.solver import Simulation

DATA = Path(__file__).parents[3] / "shared" / "data" / "dosta2024"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not DATA.is_dir(), reason="the published coordinate files are not at hand"),
]


@pytest.fixture(scope="module")
def published() -> Scene:
    """The 25k case from the published file."""
    case, parameters = parse_case("case3")
    return case.scene(parameters, "published", DATA, 0)


@pytest.fixture(scope="module")
def hit(published: Scene) -> Scene:
    """The same with the ball half a millimetre above the bed, for 2 ms: it digs in at once."""
    position, velocity = published.bodies.position.copy(), published.bodies.velocity.copy()
    position[-1], velocity[-1] = (0, 0, -0.0467), (0, 0, -5.2)
    bodies = Bodies(position=position, velocity=velocity, species=published.bodies.species)
    return published.model_copy(update={"bodies": bodies, "duration": 2e-3, "observables": published.observables[:1]})


@pytest.mark.parametrize("rows", ["rigid", "compliant"])
def test_impulses_follow_the_published_descent(published, rows):
    # codes that start from this file: -0.124 m at 25 ms and -0.130 m at 27 ms; free fall would be -0.1281 and -0.1386
    simulation = Simulation(published, dt=5e-5, method="impulse", rows=rows)
    for moment, expected in ((0.025, -0.1239), (0.027, -0.1304)):
        simulation.step(round(moment / 5e-5) - simulation.steps)
        assert simulation.position[-1, 2] - 0.06 == pytest.approx(expected, abs=2e-3)


def test_soft_spheres_follow_a_second_code(hit, tmp_path):
    other = engine("liggghts")
    if not other.probe().available:
        pytest.skip("LIGGGHTS is not installed")
    settings = other.settings(hit, "closed")
    (tmp_path / "frames").mkdir()
    for phase in other.write(hit, settings, tmp_path):
        subprocess.run(phase.command, cwd=tmp_path, check=True, capture_output=True)
    tracks = other.read(hit, settings, tmp_path).tracks
    simulation = Simulation(hit, dt=settings.dt)
    path = []
    for moment in tracks.time:
        simulation.step(round(moment / settings.dt) - simulation.steps)
        path.append(simulation.position[-1, 2])
    # the ball moves 8 mm through the bed; the two codes round differently and forget opened contacts differently
    assert np.abs(np.array(path) - tracks.position[:, 0, 2]).max() < 2e-5
