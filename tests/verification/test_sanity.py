"""The sanity suite: all sixteen checks on the impulse solver, and that each of them can fail."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from reading import Page
from typer.testing import CliRunner

from dembench.cli import app
from dembench.results.schema import SnapshotSeries
from dembench.verification import sanity, sanity_scenes
from dembench.verification.suites import suite

CHECKS = [
    f"SP{k}" for k in ("1a", "1b", "1c", "1d", "1e", "2a", "2b", "3", "4a", "4b", "5a", "5b", "5c", "6a", "6b", "6c")
]


@pytest.fixture(scope="module")
def verified(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, dict[str, Any]], Page]:
    """Rows by id and the page of one run of the whole suite."""
    out = tmp_path_factory.mktemp("sanity")
    words = ["verify", "--suite", "sanity", "--engines", "peclet", "--out", str(out), "--json"]
    done = CliRunner().invoke(app, words)
    found = {row["id"]: row for row in json.loads(done.stdout)["rows"]}
    assert done.exit_code == 0, [row for row in found.values() if row["status"] != "ok"]
    return found, Page((Path(out) / "sanity.html").read_text())


def test_all_sixteen_checks_agree_with_the_closed_forms(verified) -> None:
    found, _ = verified
    assert list(found) == CHECKS
    assert {row["status"] for row in found.values()} == {"ok"}
    assert abs(found["SP2a"]["measured"] - found["SP2b"]["measured"]) < 1e-3


def test_fifteen_lie_inside_the_tolerances_of_the_page(verified) -> None:
    """The sixteenth is the deflection, where the page exceeds Coulomb's bound."""
    found, _ = verified
    assert [k for k, row in found.items() if not row["published"]["inside"]] == ["SP5b"]
    assert "Coulomb's bound" in found["SP5b"]["published"]["note"]


def test_the_page_has_a_figure_for_each_problem(verified) -> None:
    _, page = verified
    assert list(page.figures) == ["restitution", "bounce", "rolling", "column", "deflection", "bed"]
    for figure in page.figures.values():
        assert all(len(panel["lines"]) for panel in figure.data["panels"])
        assert "dembench verify --suite sanity --engines peclet" in figure.command
    assert len(page.tables["rows"]) == 17


# ---- what is measured, on motions that are known


def still(scene: Any, times: int = 3) -> SnapshotSeries:
    """The bodies of a scene where they started, at some times up to its end."""
    n = len(scene.bodies)
    time = np.linspace(0, scene.duration, times)
    return SnapshotSeries(
        step=np.arange(times),
        time=time,
        position=np.broadcast_to(scene.bodies.position, (times, n, 3)).copy(),
        velocity=np.zeros((times, n, 3)),
        angular_velocity=np.zeros((times, n, 3)),
    )


def measured(name: str, motion: SnapshotSeries) -> dict[str, float]:
    experiment = next(e for e in suite("sanity").experiments if e.name == name)
    result: Any = SimpleNamespace(snapshots={sanity_scenes.MOTION: motion})
    return dict(experiment.measure({name: result}))


def test_the_bounce_of_a_point_is_the_square_of_the_restitution() -> None:
    """Samples of an exact flight, 10 ms apart, so that neither contact nor apex falls on one."""
    from dembench.reports.sanity_figures import bouncing

    time = np.arange(0, 3, 0.01) + 1e-9
    z = bouncing(time)
    motion = SnapshotSeries(
        step=np.arange(len(time)),
        time=time,
        position=np.stack([0 * z, 0 * z, z + 1], axis=1)[:, None],
        velocity=np.stack([0 * z, 0 * z, (bouncing(time + 1e-6) - z) / 1e-6], axis=1)[:, None],
        angular_velocity=np.zeros((len(time), 1, 3)),
    )
    assert sanity.bounce(motion) == pytest.approx(0.49, abs=1e-5)


def test_a_bed_that_sinks_or_moves_is_seen() -> None:
    motion = still(sanity_scenes.bed())
    assert measured("sanity_bed", motion) == pytest.approx({"SP6a": 0, "SP6b": 2, "SP6c": 0})
    motion.velocity[-1, 17] = 0, 0.03, -0.04
    motion.position[-1, -25:, 2] -= 0.01
    assert measured("sanity_bed", motion) == pytest.approx({"SP6a": 0.05, "SP6b": 1.99, "SP6c": 0.01})


def test_pairs_are_told_apart() -> None:
    motion = still(sanity_scenes.collisions())
    e = np.array(sanity_scenes.HEAD_ON)
    motion.velocity[-1, 0:10:2, 0], motion.velocity[-1, 1:10:2, 0] = -2 * e, 2 * e
    motion.velocity[-1, 10:12, 1] = -1.44, 1.45
    motion.velocity[-1, 13, 1] = -0.2
    found = measured("sanity_collisions", motion)
    assert [found[f"SP1{k}"] for k in "abcde"] == pytest.approx(e)
    assert (found["SP5a"], found["SP5b"], found["SP5c"]) == pytest.approx((0.01, 1.44, 0.2))


def test_the_column_is_judged_over_its_last_half_second() -> None:
    motion = still(sanity_scenes.floor(), times=1401)
    motion.velocity[:, 1, 0] = 2.0
    motion.velocity[1300, 4, 2] = 1.0
    motion.position[-1, 2:8, 2] *= 1.01
    assert motion.time[1300] < 13.5 - 1e-6
    found = measured("sanity_floor", motion)
    assert found["SP4a"] == 0 and found["SP4b"] == pytest.approx(2.02)
    assert found["SP3"] == pytest.approx(2 / 3)
    motion.velocity[1360, 4, 2] = 0.5
    assert measured("sanity_floor", motion)["SP4a"] == 0.5
