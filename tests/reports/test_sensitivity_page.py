"""The page of a study of sensitivity, on made-up runs: one engine feels the parameter, the other does not."""

from __future__ import annotations

from pathlib import Path

import pytest
from reading import Page
from synthetic import add_run, impact, registered, series

from dembench.recipes import Page as Shown
from dembench.recipes import Recipe
from dembench.reports import sensitivity, study
from dembench.reports.variants import problems
from dembench.runs.directory import find_runs

FRICTIONS, SEEDS = (0.0, 0.3, 0.9), (0, 1)
DEEPEST, EFFECT, SCATTER = -0.14, 0.02, 1e-4
"""Deepest point [m] without friction, what friction 1 adds to it, and what a seed adds."""
RECIPE = Recipe(
    title="Friction",
    cases=("case3",),
    preset="published",
    parameters={"friction": list(FRICTIONS)},
    seeds=SEEDS,
    runs=[{"engines": ["beta", "gamma"]}],
    sensitivity={"parameter": "friction", "must_vary": ["deepest"]},
    page=Shown(quantities=("deepest",)),
)


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Page:
    with registered():
        return _page(tmp_path_factory.mktemp("sensitivity"))


def _page(tmp_path: Path) -> Page:
    for friction in FRICTIONS:
        for seed in SEEDS:
            scene = impact().model_copy(update={"name": f"friction{round(100 * friction)}_{seed}"})
            for engine, felt in (("beta", friction), ("gamma", 0.0)):
                recorded = series(scene, DEEPEST + EFFECT * felt + SCATTER * seed, 1.0)
                add_run(tmp_path, scene, engine, observables=recorded, case=f"case3[friction={friction}]", seed=seed)
    assert RECIPE.sensitivity is not None and RECIPE.page is not None
    found = problems([(RECIPE.runs[0], find_runs(tmp_path))], "friction")
    findings = sensitivity.findings(RECIPE.sensitivity, found)
    page = study.render(RECIPE, RECIPE.page, found, findings, tmp_path / "study.html", "dembench run friction")
    return Page(page.read_text())


def test_the_flat_curve_is_flagged_and_the_other_is_not(read: Page) -> None:
    _, *rows = read.tables["scene1-sensitivity"]
    assert {row[1].text: row[2].text for row in rows} == {"beta": "varies", "gamma": "flat"}
    changes = {row[1].text: float(row[3].value or "nan") for row in rows}
    assert changes == pytest.approx({"beta": 0.9 * EFFECT, "gamma": 0.0}, abs=1e-5)
    text = "".join(read.text)
    assert "gamma: deepest point of the ball, 1 ms samples stays FLAT where it must vary with friction" in text
    assert "beta: deepest point" not in text


def test_all_values_of_the_parameter_are_one_problem_with_a_row_each(read: Page) -> None:
    _, *rows = read.tables["scene1-variants"]
    assert [(row[0].value, row[1].value) for row in rows] == [
        (engine, str(friction)) for engine in ("beta", "gamma") for friction in FRICTIONS
    ]
    assert {row[3].text for row in rows} == {"2"}


def test_quantities_are_drawn_over_the_parameter_with_the_range_of_the_seeds(read: Page) -> None:
    (panel,) = read.figures["scene1-sensitivity-curves"].data["panels"]
    lines = {line["label"]: line for line in panel["lines"]}
    assert lines["beta"]["x"] == list(FRICTIONS)
    means = [1e3 * (DEEPEST + EFFECT * f + SCATTER / 2) for f in FRICTIONS]
    assert lines["beta"]["y"] == pytest.approx(means, abs=0.01)
    spread = [high - low for low, high in zip(lines["beta"]["low"], lines["beta"]["high"], strict=True)]
    assert spread == pytest.approx([1e3 * SCATTER] * 3, rel=1e-3)
