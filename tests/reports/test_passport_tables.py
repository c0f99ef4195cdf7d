"""What a report says of the contact law of its engines: measured, or how to measure it."""

from __future__ import annotations

from pathlib import Path

import pytest
from passports import passport
from reading import Page
from synthetic import add_run, impact, series

from dembench.reports.report import render
from dembench.runs.directory import find_runs
from dembench.solver.timestep import choose_step
from dembench.verification.passport import measure, record
from dembench.verification.passport.scenes import contact_time


def test_the_law_measured_stands_beside_the_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Alpha has a passport, made with another time step; beta has none, and one of other rows does not count."""
    monkeypatch.setenv("DEMBENCH_CACHE", str(tmp_path / "cache"))
    scene, runs = impact(0.02), tmp_path / "runs"
    add_run(runs, scene, "alpha", observables=series(scene), loop=9.0, settings={"dt": 5e-7})
    beta = {"rows": "soft", "dt": 5e-6}
    add_run(
        runs,
        scene,
        "beta",
        observables=series(scene),
        loop=1.0,
        overrides={"rows": "soft", "dt": "5e-6"},
        settings=beta,
    )
    record.keep(
        [passport("alpha", "1.0", {"dt": 1e-9}, "no-tension"), passport("beta", "1.0", {"rows": "hard"}, "no-tension")],
        tmp_path / "verify",
    )
    page = Page(render(find_runs(runs), tmp_path / "report.html").read_text(encoding="utf-8"))
    (table,) = [rows for name, rows in page.tables.items() if name.endswith("-law")]
    heading, *rows = [[cell.text.strip() for cell in row] for row in table]
    assert heading[1].startswith("Distance to the scene's law")
    first, second = sorted(rows)
    scene_distance = measure.together(measure.distances(measure.predicted()["no-tension"])["hertz-mindlin"])
    assert (
        float(first[1]) == pytest.approx(scene_distance, abs=5e-5)
        and "tension clipped" in first[2]
        and first[6] == "2026-01-01"
    )
    measured, here = (k for k, text in enumerate(heading) if text.startswith("Steps per contact"))
    contact = choose_step(scene).contact_time
    assert float(first[measured]) == pytest.approx(contact_time() / 1e-9, rel=0.05)
    assert float(first[here]) == pytest.approx(contact / 5e-7, rel=0.05)
    assert float(second[here]) == pytest.approx(contact / 5e-6, rel=0.05)
    assert second[measured] == "–"
    assert "not measured" in second[2] and "dembench passport --engines 'beta[rows=soft]'" in second[2]
