"""The page of speeds: the roofline, rates by scene and size, marks, and rows without a rate."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reading import Page

from dembench.reports.throughput import model_table, rate_table, render, roofline, scaling
from dembench.throughput.machine import Machine, least_work
from dembench.throughput.model import fitted
from dembench.throughput.rates import Rate

LIMITS = [Machine(1, 1e10, 4e10, 2e10, 1.0), Machine(2, 1.6e10, 8e10, 4e10, 0.5)]


def row(scene: str, engine: str, speed: float | None, bodies: int = 1000, **more: Any) -> Rate:
    known = {"bodies": bodies, "steps": 100, "dt": 1e-5, "touching": 2.0, "samples": 5, "settings": {"dt": 1e-5}}
    if speed:
        known |= {"spread": 0.02, "slowest": 0.99 * speed, "fastest": 1.01 * speed, "wall": 1.0, "core_seconds": 1.0}
    return Rate(scene, engine, more.pop("cores", 1), speed, **{**known, **more})


ROWS = [
    row("bed25k", "alpha", 2e6),
    row("bed25k", "beta", 6e6, contended=True, busy=0.5),
    row("bed25k", "gamma", 1e6, law="a law of its own"),
    row("bed25k", "alpha", 3e6, cores=2),
    row("scaling-1k", "alpha", 2e6),
    row("scaling-5k", "alpha", 2.5e6, bodies=5000),
    row("scaling-5k", "beta", None, bodies=5000, detail="failed: signal: SIGSEGV ended it", samples=0),
]


def test_the_page_has_every_row_with_its_marks_and_reasons(tmp_path: Path) -> None:
    page = Page(render(ROWS, LIMITS, tmp_path / "bench.html").read_text(encoding="utf-8"))
    shown = "".join(page.text)
    for words in (
        "failed: signal: SIGSEGV ended it",
        "a law of its own",
        "dt=1e-05",
        "the limits are understated",
        "roof understated",
    ):
        assert words in shown
    assert "1 of 7 rates were disturbed" in shown
    assert set(page.figures) == {"roofline", "scaling"}


def test_ratios_are_to_the_slowest_of_the_same_law_on_as_many_cores() -> None:
    table = rate_table("bed25k", ROWS[:4], LIMITS)
    (place,) = [k for k, column in enumerate(table.columns) if column.title == "Ratio"]
    assert [line[place].value for line in table.rows] == [1.0, 3.0, None, 1.0]
    assert [line[0].flags for line in table.rows] == ["", "c", "l", ""]
    (share,) = [k for k, column in enumerate(table.columns) if column.title == "Of the roof"]
    assert table.rows[0][share].value == pytest.approx(100 * 2e6 / LIMITS[0].attainable(least_work(2.0)))


def test_a_point_of_the_roofline_is_the_least_work_at_the_measured_rate() -> None:
    plot = roofline(ROWS, LIMITS, "dembench bench")
    assert [panel.title for panel in plot.panels] == ["bed25k", "scaling-5k"]
    work, point = least_work(2.0), plot.panels[0].lines[0]
    assert (point.x[0], point.y[0]) == pytest.approx((work.intensity, work.flops * 2e6 / 1e9))
    roof = plot.panels[0].known[0]
    assert np.interp(2.0, roof.x, roof.y) == pytest.approx(20.0), "slope and level part meet at 2 operations per byte"
    assert roof.y[0] == pytest.approx(10.0 * roof.x[0]) and roof.y[-1] == pytest.approx(20.0)


def test_sizes_without_a_rate_leave_the_curve() -> None:
    sized = [r for r in ROWS if r.scene.startswith("scaling")]
    plot = scaling(sized, LIMITS, [], "dembench bench")
    (curve,) = plot.panels[0].lines
    assert list(curve.x) == [1000, 5000] and list(curve.y) == [2.0, 2.5]
    assert [known.label for known in plot.panels[0].known] == ["roof of 1 core", "roof of 2 cores"]


def test_the_model_is_drawn_with_its_engine_and_tabled(tmp_path: Path) -> None:
    """A rate of 2 and 2.5 million at 1000 and 5000 bodies: 375 ns for each body, and 125 µs for each step."""
    rows = [
        row("scaling-1k", "alpha", 2e6),
        row("scaling-5k", "alpha", 2.5e6, bodies=5000),
        row("scaling-25k", "alpha", 1 / (375e-9 + 125e-6 / 25e3), bodies=25_000),
    ]
    (model,) = fitted(rows, None)
    plot = scaling(rows, LIMITS, [model], "dembench bench")
    curve, drawn = plot.panels[0].lines
    assert drawn.label == "alpha, 1 core, model" and drawn.colour == curve.colour and curve.points and not drawn.points
    assert np.interp([1000, 5000, 25_000], drawn.x, drawn.y) == pytest.approx(curve.y, rel=1e-3)
    table = model_table([model], 16e9)
    values = {column.title: cell.value for column, cell in zip(table.columns, table.rows[0], strict=True)}
    assert values["Body"] == pytest.approx(375) and values["Step"] == pytest.approx(125)
    assert values["Pair"] is None and values["Not divided"] is None
    page = Page(render(rows, LIMITS, tmp_path / "bench.html").read_text(encoding="utf-8"))
    assert "Model of the time of a step" in "".join(page.text)
