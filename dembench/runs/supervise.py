"""One run from its deck to its result: launches the phases, watches them, and is the only writer of the result."""

from __future__ import annotations

import shlex
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from threading import Event
from typing import Any

from dembench.engines.base import Phase, Series, Timing
from dembench.results import Observer, Result, channels, read, write
from dembench.runs import environment, workload
from dembench.runs.attempts import Earlier, resources, together
from dembench.runs.directory import now
from dembench.runs.outcome import Failure, failure_of
from dembench.runs.plan import PlannedRun
from dembench.runs.process import Ended, Stop, Usage, run_phase
from dembench.runs.progress import Progress
from dembench.runs.states import Resumption, Status, Verdict
from dembench.runs.tidy import remove_bulk

CHECKPOINT = 30.0
"""Time between two checkpoints of the result [s]; the first ones come sooner."""
FIRST_CHECKPOINT = 2.0
GLANCE_INTERVAL = 1.0
"""Time between two glances at how far a run is [s]."""
LOOK_INTERVAL = 2.0
LOOK_SHARE = 0.02
"""Largest share of the time that may go into looking at a running deck [-]."""

Judge = Callable[[PlannedRun, Result], Verdict]
"""Gives a finished run its verdict; the layers above bring it."""


def skipped(run: PlannedRun) -> Status:
    """Records a run whose scene the engine cannot do."""
    return _without_start(run, Status(state="skipped", reason="unsupported", detail="; ".join(run.unsupported)))


def missing(run: PlannedRun) -> Status:
    """Records a run whose engine is not there."""
    detail = run.probe.reason or "the engine was not found"
    return _without_start(
        run, Status(state="missing", reason="not installed", detail=detail, install=run.probe.install)
    )


def rejudged(run: PlannedRun, judge: Judge | None) -> Status:
    """The status of a finished run under the references of today; its record is rewritten where the verdict changes."""
    before = run.before
    assert before is not None, "only a run that has ended is reused"
    if judge is None or before.state not in ("ok", "inaccurate"):
        return before
    found = judge(run, read(run.directory.result))
    status = before.model_copy(update={"state": found.state, "scored": found.scored, "detail": found.detail})
    if status != before:
        run.directory.write_status(status)
    return status


def _without_start(run: PlannedRun, status: Status) -> Status:
    run.directory.claim(run.spec)
    run.directory.write_status(status)
    return status


