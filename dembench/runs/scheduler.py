"""Hands out cores: runs that are timed at the same time never share one, nor a device."""

from __future__ import annotations

import math
import os
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from dembench.runs.directory import Occupied
from dembench.runs.environment import busy_shares
from dembench.runs.plan import PlannedRun
from dembench.runs.progress import Progress
from dembench.runs.states import Status
from dembench.runs.supervise import Supervisor, missing, rejudged, skipped


@dataclass
class Job:
    """A planned run on its way through the scheduler.

    Attributes:
        run: The run.
        action: See `PlannedRun.action`.
        progress: How far it is.
        status: How it ended; None before that.
    """

    run: PlannedRun
    action: str
    progress: Progress = field(default_factory=Progress)
    status: Status | None = None


class Scheduler:
    """Carries out planned runs in their order, as many at a time as cores and devices allow."""

    def __init__(
        self, jobs: Sequence[Job], cores: Sequence[int], at_once: int, *, budget: float | None = None, **options: Any
    ) -> None:
        """Prepares the jobs.

        Args:
            jobs: The jobs.
            cores: Numbers of the cores that may be used.
            at_once: Largest number of runs at a time.
            budget: Time after which no other run is started [s]; those that go on then come to their end. None for no
                limit.
            options: Passed on to each `Supervisor`.
        """
        self.jobs = list(jobs)
        self.stop = threading.Event()
        self._free, self._at_once, self._options = sorted(cores), at_once, options
        self._last_start = math.inf if budget is None else time.monotonic() + budget
        self._changed = threading.Condition()
        self._running: list[Job] = []
        self._waiting = [job for job in self.jobs if job.action in ("run", "resume")]

    def start(self) -> None:
        """Settles the jobs that need no run and starts the first ones."""
        for job in self.jobs:
            if job.action == "reuse":
                job.status = self._settled(job, lambda run: rejudged(run, self._options.get("judge")))
            elif job.action in ("skip", "missing"):
                job.status = self._settled(job, skipped if job.action == "skip" else missing)
            if job.status is not None:
                job.progress.state = job.status.state
                job.progress.note = "reused" if job.action == "reuse" else job.status.detail
        with self._changed:
            self._start_next()

    def wait(self, timeout: float) -> bool:
        """Waits for a change or the time [s]; True once all jobs have ended."""
        with self._changed:
            if self._running or self._waiting:
                self._changed.wait(timeout)
            return not self._running and not self._waiting

    def interrupt(self) -> None:
        """Ends the runs that go on and starts no other."""
        self.stop.set()

    def _start_next(self) -> None:
        """Starts the first waiting runs that fit; the condition is held."""
        spent = time.monotonic() > self._last_start
        if self.stop.is_set() or spent:
            for job in self._waiting:
                job.progress.note = "not started: the budget is spent" if spent else "not started"
            self._waiting.clear()
        while self._waiting and len(self._running) < self._at_once:
            job = self._waiting[0]
            spec = job.run.spec
            devices = {other.run.spec.device for other in self._running} - {"cpu"}
            if spec.cores > len(self._free) or spec.device in devices:
                return
            cores = _quietest(self._free, spec.cores)
            self._free = [core for core in self._free if core not in cores]
            self._waiting.pop(0)
            self._running.append(job)
            threading.Thread(target=self._carry_out, args=(job, cores), name=spec.name()).start()

    def _carry_out(self, job: Job, cores: list[int]) -> None:
        options = {**self._options, "progress": job.progress}
        job.status = self._settled(job, lambda run: Supervisor(run, cores, self.stop, **options).run())
        job.progress.state = job.status.state
        job.progress.note = job.status.detail or job.status.reason
        with self._changed:
            self._running.remove(job)
            self._free = sorted([*self._free, *cores])
            self._start_next()
            self._changed.notify_all()

    def _settled(self, job: Job, act: Callable[[PlannedRun], Status]) -> Status:
        """The status of a job; an error of ours fails that run and no other."""
        try:
            return act(job.run)
        except Occupied as error:
            return Status(state="running", reason="occupied", detail=str(error))
        except Exception as error:
            directory = job.run.directory
            status = Status(
                state="failed",
                reason="supervisor error",
                detail=f"{type(error).__name__}: {error}",
                log_tail=traceback.format_exc(),
            )
            if directory.supervisor() == os.getpid():
                directory.write_status(status)
            return status


def _quietest(free: Sequence[int], count: int) -> list[int]:
    """Those of the free cores that other programs use least: they may be pinned too."""
    if count == len(free):
        return list(free)
    shares = busy_shares(free)
    return sorted(sorted(free, key=lambda core: round(shares.get(core, 0.0), 1))[:count])
