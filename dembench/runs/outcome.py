"""Why a run is no result: decided from what came out, never from the exit code alone."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import psutil

from dembench.engines.base import Series
from dembench.results.observe import Fault
from dembench.runs.process import Ended

MEMORY_SHARE = 0.8
"""A process killed from outside while the run held this share of the machine's memory ran out of it [-]."""
ASKED_TO_END = ("SIGTERM", "SIGINT", "SIGHUP")
"""Signals that batch systems send to all processes of a job: the run itself is not to blame."""
_OUT_OF_MEMORY = re.compile(r"MemoryError|bad_alloc|[Cc]annot allocate memory|[Oo]ut of memory")


@dataclass(frozen=True)
class Failure:
    """Final state of a run that is no result, with its reason and one line about it."""

    state: Literal["failed", "timeout", "interrupted"]
    reason: str
    detail: str


def failure_of(
    ended: Ended | None,
    series: Series,
    fault: Fault | None,
    *,
    missing: np.ndarray,
    short: Sequence[str],
    timeout: float | None,
    log_tail: str,
) -> Failure | None:
    """The failure of a run, or None where it is complete: one that was at its end when it was stopped is, too.

    Args:
        ended: How its last phase ended.
        series: What the engine's output says.
        fault: What the frames show.
        missing: Times of the frames that are missing [s].
        short: Observables with missing rows.
        timeout: Its time limit [s].
        log_tail: Last lines of its logs.
    """
    complete = series.failure is None and not len(missing) and not short
    cut_off = ended is not None and not (ended.exit_code == 0 and complete)
    if ended is not None and ended.stopped == "interrupted" and cut_off:
        return Failure("interrupted", "", f"stopped by the user at t = {series.time:.6g} s")
    if ended is not None and ended.stopped == "timeout" and cut_off:
        return Failure("timeout", "", f"not done within {timeout:g} s; t = {series.time:.6g} s was reached")
    if fault is not None and fault.reason == "nan":
        return Failure("failed", fault.reason, fault.detail)
    if ended is not None and _out_of_memory(ended, log_tail):
        return Failure("failed", "memory", f"{ended.usage.peak_memory / 1e9:.2f} GB were in use; {_how(ended)}")
    if ended is not None and ended.signal in ASKED_TO_END and ended.stopped is None:
        return Failure("interrupted", "", f"{ended.signal} ended it at t = {series.time:.6g} s")
    if ended is not None and ended.signal and ended.stopped is None:
        return Failure("failed", "signal", f"{ended.signal} ended it at t = {series.time:.6g} s")
    if series.failure is not None:
        return Failure("failed", series.failure, series.detail)
    if fault is not None:
        return Failure("failed", fault.reason, fault.detail)
    if ended is not None and ended.exit_code:
        return Failure("failed", "engine error", _how(ended))
    if len(missing):
        return Failure("failed", "no output", f"{len(missing)} frames are missing, the first at t = {missing[0]:.6g} s")
    if short:
        return Failure("failed", "no output", f"rows are missing in {', '.join(short)}")
    return None


def _out_of_memory(ended: Ended, log_tail: str) -> bool:
    if ended.stopped is not None or not (ended.signal or ended.exit_code):
        return False
    full = ended.usage.peak_memory > MEMORY_SHARE * psutil.virtual_memory().total
    return (ended.signal == "SIGKILL" and full) or _OUT_OF_MEMORY.search(log_tail) is not None


def _how(ended: Ended) -> str:
    return f"ended by {ended.signal}" if ended.signal else f"exit code {ended.exit_code}"
