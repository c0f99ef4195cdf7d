"""`dembench bench` as a person meets it: rows of engines that fail, usage errors, settings, the page."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from dembench.cli import app
from dembench.runs import environment, scheduler
from dembench.throughput import machine
from dembench.throughput.machine import Machine
from dembench.throughput.scenes import SCENES

LIMITS = Machine(1, 1e10, 4e10, 2e10, 1.0)
ROW = {"scene": str, "engine": str, "cores": int, "settings": dict, "law": str, "contended": bool, "detail": str}
"""What every row has, and of which type it is."""
NUMBERS = ("particle_steps_per_second", "spread", "wall", "core_seconds", "busy")


@pytest.fixture
def bench(standin: Any, small_scene: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Runs the command in an empty directory, on three grains and a ball, on a machine that is known."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(SCENES, "small", lambda initial, progress: small_scene())
    monkeypatch.setattr(machine, "measured", lambda cores: LIMITS)
    for module in (environment, scheduler):  # looking for other load takes a while at each run
        monkeypatch.setattr(module, "busy_shares", lambda cores: {})

    def call(*arguments: str) -> Result:
        return CliRunner().invoke(app, ["bench", *arguments])

    return call


def test_an_engine_that_fails_is_a_row_with_its_reason(bench: Callable[..., Result], standin: Any) -> None:
    standin(standin=["crash", 1])
    done = bench("--scene", "small", "--steps", "100", "--engines", "standin,standin-absent,standin-picky", "--json")
    assert done.exit_code == 1, done.output
    answer = json.loads(done.stdout)
    crashed, absent, picky = answer["rows"]
    for row in answer["rows"]:
        assert {key: type(row[key]) for key in ROW} == ROW
        assert [row[key] for key in NUMBERS] == [None] * len(NUMBERS)
    assert "exit code 3" in crashed["detail"]
    assert "the program standin is not on the path" in absent["detail"]
    assert "all radii must be equal" in picky["detail"]
    page = Path(answer["report"]).read_text()
    assert all(text in page for text in ("exit code 3", "not on the path", "all radii must be equal"))
    assert answer["machine"] == [vars(LIMITS)]


def test_what_an_engine_cannot_do_is_no_failure(bench: Callable[..., Result]) -> None:
    done = bench("--scene", "small", "--engines", "standin-picky")
    assert done.exit_code == 0, done.output
    assert "all radii must be equal" in done.stdout
    assert done.stdout.splitlines()[-1] == "runs/bench/bench.html"


def test_settings_are_printed(bench: Callable[..., Result]) -> None:
    done = bench("--scene", "small", "--engines", "standin-absent[threads=1]")
    assert "standin-absent[threads=1]: dt=1e-05, threads=1" in done.stdout
    assert done.exit_code == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--scene", "bed26k"], "scene 'bed26k' is not known; accepted are bed25k"),
        (["--scene", "small", "--cores", "0"], "--cores 0: accepted are 1 to"),
        (["--scene", "small", "--cores", "1000"], "--cores 1000: accepted are 1 to"),
        (["--scene", "small", "--cores", "a"], "is no list of different whole numbers"),
        (["--scene", "small", "--engines", "standin[dt=1e-6]"], "all engines make that of small"),
        (["--scene", "small", "--repeat", "3"], "--repeat"),
        (["--scene", "small", "--steps", "1"], "--steps"),
        ([], "--scene"),
    ],
)
def test_what_is_asked_for_wrongly_is_code_2_and_nothing_is_written(
    bench: Callable[..., Result], arguments: list[str], said: str
) -> None:
    done = bench(*arguments)
    assert done.exit_code == 2
    assert said in " ".join(done.stderr.split())
    assert not Path("runs").exists()