class Supervisor:
    """Carries out one run."""

    def __init__(
        self,
        run: PlannedRun,
        cores: Sequence[int],
        stop: Event,
        *,
        judge: Judge | None = None,
        fresh: bool = False,
        checkpoint: float = CHECKPOINT,
        command: str = "",
        beside_workload: bool = False,
        progress: Progress | None = None,
    ) -> None:
        """Prepares a run.

        Args:
            run: The run.
            cores: Numbers of the cores that it is pinned to.
            stop: Interrupts it when set.
            judge: Gives its verdict; None leaves it unscored.
            fresh: Begins anew where it could go on from an interruption.
            checkpoint: Time between checkpoints of the result [s].
            command: Command line that asked for it.
            beside_workload: Times the reference workload on the same cores before and after it.
            progress: Kept up to date while it goes on.
        """
        self._run, self._cores, self._stop = run, tuple(cores), stop
        self._judge, self._fresh, self._checkpoint, self._command = judge, fresh, checkpoint, command
        self._beside_workload, self._workload = beside_workload, dict[str, Any]()
        self._progress = progress or Progress()
        self._begin = time.monotonic()
        self._earlier = Earlier()
        self._observer = Observer(run.scene)
        self._series = Series(frames=(), tracks=None)
        self._usage: dict[str, Usage] = {}
        self._timed: list[str] = []
        self._next_look = self._next_glance = 0.0
        self._pause = min(FIRST_CHECKPOINT, checkpoint)
        self._next_checkpoint = time.monotonic() + self._pause
        self._environment: dict[str, Any] = {}
        self._status = Status(state="running", frames_expected=len(run.scene.frame_times()))

    def run(self) -> Status:
        """Runs to the end, whatever that is; the status is also in `status.json`.

        Raises:
            Occupied: Another supervisor works on the same run.
        """
        before = self._run.directory.claim(self._run.spec, keep=not self._fresh)
        self._time_workload()
        self._begin = time.monotonic()
        self._set(state="running", started=now())
        ended, failure = self._carry_out(before)
        self._look(final=True)
        failure = failure or self._failure(ended)
        self._set(
            ended=now(),
            wall=self._wall(),
            phase=next(reversed(self._usage), ""),
            exit_code=ended.exit_code if ended else None,
            signal=ended.signal if ended else None,
            contended=self._contended(),
        )
        self._time_workload()
        self._conclude(failure)
        self._write_result()
        if self._status.state in ("ok", "inaccurate"):
            remove_bulk(self._run.directory.deck)
        self._run.directory.write_status(self._status)
        self._progress.note = self._status.detail or self._status.reason
        return self._status

    # ---- the parts of a run

    def _carry_out(self, before: Status | None) -> tuple[Ended | None, Failure | None]:
        """Writes the deck, or prepares the one that an attempt before has left, and runs its phases.

        It runs them up to the first that does not end well.
        """
        run, paths = self._run, self._run.directory
        busy = max(environment.busy_shares(self._cores).values(), default=None)
        self._environment = {
            **environment.environment(self._cores, busy),
            "engine": run.probe.model_dump(mode="json"),
        }
        phases = self._resumed(before) if before is not None else None
        paths.write_environment(self._environment)
        if phases is None:
            self._progress.note = "writing the deck"
            try:
                phases = run.engine.write(run.scene, run.settings, paths.deck)
            except Exception as error:
                (paths.log / "write.err").write_text(traceback.format_exc())
                return None, Failure("failed", "engine error", f"the deck could not be written: {error}")
        deadline = self._begin + run.spec.timeout if run.spec.timeout else None
        ended = None
        for phase in phases:
            self._progress.note = phase.name
            usage = self._usage[phase.name] = Usage()
            ended = run_phase(
                phase, paths.deck, paths.log, self._cores, deadline, self._stop, self._tick, usage, paths.watch
            )
            if phase.timed:
                self._timed.append(phase.name)
            if ended.stopped or ended.signal or ended.exit_code:
                break
        return ended, None

    def _time_workload(self) -> None:
        """Adds CPU times of the reference workload to the record of the machine, where they are wanted."""
        if not self._beside_workload or self._stop.is_set():
            return
        self._progress.note = "timing the reference workload"
        try:
            found = workload.measure_on(self._cores)
        except (OSError, subprocess.SubprocessError, ValueError) as error:
            self._remark(f"the reference workload was not timed: {error}")
            return
        self._workload = workload.added(self._workload, found)

    def _resumed(self, before: Status) -> list[Phase] | None:
        """Phases that go on with an earlier attempt; None, with the directory made anew, without a checkpoint of it."""
        run, paths = self._run, self._run.directory
        self._progress.note = "reading the last checkpoint"
        arguments = (run.scene, run.settings, paths.deck)
        try:
            reached = max(before.time, run.engine.read(*arguments).time)
            found = run.engine.checkpoint(*arguments)
            phases = run.engine.resume(*arguments) if found is not None else None
            why = "it left no checkpoint that can be used"
        except Exception as error:
            found, phases, why = None, None, f"it cannot be gone on with: {type(error).__name__}: {error}"
        if found is None or phases is None:
            paths.renew(run.spec)
            self._remark(f"begun anew after an attempt that ended as {before.label()}: {why}")
            return None
        self._earlier = Earlier.of(paths.result)
        there = Resumption(step=found.step, time=found.time, reached=reached, when=now(), note=found.note)
        if (last := self._earlier.status) is not None:
            self._set(started=last.started, resumed=last.resumed)
            self._remark(last.note)
        self._set(resumed=(*self._status.resumed, there))
        for log in paths.log.glob("*.*"):
            with open(log, "a") as stream:
                stream.write(f"--- attempt {len(self._status.resumed) + 1}, from t = {there.time:.6g} s\n")
        self._look()
        return phases

    def _tick(self) -> Stop | None:
        """Shows the progress and now and then looks at the running deck and writes a checkpoint."""
        clock = time.monotonic()
        self._progress.elapsed = clock - self._begin
        self._progress.memory = max(u.peak_memory for u in self._usage.values())
        if clock >= self._next_glance:
            self._glance()
            self._next_glance = clock + GLANCE_INTERVAL
        if clock < self._next_look:
            return None
        self._look()
        if clock >= self._next_checkpoint:
            self._write_checkpoint()
            self._pause = min(2 * self._pause, self._checkpoint)
            self._next_checkpoint = time.monotonic() + self._pause
        cost = time.monotonic() - clock
        self._next_look = time.monotonic() + max(min(LOOK_INTERVAL, self._checkpoint), cost / LOOK_SHARE)
        return "fault" if self._observer.fault is not None else None

    def _glance(self) -> None:
        """Shows how far the run is, where the engine can tell without reading its output."""
        try:
            reached = self._run.engine.reached(self._run.settings, self._run.directory.deck)
        except Exception as error:
            # a display is no reason to lose a run
            self._remark(f"its progress is not known between looks: {type(error).__name__}: {error}")
            reached = None
        if reached is not None:
            self._progress.reach(reached, self._run.scene.duration)

    def _look(self, final: bool = False) -> None:
        """Reads what the engine has written so far; an output that is not readable yet counts at the end only."""
        try:
            self._series = self._run.engine.read(self._run.scene, self._run.settings, self._run.directory.deck)
            self._observer.update(self._series.frames, self._series.tracks)
        except Exception as error:
            if final:
                (self._run.directory.log / "read.err").write_text(traceback.format_exc())
                if self._series.failure is None:
                    detail = f"the output could not be read: {error}"
                    self._series = replace(self._series, failure="no output", detail=detail)
        reached = len(self._run.scene.frame_times()) - len(self._observer.missing())
        self._set(frames=reached, time=self._series.time)
        self._progress.reach(self._series.time, self._run.scene.duration)

    def _failure(self, ended: Ended | None) -> Failure | None:
        observed = self._observer.observed()
        short = [n for n, c in channels(self._run.scene).items() if len(observed[n].time) < len(c.time)]
        return failure_of(
            ended,
            self._series,
            self._observer.fault,
            missing=self._observer.missing(),
            short=short,
            timeout=self._run.spec.timeout,
            log_tail=self._run.directory.log_tail(),
        )

    def _conclude(self, failure: Failure | None) -> None:
        """Sets the final state; a run without failure is judged."""
        if failure is not None:
            self._set(
                state=failure.state,
                reason=failure.reason,
                detail=failure.detail,
                log_tail=self._run.directory.log_tail(),
            )
            return
        verdict = Verdict()
        if self._judge is not None:
            try:
                verdict = self._judge(self._run, self._result())
            except Exception as error:
                (self._run.directory.log / "score.err").write_text(traceback.format_exc())
                verdict = Verdict(detail=f"could not be scored: {type(error).__name__}: {error}")
        self._set(state=verdict.state, scored=verdict.scored, detail=verdict.detail)

    # ---- records

    def _result(self) -> Result:
        run = self._run
        return Result(
            scene=run.scene,
            engine=run.spec.engine,
            division=run.spec.division,
            settings=run.spec.settings,
            environment=self._environment,
            timing=asdict(self._timing()),
            resources={**self._resources(), **({workload.RECORD: self._workload} if self._workload else {})},
            counters=dict(self._series.counters),
            status=self._status.plain(),
            provenance={
                "engine_version": run.spec.engine_version,
                "dembench": self._environment.get("dembench", ""),
                "commit": self._environment.get("commit", ""),
                "run": run.spec.name(),
                "hash": run.spec.digest(),
                "command": self._command,
                "started": self._status.started,
                "written": now(),
            },
            observables=self._observer.observed(),
            snapshots=self._observer.snapshots(),
        )

    def _write_checkpoint(self) -> None:
        """Writes the result so far as that of an interrupted run: that is what it is if nothing follows."""
        going_on = self._status
        update = {"state": "interrupted", "reason": "checkpoint", "wall": self._wall()}
        self._status = going_on.model_copy(update=update)
        self._write_result()
        self._status = going_on

    def _write_result(self) -> None:
        write(self._result(), self._run.directory.result)

    def _timing(self) -> Timing:
        """The engine's own timing; without a loop time, the wall time of its timed phases."""
        timing = self._series.timing
        if timing.loop is None and self._usage:
            return replace(timing, loop=self._resources()["wall"], source="wall")
        return timing

    def _resources(self) -> dict[str, Any]:
        return together([*self._earlier.resources, resources(self._usage, self._timed)])

    def _wall(self) -> float:
        """Wall time of all attempts up to now [s]."""
        before = self._earlier.status
        return (before.wall if before and before.wall else 0.0) + time.monotonic() - self._begin

    def _contended(self) -> bool:
        own, before = resources(self._usage, self._timed), self._earlier.status
        here = environment.contended(self._environment.get("busy_before"), own["waited"], own["cpu"])
        return here or (before is not None and before.contended)

    def _set(self, **changes: Any) -> None:
        self._status = self._status.model_copy(update=changes)
        self._progress.state = self._status.state

    def _remark(self, text: str) -> None:
        """Adds to the note of the status what it does not say yet."""
        note = self._status.note
        if text not in note:
            self._set(note=f"{note}; {text}" if note else text)


def command_line() -> str:
    """The command as typed, for the record."""
    return shlex.join(["dembench", *sys.argv[1:]])
