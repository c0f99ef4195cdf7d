"""From a request to verdicts."""

from __future__ import annotations

import pytest
from conftest import falling_frames, falling_tracks

from dembench import campaign
from dembench.results import Observer, Result
from dembench.runs.plan import EngineChoice, RequestError, SceneChoice, plan


@pytest.mark.parametrize(
    ("text", "value"), [("90", 90), ("45s", 45), ("1.5m", 90), ("2h", 7200), (" .5 d ", 43200), ("0.04", 0.04)]
)
def test_times(text, value):
    assert campaign.seconds(text) == pytest.approx(value)


@pytest.mark.parametrize("text", ["", "h", "-3", "0", "1e3x", "2 weeks", "nan"])
def test_what_is_no_time(text):
    with pytest.raises(RequestError, match="is no time"):
        campaign.seconds(text)


def _judged(scene, happened, out, case="case3", preset="quick"):
    """Verdict on a run of `scene` in which `happened` took place."""
    (run,) = plan([SceneChoice(case, preset, 0, scene)], [EngineChoice("standin")], out)
    observer = Observer(scene)
    observer.update(falling_frames(happened, 1e-5), falling_tracks(happened, 1e-5))
    return campaign.judge(run, Result(scene, "standin", "closed", observables=observer.observed()))


def test_a_ball_that_falls_too_fast_is_inaccurate_and_the_verdict_says_why(standin, small_scene, tmp_path):
    right = _judged(small_scene(), small_scene(), tmp_path)
    assert right.state == "ok" and not right.scored, "necessary conditions prove nothing about the impact"
    wrong = _judged(small_scene(), small_scene(gravity=(0, 0, -30.0)), tmp_path)
    assert wrong.state == "inaccurate"
    assert "potential energy" in wrong.detail and "is outside -inf to" in wrong.detail


def test_a_scene_file_has_no_references(standin, small_scene, tmp_path):
    wrong = _judged(small_scene(), small_scene(gravity=(0, 0, -30.0)), tmp_path, "small.json", None)
    assert (wrong.state, wrong.scored) == ("ok", False)
