"""A page shows what a scene has and says what was left out."""

from __future__ import annotations

from pathlib import Path

from reading import Page
from synthetic import add_run, impact, series

from dembench.reports.facts import words
from dembench.reports.report import render
from dembench.runs.directory import find_runs
from dembench.scene import Scene, features


def page_of(scene: Scene, out: Path, names: tuple[str, ...], seeds: int = 1) -> Page:
    """The page of one engine that recorded some series, without a case."""
    observables = {name: values for name, values in series(scene).items() if name in names}
    for seed in range(seeds):
        add_run(out, scene, "alpha", observables=observables, loop=1.0, case="own.json", preset=None, seed=seed)
    return Page(render(find_runs(out), out / "report.html").read_text(encoding="utf-8"))


def test_features_and_what_is_left_out_are_listed_completely(stand_ins: None, tmp_path: Path) -> None:
    scene = impact(0.02)
    shown = "".join(page_of(scene, tmp_path, ("ball_displacement",)).text)
    present = features(scene)
    assert set(present.names()) | set(present.absent()) == set(type(present).model_fields)
    assert words(present.names()) in shown
    assert f"{words(present.absent())}; no kernel, buffer or command of a deck is there for them" in shown


def test_only_recorded_series_have_figures(stand_ins: None, tmp_path: Path) -> None:
    """No figure of energy or overlap, no pictures and no tables of references or seeds where there are none."""
    scene = impact(0.02)
    one = page_of(scene, tmp_path / "one", ("ball_displacement",))
    two = page_of(scene, tmp_path / "two", ("ball_displacement", "energy"))
    assert len(one.figures) == 1 and len(two.figures) > 1
    assert not [name for name in one.figures if "energy" in name or "overlap" in name]
    assert not [tag for tag, attributes in one.tags if tag == "img"]
    headings = {cell.text.strip() for rows in one.tables.values() for cell in rows[0]}
    assert not headings & {"Accepted", "Standard deviation", "Inside", "Published"}


def test_tables_of_seeds_are_there_where_there_are_seeds(stand_ins: None, tmp_path: Path) -> None:
    scene = impact(0.02)
    alone, several = (page_of(scene, tmp_path / str(n), ("ball_displacement",), seeds=n) for n in (1, 3))
    assert not [name for name in alone.tables if "single-runs" in name]
    assert [name for name in several.tables if "single-runs" in name]
