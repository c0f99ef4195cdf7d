"""Ablation: each absent feature is forced on one by one, and rows say what it cost and whether a bit changed."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from standin import StandIn
from typer.testing import CliRunner

from dembench import ablation
from dembench.ablation import EVERYTHING, Ablation, Cost, difference
from dembench.cli import app
from dembench.engines import registry
from dembench.reports.ablation import render
from dembench.runs.plan import EngineChoice, SceneChoice
from dembench.scene import FORCEABLE, features
from dembench.verification.ablation_scenes import SCENES

PLANNED = {"gas": {"periodic"}, "bed": {"friction", "rotation", "walls"}, "smooth-bed": {"walls"}}


@pytest.mark.parametrize("name", list(SCENES))
def test_every_absent_feature_is_forced_alone_and_all_together(name: str, tmp_path: Path) -> None:
    scene = SCENES[name]()
    runs = ablation.planned([SceneChoice(name, None, 0, scene)], [EngineChoice("peclet-hertz")], tmp_path, 2, 60.0)
    forced = [run.spec.overrides.get("force", "") for run in runs if run.spec.repeat == 1]
    absent = [f for f in features(scene).absent() if f in FORCEABLE]
    assert not set(absent) & PLANNED[name]
    assert forced == ["", *absent, "+".join(absent)]
    assert [run.spec.repeat for run in runs] == sorted(run.spec.repeat for run in runs), "repeats are interleaved"


def test_an_engine_that_can_force_nothing_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(registry.BUILT_IN, "standin", f"{StandIn.__module__}:StandIn")
    runs = ablation.planned(
        [SceneChoice("gas", None, 0, SCENES["gas"]())], [EngineChoice("standin")], tmp_path, 1, 60.0
    )
    (row,) = ablation.rows(runs)
    assert len(runs) == 1 and row.feature == "" and row.why == ablation.NOTHING


def results(shift: float, after: int) -> SimpleNamespace:
    """A record of three states that is off by a shift from some state on."""
    position = np.zeros((3, 2, 3))
    position[after:] += shift
    state = SimpleNamespace(
        time=np.array([0.0, 0.1, 0.2]),
        position=position,
        velocity=np.zeros((3, 2, 3)),
        angular_velocity=-0.0 * position,
    )
    return SimpleNamespace(observables={}, snapshots={"state": state})


def test_results_differ_from_the_first_bit_on_but_not_by_the_sign_of_zero() -> None:
    assert difference(results(0.0, 1), results(-0.0, 1)) is None
    assert difference(results(0.0, 1), results(1e-300, 1)) == (0.1, 1e-300)
    assert difference(results(0.0, 2), results(2e-3, 2)) == (0.2, 2e-3)


def test_the_page_lists_what_is_left_out_and_every_row(tmp_path: Path) -> None:
    rows = [
        Ablation("gas", "peclet-hertz", "friction", Cost(1.0, 0.9, 1.1, 1e6, 2e8), Cost(1.5, 1.4, 1.6, 2e6, 2e8), True),
        Ablation("gas", "peclet-hertz", EVERYTHING, Cost(1.0), Cost(2.0), False, 0.015, 1e-12, "rounding"),
    ]
    choice = SceneChoice("gas", None, 0, SCENES["gas"]())
    text = render([choice], rows, tmp_path / "ablation.html").read_text()
    for words in ("equal to the bit", "differ from t = 15 ms on", "tangential history", "1 of 2 forced features"):
        assert words in text
    assert rows[0].slowdown == 1.5 and rows[0].plain()["slowdown"] == 1.5


def test_without_a_scene_the_verb_says_what_it_takes(tmp_path: Path) -> None:
    answer = CliRunner().invoke(app, ["ablate", "--out", str(tmp_path / "runs")])
    assert answer.exit_code == 2
    assert not (tmp_path / "runs").exists()
