"""Everything that sets of runs give: rows of suites, quantities of cases, speeds."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dembench.regression import RegressionError
from dembench.regression.benchmarks import read_benchmarks
from dembench.regression.metrics import Key, Metric, margin_of, worse_of
from dembench.regression.quantities import quantities
from dembench.regression.records import engine_of, grouped, problem_of
from dembench.regression.speeds import speeds
from dembench.runs.directory import RunRecord, find_runs
from dembench.verification import suites
from dembench.verification.checks import Experiment
from dembench.verification.rows import MEASURED, UNJUDGED, rows_of


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

    def digest(self) -> str:
        """What tells one set of runs from another: the runs with when they were made, and the values."""
        runs = [f"{record.spec.digest()} {record.status.started}" for record in self.runs]
        values = [f"{metric.key} {metric.values}" for metric in self.metrics]
        return hashlib.sha256("\n".join(sorted(runs) + sorted(values)).encode()).hexdigest()[:12]


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
    latest = sorted(records.values(), key=lambda r: r.name)
    metrics += _of_suites(latest) + quantities(latest) + speeds(latest)
    machines += [_machine(record) for record in latest]
    versions = {name: text for found, _ in machines for name, text in sorted(found.items())}
    processors = dict.fromkeys(processor for _, processor in machines if processor)
    ordered = sorted(metrics, key=lambda metric: metric.key)
    return Gathered(tuple(ordered), tuple(latest), versions, "; ".join(processors))


def _identity(record: RunRecord) -> tuple[Any, ...]:
    return (problem_of(record), engine_of(record), record.spec.seed, record.spec.repeat)


def _experiments() -> list[tuple[str, Experiment]]:
    """All experiments with the names of their suites."""
    return [(name, e) for name in suites.names() for e in suites.suite(name).experiments]


def _of_suites(records: Sequence[RunRecord]) -> list[Metric]:
    found = []
    for (engine,), own in grouped((r for r in records if r.spec.preset is None), lambda run: (engine_of(run),)).items():
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


def _machine(record: RunRecord) -> tuple[dict[str, str], str]:
    """Versions of what made a run, and its processor."""
    known = record.environment
    packages = {n.lower(): v for n, v in known.get("packages", {}).items()}
    versions = {name: str(packages[name]) for name in ("numpy", "scipy", "warp-lang") if name in packages}
    named = {"dembench": known.get("dembench", ""), "commit": known.get("commit", "")}
    versions |= {name: str(text) for name, text in named.items() if text}
    return {**versions, record.spec.engine: record.spec.engine_version}, str(known.get("cpu", ""))
