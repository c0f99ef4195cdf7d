"""Requests, names and hashes of runs."""

from __future__ import annotations

import pytest

from dembench.engines.base import SettingsError
from dembench.engines.registry import UnknownEngine
from dembench.runs.environment import available_cores, contended, machine
from dembench.runs.plan import EngineChoice, RequestError, SceneChoice, parse_engines, plan, split_list
from dembench.scene import ElasticEnergy, Rigid


def test_lists_are_split_outside_brackets():
    assert split_list("a[x=1,y=2],b, c[z=3]") == ["a[x=1,y=2]", "b", "c[z=3]"]
    assert split_list(" , ") == []


def test_engines_with_settings(standin):
    assert parse_engines("standin,standin-coarse[dt=1e-6,threads=1]") == [
        EngineChoice("standin"),
        EngineChoice("standin-coarse", {"dt": "1e-6", "threads": "1"}),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("standin[dt]", "'dt' is no setting"),
        ("standin[dt=1,dt=2]", "more than once"),
        ("standin,standin", "use --repeat"),
        ("standin[dt=1", "is no engine"),
        ("stan din", "is no engine"),
        ("", "no engine is given"),
    ],
)
def test_bad_engine_texts(standin, text, message):
    with pytest.raises(RequestError, match=message):
        parse_engines(text)


def test_an_unknown_engine_names_the_nearest(standin):
    with pytest.raises(UnknownEngine, match="Did you mean 'standin'"):
        parse_engines("standim")


def _plan(scene, out, *choices, case="case3[bed=25k]", preset="quick", seed=0, **options):
    return plan([SceneChoice(case, preset, seed, scene)], list(choices or [EngineChoice("standin")]), out, **options)


def test_the_name_is_readable_and_safe(standin, small_scene, tmp_path):
    (run,) = _plan(small_scene(), tmp_path)
    assert run.spec.name() == f"case3-bed-25k-quick__standin__{run.spec.digest()[:8]}"
    (run,) = _plan(small_scene(), tmp_path, case="../../x y;$(z).json", preset=None)
    assert run.spec.name().startswith("x-y-z-json__standin__")
    assert run.directory.path.parent == tmp_path


def test_the_hash_covers_what_the_result_depends_on_and_nothing_else(standin, small_scene, tmp_path):
    def digest(scene=None, *choices, **options):
        return _plan(scene or small_scene(), tmp_path, *choices, **options)[0].spec.digest()

    base = digest()
    assert base == digest()
    assert base == digest(timeout=5.0) == digest(case="other"), "the limit and the words change no result"
    others = [
        digest(small_scene(duration=0.02)),
        digest(small_scene(gravity=(0, 0, -1.62))),
        digest(None, EngineChoice("standin", {"dt": "2e-6"})),
        digest(None, EngineChoice("standin-coarse")),
        digest(None, EngineChoice("standin-coarse", {"dt": "1e-5"})),
        digest(division="open"),
        digest(seed=1),
    ]
    assert len({base, *others}) == 8


def test_repeats_are_interleaved(standin, small_scene, tmp_path):
    runs = _plan(small_scene(), tmp_path, EngineChoice("standin"), EngineChoice("standin-coarse"), repeats=2)
    assert [(r.spec.engine, r.spec.repeat) for r in runs] == [
        ("standin", 1),
        ("standin-coarse", 1),
        ("standin", 2),
        ("standin-coarse", 2),
    ]
    assert len({r.spec.digest() for r in runs}) == 4


def test_settings_are_resolved_and_the_step_is_fitted(standin, small_scene, tmp_path):
    (run,) = _plan(small_scene(), tmp_path, EngineChoice("standin", {"dt": "3e-5"}))
    assert run.spec.settings["dt"] == pytest.approx(2e-4 / 7)
    assert run.spec.label() == "standin[dt=3e-5]"


def test_more_cores_than_there_are_is_refused(standin, small_scene, tmp_path):
    there = len(available_cores())
    with pytest.raises(RequestError, match=f"asks for {there + 1} cores and {there} can be used"):
        _plan(small_scene(), tmp_path, EngineChoice("standin", {"threads": str(there + 1)}))


def test_an_unknown_setting_names_the_accepted_ones(standin, small_scene, tmp_path):
    with pytest.raises(SettingsError, match="Did you mean 'threads'"):
        _plan(small_scene(), tmp_path, EngineChoice("standin", {"thread": "1"}))


def test_a_run_that_is_asked_for_twice_is_refused(standin, small_scene, tmp_path):
    twice = [SceneChoice("small.json", None, 0, small_scene())] * 2
    with pytest.raises(RequestError, match="more than once"):
        plan(twice, [EngineChoice("standin")], tmp_path)


def test_what_cannot_be_recorded_is_refused(standin, small_scene, tmp_path):
    scene = small_scene(law=Rigid(), observables=(ElasticEnergy(name="push", interval=1e-3),))
    with pytest.raises(RequestError, match="push"):
        _plan(scene, tmp_path)


def test_the_machine_is_described():
    found = machine()
    assert found["cores"] >= 1 and found["memory"] > 1e8
    assert found["packages"]["numpy"]
    assert {"cpu", "frequency_policy", "gpu", "system", "kernel", "python", "commit"} <= set(found)


def test_contention_is_load_before_the_start_or_waiting_for_a_core():
    assert not contended(0.05, 0.1, 10.0)
    assert contended(0.9, 0.0, 10.0)
    assert contended(0.0, 3.0, 10.0)
    assert not contended(None, None, 10.0)
