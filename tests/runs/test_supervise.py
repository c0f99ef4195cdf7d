"""Runs of the stand-in engine through all states."""

from __future__ import annotations

import os
import signal
import threading
from functools import partial
from pathlib import Path

import psutil
import pytest
from conftest import gone, wait_for
from supervising import CORES, only_record, pids, planned_runs, supervise

from dembench.results import Result, read, validate
from dembench.runs.directory import Occupied, find_runs
from dembench.runs.environment import available_cores
from dembench.runs.scheduler import Job, Scheduler
from dembench.runs.states import Verdict


@pytest.fixture
def planned(small_scene, tmp_path):
    return partial(planned_runs, small_scene(), tmp_path / "runs")


def test_a_run_that_ends_well(standin, planned):
    (run,) = planned("standin")
    status = supervise(run, command="dembench run small.json")
    assert (status.state, status.scored, status.label()) == ("ok", False, "ok, unscored")
    assert (status.frames, status.frames_expected, status.exit_code) == (11, 11, 0)
    record = only_record(run)
    assert record.status == status and record.spec == run.spec
    assert validate(run.directory.result) == []
    result = record.result
    assert result.status["state"] == "ok"
    assert result.frame("ball_displacement")["ball_displacement"].iloc[-1] == pytest.approx(-0.01 - 0.5 * 9.81e-4)
    assert result.timing["loop"] == 0.5 and result.timing["source"] == "engine"
    assert result.counters == {"files": 11.0}
    assert 0 < result.resources["cpu"] < result.resources["wall"] + 1
    assert result.resources["peak_memory"] > 1e6
    assert result.provenance["hash"] == run.spec.digest()
    assert result.provenance["command"] == "dembench run small.json"
    assert record.environment["cpu"] and record.environment["engine"]["version"] == "1.0"
    assert "standin is done" in (run.directory.log / "simulate.out").read_text()


def test_raw_frames_go_after_success_and_stay_after_a_failure(standin, planned):
    (run,) = planned("standin")
    supervise(run)
    assert not (run.directory.deck / "frames").exists()
    assert (run.directory.deck / "deck.txt").exists()
    standin(standin=["crash", 4])
    supervise(run)
    assert len(list((run.directory.deck / "frames").iterdir())) == 4


def test_two_engines_give_the_same_names_shapes_units_and_times(standin, planned):
    results = []
    for run in planned("standin", "standin-coarse"):
        assert supervise(run).state == "ok"
        results.append(read(run.directory.result))
    fine, coarse = results
    assert set(fine.observables) == set(coarse.observables) and fine.observables
    for name, a in fine.observables.items():
        b = coarse.observables[name]
        assert (a.value.shape, a.unit, a.components, a.title) == (b.value.shape, b.unit, b.components, b.title)
        assert (a.time == b.time).all() and a.time[0] == 0
    assert fine.observables["energy"].step[-1] == 1000 and coarse.observables["energy"].step[-1] == 100


@pytest.mark.parametrize(
    ("mode", "reason", "detail"),
    [
        ("crash", "engine error", "exit code 3"),
        ("segfault", "signal", "SIGSEGV"),
        ("memory", "memory", "exit code 1"),
        ("short", "no output", "7 frames are missing, the first at t = 0.004 s"),
        ("says", "energy", "the stand-in says so"),
    ],
)
def test_a_failure_keeps_what_was_produced(standin, planned, mode, reason, detail):
    standin(standin=[mode, 4])
    (run,) = planned("standin")
    status = supervise(run)
    assert (status.state, status.reason) == ("failed", reason)
    assert detail in status.detail
    assert "standin starts" in status.log_tail
    assert len(read(run.directory.result).observables["ball_displacement"].time) == 4
    assert validate(run.directory.result) == []


def test_the_error_output_is_in_the_log_tail(standin, planned):
    standin(standin=["crash", 0])
    (run,) = planned("standin")
    assert "something is wrong here" in supervise(run).log_tail


@pytest.mark.parametrize(("spoil", "reason"), [("nan", "nan"), ("lost", "lost particles")])
def test_frames_are_judged_though_the_engine_ends_with_code_zero(standin, planned, spoil, reason):
    (run,) = planned("standin", spoil=spoil)
    status = supervise(run)
    assert (status.state, status.reason, status.exit_code) == ("failed", reason, 0)
    assert "0.003" in status.detail
    assert validate(run.directory.result) == []


