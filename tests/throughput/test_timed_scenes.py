"""The scenes whose steps are timed: made without any file, settled, alike in every size."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dembench.cases.base import CaseError
from dembench.runs.plan import RequestError
from dembench.scene.checks import check_scene
from dembench.scene.overlap import touching
from dembench.solver import Simulation
from dembench.throughput import scenes
from dembench.throughput.scenes import SCENES, TILES, WORK, names, timed

COUNTS = {"1k": 1e3, "5k": 5e3, "25k": 25e3, "100k": 1e5, "500k": 5e5, "1M": 1e6}


def test_the_series_stands_for_its_members_and_an_unknown_scene_is_told() -> None:
    series = [f"scaling-{size}" for size in TILES]
    assert names("scaling") == series and names("bed25k, scaling-1k,scaling") == ["bed25k", *series]
    with pytest.raises(RequestError, match=r"scene 'bed26k' is not known; accepted are bed25k, .*scaling-1M"):
        names("bed25k,bed26k")


def test_sizes_are_what_they_are_called() -> None:
    tile = scenes.WIDTH**2 * scenes.LAYERS
    assert {size: tile * a * b for size, (a, b) in TILES.items()} == COUNTS


@pytest.mark.parametrize("size", ["1k", "5k"])
def test_the_bed_is_at_rest_and_alike_in_every_size(size: str) -> None:
    """Each grain touches as many others as in the tile, nothing overlaps more, and 200 steps move no grain by 1 % of
    its radius: at rest springs are loaded by the weight alone, which takes a few steps to come back after the start
    without a history of shear."""
    scene = SCENES[f"scaling-{size}"](None, None)
    check_scene(scene)
    assert len(scene.bodies) == COUNTS[size] and scene.domain.periodic == (True, True, False)
    tile = scenes._between_periodic_sides(scene.bodies.position[: scenes.WIDTH**2 * scenes.LAYERS], _edges())
    own, first = (touching(s.bodies.position, s.radii(), s.domain) for s in (scene, tile))
    assert len(own[0]) / len(scene.bodies) == pytest.approx(len(first[0]) / len(tile.bodies))
    assert 1.5 < timed("it", scene).touching < 3
    assert own[2].max() == pytest.approx(first[2].max(), rel=1e-9) and own[2].max() < 0.02 * scenes.RADIUS
    simulation = Simulation(scene, scene.closed_step())
    simulation.step(200)
    assert np.linalg.norm(simulation.position - scene.bodies.position, axis=1).max() < 0.01 * scenes.RADIUS


def _edges() -> tuple[float, float]:
    edge = scenes.WIDTH * scenes.SPACING * scenes.RADIUS
    return edge, edge


def test_work_is_the_same_for_every_size_until_steps_are_too_few() -> None:
    small = timed("small", SCENES["scaling-1k"](None, None))
    assert small.steps * small.bodies == WORK
    assert timed("few", SCENES["scaling-1k"](None, None), 80).steps == 80


def test_a_directory_that_is_not_there_is_no_initial_state(tmp_path: Path) -> None:
    with pytest.raises(CaseError):
        SCENES["bed25k"](tmp_path / "nowhere", None)


def test_the_ball_is_just_above_the_bed_or_left_out(small_scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lowered by its gap it touches the highest place of the grains below it, and no grain moves."""
    bed = small_scene()
    monkeypatch.setattr(scenes, "_bulk", lambda *_: bed)
    hit, alone = (SCENES[name](None, None) for name in ("bed25k-ball", "bed25k"))
    assert [s.name for s in alone.species] == ["grain"] and len(alone.bodies) == len(bed.bodies) - 1
    assert not alone.bodies.velocity.any()
    assert np.array_equal(hit.bodies.position[:-1], bed.bodies.position[:-1])
    assert tuple(hit.bodies.velocity[-1]) == (0, 0, -scenes.BALL_SPEED)
    lowered = hit.bodies.position.copy()
    lowered[-1, 2] -= scenes.BALL_GAP
    apart = np.linalg.norm(lowered[:-1] - lowered[-1], axis=1) - hit.radii()[:-1] - hit.radii()[-1]
    assert apart.min() == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("ratio", [10, 100])
def test_a_ball_of_any_size_hangs_above_the_same_bed(ratio: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """It has room beside its own image, and lowered by its gap it touches the highest grain below it."""
    monkeypatch.setattr(scenes, "cached", lambda *_: np.random.default_rng(0).uniform(0, 11.5e-3, (500, 3)))
    alone, with_ball = (SCENES[f"wide-{k}"](None, None) for k in (1, ratio))
    assert names("wide") == [f"wide-{k}" for k in (1, 10, 100)]
    assert np.array_equal(with_ball.bodies.position[:-1], alone.bodies.position)
    radius = with_ball.radii()[-1]
    assert radius == pytest.approx(ratio * scenes.RADIUS)
    assert 2 * radius < min(with_ball.domain.upper[:2])
    offset = with_ball.bodies.position[-1] - (0, 0, scenes.BALL_GAP) - alone.bodies.position
    assert np.linalg.norm(offset, axis=1).min() == pytest.approx(radius + scenes.RADIUS, rel=1e-12)
