"""Runs that go on where an attempt before was cut off."""

from __future__ import annotations

import json
import os
import signal
import threading
from functools import partial

import numpy as np
import psutil
import pytest
from conftest import gone, wait_for
from hopper import hopper
from supervising import only_record, pids, planned_runs, supervise

from dembench.results import read, validate
from dembench.runs import supervise as supervise_module
from dembench.runs.directory import Occupied, find_runs
from dembench.scene import save_scene

OBSERVED = (
    {"kind": "count", "name": "inside", "region": {"lower": (None, None, 0.0)}, "interval": 2e-3},
    {"kind": "wall-force", "name": "cone_force", "wall": "cone", "interval": 2e-3},
    {"kind": "snapshot", "name": "flow", "times": (0.1,)},
)


@pytest.fixture
def planned(small_scene, tmp_path):
    return partial(planned_runs, small_scene(), tmp_path / "runs")


@pytest.fixture
def interrupted(standin, planned):
    """A run that was interrupted after 5 of its 11 frames, planned again; then the stand-in goes on to its end."""

    def make(name="standin", frames=5):
        standin(**{name.replace("-", "_"): ["hang", frames]})
        (run,) = planned(name)
        stop, statuses = threading.Event(), []
        thread = threading.Thread(target=lambda: statuses.append(supervise(run, stop)))
        thread.start()
        wait_for(lambda: len(pids(run)) == 2)
        stop.set()
        thread.join(30)
        assert statuses[0].state == "interrupted"
        (run.directory.deck / "pids").unlink()
        standin()
        return planned(name)[0]

    return make


def test_an_interrupted_run_goes_on_in_its_directory(interrupted, planned):
    run = interrupted()
    assert run.action() == "resume" and run.checkpoint.time == pytest.approx(4e-3)
    assert run.action(fresh=True) == "run"
    first = read(run.directory.result)
    status = supervise(run)
    assert status.state == "ok" and len(status.resumed) == 1 and status.note == ""
    there = status.resumed[0]
    assert (there.step, there.time, there.reached) == pytest.approx((400, 4e-3, 4e-3))
    assert status.started == first.status["started"] <= there.when <= status.ended
    assert (status.frames, only_record(run).status) == (11, status)
    assert validate(run.directory.result) == []
    whole = read(run.directory.result)
    assert whole.status["resumed"] == [there.model_dump()]
    fell = whole.frame("ball_displacement")["ball_displacement"].to_numpy()
    times = whole.observables["ball_displacement"].time
    np.testing.assert_allclose(fell, -times - 0.5 * 9.81 * times**2, atol=1e-12)
    assert [r.action() for r in planned("standin")] == ["reuse"]
    assert not run.directory.path.with_name(f".{run.directory.path.name}.previous").exists()


def test_what_all_attempts_used_is_added(interrupted):
    run = interrupted()
    first = read(run.directory.result)
    status = supervise(run)
    used = read(run.directory.result).resources
    assert used["attempts"][0] == first.resources["attempts"][0]
    assert len(used["attempts"]) == 2 and used["attempts"][1]["phases"]["simulate"]["wall"] > 0
    for name in ("wall", "cpu"):
        assert used[name] == pytest.approx(sum(attempt[name] for attempt in used["attempts"]))
        assert used[name] > first.resources[name]
    assert used["peak_memory"] == max(attempt["peak_memory"] for attempt in used["attempts"])
    assert status.wall > first.status["wall"]


def test_logs_and_environments_of_all_attempts_stay(interrupted):
    run = interrupted()
    supervise(run)
    log = (run.directory.log / "simulate.out").read_text()
    assert log.count("standin starts with") == 2 and "--- attempt 2, from t = 0.004 s" in log
    assert {p.name for p in run.directory.path.glob("environment*.json")} == {"environment.json", "environment-1.json"}
    assert only_record(run).environment["cpu"]


def test_frames_after_the_checkpoint_are_made_again(interrupted):
    run = interrupted(frames=6)
    assert run.checkpoint.time == pytest.approx(4e-3)
    status = supervise(run)
    assert status.state == "ok"
    assert status.resumed[0].reached == pytest.approx(5e-3)
    assert validate(run.directory.result) == []


