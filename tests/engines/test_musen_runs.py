"""Whole runs of a stand-in for MUSEN that reads and writes the same files: what comes out, and what goes wrong."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from launching import meets_the_times, run
from musen_scenes import FLOOR, SINK, everything, scene, two_spheres

from dembench.engines import registry
from dembench.engines.musen import Musen
from dembench.results import observe, read, validate
from dembench.runs.environment import available_cores
from dembench.runs.plan import EngineChoice, SceneChoice, plan
from dembench.runs.supervise import Supervisor
from dembench.scene import Scene

PROGRAM = Path(__file__).with_name("musen_program.py")


@pytest.fixture
def musen(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Musen]:
    """The engine with the stand-in program, which behaves as asked for."""

    def make(mode: str = "") -> Musen:
        program = tmp_path_factory.mktemp("program") / "CMUSEN"
        program.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{PROGRAM}" "$@"\n')
        program.chmod(0o755)
        monkeypatch.setenv("DEMBENCH_MUSEN", str(program))
        monkeypatch.setenv("MUSEN_STANDIN", mode)
        return Musen()

    return make


def test_the_stand_in_is_found(musen: Callable[[str], Musen]) -> None:
    probe = musen("").probe()
    assert (probe.available, probe.version, probe.facts["build"]) == (True, "1.74.2", "261122.061209.")
    assert len(probe.facts["sha256"]) == 64


# ---- runs of the stand-in


@pytest.mark.parametrize(("young", "restitution"), [(1e7, 0.499862), (1e9, 0.502567)])
def test_two_spheres_rebound_as_on_record(
    young: float, restitution: float, musen: Callable[[str], Musen], tmp_path: Path
) -> None:
    """The values are those of recorded runs of the real program; the stand-in has its scheme and its normal force."""
    made = two_spheres(young)
    series = run(musen(""), made, tmp_path)
    assert (series.failure, series.detail) == (None, "")
    last = series.frames[-1]
    assert last.velocity[1, 0] - last.velocity[0, 0] == pytest.approx(restitution, abs=1e-6)


def test_frames_and_tracks_meet_the_times(musen: Callable[[str], Musen], tmp_path: Path) -> None:
    made = everything()
    series = run(musen(""), made, tmp_path, digits="17")
    meets_the_times(series, made, tracked=2)
    assert np.array_equal(series.frames[0].angular_velocity, made.bodies.angular_velocity)
    assert series.time == made.duration
    assert series.timing.source == "wall"
    assert series.timing.loop is not None and series.timing.loop > 0


def test_the_floor_carries_a_grain_at_rest(musen: Callable[[str], Musen], tmp_path: Path) -> None:
    """The force that the program exports is the one on the wall: the weight, downwards."""
    made = scene(
        walls=(FLOOR,),
        bodies={"position": [[0.001, 0.002, 0.001]]},
        duration=0.03,
        observables=({"kind": "wall-force", "name": "load", "wall": "floor", "interval": 1e-2},),
    )
    series = run(musen(""), made, tmp_path)
    load = observe(made, series.frames)["load"].value
    assert load.shape == (4, 3)
    assert load[-1] == pytest.approx([0, 0, -9.81 * made.masses()[0]], rel=1e-3)


def falling(**changes: Any) -> Scene:
    """Eight grains one above the other that fall through a sink at z = -2 cm; the domain ends at -3 cm."""
    fields = {
        "bodies": {"position": [[0, 0, -0.0185 + 0.0025 * k] for k in range(8)]},
        "sinks": (SINK,),
        "duration": 0.06,
        "time_step": 5e-5,
        "observables": ({"kind": "count", "name": "inside", "interval": 5e-3},),
    }
    return scene(**{**fields, **changes})


@pytest.mark.parametrize("size", [1e8, 1])
def test_grains_leave_through_a_sink(
    size: float, musen: Callable[[str], Musen], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Grain k passes after sqrt(2 (1.5 mm + 2.5 mm k) / g), also where every frame is a part of the export."""
    monkeypatch.setattr("dembench.engines.musen_output.PART_BYTES", size)
    made = falling()
    series = run(musen(""), made, tmp_path)
    assert (series.failure, series.detail) == (None, "")
    assert len(list((tmp_path / "frames").glob("part_*.json"))) == (1 if size > 1 else 12)
    assert not list((tmp_path / "frames").glob("*.txt")), "text that has been read is removed"
    found = observe(made, series.frames)["inside"]
    passes = np.sqrt(2 * (1.5e-3 + 2.5e-3 * np.arange(8)) / 9.81)
    assert found.value.ravel().tolist() == [np.count_nonzero(passes > t) for t in found.time]


