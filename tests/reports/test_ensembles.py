"""Several seeds of an engine: spreads as numpy has them, one row per engine, one line with a band."""

from __future__ import annotations

import numpy as np
import pytest
from reading import Page
from synthetic import add_run, impact, registered, series

from dembench.reports.report import render
from dembench.runs.directory import find_runs
from dembench.scene import Bodies, Scene

DEEPEST = {"alpha": [-0.1384, -0.1386, -0.1381, -0.1385], "beta": [-0.1391, -0.1388, -0.1390, -0.1450]}


def seeded(seed: int) -> Scene:
    """The impact scene with grains moved by a micrometre."""
    scene = impact(0.1).model_copy(update={"name": "case3_25k_generated"})
    moved = scene.bodies.position + 1e-6 * seed
    return scene.model_copy(
        update={"bodies": Bodies(position=moved, species=scene.bodies.species, velocity=scene.bodies.velocity)}
    )


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    """Four seeds of two engines, one of beta far too deep, and one seed of gamma."""
    out = tmp_path_factory.mktemp("seeds")
    with registered():
        for engine, depths in DEEPEST.items():
            for seed, depth in enumerate(depths):
                found = series(seeded(seed), depth, 1.25 + 0.02 * seed)
                add_run(out, seeded(seed), engine, observables=found, loop=100.0 + seed, seed=seed)
        add_run(out, seeded(0), "gamma", observables=series(seeded(0), -0.1384, 1.3), loop=50.0)
        return Page(render(find_runs(out), out / "report.html").read_text(encoding="utf-8"))


def test_every_engine_has_one_row_per_quantity(page: Page) -> None:
    table = "scene1-ensembles"
    rows = [
        k
        for k, cell in enumerate(page.column(table, "Quantity"))
        if cell.text == "Deepest point of the ball, 1 ms samples"
    ]
    engines = [page.column(table, "Engine")[k].value for k in rows]
    assert engines == ["alpha", "beta", "gamma"]
    mean, deviation = (page.column(table, title) for title in ("Mean", "Standard deviation"))
    for k, name in zip(rows, engines, strict=True):
        if name in DEEPEST:
            assert float(mean[k].value or 0) == pytest.approx(1e3 * np.mean(DEEPEST[name]), abs=0.01)
            assert float(deviation[k].value or 0) == pytest.approx(1e3 * np.std(DEEPEST[name], ddof=1), rel=0.02)
    assert [page.column(table, "Inside")[k].text for k in rows] == ["4 of 4", "1 of 4", "1 of 1"]
    assert page.column(table, "Standard error")[rows[2]].value == ""


def test_the_verdict_has_one_row_per_engine_and_single_runs_stand_below(page: Page) -> None:
    engines = [cell.text for cell in page.column("scene1-verdicts", "Engine")]
    assert engines == ["alpha4 seeds", "beta4 seeds", "gamma"]
    assert len(page.column("scene1-single-runs", "Engine")) == 9
    assert float(page.column("scene1-verdicts", "Loop time")[0].value or 0) == 101.5
    assert "scene1-quantities" not in page.tables


def test_seeds_are_one_line_with_a_band(page: Page) -> None:
    (panel,) = page.figures["scene1-ball-displacement"].data["panels"]
    lines = {line["label"]: line for line in panel["lines"]}
    assert set(lines) == {"alpha, 4 seeds", "beta, 4 seeds", "gamma, seed 0"}
    alpha = lines["alpha, 4 seeds"]
    at = alpha["x"].index(31)
    assert alpha["low"][at] == pytest.approx(-138.6, abs=0.01) and alpha["high"][at] == pytest.approx(-138.1, abs=0.01)
    assert alpha["y"][at] == pytest.approx(1e3 * np.median(DEEPEST["alpha"]), abs=0.01)
    assert lines["gamma, seed 0"]["low"] is None


def test_quantities_by_seed_show_the_accepted_range(page: Page) -> None:
    panels = page.figures["scene1-seeds"].data["panels"]
    deepest = next(p for p in panels if p["label"] == "Value [mm]")
    alpha = next(line for line in deepest["lines"] if line["label"] == "alpha")
    assert alpha["x"] == [0, 1, 2, 3] and alpha["y"] == pytest.approx(1e3 * np.array(DEEPEST["alpha"]), abs=0.01)
    assert deepest["known"] and deepest["known"][0]["low"][0] < deepest["known"][0]["high"][0]


def test_only_runs_from_one_initial_state_are_compared(page: Page) -> None:
    pairs = list(
        zip(
            [c.value for c in page.column("scene1-differences", "Engine")],
            [c.value for c in page.column("scene1-differences", "Other engine")],
            strict=True,
        )
    )
    assert pairs == [
        ("alpha, seed 0", "beta, seed 0"),
        ("alpha, seed 0", "gamma, seed 0"),
        ("beta, seed 0", "gamma, seed 0"),
    ]
