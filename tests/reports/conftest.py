"""One rendered page, with runs in every state, that all tests of this folder read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from synthetic import every_state, registered

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
