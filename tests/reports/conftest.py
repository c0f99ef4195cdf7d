"""One rendered page, with runs in every state, that all tests of this folder read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from synthetic import every_state, registered
from synthetic_bulk import add_bulk_run, silo_record, silo_scene

from dembench.reports.report import render
from dembench.runs.directory import find_runs


@pytest.fixture(autouse=True)
def stand_ins() -> Iterator[None]:
    """Registers the stand-in engines, for the tests of this folder alone."""
    with registered():
        yield


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with runs in every state."""
    with registered():
        return every_state(tmp_path_factory.mktemp("campaign"))


@pytest.fixture(scope="session")
def page(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of these runs."""
    with registered():
        return render(find_runs(runs), tmp_path_factory.mktemp("page") / "report.html")


@pytest.fixture(scope="session")
def silo_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two engines on a silo, one of which ended early."""
    out = tmp_path_factory.mktemp("silo")
    with registered():
        scene = silo_scene()
        add_bulk_run(out / "runs", scene, "alpha", silo_record(scene, 400), "case1")
        short = silo_record(scene, 500, until=0.4)
        add_bulk_run(out / "runs", scene, "beta", short, "case1", state="timeout", reason="time limit")
        return render(find_runs(out / "runs"), out / "silo.html")
