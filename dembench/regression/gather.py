"""Metrics from run directories: quantities of cases, rows of suites, and speeds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from dembench.cases.base import CaseError
from dembench.cases.registry import parse_case
from dembench.regression.benchmarks import read_benchmarks
from dembench.regression.metrics import (
    SPEED,
    Key,
    Metric,
    RegressionError,
    margin_of,
    worse_of,
)
from dembench.runs import workload
from dembench.runs.directory import RunRecord, find_runs
from dembench.scoring.score import score
from dembench.verification import suites
from dembench.verification.checks import Experiment
from dembench.verification.rows import MEASURED, UNJUDGED, rows_of

SPEED_TITLE = "CPU time over that of the reference workload"


@dataclass(frozen=True)
class Gathered:
    """What sets of runs give.

    Attributes:
        metrics: The metrics, in the order of problems, engines and names.
        runs: The runs that they rest on: of each the latest, whatever became of it.
        versions: Versions of dembench, its commit, the engines and the packages that matter, as the runs recorded them.
        processor: Processor of the runs; several where they differ.
    """

    metrics: tuple[Metric, ...]
    runs: tuple[RunRecord, ...] = ()
    versions: dict[str, str] | None = None
    processor: str = ""

    @property
    def failed(self) -> list[RunRecord]:
        """Runs that gave no result, and of which none is an answer."""
        dead = {trial.name for _, e in _experiments() if e.deaths_count for trial in e.trials}
        accepted = (*MEASURED, "skipped")
        return [r for r in self.runs if r.status.state not in accepted and r.spec.case not in dead]


def gather(paths: Sequence[Path]) -> Gathered:
    """The metrics of all runs in directories and of results of pytest-benchmark in files `*.json`.

    Of runs that differ in nothing but the version of their code or scene, the latest counts.

    Raises:
        RegressionError: A path holds neither.
    """
    records: dict[tuple[Any, ...], RunRecord] = {}
    metrics: list[Metric] = []
    machines: list[tuple[dict[str, str], str]] = []
    for path in paths:
        if path.suffix == ".json":
            found, versions, processor = read_benchmarks(path)
            metrics += found
            machines.append((versions, processor))
            continue
        runs = find_runs(path)
        if not runs:
            raise RegressionError(f"{path} holds no runs; give directories of runs or JSON files of pytest-benchmark")
        for record in runs:
            identity = _identity(record)
            if identity not in records or records[identity].status.started <= record.status.started:
                records[identity] = record
    latest = sorted((r for r in records.values() if not r.spec.imported), key=lambda r: r.name)
    metrics += _of_suites(latest) + _of_cases(latest) + _of_speeds(latest)
    machines += [_machine(record) for record in latest]
    versions = {name: text for found, _ in machines for name, text in sorted(found.items())}
    processors = dict.fromkeys(processor for _, processor in machines if processor)
    ordered = sorted(metrics, key=lambda metric: metric.key)
    return Gathered(tuple(ordered), tuple(latest), versions, "; ".join(processors))


def problem_of(record: RunRecord) -> str:
    """The problem of a run in words: case, preset where there is one, and simulated time where it was cut."""
    spec = record.spec
    if spec.preset is None:
        return spec.case
    return f"{spec.case} {spec.preset} {spec.duration:g} s"


def engine_of(record: RunRecord) -> str:
    """The engine of a run with its settings as typed, and the division where it is open."""
    return record.spec.label() + (", open" if record.spec.division == "open" else "")


def _identity(record: RunRecord) -> tuple[Any, ...]:
    return (problem_of(record), engine_of(record), record.spec.seed, record.spec.repeat)


@cache
def _experiments() -> tuple[tuple[str, Experiment], ...]:
    """All experiments with the names of their suites."""
    return tuple((name, e) for name in suites.names() for e in suites.suite(name).experiments)


def _grouped(
    records: Iterable[RunRecord], by: Callable[[RunRecord], tuple[str, ...]]
) -> dict[tuple[str, ...], list[RunRecord]]:
    found: dict[tuple[str, ...], list[RunRecord]] = {}
    for record in records:
        found.setdefault(by(record), []).append(record)
    return found


def _of_suites(records: Sequence[RunRecord]) -> list[Metric]:
    found = []
    for (engine,), own in _grouped((r for r in records if r.spec.preset is None), lambda r: (engine_of(r),)).items():
        by_name = {record.spec.case: record for record in own}
        for suite, experiment in _experiments():
            trials = {trial.name: by_name.get(trial.name) for trial in experiment.trials}
            if not any(trials.values()):
                continue
            found += [
                Metric(
                    key=Key(suite, engine, row.check.id),
                    title=row.check.title,
                    unit=row.check.unit,
                    kind="check",
                    values=() if row.measured is None else (row.measured,),
                    worse=worse_of(row.check),
                    margin=margin_of(row.check),
                    target=row.check.expected if row.check.sense == "within" else None,
                    state=row.status,
                    detail=row.detail,
                )
                for row in rows_of(experiment, engine, trials)
                if row.status not in UNJUDGED
            ]
    return found


def _of_cases(records: Sequence[RunRecord]) -> list[Metric]:
    """Quantities over the seeds; the first repeat of a seed stands for all, since its others have the same bits."""
    found = []
    first = [r for r in records if r.spec.preset is not None and r.spec.repeat == 1]
    for (problem, engine), seeds in _grouped(first, lambda r: (problem_of(r), engine_of(r))).items():
        values: dict[str, list[float]] = {}
        about: dict[str, tuple[str, str, bool | None]] = {}
        for record in seeds:
            for name, (title, unit, value, within) in _quantities(record).items():
                values.setdefault(name, []).append(value)
                before = about.get(name, (title, unit, None))[2]
                about[name] = (title, unit, within if before is None else before and within is not False)
        for name, (title, unit, within) in about.items():
            state = "inaccurate" if within is False else "ok"
            found.append(Metric(Key(problem, engine, name), title, unit, "quantity", tuple(values[name]), state=state))
    return found


def _quantities(record: RunRecord) -> dict[str, tuple[str, str, float, bool | None]]:
    """Quantities of a run by name: title, unit, value, whether all references accept it; None where none judges it."""
    if record.status.state not in MEASURED or record.result is None:
        return {}
    try:
        case, parameters = parse_case(record.spec.case)
    except CaseError as error:
        raise RegressionError(f"{record.directory}: {error}") from None
    preset: Any = record.spec.preset
    found: dict[str, tuple[str, str, float, bool | None]] = {}
    for s in score(case, record.result.scene, record.result, parameters, preset):
        name, within = s.quantity.name, s.within
        if name in found and (within is None or found[name][3] is False):
            continue
        found[name] = (s.quantity.title, s.quantity.unit, s.quantity.value, within)
    return found


def _of_speeds(records: Sequence[RunRecord]) -> list[Metric]:
    """Speeds over repeats and seeds, of runs that were timed beside the reference workload and came to their end.

    The workload was done before and after each of them; its fastest passes are the reference of all.
    """
    timed = [r for r in records if r.status.state in MEASURED and r.result is not None and not r.status.resumed]
    found = []
    for (problem, engine, processor), own in _grouped(timed, _timed_as).items():
        results = [record.result for record in own if record.result is not None]
        known = [result.resources.get(workload.RECORD, {}) for result in results]
        beside = [record["passes"] for record in known if record.get("version") == workload.VERSION]
        times = [workload.cpu_time(result.timing, result.resources) for result in results]
        if beside and all(times):
            reference = workload.reference_time(beside)
            values = tuple(time / reference for time in times if time)
            key = Key(problem, engine, "speed", processor)
            found.append(Metric(key, SPEED_TITLE, "1", "speed", values, worse="higher", margin=SPEED))
    return found


def _timed_as(record: RunRecord) -> tuple[str, ...]:
    return (problem_of(record), engine_of(record), str(record.environment.get("cpu", "")))


def _machine(record: RunRecord) -> tuple[dict[str, str], str]:
    """Versions of what made a run, and its processor."""
    known = record.environment
    packages = {n.lower(): v for n, v in known.get("packages", {}).items()}
    versions = {name: str(packages[name]) for name in ("numpy", "scipy", "warp-lang") if name in packages}
    named = {"dembench": known.get("dembench", ""), "commit": known.get("commit", "")}
    versions |= {name: str(text) for name, text in named.items() if text}
    return {**versions, record.spec.engine: record.spec.engine_version}, str(known.get("cpu", ""))
