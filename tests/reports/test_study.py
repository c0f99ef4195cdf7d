"""The page of a study, on made-up runs: means over seeds, differences from the references, failures as rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from reading import Page
from synthetic import add_run, impact, registered, series

from dembench.recipes import Page as Shown
from dembench.recipes import Recipe
from dembench.reports import study
from dembench.reports.variants import problems
from dembench.runs.directory import find_runs

PAGE = Shown(
    figures=("ball_displacement",),
    curves=("ball_displacement",),
    start=0.02,
    quantities=("deepest", "deepest_time", "speed_35ms", "energy_rise"),
    costs=("deepest", "speed_35ms"),
)
RECIPE = Recipe(
    title="A study",
    text="What it is about.",
    cases=("case3[bed=25k]",),
    preset="published",
    runs=[
        {"engines": ["beta"], "title": "sweeps", "settings": {"sweeps": [8, 32]}, "division": "open"},
        {"engines": ["gamma"], "title": "substeps", "settings": {"substeps": [1, 2]}},
        {"engines": ["alpha"], "reference": True},
    ],
    page=PAGE,
)


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Page:
    with registered():
        return _page(tmp_path_factory.mktemp("study"))


def _page(tmp_path: Path) -> Page:
    scene = impact()
    add_run(tmp_path, scene, "alpha", observables=series(scene, -0.1380, 2.4), loop=900.0)
    for sweeps, deepest, loop in (("8", -0.1400, 40.0), ("32", -0.1390, 80.0)):
        rebound = series(scene, deepest, 1.0)
        chosen = {"overrides": {"sweeps": sweeps}, "division": "open"}
        add_run(tmp_path, scene, "beta", observables=rebound, loop=loop, **chosen)
    add_run(tmp_path, scene, "gamma", observables=series(scene, -0.1382, 2.2), loop=60.0, overrides={"substeps": "1"})
    add_run(tmp_path, scene, "gamma", "failed", reason="nan", detail="no number", overrides={"substeps": "2"})
    runs = find_runs(tmp_path)
    found = problems([(block, [r for r in runs if r.spec.engine in block.engines]) for block in RECIPE.runs])
    page = study.render(RECIPE, PAGE, found, [], tmp_path / "study.html", "dembench run a-study")
    return Page(page.read_text())


def test_every_variant_has_a_row_in_the_order_of_the_recipe(read: Page) -> None:
    head, *rows = read.tables["scene1-variants"]
    assert [row[0].value for row in rows[:-1]] == [
        "beta[sweeps=8]",
        "beta[sweeps=32]",
        "gamma[substeps=1]",
        "gamma[substeps=2]",
        "alpha",
    ]
    deepest = next(k for k, cell in enumerate(head) if cell.text.startswith("Deepest point"))
    assert [float(row[deepest].value or "nan") for row in rows[:-1]] == pytest.approx(
        [-140.0, -139.0, -138.2, np.nan, -138.0], abs=0.05, nan_ok=True
    )
    assert [row[1].text == "failed" for row in rows[:-1]] == [False, False, False, True, False]
    assert rows[4][0].text.endswith("reference")
    assert [row[2].text for row in rows[:5]] == ["1", "1", "1", "0 of 1", "1"]


def test_what_was_published_stands_below_the_variants(read: Page) -> None:
    """Mean of eight codes -0.13845 m and the band of every code's mean with two of its standard deviations."""
    head, *rows = read.tables["scene1-variants"]
    deepest = next(k for k, cell in enumerate(head) if cell.text.startswith("Deepest point"))
    assert rows[-1][0].text == "references"
    assert float(rows[-1][deepest].value or "nan") == pytest.approx(-138.45, abs=0.05)
    assert rows[-1][deepest].text.endswith("[1]")
    assert "mean of 8 codes over ten initial conditions" in "".join(read.text)


def test_errors_are_differences_from_the_references_against_run_time(read: Page) -> None:
    data = read.figures["scene1-costs"].data
    assert data["axes"]["wide"][0]["log_x"]
    deepest = {line["label"]: line for line in data["panels"][0]["lines"]}
    assert deepest["sweeps"]["x"] == [40, 80]
    assert deepest["sweeps"]["y"] == pytest.approx([-2.0, -1.0], abs=0.05)
    assert deepest["substeps"]["x"] == [60]
    assert deepest["alpha"]["y"] == [0]
    assert data["panels"][0]["label"] == "Difference [mm]"


def test_curves_stand_in_one_panel_per_family_with_the_band_of_the_references(read: Page) -> None:
    data = read.figures["scene1-ball-displacement-curves"].data
    assert [panel["label"] for panel in data["panels"]] == ["Displacement [mm]"] * 2
    assert data["panels"][0]["lines"][0]["x"][0] == 20
    assert [line["label"] for line in data["panels"][0]["lines"]] == ["sweeps: 8", "sweeps: 32"]
    for panel in data["panels"]:
        (band,) = panel["known"]
        assert min(band["y"]) == pytest.approx(-138, abs=0.1)


def test_figures_of_the_common_report_and_published_run_times_stand_beside(read: Page) -> None:
    """Both divisions are in one figure: the label says which."""
    (panel,) = read.figures["scene1-ball-displacement"].data["panels"]
    labels = {line["label"] for line in panel["lines"]}
    assert {"beta[sweeps=8], open", "gamma[substeps=1], closed", "alpha, closed"} <= labels
    assert read.tables["scene1-published-times"]


def test_what_failed_is_listed_and_the_command_is_given(read: Page) -> None:
    text = "".join(read.text)
    assert "no number" in text and "dembench run a-study" in text
    assert "5 runs: " in text and "1 failed" in text
