"""Rates: the order of the runs, what a sample is, medians and spreads, and rows of engines that have none."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from dembench.engines import registry
from dembench.engines.base import Engine, SettingsError
from dembench.runs.plan import EngineChoice, RequestError, parse_engines
from dembench.runs.states import Status
from dembench.scene import Energy, Scene
from dembench.throughput import rates
from dembench.throughput.rates import Entry, Spent, in_turn, planned, rate
from dembench.throughput.scenes import Timed, timed

SAMPLES = 5


@pytest.fixture
def scene(small_scene: Any) -> Timed:
    """A hundred steps of three grains and a ball, after 25 others."""
    return timed("small", small_scene(), 100)


def entries(scene: Timed, engines: str, out: Path, cores: tuple[int, ...] = (1,)) -> list[Entry]:
    return planned([scene], parse_engines(engines), cores, out, samples=SAMPLES, timeout=60.0)


def took(wall: float, cpu: float | None = None, loop: float | None = None) -> tuple[Spent, Spent]:
    """A sample whose steps take that long, after a start of 3 s with 2 s of CPU time."""
    cpu = wall if cpu is None else cpu
    return Spent(3.0, 2.0, 1.0, 1e8), Spent(3.0 + wall, 2.0 + cpu, None if loop is None else 1.0 + loop, 2e8)


def test_both_runs_of_a_sample_differ_in_their_end_alone(scene: Timed) -> None:
    assert (scene.steps, scene.dt, scene.bodies) == (100, pytest.approx(1e-5), 4)
    assert scene.short.duration == pytest.approx(25e-5) and scene.long.duration == pytest.approx(125e-5)
    ends = {"duration", "observables"}
    assert scene.short.model_dump(exclude={*ends, "bodies"}) == scene.long.model_dump(exclude={*ends, "bodies"})
    assert scene.short.bodies.digest() == scene.long.bodies.digest()
    for part in (scene.short, scene.long):
        assert [type(o) for o in part.observables] == [Energy]
        assert part.frame_times() == pytest.approx([0, part.duration]) and not len(part.track_times())


def test_engines_take_turns_sample_after_sample(scene: Timed, tmp_path: Path, standin: Any) -> None:
    runs = in_turn(entries(scene, "standin,standin-coarse", tmp_path))
    order = [(run.spec.repeat, run.spec.engine, run.spec.case) for run in runs]
    turn = [(e, c) for e in ("standin", "standin-coarse") for c in ("small-short", "small")]
    assert order == [(repeat, *one) for repeat in range(1, SAMPLES + 2) for one in turn]


def test_all_engines_make_the_same_steps_of_the_same_law_and_write_the_same(scene: Timed, tmp_path: Path) -> None:
    """That of the scene, although an engine of large steps would choose another by itself."""
    found = [entry.samples[0][1].spec for entry in entries(scene, ",".join(registry.BUILT_IN), tmp_path)]
    assert registry.engine("peclet").settings(scene.long, "closed").dt > 2 * scene.dt
    assert {spec.settings["dt"] for spec in found} == {scene.dt}
    assert {spec.law for spec in found if spec.engine in ("peclet", "peclet-hertz", "liggghts")} == {""}
    assert len({spec.scene_digest for spec in found}) == 1


def test_cores_are_shared_by_the_setting_that_an_engine_names(scene: Timed, tmp_path: Path) -> None:
    for name in registry.BUILT_IN:
        engine = registry.engine(name)
        assert engine.cores_setting is not None
        assert engine.settings(scene.long, "closed", {engine.cores_setting: "3"}).cores() == 3
    assert Engine.cores_setting is None, "what a plug-in says that knows nothing of it"


def test_an_engine_that_cannot_share_a_step_is_a_row_that_says_so(scene: Timed, tmp_path: Path, standin: Any) -> None:
    one, two = entries(scene, "standin", tmp_path, cores=(1, 2))
    assert one.samples and not two.samples
    row = rate(two, [])
    assert (row.engine, row.cores, row.particle_steps_per_second) == ("standin", 2, None)
    assert row.detail == "it cannot share a step among cores"


def test_settings_that_have_one_core_only_are_a_row_that_says_so(
    scene: Timed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine, settings = registry.engine("peclet"), registry.engine("peclet").settings

    def of_one_core(scene: Scene, division: Any, overrides: dict[str, str] | None = None) -> Any:
        if (overrides or {}).get("threads") == "2":
            raise SettingsError("threads: this scene has one")
        return settings(scene, division, overrides)

    monkeypatch.setattr(engine, "settings", of_one_core)
    one, two = entries(scene, "peclet[rows=rigid]", tmp_path, cores=(1, 2))
    assert "this scene has one" in rate(two, []).detail
    row = rate(one, [took(1.0)] * SAMPLES)
    assert row.law and row.particle_steps_per_second == 400


@pytest.mark.parametrize(
    ("engines", "error", "said"),
    [
        ("peclet-hertz[dt=5e-6]", RequestError, "all engines make that of small"),
        ("peclet-hertz[threads=2]", RequestError, "--cores says how many"),
        ("peclet-hertz[thread=2]", SettingsError, "Did you mean 'threads'"),
    ],
)
def test_settings_that_make_another_comparison_are_refused(
    scene: Timed, tmp_path: Path, engines: str, error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        entries(scene, engines, tmp_path)


def test_a_rate_is_the_median_of_differences(scene: Timed, tmp_path: Path, standin: Any) -> None:
    """400 particle-steps in 0.5, 1, 2, 4 and 8 s: 800, 400, 200, 100 and 50 in a second."""
    (entry,) = entries(scene, "standin", tmp_path)
    samples = [took(wall, cpu=0.95 * wall, loop=0.8 * wall) for wall in (4.0, 0.5, 2.0, 8.0, 1.0)]
    row = rate(entry, samples)
    assert (row.bodies, row.steps, row.samples) == (4, 100, SAMPLES)
    assert row.particle_steps_per_second == pytest.approx(200)
    assert (row.fastest, row.slowest) == (pytest.approx(800), pytest.approx(50))
    assert row.spread == pytest.approx((800 - 50) / 200)
    assert (row.wall, row.core_seconds) == (pytest.approx(2.0), pytest.approx(1.9))
    assert row.own_clock == pytest.approx(400 / 1.6)
    assert row.busy == pytest.approx(0.95) and not row.contended
    assert row.peak_memory == 2e8 and not row.detail
    assert {"scene", "engine", "cores", "particle_steps_per_second", "spread"} <= set(row.plain())
    assert (row.settings, row.law) == (entry.samples[0][1].spec.settings, "")


def test_other_load_shows_as_core_seconds_that_are_missing(scene: Timed, tmp_path: Path, standin: Any) -> None:
    (entry,) = entries(scene, "standin", tmp_path)
    quiet, held = took(2.0), took(2.0, cpu=1.0)
    assert not rate(entry, [quiet] * SAMPLES).contended
    row = rate(entry, [quiet, held, quiet, quiet, quiet])
    assert row.contended and row.busy == pytest.approx(0.5)
    waited = (quiet[0], Spent(5.0, 4.0, contended=True))
    assert rate(entry, [quiet, waited, quiet, quiet, quiet]).contended


def test_steps_that_drown_in_the_start_give_no_rate(scene: Timed, tmp_path: Path, standin: Any) -> None:
    """A sample that came out negative must not be dropped: those that stay would be too slow."""
    (entry,) = entries(scene, "standin", tmp_path)
    row = rate(entry, [took(0.2), took(-0.1), took(0.2), took(0.1), took(0.2)])
    assert row.particle_steps_per_second is None and "--steps" in row.detail


def test_a_sample_that_failed_is_missed_and_its_reason_shown(scene: Timed, tmp_path: Path, standin: Any) -> None:
    (entry,) = entries(scene, "standin", tmp_path)
    failed = (took(1.0)[0], "failed: signal: SIGSEGV ended it")
    row = rate(entry, [took(1.0), failed, took(1.0), took(1.0), took(1.0)])
    assert row.samples == 4 and row.particle_steps_per_second == pytest.approx(400)
    assert row.detail == "failed: signal: SIGSEGV ended it"
    nothing = rate(entry, [failed] * SAMPLES)
    assert nothing.particle_steps_per_second is None and nothing.detail == row.detail


def test_what_this_command_did_not_run_is_not_taken_from_one_before(scene: Timed, tmp_path: Path, standin: Any) -> None:
    (entry,) = entries(scene, "standin", tmp_path)
    for run in in_turn([entry]):
        run.directory.claim(run.spec)
        run.directory.write_status(Status(state="ok"))
    jobs: list[Any] = [SimpleNamespace(run=run, status=None) for run in in_turn([entry])]
    (row,) = rates.rates([entry], jobs)
    assert row.detail == "not run"


def test_a_choice_of_settings_names_its_row(scene: Timed, tmp_path: Path) -> None:
    (entry,) = planned(
        [scene], [EngineChoice("peclet-hertz", {"arithmetic": "float64"})], [1], tmp_path, samples=5, timeout=None
    )
    assert entry.engine == "peclet-hertz[arithmetic=float64]" == entry.samples[0][0].spec.label()
    assert isinstance(entry.samples[0][0].scene, Scene)
