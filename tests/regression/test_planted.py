"""Planted faults: each is flagged, and reruns of an unchanged tree flag nothing."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import planting
import pytest
from typer.testing import CliRunner

from dembench.cli import app
from dembench.engines import registry
from dembench.engines.in_tree import InTree
from dembench.verification import suites

ENGINES = "peclet[rows=compliant],peclet-hertz"
RERUNS = 10

pytestmark = pytest.mark.slow


@pytest.fixture
def planted_suite(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The suite of the planted faults beside the others."""
    monkeypatch.setattr(suites, "BUILT_IN", {"planted": "planting:suite"})
    suites.suite.cache_clear()
    yield
    suites.suite.cache_clear()


def called(*words: str) -> tuple[int, Any]:
    """Exit code and JSON of a command."""
    done = CliRunner().invoke(app, [*words, "--json"], catch_exceptions=False)
    return done.exit_code, json.loads(done.stdout)


def verified(out: Path) -> Path:
    code, found = called("verify", "--suite", "planted", "--engines", ENGINES, "--out", str(out))
    assert len(found["rows"]) == 8 and code in (0, 1)
    return out


def flagged(runs: Path, baseline: Path) -> set[str]:
    """Names of the metrics that are regressions; the exit code says so, too."""
    code, found = called("check", str(runs), "--baseline", str(baseline))
    names = {v["name"] for v in found["verdicts"] if v["verdict"] in ("regression", "missing", "failed")}
    assert code == (1 if names else 0)
    return names


def test_errors_of_two_per_cent_are_flagged_and_ten_reruns_are_not(
    tmp_path: Path, planted_suite: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    baseline = tmp_path / "baseline.json"
    code, _ = called("bless", str(verified(tmp_path / "first")), "--baseline", str(baseline), "--reason", "first")
    assert code == 0
    for k in range(RERUNS):
        assert not flagged(verified(tmp_path / f"again{k}"), baseline)
    for name, fault in planting.FAULTS.items():
        with monkeypatch.context() as patch:
            patch.setattr(InTree, "write", planting.misreading(InTree, fault))
            assert planting.ANSWERS[name] in flagged(verified(tmp_path / name), baseline), name


def test_a_slowdown_of_a_fifth_is_flagged_and_ten_reruns_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    baseline = tmp_path / "baseline.json"

    def run(out: Path) -> Path:
        code, _ = called("run", "ci", "--no-report", "--out", str(out))
        assert code == 0
        return out

    code, _ = called("bless", str(run(tmp_path / "first")), "--baseline", str(baseline), "--reason", "first")
    assert code == 0
    for k in range(RERUNS):
        assert not flagged(run(tmp_path / f"again{k}"), baseline)
    monkeypatch.setattr(registry, "BUILT_IN", {**registry.BUILT_IN, **planting.SLOW})
    registry.engine.cache_clear()
    try:
        found = called("check", str(run(tmp_path / "slow")), "--baseline", str(baseline))[1]["verdicts"]
    finally:
        registry.engine.cache_clear()
    slow = {v["engine"]: v["verdict"] for v in found if v["name"] == "speed"}
    assert slow == {"peclet": "regression", "peclet-hertz": "regression"}
