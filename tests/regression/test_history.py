"""The history: appended once, refused where it is none; its page draws what moved and marks what was blessed."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making import gathered, metric, speed

from dembench.regression import RegressionError
from dembench.regression.baseline import Baseline
from dembench.regression.bless import bless
from dembench.regression.gather import Gathered
from dembench.regression.history import FILE, Line, add, lines_of, read
from dembench.reports.trends import render


def a_set(day: int, rate: float, depth: float, pace: float = 80.0) -> Gathered:
    """Three metrics of one engine, made on a day of a commit of its own."""
    rng = np.random.default_rng(day)
    found = gathered(
        metric("discharge_rate", *rng.normal(rate, 60, 3), unit="s-1", title="Discharge rate"),
        metric("depth", depth, title="Depth of the crater"),
        speed(list(pace * (1 + rng.exponential(0.03, 8)))),
    )
    return replace(found, versions={"commit": f"{day:07x}abcdef"})


def date(day: int) -> str:
    return f"2026-03-{day:02d}T10:00:00+00:00"


def test_a_set_of_runs_is_added_once(tmp_path: Path) -> None:
    first = lines_of(a_set(1, 23000, -0.12), date(1))
    assert add(tmp_path / "store", first) == 3
    assert add(tmp_path / "store", first) == 0
    assert add(tmp_path / "store", lines_of(a_set(2, 23000, -0.12), date(2))) == 3
    found = read(tmp_path / "store")
    assert found[:3] == first and [line.commit for line in found[::3]] == ["0000001abcdef", "0000002abcdef"]
    assert isinstance(found[0], Line)


def test_an_empty_directory_has_no_history(tmp_path: Path) -> None:
    assert read(tmp_path) == []


@pytest.mark.parametrize("spoil", [lambda text: text.replace("spread", "sprawl"), lambda text: text + "a,b\n"])
def test_a_table_that_is_no_history_is_refused(tmp_path: Path, spoil: object) -> None:
    add(tmp_path, lines_of(a_set(1, 23000, -0.12), date(1)))
    path = tmp_path / FILE
    path.write_text(spoil(path.read_text()))  # type: ignore[operator]
    with pytest.raises(RegressionError, match="no history"):
        add(tmp_path, lines_of(a_set(2, 23000, -0.12), date(2)))


def a_history(directory: Path) -> Baseline:
    """Eight days: the rate steps up on day 5 and is blessed then, the solver gets faster on day 7."""
    baseline = Baseline()
    for day in range(1, 9):
        found = a_set(day, 23000 if day < 5 else 24100, -0.12, 80 if day < 7 else 62)
        add(directory, lines_of(found, date(day)))
        if day in (1, 5):
            reason = "first values" if day == 1 else "walls turn with the drum"
            baseline = bless(found, baseline, reason, date(day).replace("T10", "T11"))
    return baseline


def test_the_page_shows_what_moved_and_what_was_blessed(tmp_path: Path) -> None:
    baseline = a_history(tmp_path)
    page = render(read(tmp_path), baseline, tmp_path / "trends.html").read_text()
    assert "3 metrics of 8 sets of runs, 2026-03-01 to 2026-03-08" in page
    assert "walls turn with the drum" in page and "What did not move is in the table only (1)" in page
    data = re.findall(r'<script type="application/json">(.*?)</script>', page)
    assert len(data) == 1 and data[0].count('"measured') == 2, "the depth that never moved is not drawn"


def test_a_history_of_one_set_without_a_baseline_has_a_page(tmp_path: Path) -> None:
    add(tmp_path, lines_of(a_set(1, 23000, -0.12), date(1)))
    page = render(read(tmp_path), None, tmp_path / "trends.html").read_text()
    assert "3 metrics of 1 sets of runs" in page and "Blessings" not in page
