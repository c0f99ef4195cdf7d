"""Speeds: CPU times of runs over that of the reference workload."""

from __future__ import annotations

from collections.abc import Sequence

from dembench.regression.metrics import SPEED, Key, Metric
from dembench.regression.records import engine_of, grouped, problem_of
from dembench.runs import workload
from dembench.runs.directory import RunRecord
from dembench.verification.rows import MEASURED

TITLE = "CPU time over that of the reference workload"


def speeds(records: Sequence[RunRecord]) -> list[Metric]:
    """Speeds over repeats and seeds, of runs that were timed beside the reference workload and came to their end.

    The workload was done before and after each of them; its fastest passes are the reference of all.
    """
    timed = [r for r in records if r.status.state in MEASURED and r.result is not None and not r.status.resumed]
    found = []
    for (problem, engine, processor), own in grouped(timed, _timed_as).items():
        results = [record.result for record in own if record.result is not None]
        known = [result.resources.get(workload.RECORD, {}) for result in results]
        beside = [record["passes"] for record in known if record.get("version") == workload.VERSION]
        times = [workload.cpu_time(result.timing, result.resources) for result in results]
        if beside and all(times):
            reference = workload.reference_time(beside)
            values = tuple(time / reference for time in times if time)
            key = Key(problem, engine, "speed", processor)
            found.append(Metric(key, TITLE, "1", "speed", values, worse="higher", margin=SPEED))
    return found


def _timed_as(record: RunRecord) -> tuple[str, ...]:
    return (problem_of(record), engine_of(record), str(record.environment.get("cpu", "")))
