"""One phase of a run as a supervised child process: time limit, interruption, logs, resources of the process tree."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Literal

import psutil

from dembench.engines.base import Phase

LAUNCHER = Path(__file__).with_name("launch.py")
SAMPLE_INTERVAL = 0.5
SAMPLE_SHARE = 0.005
"""Largest share of the time that goes into sampling: on a machine with thousands of processes it takes a while [-]."""
LONGEST_POLL = 0.1
END_GRACE = 10.0
"""Time that the guard has for ending the engine before everything is killed [s]."""

Stop = Literal["timeout", "interrupted", "fault"]


@dataclass
class Usage:
    """Resources of a process tree.

    Attributes:
        wall: Wall time [s].
        cpu: CPU time of all processes, exact at the end [s].
        peak_memory: Largest resident memory [bytes]: of the sum of all processes, sampled, or of the largest one,
            exact; the larger of both.
        waited: Time that runnable threads waited for a core [s]; None where the system does not tell.
    """

    wall: float = 0.0
    cpu: float = 0.0
    peak_memory: int = 0
    waited: float | None = None


@dataclass(frozen=True)
class Ended:
    """How a phase ended: exit code or signal, why it was stopped, what it used."""

    exit_code: int | None
    signal: str | None
    stopped: Stop | None
    usage: Usage


def run_phase(
    phase: Phase,
    deck: Path,
    log: Path,
    cores: Iterable[int],
    deadline: float | None,
    stop: Event,
    tick: Callable[[], Stop | None],
    usage: Usage,
    started: Callable[[int], None] = lambda guard: None,
) -> Ended:
    """Runs one phase to its end.

    Args:
        phase: What is run.
        deck: Directory in which it runs.
        log: Directory for `<phase>.out` and `<phase>.err`.
        cores: Numbers of the cores that it is pinned to; none leaves it free.
        deadline: Time on the monotonic clock at which it is ended [s], or None.
        stop: Ends it when set.
        tick: Called again and again meanwhile; may ask for the end.
        usage: Kept up to date meanwhile, exact at the end.
        started: Called with the number of the guard's process once it runs.
    """
    pinned = ",".join(map(str, cores))
    reading, writing = os.pipe()
    with (
        open(log / f"{phase.name}.out", "ab") as out,
        open(log / f"{phase.name}.err", "ab") as err,
        open(reading, "rb") as memory,
    ):
        begin = time.monotonic()
        try:
            child = subprocess.Popen(
                [sys.executable, "-I", "-S", str(LAUNCHER), str(os.getpid()), pinned, str(writing), *phase.command],
                cwd=deck,
                env={**os.environ, **phase.environment},
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                start_new_session=True,
                pass_fds=(writing,),
            )
        finally:
            os.close(writing)
        started(child.pid)
        tree = _Tree(child.pid, usage)
        stopped: Stop | None = None
        while (ended := _poll(child.pid)) is None:
            tree.sample()
            if stopped is None:
                elapsed = usage.wall = time.monotonic() - begin
                if deadline is not None and time.monotonic() >= deadline:
                    stopped = "timeout"
                elif stop.wait(min(LONGEST_POLL, 0.002 + 0.02 * elapsed)):
                    stopped = "interrupted"
                else:
                    stopped = tick()
                if stopped is not None:
                    # not by Popen, which would take the exit status of a child that has just ended
                    os.kill(child.pid, signal.SIGTERM)
                    asked = time.monotonic()
            else:
                if time.monotonic() > asked + END_GRACE:
                    tree.kill()
                time.sleep(0.01)
        status, used = ended
        child.returncode = os.waitstatus_to_exitcode(status)
        tree.kill()
        usage.wall = time.monotonic() - begin
        usage.cpu = used.ru_utime + used.ru_stime
        usage.peak_memory = max(usage.peak_memory, 1024 * int(memory.read() or 0))
    code, name = _outcome(child.returncode)
    return Ended(code, name, stopped, usage)


def _poll(pid: int) -> tuple[int, resource.struct_rusage] | None:
    """Wait status and resource usage of a child, its own descendants included; None while it runs."""
    found, status, used = os.wait4(pid, os.WNOHANG)
    return (status, used) if found else None


def _outcome(code: int) -> tuple[int | None, str | None]:
    """Exit code or name of the signal; a code above 128 is how shells and mpirun report a signal."""
    number = -code if code < 0 else code - 128
    known = {s.value: s.name for s in signal.Signals}
    return (None if code < 0 else code), known.get(number)


class _Tree:
    """The processes below a guard, sampled."""

    def __init__(self, pid: int, usage: Usage) -> None:
        self.usage = usage
        self._guard = psutil.Process(pid)
        self._known: dict[int, psutil.Process] = {}
        self._waited: dict[tuple[int, str], float] = {}
        self._next = 0.0

    def sample(self) -> None:
        """Updates the usage; does nothing where the last sample is fresh."""
        begin = time.monotonic()
        if begin < self._next:
            return
        self._sample()
        now = time.monotonic()
        self._next = now + max(SAMPLE_INTERVAL, (now - begin) / SAMPLE_SHARE)

    def _sample(self) -> None:
        try:
            processes = self._guard.children(recursive=True)
        except psutil.Error:
            return
        memory, cpu = 0, 0.0
        for process in processes:
            self._known[process.pid] = process
            try:
                memory += process.memory_info().rss
                times = process.cpu_times()
                cpu += times.user + times.system
            except psutil.Error:
                continue
            self._sample_waiting(process.pid)
        self.usage.peak_memory = max(self.usage.peak_memory, memory)
        self.usage.cpu = max(self.usage.cpu, cpu)
        if self._waited:
            self.usage.waited = sum(self._waited.values())

    def kill(self) -> None:
        """Kills the guard and all that was seen below it and is still there."""
        for process in [self._guard, *self._known.values()]:
            try:
                process.kill()
            except psutil.Error:
                continue

    def _sample_waiting(self, pid: int) -> None:
        """Second field of the scheduler's statistics of each thread: time on the run queue [ns] (proc(5))."""
        for path in Path(f"/proc/{pid}/task").glob("*/schedstat"):
            try:
                self._waited[pid, path.parent.name] = int(path.read_text().split()[1]) * 1e-9
            except (OSError, ValueError, IndexError):
                continue