def test_a_nan_ends_a_run_that_would_go_on(standin, planned):
    standin(standin=["hang", 8])
    (run,) = planned("standin", spoil="nan")
    assert supervise(run, checkpoint=0.1).reason == "nan"


def test_a_deck_that_cannot_be_written(standin, planned):
    (run,) = planned("standin-wordless")
    status = supervise(run)
    assert (status.state, status.reason) == ("failed", "engine error")
    assert "no ink left" in status.detail and "Traceback" in status.log_tail


@pytest.mark.parametrize("mode", ["hang", "ignore"])
def test_a_timeout_ends_the_whole_process_tree(standin, planned, mode):
    standin(standin=[mode, 5])
    (run,) = planned("standin", timeout=4)
    status = supervise(run)
    assert status.state == "timeout" and "4 s" in status.detail
    assert len(pids(run)) == 2
    for pid in pids(run):
        wait_for(lambda pid=pid: gone(pid))
    assert len(read(run.directory.result).observables["ball_displacement"].time) == 5


def test_killing_the_engine_is_a_failure_and_leaves_nothing_behind(standin, planned):
    standin(standin=["hang", 5])
    (run,) = planned("standin")
    statuses = []
    thread = threading.Thread(target=lambda: statuses.append(supervise(run)))
    thread.start()
    engine, grandchild = wait_for(lambda: len(pids(run)) == 2 and pids(run))
    os.kill(engine, signal.SIGKILL)
    thread.join(30)
    assert (statuses[0].state, statuses[0].reason, statuses[0].signal) == ("failed", "signal", "SIGKILL")
    wait_for(lambda: gone(grandchild))


def test_an_interrupt_keeps_the_partial_result(standin, planned):
    standin(standin=["hang", 5])
    (run,) = planned("standin")
    stop, statuses = threading.Event(), []
    thread = threading.Thread(target=lambda: statuses.append(supervise(run, stop=stop)))
    thread.start()
    wait_for(lambda: len(pids(run)) == 2)
    stop.set()
    thread.join(30)
    assert statuses[0].state == "interrupted"
    assert only_record(run).result.status["state"] == "interrupted"
    assert len(only_record(run).result.observables["ball_displacement"].time) == 5


def test_checkpoints_are_readable_while_the_run_goes_on(standin, planned):
    standin(standin=["hang", 5])
    (run,) = planned("standin")
    stop = threading.Event()
    thread = threading.Thread(target=lambda: supervise(run, stop=stop, checkpoint=0.1))
    thread.start()
    try:
        wait_for(lambda: run.directory.result.exists() and len(read(run.directory.result).observables["low"].time) == 5)
        assert validate(run.directory.result) == []
        assert only_record(run).status.state == "running"
        with pytest.raises(Occupied):
            run.directory.claim(run.spec)
    finally:
        stop.set()
        thread.join(30)


def test_the_judge_decides_between_ok_and_inaccurate(standin, planned):
    seen = []

    def judge(run, result):
        seen.append((run.spec.engine, result))
        return Verdict(state="inaccurate", scored=True, detail="too deep")

    (run,) = planned("standin")
    status = supervise(run, judge=judge)
    assert (status.state, status.scored, status.detail) == ("inaccurate", True, "too deep")
    assert isinstance(seen[0][1], Result) and seen[0][0] == "standin"
    standin(standin=["crash", 2])
    supervise(run, judge=judge)
    assert len(seen) == 1, "a run that failed is not judged"


def _schedule(runs, at_once=1, fresh=False):
    scheduler = Scheduler([Job(r, r.action(fresh)) for r in runs], available_cores(), at_once)
    scheduler.start()
    wait_for(lambda: scheduler.wait(0.1), 60)
    return {job.run.spec.engine: job for job in scheduler.jobs}


