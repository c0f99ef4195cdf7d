"""`check`, `bless`, `history` and `compare` on runs of the stand-in engine, which falls as it is told to."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import standin as standins
from planting import FAULTS, misreading
from typer.testing import CliRunner, Result

from dembench.cli import app
from dembench.regression.gather import gather
from dembench.scene import save_scene
from dembench.verification import suites

BASELINE = ("--baseline", "ci.json")


@pytest.fixture
def call(
    standin: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[..., Result]]:
    """Calls dembench in an empty directory, with the suite of falling spheres and the stand-in engines."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(suites, "BUILT_IN", {"falling": "falling:suite"})
    suites.suite.cache_clear()
    yield lambda *words: CliRunner().invoke(app, [str(word) for word in words])
    suites.suite.cache_clear()


def verified(call: Callable[..., Result], out: str) -> str:
    call("verify", "--engines", "standin", "--out", out, "--json")
    return out


def verdicts(done: Result) -> dict[str, str]:
    return {v["name"]: v["verdict"] for v in json.loads(done.stdout)["verdicts"]}


def test_an_unchanged_tree_is_fine_and_two_per_cent_more_gravity_is_not(
    call: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = verified(call, "first")
    assert call("bless", runs, *BASELINE, "--reason", "first values").exit_code == 0
    same = call("check", verified(call, "second"), *BASELINE, "--json")
    assert same.exit_code == 0 and verdicts(same) == {"F1": "ok", "F2": "ok", "F3": "ok"}
    monkeypatch.setattr(standins.StandIn, "write", misreading(standins.StandIn, FAULTS["g"]))
    files = ("--junit", "out/check.xml", "--markdown", "out/check.md")
    found = call("check", verified(call, "heavier"), *BASELINE, "--json", *files)
    assert found.exit_code == 1
    assert verdicts(found) == {"F1": "regression", "F2": "regression", "F3": "ok"}
    assert len(ElementTree.parse("out/check.xml").findall(".//failure")) == 2
    assert "2 regressions, 1 ok" in Path("out/check.md").read_text()
    assert "2 regressions, 1 ok" in call("check", "heavier", *BASELINE).output


def test_a_failed_run_is_a_regression_and_is_not_blessed(call: Callable[..., Result], standin: Any) -> None:
    runs = verified(call, "first")
    call("bless", runs, *BASELINE, "--reason", "first values")
    standin(standin=["crash", 0])
    broken = verified(call, "broken")
    found = call("check", broken, *BASELINE, "--json")
    assert found.exit_code == 1 and "failed" in verdicts(found).values()
    before = Path("ci.json").read_bytes()
    refused = call("bless", broken, *BASELINE, "--reason", "why not")
    assert refused.exit_code == 2 and "failed are not blessed" in refused.output
    assert Path("ci.json").read_bytes() == before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("check", "none", *BASELINE), "holds no runs"),
        (
            ("check", "first", "--baseline", "none.json"),
            "error: none.json: No such file or directory; `dem",
        ),
        (("bless", "first", *BASELINE, "--reason", " "), "needs a reason"),
        (("check", "ci.toml.json", *BASELINE), "no result of pytest-benchmark"),
        (("compare", "first", "first", "--margin", "F1"), "is no margin"),
        (("compare", "first", "first", "--margin", "F9=2%"), "no metric that both have is called 'F9'"),
        (("compare", "first", "none"), "holds no runs"),
        (("history", "show", "--store", "none"), "has no history"),
    ],
)
def test_usage_errors_say_what_to_do(call: Callable[..., Result], words: tuple[str, ...], message: str) -> None:
    call("bless", verified(call, "first"), *BASELINE, "--reason", "first values")
    Path("ci.toml.json").write_text("[]")
    done = call(*words)
    assert done.exit_code == 2 and message in done.output


def test_of_two_versions_in_one_directory_the_later_counts(
    call: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    verified(call, "runs")
    monkeypatch.setattr(standins.StandIn, "probe", lambda self: standins.Probe(available=True, version="2.0"))
    monkeypatch.setattr(standins.StandIn, "write", misreading(standins.StandIn, FAULTS["g"]))
    verified(call, "runs")
    found = gather([Path("runs")])
    assert [record.spec.engine_version for record in found.runs] == ["2.0"]
    assert found.metrics[0].value == pytest.approx(-0.05 * 1.02)


def test_names_of_trials_tell_suites_apart() -> None:
    """Runs are assigned to suites by the names of their trials: no two suites may share one."""
    names = [t.name for s in suites.names() for e in suites.suite(s).experiments for t in e.trials]
    assert sorted(set(names)) == sorted(names)


def test_speeds_are_those_of_runs_beside_the_reference_workload(call: Callable[..., Result], small_scene: Any) -> None:
    save_scene(small_scene(), Path("small.json"))
    run = ("run", "small.json", "--engines", "standin", "--no-report", "--json")
    assert call(*run, "--out", "plain").exit_code == 0
    assert gather([Path("plain")]).metrics == ()
    assert call(*run, "--out", "timed", "--workload").exit_code == 0
    (speed,) = gather([Path("timed")]).metrics
    assert (speed.kind, speed.key.problem, speed.key.engine, len(speed.values)) == ("speed", "small.json", "standin", 1)
    assert all(value > 0 for value in speed.values) and speed.key.processor


def test_sets_are_compared_with_a_margin(call: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
    verified(call, "a")
    same = call("compare", "a", "a", "--margin", "F1=1%", "--json")
    assert same.exit_code == 0
    assert {c["verdict"] for c in json.loads(same.stdout)["comparisons"]} == {"indistinguishable"}


def test_a_history_grows_by_sets_of_runs(call: Callable[..., Result]) -> None:
    verified(call, "a")
    assert json.loads(call("history", "add", "a", "--json").stdout)["added"] == 3
    again = json.loads(call("history", "add", "a", "--json").stdout)
    assert (again["added"], again["known"]) == (0, 3)
    assert call("history", "show").exit_code == 0
    assert "3 metrics of 1 sets of runs" in Path("history/trends.html").read_text()
    assert call("history", "show", "-o", "other.html").exit_code == 0 and Path("other.html").is_file()
