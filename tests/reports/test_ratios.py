"""The table of ratios between variants: which runs make a pair, and what is judged."""

from pathlib import Path

import numpy as np
import pytest
from synthetic import add_run

from dembench.cases import silo
from dembench.cases.registry import parse_case
from dembench.reports.groups import gather
from dembench.reports.ratios import ratios
from dembench.reports.report import render
from dembench.results import Observed, channels
from dembench.runs.directory import find_runs


@pytest.fixture
def few_grains(monkeypatch):
    """A silo with 50 grains: what is counted is made up anyway."""
    position = np.random.default_rng(3).uniform(-0.01, 0.01, (50, 3)) + np.array([0, 0, 0.1])
    monkeypatch.setattr(silo, "bed", lambda name, plan, progress, seed=0: position)


def run(
    out: Path, orifice: str, rate: float, engine: str = "alpha", preset: str = "published", contacts="", **more
) -> None:
    """A run whose 50 grains leave at `rate` [1/s]."""
    text = f"case1[orifice={orifice}{contacts}]"
    case, parameters = parse_case(text)
    scene = case.scene(parameters, preset)
    made = {}
    for name, channel in channels(scene).items():
        value = np.zeros(channel.shape(len(channel.time)))
        if name == "inside":
            value = 50 - rate * channel.time
        steps = np.arange(len(channel.time))
        made[name] = Observed(steps, channel.time, value, channel.unit, channel.components, channel.title)
    add_run(out, scene, engine, case=text, preset=preset, observables=made, loop=1.0, **more)


def test_a_pair_has_the_same_engine_and_settings(few_grains, tmp_path):
    run(tmp_path, "large", 9.3)
    run(tmp_path, "small", 3.0)
    run(tmp_path, "small", 2.0, settings={"sweeps": 4}, overrides={"sweeps": "4"})
    run(tmp_path, "small", 1.0, engine="beta")
    table = ratios(gather(find_runs(tmp_path)))
    assert table is not None
    ((title, engine, preset, _, value, reference, accepted, within, source),) = table.rows
    assert "large over small" in title.text and engine.text == "alpha" and preset.text == "published"
    assert value.value == pytest.approx(3.1)
    assert (reference.value, accepted.text, within.text) == (3.1, "3 to 3.2", "yes")
    assert "doi" in source.text
    assert "Ratios between variants" in render(find_runs(tmp_path), tmp_path / "page.html").read_text()


def test_only_published_scenes_are_judged(few_grains, tmp_path):
    run(tmp_path, "large", 20.0, preset="quick")
    run(tmp_path, "small", 5.0, preset="quick")
    table = ratios(gather(find_runs(tmp_path)))
    assert table is not None
    (row,) = table.rows
    assert row[4].value == pytest.approx(4.0) and row[7].text == ""
    run(tmp_path / "far", "large", 12.0)
    run(tmp_path / "far", "small", 3.0)
    table = ratios(gather(find_runs(tmp_path / "far")))
    assert table is not None and table.rows[0][7].text == "no"
    run(tmp_path / "smooth", "large", 12.0, contacts=",friction=0")
    run(tmp_path / "smooth", "small", 3.0, contacts=",friction=0")
    table = ratios(gather(find_runs(tmp_path / "smooth")))
    assert table is not None and table.rows[0][7].text == ""


def test_one_variant_alone_has_no_ratio(few_grains, tmp_path):
    run(tmp_path, "large", 9.3)
    assert ratios(gather(find_runs(tmp_path))) is None
