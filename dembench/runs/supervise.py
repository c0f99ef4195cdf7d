"""One run from its deck to its result: launches the phases, watches them, and is the only writer of the result."""

from __future__ import annotations

import shlex
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from threading import Event
from typing import Any

from dembench.engines.base import Series, Timing
from dembench.results import Observer, Result, channels, read, write
from dembench.runs import environment
from dembench.runs.directory import now
from dembench.runs.outcome import Failure, failure_of
from dembench.runs.plan import PlannedRun
from dembench.runs.process import Ended, Stop, Usage, run_phase
from dembench.runs.states import State, Status, Verdict
from dembench.runs.tidy import remove_raw_frames

CHECKPOINT = 30.0
"""Time between two checkpoints of the result [s]; the first ones come sooner."""
FIRST_CHECKPOINT = 2.0
LOOK_INTERVAL = 2.0
LOOK_SHARE = 0.05
"""Largest share of the time that may go into looking at a running deck [-]."""

Judge = Callable[[PlannedRun, Result], Verdict]
"""Gives a finished run its verdict; the layers above bring it."""


@dataclass
class Progress:
    """How far a run is, as shown while it goes on.

    Attributes:
        state: Its state; None before its start.
        fraction: Simulated time reached, as a share of the duration [-].
        elapsed: Wall time since the start [s].
        memory: Peak memory of its processes so far [bytes].
        note: What it is doing, or the reason of its end.
    """

    state: State | None = None
    fraction: float = 0.0
    elapsed: float = 0.0
    memory: int = 0
    note: str = "waiting"

    def left(self) -> float | None:
        """Estimated wall time to the end [s]; None while too little is known."""
        return self.elapsed * (1 - self.fraction) / self.fraction if self.fraction > 0.01 else None


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
        checkpoint: float = CHECKPOINT,
        command: str = "",
        progress: Progress | None = None,
    ) -> None:
        """Prepares a run.

        Args:
            run: The run.
            cores: Numbers of the cores that it is pinned to.
            stop: Interrupts it when set.
            judge: Gives its verdict; None leaves it unscored.
            checkpoint: Time between checkpoints of the result [s].
            command: Command line that asked for it.
            progress: Kept up to date while it goes on.
        """
        self._run, self._cores, self._stop = run, tuple(cores), stop
        self._judge, self._checkpoint, self._command = judge, checkpoint, command
        self._progress = progress or Progress()
        self._observer = Observer(run.scene)
        self._series = Series(frames=(), tracks=None)
        self._usage: dict[str, Usage] = {}
        self._timed: list[str] = []
        self._next_look = 0.0
        self._pause = min(FIRST_CHECKPOINT, checkpoint)
        self._next_checkpoint = time.monotonic() + self._pause
        self._environment: dict[str, Any] = {}
        self._status = Status(state="running", frames_expected=len(run.scene.frame_times()))

    def run(self) -> Status:
        """Runs to the end, whatever that is; the status is also in `status.json`.

        Raises:
            Occupied: Another supervisor works on the same run.
        """
        self._run.directory.claim(self._run.spec)
        begin = time.monotonic()
        self._set(state="running", started=now())
        self._progress.note = "writing the deck"
        ended, failure = self._carry_out(begin)
        self._look(final=True)
        failure = failure or self._failure(ended)
        self._set(
            ended=now(),
            wall=time.monotonic() - begin,
            phase=next(reversed(self._usage), ""),
            exit_code=ended.exit_code if ended else None,
            signal=ended.signal if ended else None,
            contended=self._contended(),
        )
        self._conclude(failure)
        self._write_result()
        if self._status.state in ("ok", "inaccurate"):
            remove_raw_frames(self._run.directory.deck)
        self._run.directory.write_status(self._status)
        self._progress.note = self._status.detail or self._status.reason
        return self._status

    # ---- the parts of a run

    def _carry_out(self, begin: float) -> tuple[Ended | None, Failure | None]:
        """Writes the deck and runs its phases up to the first that does not end well."""
        run, paths = self._run, self._run.directory
        busy = max(environment.busy_shares(self._cores).values(), default=None)
        self._environment = {
            **environment.environment(self._cores, busy),
            "engine": run.probe.model_dump(mode="json"),
        }
        paths.write_environment(self._environment)
        try:
            phases = run.engine.write(run.scene, run.settings, paths.deck)
        except Exception as error:
            (paths.log / "write.err").write_text(traceback.format_exc())
            return None, Failure("failed", "engine error", f"the deck could not be written: {error}")
        deadline = begin + run.spec.timeout if run.spec.timeout else None
        ended = None
        for phase in phases:
            self._progress.note = phase.name
            usage = self._usage[phase.name] = Usage()
            ended = run_phase(
                phase, paths.deck, paths.log, self._cores, deadline, self._stop, lambda: self._tick(begin), usage
            )
            if phase.timed:
                self._timed.append(phase.name)
            if ended.stopped or ended.signal or ended.exit_code:
                break
        return ended, None

    def _tick(self, begin: float) -> Stop | None:
        """Shows the progress and now and then looks at the running deck and writes a checkpoint."""
        clock = time.monotonic()
        self._progress.elapsed = clock - begin
        self._progress.memory = max(u.peak_memory for u in self._usage.values())
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
        self._progress.fraction = min(1.0, self._series.time / self._run.scene.duration)

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
            resources=self._resources(),
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
        self._status = going_on.model_copy(update={"state": "interrupted", "reason": "checkpoint"})
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
        """Sums over the timed phases, the largest memory of all, and every phase by itself."""
        timed = [u for name, u in self._usage.items() if name in self._timed] or list(self._usage.values())
        waited = [u.waited for u in timed if u.waited is not None]
        return {
            "wall": sum(u.wall for u in timed),
            "cpu": sum(u.cpu for u in timed),
            "waited": sum(waited) if waited else None,
            "peak_memory": max((u.peak_memory for u in self._usage.values()), default=0),
            "phases": {name: asdict(usage) for name, usage in self._usage.items()},
        }

    def _contended(self) -> bool:
        used = self._resources()
        return environment.contended(self._environment.get("busy_before"), used["waited"], used["cpu"])

    def _set(self, **changes: Any) -> None:
        self._status = self._status.model_copy(update=changes)
        self._progress.state = self._status.state


def command_line() -> str:
    """The command as typed, for the record."""
    return shlex.join(["dembench", *sys.argv[1:]])