def test_a_failed_engine_does_not_stop_the_others_and_is_run_again_alone(standin, planned):
    standin(standin=["crash", 2])
    names = ("standin", "standin-coarse", "standin-absent", "standin-picky")
    first = _schedule(planned(*names))
    assert {n: j.status.state for n, j in first.items()} == {
        "standin": "failed",
        "standin-coarse": "ok",
        "standin-absent": "missing",
        "standin-picky": "skipped",
    }
    assert first["standin-absent"].status.install == "apt install standin"
    assert "polydisperse" in first["standin-picky"].status.detail
    assert len(find_runs(first["standin"].run.directory.path.parent)) == 4

    standin()
    again = planned(*names)
    assert [run.action() for run in again] == ["run", "reuse", "missing", "skip"]
    second = _schedule(again)
    assert second["standin"].status.state == "ok"
    assert second["standin-coarse"].status == first["standin-coarse"].status
    assert [run.action() for run in planned(*names)][:2] == ["reuse", "reuse"]
    assert [run.action(fresh=True) for run in planned(*names)] == ["run", "run", "missing", "skip"]


def test_a_reused_run_is_judged_by_the_references_of_today(standin, planned):
    standin()

    def carried_out(verdict):
        (run,) = planned("standin")
        job = Job(run, run.action())
        scheduler = Scheduler([job], CORES, 1, judge=lambda run, result: verdict)
        scheduler.start()
        wait_for(lambda: scheduler.wait(0.1), 60)
        return job

    strict = carried_out(Verdict(state="inaccurate", scored=True, detail="too deep"))
    assert (strict.action, strict.status.state) == ("run", "inaccurate")
    mended = carried_out(Verdict(state="ok", scored=True))
    assert (mended.action, mended.status.state, mended.status.detail) == ("reuse", "ok", "")
    assert only_record(mended.run).status.state == "ok"
    assert mended.status.wall == strict.status.wall


def test_an_earlier_attempt_is_kept_aside(standin, planned):
    standin(standin=["crash", 2])
    (run,) = planned("standin")
    supervise(run)
    standin()
    supervise(run)
    previous = run.directory.path.with_name(f".{run.directory.path.name}.previous")
    assert find_runs(previous)[0].status.state == "failed"
    assert [r.name for r in find_runs(run.directory.path.parent)] == [run.spec.name()]


def test_runs_at_the_same_time_have_cores_of_their_own(standin, planned):
    jobs = _schedule(planned("standin", "standin-coarse"), at_once=2)
    pinned = [find_runs(j.run.directory.path)[0].environment["pinned_to"] for j in jobs.values()]
    assert all(len(cores) == 1 for cores in pinned)
    if len(available_cores()) > 1:
        assert pinned[0] != pinned[1], "both start at once"
    assert {j.status.state for j in jobs.values()} == {"ok"}


def test_the_quietest_core_is_chosen(standin, planned, monkeypatch):
    busy = dict.fromkeys(available_cores()[:-1], 1.0)
    monkeypatch.setattr("dembench.runs.scheduler.busy_shares", lambda cores: busy)
    job = _schedule(planned("standin"))["standin"]
    assert find_runs(job.run.directory.path)[0].environment["pinned_to"] == [available_cores()[-1]]


def test_the_engine_runs_on_its_cores_only(standin, planned):
    standin(standin=["hang", 5])
    (run,) = planned("standin")
    stop = threading.Event()
    thread = threading.Thread(target=lambda: supervise(run, stop=stop))
    thread.start()
    try:
        for pid in wait_for(lambda: len(pids(run)) == 2 and pids(run)):
            assert psutil.Process(pid).cpu_affinity() == list(CORES)
    finally:
        stop.set()
        thread.join(30)


def test_an_error_of_ours_fails_one_run_only(standin, planned, monkeypatch):
    runs = planned("standin", "standin-coarse")
    monkeypatch.setattr("dembench.runs.supervise.write", lambda result, path: 1 / 0)
    jobs = _schedule(runs)
    assert {j.status.reason for j in jobs.values()} == {"supervisor error"}
    assert "ZeroDivisionError" in jobs["standin"].status.detail
    assert all(Path(r.directory.path / "status.json").exists() for r in runs)


def test_an_error_of_scoring_loses_no_result(standin, planned):
    (run,) = planned("standin")
    status = supervise(run, judge=lambda run, result: Verdict(scored=1 / 0))
    assert (status.state, status.scored) == ("ok", False)
    assert "could not be scored: ZeroDivisionError" in status.detail
    assert only_record(run).result is not None
