"""Planned runs of the stand-in engines, and what happens to them."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

from dembench.runs.directory import RunRecord, find_runs
from dembench.runs.environment import available_cores
from dembench.runs.plan import EngineChoice, PlannedRun, SceneChoice, plan
from dembench.runs.states import Status
from dembench.runs.supervise import Supervisor
from dembench.scene import Scene

CORES = available_cores()[:1]


def planned_runs(
    scene: Scene, out: Path, *engines: str, timeout: float | None = None, repeats: int = 1, **settings: str
) -> list[PlannedRun]:
    """One run per engine, all with the same settings."""
    choices = [EngineChoice(name, settings) for name in engines]
    return plan([SceneChoice("small.json", None, 0, scene)], choices, out, timeout=timeout, repeats=repeats)


def supervise(run: PlannedRun, stop: threading.Event | None = None, **options: Any) -> Status:
    """Carries a run out in this thread."""
    return Supervisor(run, CORES, stop or threading.Event(), **options).run()


def only_record(run: PlannedRun) -> RunRecord:
    """The run as others read it."""
    return find_runs(run.directory.path)[0]


def pids(run: PlannedRun) -> list[int]:
    """Processes of a stand-in engine that hangs; none before it does."""
    path = run.directory.deck / "pids"
    return [int(pid) for pid in path.read_text().split()] if path.exists() and path.read_text() else []
