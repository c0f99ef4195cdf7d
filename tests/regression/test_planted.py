"""Planted faults: what a workflow runs flags each of them against the baseline that ships, and reruns flag nothing."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import planting
import pytest
from typer.testing import CliRunner
from workflows import commands, variables

from dembench.cli import app
from dembench.engines import registry
from dembench.engines.in_tree import InTree
from dembench.share import share

WORKFLOW = "github.yml"
SHIPPED = share(*variables(WORKFLOW)["BASELINE"].split("/"))
RERUNS = 10

pytestmark = pytest.mark.slow


def called(*words: str) -> tuple[int, Any]:
    """Exit code and JSON of a command."""
    done = CliRunner().invoke(app, [*words, "--json"], catch_exceptions=False)
    return done.exit_code, json.loads(done.stdout)


def workflow(out: Path, verbs: Iterable[str] = ("run", "verify"), *more: str) -> list[str]:
    """Does what the workflow does by these verbs, and gives the directories of the runs."""
    found = []
    for words in (words for words in commands(WORKFLOW) if words[0] in verbs):
        place = words.index("--out") + 1
        engines = [variables(WORKFLOW)["ENGINES"] if word == "$ENGINES" else word for word in words]
        found.append(str(out / engines[place]))
        own = ["--no-report", *more] if words[0] == "run" else []
        code, _ = called(*engines[:place], found[-1], *engines[place + 1 :], *own)
        assert code in (0, 1), words
    return found


def verdicts(runs: list[str], baseline: Path) -> list[Any]:
    """What a check says; the exit code says whether something is a regression."""
    code, found = called("check", *runs, "--baseline", str(baseline))
    assert code == (1 if found["regression"] else 0)
    return list(found["verdicts"])


def regressions(found: list[Any]) -> set[tuple[str, str]]:
    """Engines and names of the metrics that became worse; speeds are left out, since one repeat has none."""
    return {(v["engine"], v["name"]) for v in found if v["verdict"] == "regression" and v["name"] != "speed"}


@pytest.mark.parametrize("name", planting.FAULTS)
def test_each_fault_of_each_engine_is_flagged(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(InTree, "write", planting.misreading(InTree, planting.FAULTS[name]))
    found = regressions(verdicts(workflow(tmp_path, ("run", "verify"), "--repeat", "1"), SHIPPED))
    assert {engine for engine, _ in found} == set(variables(WORKFLOW)["ENGINES"].split(","))


def test_two_per_cent_more_gravity_show_in_the_recipe_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(InTree, "write", planting.misreading(InTree, planting.FAULTS["g"]))
    found = regressions(verdicts(workflow(tmp_path, ("run",), "--repeat", "1"), SHIPPED))
    assert ("peclet", "free_fall") in found


def test_a_slowdown_of_a_fifth_is_flagged_and_ten_reruns_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Speeds are known per processor: that of this machine is added to what ships."""
    baseline = Path(shutil.copy(SHIPPED, tmp_path / "ci.json"))
    code, _ = called("bless", *workflow(tmp_path / "first"), "--baseline", str(baseline), "--reason", "this processor")
    assert code == 0
    for k in range(RERUNS):
        runs = workflow(tmp_path / f"again{k}")
        assert not [v for v in verdicts(runs, baseline) if v["verdict"] in ("regression", "missing", "failed")]
    monkeypatch.setattr(registry, "BUILT_IN", {**registry.BUILT_IN, **planting.SLOW})
    registry.engine.cache_clear()
    try:
        found = verdicts(workflow(tmp_path / "slow", ("run",)), baseline)
    finally:
        registry.engine.cache_clear()
    slow = {v["engine"]: v["verdict"] for v in found if v["name"] == "speed"}
    assert slow == {"peclet": "regression", "peclet-hertz": "regression"}
