"""Guard between the supervisor and an engine: `launch.py SUPERVISOR_PID CORES DESCRIPTOR COMMAND...`.

It pins the engine to its cores, ends as the engine ends, and takes every process that the engine started with it,
also where the supervisor is killed outright. At the end it writes the peak memory of its largest descendant [kB] to the
descriptor: what the supervisor itself could ask for also counts the memory that the supervisor had when it forked.
It is a program of its own, of the standard library alone, so that it starts within milliseconds and forks from a single
thread.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
import sys
import time
from pathlib import Path

PR_SET_PDEATHSIG = 1
PR_SET_CHILD_SUBREAPER = 36
GRACE = 5.0
"""Time between asking processes to end and killing them [s]: enough for a checkpoint of 100 000 bodies."""


def main(arguments: list[str]) -> None:
    """Runs the command; does not return."""
    supervisor, cores, report, command = int(arguments[0]), arguments[1], int(arguments[2]), arguments[3:]
    os.set_inheritable(report, False)
    _prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    _prctl(PR_SET_CHILD_SUBREAPER, 1)
    if os.getppid() != supervisor:
        sys.exit("the supervisor is gone")
    if cores and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {int(core) for core in cores.split(",")})
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    guard = os.getpid()
    engine = os.fork()
    if engine == 0:
        _become(command, guard)
    signal.signal(signal.SIGTERM, lambda *_: _end(engine, report))
    code = _wait_for(engine)
    _kill_descendants(signal.SIGKILL)
    _reap()
    _report_memory(report)
    if code < 0:
        if -code != signal.SIGKILL:
            signal.signal(-code, signal.SIG_DFL)
        os.kill(guard, -code)
    os._exit(code if code >= 0 else 128 - code)


def _become(command: list[str], guard: int) -> None:
    _prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != guard:
        os._exit(1)
    try:
        os.execvp(command[0], command)
    except OSError as error:
        print(f"cannot start {command[0]}: {error.strerror}", file=sys.stderr, flush=True)
        os._exit(127)


def _wait_for(engine: int) -> int:
    """Exit code of the engine, negative for a signal; orphans of it are collected on the way.

    Once it has ended, the guard is not to be stopped any more: that would hide how it ended.
    """
    while True:
        ended = os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOWAIT)
        if ended is not None and ended.si_pid == engine:
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
        pid, status = os.waitpid(ended.si_pid if ended is not None else -1, 0)
        if pid == engine:
            return os.waitstatus_to_exitcode(status)


def _report_memory(report: int) -> None:
    with contextlib.suppress(BrokenPipeError):
        os.write(report, str(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss).encode())


def _end(engine: int, report: int) -> None:
    """Asks all descendants to end, then kills those that have not; exit code 0 where the engine was done."""
    _kill_descendants(signal.SIGTERM)
    deadline = time.monotonic() + GRACE
    done = False
    while time.monotonic() < deadline and _descendants():
        done |= (engine, 0) in _reap_ended()
        time.sleep(0.02)
    done |= (engine, 0) in _reap_ended()
    _kill_descendants(signal.SIGKILL)
    _reap()
    _report_memory(report)
    os._exit(0 if done else 128 + signal.SIGTERM)


def _kill_descendants(number: int) -> None:
    for pid in _descendants():
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)


def _reap() -> None:
    with contextlib.suppress(ChildProcessError):
        while True:
            os.wait()


def _reap_ended() -> list[tuple[int, int]]:
    """Process ids and wait statuses of the descendants that have ended."""
    ended: list[tuple[int, int]] = []
    with contextlib.suppress(ChildProcessError):
        while (one := os.waitpid(-1, os.WNOHANG))[0]:
            ended.append(one)
    return ended


def _descendants() -> list[int]:
    """Process ids of all descendants that have not ended; as their reaper this process keeps orphans too."""
    children: dict[int, list[int]] = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if fields[0] != "Z":
            children.setdefault(int(fields[1]), []).append(int(entry.name))
    found, queue = [], [os.getpid()]
    while queue:
        below = children.get(queue.pop(), [])
        found += below
        queue += below
    return found


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


if __name__ == "__main__":
    main(sys.argv[1:])