def test_a_run_is_gone_on_with_more_than_once_and_a_time_limit_is_that_of_an_attempt(standin, planned):
    """Each attempt has 3 s, in which the stand-in gets 4 frames further and hangs."""
    standin(standin=["hang", 4])
    reached = []
    for attempt in range(3):
        (run,) = planned("standin", timeout=3)
        assert run.action() == ("resume" if attempt else "run")
        status = supervise(run)
        reached.append(status.time)
        if attempt < 2:
            assert status.state == "timeout" and "3 s" in status.detail
    assert status.state == "ok"
    assert reached == pytest.approx([3e-3, 6e-3, 10e-3])
    assert [r.time for r in status.resumed] == pytest.approx([2e-3, 6e-3])
    assert [r.reached for r in status.resumed] == pytest.approx([3e-3, 6e-3])
    assert len(read(run.directory.result).resources["attempts"]) == 3
    assert status.wall > 6


def test_fresh_begins_anew(interrupted):
    run = interrupted()
    status = supervise(run, fresh=True)
    assert (status.state, status.resumed, status.note) == ("ok", (), "")
    assert len(read(run.directory.result).resources["attempts"]) == 1
    assert run.directory.path.with_name(f".{run.directory.path.name}.previous").is_dir()


def test_without_a_checkpoint_it_begins_anew_and_says_so(interrupted):
    run = interrupted(frames=0)
    assert run.checkpoint is None and run.action() == "run"
    status = supervise(run)
    assert (status.state, status.resumed) == ("ok", ())
    assert (
        status.note == "begun anew after an attempt that ended as interrupted: it left no checkpoint that can be used"
    )


def test_a_checkpoint_that_cannot_be_used_is_no_end(interrupted):
    run = interrupted("standin-forgetful")
    assert run.action() == "resume"
    status = supervise(run)
    assert (status.state, status.resumed) == ("ok", ())
    assert status.note.endswith("it cannot be gone on with: ValueError: the checkpoint is of another world")
    assert read(run.directory.result).status["note"] == status.note


def test_a_run_that_failed_begins_anew(standin, planned):
    standin(standin=["crash", 5])
    (run,) = planned("standin")
    assert supervise(run).state == "failed"
    standin()
    (again,) = planned("standin")
    assert again.action() == "run"
    assert supervise(again).note == ""


def test_an_engine_that_is_asked_to_end_is_interrupted(standin, planned):
    """A batch system sends SIGTERM to all processes of a job, and the engine may be the first to end."""
    standin(standin=["hang", 5])
    (run,) = planned("standin")
    statuses = []
    thread = threading.Thread(target=lambda: statuses.append(supervise(run)))
    thread.start()
    wait_for(lambda: len(pids(run)) == 2)
    os.kill(pids(run)[0], signal.SIGTERM)
    thread.join(30)
    assert (statuses[0].state, statuses[0].signal) == ("interrupted", "SIGTERM")
    assert planned("standin")[0].action() == "resume"


def test_a_run_that_was_at_its_end_when_it_was_stopped_is_complete(standin, planned):
    """The engine has written everything and only takes its time to end when it is asked to: nothing is missing."""
    standin(standin=["linger", 11])
    (run,) = planned("standin")
    stop, statuses = threading.Event(), []
    thread = threading.Thread(target=lambda: statuses.append(supervise(run, stop)))
    thread.start()
    wait_for(lambda: len(pids(run)) == 2)
    stop.set()
    thread.join(30)
    assert (statuses[0].state, statuses[0].frames) == ("ok", 11)
    assert planned("standin")[0].action() == "reuse"


@pytest.fixture
def run_small(start_run, tmp_path):
    """Starts `dembench run` on a scene as a process."""

    def start(scene, *options, modes=None):
        save_scene(scene, tmp_path / "small.json")
        return start_run("small.json", *options, modes=modes)

    return start