@pytest.mark.parametrize("size", [1e8, 1])
def test_a_grain_that_leaves_elsewhere_is_lost(
    size: float, musen: Callable[[str], Musen], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dembench.engines.musen_output.PART_BYTES", size)
    made = falling(bodies={"position": [[0, 0, 0], [0.02, 0, 0]], "velocity": [[0, 0, 0], [0.62, 0, 0]]})
    series = run(musen(""), made, tmp_path)
    assert series.failure == "lost particles"
    assert "body 1 left the domain at (0.03" in series.detail


def test_a_grain_moves_with_its_wall(musen: Callable[[str], Musen], tmp_path: Path) -> None:
    """A grain that lies on a floor that rises at 0.1 m/s rises with it."""
    made = scene(
        walls=({**FLOOR, "motion": {"velocity": (0, 0, 0.1)}},),
        bodies={"position": [[0, 0, 0.001]], "velocity": [[0, 0, 0.1]]},
        duration=0.02,
    )
    last = run(musen(""), made, tmp_path).frames[-1]
    assert last.position[0, 2] == pytest.approx(0.003, abs=1e-5)


# ---- states of whole runs


def supervised(engine: Musen, made: Scene, directory: Path, monkeypatch: pytest.MonkeyPatch, **options: Any) -> Any:
    """The planned run of a scene and its status after it."""
    registry.engine.cache_clear()
    monkeypatch.setattr(registry, "BUILT_IN", {"musen": "dembench.engines.musen:Musen"})
    (planned,) = plan([SceneChoice("small.json", None, 0, made)], [EngineChoice("musen", {})], directory, **options)
    status = Supervisor(planned, available_cores()[:1], threading.Event()).run()
    registry.engine.cache_clear()
    return planned, status


def test_a_run_that_ends_well(musen: Callable[[str], Musen], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    planned, status = supervised(musen(""), everything(), tmp_path, monkeypatch)
    assert (status.state, status.detail, status.frames) == ("ok", "", len(everything().frame_times()))
    assert planned.spec.law.startswith("shear history rescaled")
    assert validate(planned.directory.result) == []
    result = read(planned.directory.result)
    (attempt,) = result.resources["attempts"]
    assert set(attempt["phases"]) == {"import", "simulate", "export"}
    assert 0 < result.timing["loop"] < attempt["wall"] == attempt["phases"]["simulate"]["wall"]
    assert not (planned.directory.deck / "frames").exists()
    assert (planned.directory.deck / "simulate.log").exists()


@pytest.mark.parametrize(
    ("mode", "reason", "detail"),
    [
        ("segfault", "signal", "SIGSEGV"),
        ("wordless", "engine error", "simulate: Error: Wrong simulator type"),
        ("empty-scene", "engine error", "simulate: the program has 0 particles, written were 2"),
        ("short", "engine error", "simulate: 'Simulation finished' stands 0 times"),
        ("empty-export", "engine error", "export: ./frames/export_0000.txt is missing or empty"),
        ("defaults", "engine error", "property 200 of glass-glass is 0.6, written was 0.5"),
        ("nan", "nan", "is not finite"),
    ],
)
def test_a_failure_is_seen_though_the_program_ends_with_code_zero(
    mode: str, reason: str, detail: str, musen: Callable[[str], Musen], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, status = supervised(musen(mode), scene(gravity=(0, 0, 0)), tmp_path, monkeypatch)
    assert (status.state, status.reason) == ("failed", reason)
    assert detail in status.detail


def test_a_scene_that_is_gone_is_not_launched(musen: Callable[[str], Musen], tmp_path: Path) -> None:
    engine, made = musen(""), scene()
    settings = engine.settings(made, "closed")
    phases = engine.write(made, settings, tmp_path)
    assert engine.read(made, settings, tmp_path).failure is None, "a run that has not begun is no failure"
    (tmp_path / "scene.txt").write_text("")
    ended = subprocess.run(phases[0].command, cwd=tmp_path, capture_output=True, check=False)
    series = engine.read(made, settings, tmp_path)
    assert ended.returncode == 1
    assert (series.failure, series.detail) == ("engine error", "import: scene.txt is missing or empty")


def test_a_disk_that_is_too_small_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda path: type("usage", (), {"free": 1000})())
    with pytest.raises(ValueError, match="GB are free"):
        Musen().write(scene(), Musen().settings(scene(), "closed"), tmp_path)


def test_the_simulation_is_followed_by_its_log(musen: Callable[[str], Musen], tmp_path: Path) -> None:
    engine, made = musen(""), scene()
    settings = engine.settings(made, "closed")
    engine.write(made, settings, tmp_path)
    (tmp_path / "simulate.log").write_text("Current time [s]: 0.001\n\tMax\nCurrent time [s]: 0.002\n")
    series = engine.read(made, settings, tmp_path)
    assert (series.time, len(series.frames), series.failure) == (0.002, 0, None)
    ended = "Elapsed time [d:h:m:s]: 00:01:00:02\n === Simulation finished ===\n"
    for took, loop, source in (("3602.715", 3602.715, "wall"), ("0.001", 3602, "engine")):
        (tmp_path / "simulate.log").write_text(f"{ended}Wall time from start to end [s]: {took}\n")
        series = engine.read(made, settings, tmp_path)
        assert (series.time, series.timing.loop, series.timing.source) == (made.duration, loop, source)


def test_an_export_that_was_cut_off_is_made_anew(musen: Callable[[str], Musen], tmp_path: Path) -> None:
    engine, made = musen(""), falling()
    settings = engine.settings(made, "closed")
    phases = engine.write(made, settings, tmp_path)
    assert engine.resume(made, settings, tmp_path) is None, "nothing is simulated yet"
    for phase in phases:
        subprocess.run(phase.command, cwd=tmp_path, capture_output=True, check=True)
    last = engine.read(made, settings, tmp_path).frames[-1].position
    (tmp_path / "export.log").write_text("Export to text started\n")
    assert len(engine.read(made, settings, tmp_path).frames) == 0
    found = engine.checkpoint(made, settings, tmp_path)
    assert found is not None and (found.step, found.time) == (1200, made.duration)
    (again,) = engine.resume(made, settings, tmp_path) or []
    assert (again.name, again.timed) == ("export", False)
    subprocess.run(again.command, cwd=tmp_path, capture_output=True, check=True)
    series = engine.read(made, settings, tmp_path)
    assert (series.failure, len(series.frames)) == (None, len(made.frame_times()))
    assert np.array_equal(series.frames[-1].position, last)
