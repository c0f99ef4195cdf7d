"""One rendered page, with runs in every state, that all tests of this folder read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from synthetic import STAND_INS, every_state

from dembench.engines import registry
from dembench.reports.report import render
from dembench.runs.directory import find_runs


@pytest.fixture(scope="session")
def stand_ins() -> Iterator[None]:
    """Registers the stand-in engines."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "BUILT_IN", dict(STAND_INS))
        registry.engine.cache_clear()
        yield
    registry.engine.cache_clear()


@pytest.fixture(scope="session")
def runs(stand_ins: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with runs in every state."""
    return every_state(tmp_path_factory.mktemp("campaign"))


@pytest.fixture(scope="session")
def page(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of these runs."""
    return render(find_runs(runs), tmp_path_factory.mktemp("page") / "report.html")