def test_a_killed_command_is_gone_on_with_once_its_engine_has_ended(standin, planned, run_small, small_scene):
    """Killed outright, in the middle of everything: the next one waits for the engine, which ignores SIGTERM."""
    (run,) = planned("standin")
    killed = run_small(small_scene(), "--engines", "standin", modes={"standin": ["ignore", 5]})
    wait_for(lambda: len(pids(run)) == 2 and run.directory.result.exists())
    (run.directory.path / ".result.h5.1.tmp").write_bytes(b"half a result")
    (run.directory.path / ".status.json.tmp").write_text('{"state": "o')
    engine, child = pids(run)
    killed.kill()
    killed.wait()
    (again,) = planned("standin")
    assert (again.before.state, again.before.reason, again.action()) == ("interrupted", "supervisor gone", "resume")
    status = supervise(again)
    assert gone(engine) and gone(child)
    assert status.state == "ok" and status.resumed[0].time == pytest.approx(4e-3)
    assert len(read(run.directory.result).resources["attempts"]) == 2
    assert validate(run.directory.result) == []


def test_one_supervisor_at_a_time_goes_on(interrupted, standin, planned):
    run = interrupted()
    standin(standin=["hang", 3])
    stop = threading.Event()
    thread = threading.Thread(target=lambda: supervise(run, stop))
    thread.start()
    try:
        wait_for(lambda: len(pids(run)) == 2)
        assert only_record(run).status.state == "running"
        with pytest.raises(Occupied, match=f"in use by process {psutil.Process().pid}"):
            run.directory.claim(run.spec, keep=True)
    finally:
        stop.set()
        thread.join(30)
    assert planned("standin")[0].action() == "resume"


def test_an_interrupted_command_leaves_a_run_that_goes_on_to_the_same_bits(run_small, tmp_path):
    """The whole way with a solver: grains leave a hopper, the command is interrupted once two frames are there.

    The steps are so short that the rest takes seconds, however late the interruption comes on a busy machine.
    """
    scene = hopper(duration=0.1, time_step=2e-7, observables=OBSERVED)
    straight = run_small(scene, "--engines", "peclet-hertz", "--out", "straight")
    assert straight.communicate(timeout=120)[0] and straight.returncode == 0

    first = run_small(scene, "--engines", "peclet-hertz", "--out", "broken")
    wait_for(lambda: len(list(tmp_path.glob("broken/*/deck/frames/*.npy"))) > 4)
    first.send_signal(signal.SIGINT)
    output, _ = first.communicate(timeout=60)
    assert first.returncode == 1 and "interrupted" in output, output
    assert find_runs(tmp_path / "broken")[0].status.state == "interrupted"

    second = run_small(scene, "--engines", "peclet-hertz", "--out", "broken", "--json")
    output, _ = second.communicate(timeout=120)
    (job,) = json.loads(output)["runs"]
    assert (job["action"], job["state"]) == ("resume", "ok")
    ours, whole = (find_runs(tmp_path / out)[0].result for out in ("broken", "straight"))
    assert len(ours.status["resumed"]) == 1 and whole.status["resumed"] == []
    for name, series in whole.observables.items():
        assert series.value.tobytes() == ours.observables[name].value.tobytes(), name
    assert whole.snapshots["flow"].position.tobytes() == ours.snapshots["flow"].position.tobytes()
    assert ours.counters == whole.counters


def test_a_fault_of_the_display_is_no_end(standin, planned, monkeypatch):
    """An engine that cannot say how far it is goes on, and its status tells, once, beside what it says already."""
    asked, stop, statuses = threading.Event(), threading.Event(), []

    def fails(*_of):
        asked.set()
        raise ValueError("no idea how far")

    def unmeasured(_cores):
        raise ValueError("no clock")

    standin(standin=["linger", 11])
    (run,) = planned("standin")
    monkeypatch.setattr(type(run.engine), "reached", fails)
    monkeypatch.setattr(supervise_module, "GLANCE_INTERVAL", 0.01)
    monkeypatch.setattr(supervise_module.workload, "measure_on", unmeasured)
    thread = threading.Thread(target=lambda: statuses.append(supervise(run, stop, beside_workload=True)))
    thread.start()
    assert asked.wait(30)
    wait_for(lambda: len(pids(run)) == 2)
    stop.set()
    thread.join(30)
    assert statuses[0].state == "ok"
    assert statuses[0].note.split("; ") == [
        "the reference workload was not timed: no clock",
        "its progress is not known between looks: ValueError: no idea how far",
    ]
