"""The verb that makes initial states."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from dembench.cases.impact import Impact
from dembench.cli import app
from dembench.initial.beds import read_bed
from dembench.initial.filling import Layer, Protocol, Stage


@pytest.fixture(autouse=True)
def small(tmp_path, monkeypatch):
    """A quick bed of case 3 that takes no time, in a cache of its own."""
    monkeypatch.setenv("DEMBENCH_CACHE", str(tmp_path / "cache"))
    whole = Impact.filling

    def filling(self, parameters, preset):
        return whole(self, parameters, preset).model_copy(update={"layers": (Layer(species="grain", count=50),)})

    monkeypatch.setattr(Impact, "filling", filling)
    return filling


def invoke(*arguments):
    return CliRunner().invoke(app, ["initial", *[str(a) for a in arguments]])


def test_a_made_bed_stands_in_the_cache_and_where_it_is_asked_for(tmp_path):
    first = json.loads(invoke("make", "case3", "--json").stdout)
    assert first["count"] == 50 and first["file"].startswith(str(tmp_path / "cache"))
    found = invoke("make", "case3", "--out", tmp_path / "beds")
    assert found.exit_code == 0
    assert str(tmp_path / "beds" / "case3.npz") in found.stdout and "50 particles, height" in found.stdout
    named = json.loads(invoke("make", "case3", "--out", tmp_path / "own.npz", "--seed", "1", "--json").stdout)
    assert named["file"] == str(tmp_path / "own.npz")
    beds = [read_bed(tmp_path / name) for name in ("beds/case3.npz", "own.npz")]
    assert [bed.seed for bed in beds] == [0, 1]
    assert not np.array_equal(beds[0].position, beds[1].position)


def test_a_bed_that_ships_is_not_made_again(monkeypatch, tmp_path):
    """The one of today's plan and seed is found in the package, whose 25 thousand grains are not settled."""
    monkeypatch.undo()
    monkeypatch.setenv("DEMBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("dembench.cli.initial.filled", None)
    found = json.loads(invoke("make", "case3", "--json").stdout)
    assert found["file"].endswith("data/beds/case3.npz") and found["count"] > 1000
    assert isinstance(invoke("make", "case3", "--seed", "1").exception, TypeError)


def test_what_cannot_be_made_is_refused(monkeypatch, small):
    found = invoke("make", "case9")
    assert found.exit_code == 2 and "case9" in found.stderr
    hasty = Protocol(longest=0.001, stages=(Stage(rest=1e-12),))
    monkeypatch.setattr(Impact, "filling", lambda *given: small(*given).model_copy(update={"protocol": hasty}))
    found = invoke("make", "case3")
    assert found.exit_code == 1 and "50 particles do not rest after 0.001 s" in found.stderr
