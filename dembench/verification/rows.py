"""What a suite reports: one row for each check and engine."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dembench.results import Result
from dembench.runs.directory import RunRecord
from dembench.verification.checks import Check, Experiment

MEASURED = ("ok", "inaccurate")
"""States of runs, and of rows, that have a result."""
DEATHS = ("failed", "timeout")
"""States of runs that an engine did not survive."""
UNJUDGED = ("skipped", "not applicable")
"""States of rows that say nothing about an engine; they are counted apart."""


@dataclass(frozen=True)
class Row:
    """One check of one engine.

    Attributes:
        check: The check.
        engine: The engine, with its settings as typed.
        measured: What came out; None where nothing did.
        status: `ok`, `inaccurate`, `not applicable`, or the state of the run that gave no value: `failed`, `skipped`,
            ...
        detail: Why there is no value.
        runs: Names of the run directories.
    """

    check: Check
    engine: str
    measured: float | None
    status: str
    detail: str
    runs: tuple[str, ...]

    @property
    def inside_published(self) -> bool | None:
        """Whether the value is inside the published tolerance; None without either."""
        if self.check.published is None or self.measured is None:
            return None
        return self.check.published.accepts(self.measured)

    def plain(self) -> dict[str, Any]:
        """As JSON data."""
        check, published = self.check, self.check.published
        return {
            "id": check.id,
            "engine": self.engine,
            "title": check.title,
            "measured": self.measured,
            "expected": check.expected,
            "tolerance": check.tolerance,
            "sense": check.sense,
            "unit": check.unit,
            "status": self.status,
            "detail": self.detail,
            "kind": check.kind,
            "source": check.source,
            "published": None
            if published is None
            else {
                "value": published.value,
                "expected": published.expected,
                "tolerance": published.tolerance,
                "inside": self.inside_published,
                "note": published.note,
            },
            "runs": list(self.runs),
        }


def rows_of(experiment: Experiment, engine: str, runs: Mapping[str, RunRecord | None]) -> list[Row]:
    """The rows of one experiment of one engine: values with their verdicts, or why there are none.

    Args:
        experiment: The experiment.
        engine: The engine, with its settings as typed.
        runs: Its runs by the names of the trials; None was never started.
    """
    names = tuple(run.name for run in runs.values() if run is not None)
    for name in (trial.name for trial in experiment.trials):
        if (end := _no_result(runs.get(name), experiment.deaths_count)) is not None:
            status, why = end
            detail = f"{name}: {why}" if len(experiment.trials) > 1 else why
            return [Row(check, engine, None, status, detail, names) for check in experiment.checks]
    done = {name: run for name, run in runs.items() if run is not None and run.status.state in MEASURED}
    results = {name: run.result for name, run in done.items() if run.result is not None}
    laws = [run.spec.law for run in done.values() if run.spec.law]
    found, trouble = measured(experiment, results)
    return [
        Row(check, engine, None, "not applicable", f"the engine computes another law: {laws[0]}", names)
        if check.scene_law and laws
        else _row(check, engine, found[check.id], trouble, names)
        for check in experiment.checks
    ]


def measured(experiment: Experiment, results: Mapping[str, Result]) -> tuple[dict[str, float], str]:
    """Every check of an experiment with what was measured, and what went wrong: then no value is a number.

    What an engine produced can be anything, and a value that cannot be derived from it is no reason to lose the others.
    """
    try:
        found = experiment.measure(results)
        return {check.id: float(found[check.id]) for check in experiment.checks}, ""
    except (ArithmeticError, LookupError, ValueError) as error:
        return {check.id: math.nan for check in experiment.checks}, f"{type(error).__name__}: {error}"


def all_right(found: list[Row]) -> bool:
    """Whether a value was measured and every row that says something about the engine is ok."""
    judged = [row for row in found if row.status not in UNJUDGED]
    return bool(judged) and all(row.status == "ok" for row in judged)


def _no_result(run: RunRecord | None, deaths_count: bool) -> tuple[str, str] | None:
    """Status and reason of a run without an answer; None where it has one."""
    if run is None:
        return "interrupted", "not started"
    state = run.status.state
    if (state in MEASURED and run.result is not None) or (deaths_count and state in DEATHS):
        return None
    why = "; ".join(text for text in (run.status.reason, run.status.detail) if text)
    return (state if state not in MEASURED else "failed"), why or "the result cannot be read"


def _row(check: Check, engine: str, value: float, trouble: str, runs: tuple[str, ...]) -> Row:
    if not math.isfinite(value):
        detail = "what was measured is not a finite number" + (f" ({trouble})" if trouble else "")
        return Row(check, engine, None, "inaccurate", detail, runs)
    return Row(check, engine, value, "ok" if check.accepts(value) else "inaccurate", "", runs)
