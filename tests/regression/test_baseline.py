"""Baselines: what a blessing writes, keeps and refuses, and files that are none."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from making import DATE, blessed, gathered, metric, speed

from dembench.regression import RegressionError
from dembench.regression.baseline import Baseline, load, save
from dembench.regression.bless import bless
from dembench.regression.metrics import Key, parse_margin
from dembench.runs.directory import RunRecord
from dembench.runs.spec import RunSpec


def test_a_baseline_survives_its_file(tmp_path: Path) -> None:
    made = blessed(metric("depth", 1.0, 1.02, target=1.0), speed([1.0, 1.01, 1.02]))
    save(made, tmp_path / "new" / "ci.json")
    assert load(tmp_path / "new" / "ci.json") == made
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["ci.json"]


def test_a_blessing_shows_what_it_changes_and_keeps_the_reasons() -> None:
    first = blessed(metric("depth", 1.0), metric("period", 2.0), metric("rate", 3.0))
    found = gathered(metric("depth", 1.5), metric("period", 2.001), metric("count", 7.0))
    second = bless(found, first, "another law", DATE)
    assert [b.reason for b in second.blessings] == ["first values", "another law"]
    assert [change.word for change in second.blessings[1].changes] == ["added", "changed", "removed"]
    assert "1 -> 1.5 m (+50%)" in second.blessings[1].changes[1].text()
    by_name = {e.name: e for e in second.metrics}
    assert by_name["depth"].value == 1.5 and by_name["depth"].blessing == 1
    assert by_name["period"].value == 2.0, "what changes by less than the tolerance does not drift"
    assert by_name["period"].blessing == 0


def test_tolerances_that_a_person_set_are_kept() -> None:
    first = blessed(metric("depth", 1.0))
    own = first.metrics[0].model_copy(update={"tolerance": parse_margin("5%"), "worse": "lower"})
    second = bless(gathered(metric("depth", 2.0)), first.model_copy(update={"metrics": (own,)}), "deeper", DATE)
    (found,) = second.metrics
    assert (found.value, found.tolerance, found.worse) == (2.0, parse_margin("5%"), "lower")


def test_speeds_on_other_processors_are_kept() -> None:
    first = blessed(speed([1.0, 1.01, 1.02], "old"))
    second = bless(gathered(speed([2.0, 2.01, 2.02], "new")), first, "another machine", DATE)
    assert {e.processor: e.value for e in second.metrics} == {"old": 1.0, "new": 2.0}


def failed_run(directory: Path) -> RunRecord:
    """A run that ended without a result."""
    directory.mkdir()
    spec = RunSpec(case="case3", preset="quick", engine="standin", scene_digest="0", scene_name="small")
    (directory / "spec.json").write_text(json.dumps({**spec.model_dump(mode="json"), "hash": spec.digest()}))
    (directory / "status.json").write_text(json.dumps({"state": "failed", "reason": "unstable"}))
    return RunRecord(directory)


def test_what_is_not_whole_is_refused(tmp_path: Path) -> None:
    whole = gathered(metric("depth", 1.0))
    with pytest.raises(RegressionError, match="needs a reason"):
        bless(whole, Baseline(), "  ", DATE)
    with pytest.raises(RegressionError, match=r"not measured.*depth \(failed\)"):
        bless(gathered(metric("depth", state="failed")), Baseline(), "why", DATE)
    with pytest.raises(RegressionError, match="nothing that could be expected"):
        bless(gathered(), Baseline(), "why", DATE)
    broken = type(whole)(whole.metrics, runs=(failed_run(tmp_path / "run"),))
    with pytest.raises(RegressionError, match=r"failed are not blessed: run \(failed: unstable\)"):
        bless(broken, Baseline(), "why", DATE)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": 2}, "version"),
        ({"metrics": [{"problem": "p"}]}, "metrics.0.name"),
        ({"more": 1}, "more"),
    ],
)
def test_a_file_that_is_no_baseline_is_refused(tmp_path: Path, change: dict[str, object], message: str) -> None:
    path = tmp_path / "ci.json"
    path.write_text(json.dumps({**json.loads(blessed(metric("depth", 1.0)).model_dump_json()), **change}))
    with pytest.raises(RegressionError, match=message):
        load(path)


def test_a_metric_that_stands_twice_is_refused(tmp_path: Path) -> None:
    one = blessed(metric("depth", 1.0))
    save(one.model_copy(update={"metrics": one.metrics * 2}), tmp_path / "ci.json")
    with pytest.raises(RegressionError, match="more than once"):
        load(tmp_path / "ci.json")


def test_keys_read_as_a_path() -> None:
    assert str(Key("case3, quick", "standin", "depth")) == "case3, quick / standin / depth"
