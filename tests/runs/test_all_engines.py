"""Every engine that is installed, on one scene: identical layout of the result, t = 0 included."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from dembench.engines import registry
from dembench.results import validate
from dembench.runs.directory import find_runs
from dembench.runs.environment import available_cores
from dembench.runs.plan import EngineChoice, SceneChoice, plan
from dembench.runs.supervise import Supervisor


@pytest.fixture(scope="module")
def records(tmp_path_factory, small_scene):
    out = tmp_path_factory.mktemp("runs")
    there = [EngineChoice(name) for name in registry.names() if registry.engine(name).probe().available]
    for run in plan([SceneChoice("small.json", None, 0, small_scene())], there, out):
        if not run.unsupported:
            Supervisor(run, available_cores()[: run.spec.cores], threading.Event()).run()
    return find_runs(out)


def test_every_engine_gives_a_valid_and_complete_result(records):
    assert records
    for record in records:
        assert record.status.state == "ok", f"{record.spec.engine}: {record.status.detail}"
        assert validate(record.directory / "result.h5") == []


def test_all_have_the_same_names_shapes_units_and_times(records):
    first, *others = (r.result for r in records)
    for other in others:
        assert set(other.observables) == set(first.observables)
        assert set(other.snapshots) == set(first.snapshots)
        for name, a in first.observables.items():
            b = other.observables[name]
            assert (a.value.shape, a.unit, a.components, a.title) == (b.value.shape, b.unit, b.components, b.title)
            np.testing.assert_array_equal(a.time, b.time)
            assert a.time[0] == 0


def test_all_agree_on_the_first_row_and_on_free_flight(records):
    """A symplectic step is off by g t dt / 2, one that also begins half a step ahead by twice that."""
    for record in records:
        seen = record.result.observables
        t = seen["ball_displacement"].time
        first_order = 9.81 * t * record.spec.settings["dt"]
        error = seen["ball_displacement"].value + t + 0.5 * 9.81 * t**2
        assert (np.abs(error) <= 1.01 * first_order + 1e-7).all(), record.spec.engine
        np.testing.assert_allclose(seen["ball_velocity"].value[0], [0, 0, -1.0], atol=1e-6)
        start = record.result.snapshots["ends"].position[0]
        np.testing.assert_allclose(start, record.result.scene.bodies.position, atol=1e-9)


def test_raw_frames_do_not_stay(records):
    for record in records:
        kept = sum(f.stat().st_size for f in (record.directory / "deck").rglob("*") if f.is_file())
        assert kept < 1e6, f"{record.spec.engine} keeps {kept} bytes in its deck"
        assert not (record.directory / "deck" / "frames").exists()
