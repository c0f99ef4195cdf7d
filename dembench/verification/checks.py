"""One number that is known beside what an engine made of it: checks, and the rows that a suite reports."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from dembench.results import Result
from dembench.runs.directory import RunRecord
from dembench.scene import Scene

MEASURED = ("ok", "inaccurate")
"""States of rows that have a measured value."""


@dataclass(frozen=True)
class Published:
    """The same number on a published page, which is not always right.

    Attributes:
        value: What the page measured.
        expected: What it expected.
        tolerance: What it accepted as a deviation, in the check's unit.
        note: Why the page and the closed form differ, where they do.
    """

    value: float
    expected: float
    tolerance: float
    note: str = ""

    def accepts(self, measured: float) -> bool:
        """Whether a value lies inside the page's own tolerance."""
        return abs(measured - self.expected) <= self.tolerance


@dataclass(frozen=True)
class Check:
    """A number that a right engine reproduces.

    Attributes:
        id: Identifier, unique in its suite.
        title: What is measured.
        unit: SI unit; "1" for a number without one.
        expected: Its exact value.
        tolerance: Largest deviation that is accepted, in `unit`.
        source: Where the exact value comes from.
        published: The same number elsewhere, or None.
    """

    id: str
    title: str
    unit: str
    expected: float
    tolerance: float
    source: str
    published: Published | None = None

    def accepts(self, measured: float) -> bool:
        """Whether a value is near enough; what is no number never is."""
        return abs(measured - self.expected) <= self.tolerance


@dataclass(frozen=True)
class Experiment:
    """One scene with the checks that are made on its result.

    Attributes:
        name: Identifier, the name of its scene.
        title: One line for tables.
        scene: Builds the scene.
        measure: Measures a complete result: a value for the id of every check.
        checks: What is known of it.
    """

    name: str
    title: str
    scene: Callable[[], Scene]
    measure: Callable[[Result], Mapping[str, float]]
    checks: tuple[Check, ...]


@dataclass(frozen=True)
class Suite:
    """Experiments that are reported together.

    Attributes:
        name: Name on the command line.
        title: Heading of its page.
        text: What it is about, a few sentences.
        source: Where its problems come from.
        experiments: The experiments.
        settings: Settings that every engine gets which has a setting of that name, unless another value is typed.
    """

    name: str
    title: str
    text: str
    source: str
    experiments: tuple[Experiment, ...]
    settings: Mapping[str, str] = field(default_factory=dict)

    def checks(self) -> list[Check]:
        """All checks in the order of the tables."""
        return sorted((c for e in self.experiments for c in e.checks), key=lambda c: c.id)


@dataclass(frozen=True)
class Row:
    """One check of one engine.

    Attributes:
        check: The check.
        engine: The engine, with its settings as typed.
        measured: What came out; None where nothing did.
        status: `ok`, `inaccurate`, or the state of the run that gave no value: `failed`, `skipped`, ...
        detail: Why there is no value.
        run: Name of the run directory.
    """

    check: Check
    engine: str
    measured: float | None
    status: str
    detail: str
    run: str

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
            "unit": check.unit,
            "status": self.status,
            "detail": self.detail,
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
            "run": self.run,
        }


def rows_of(experiment: Experiment, engine: str, run: RunRecord | None) -> list[Row]:
    """The rows of one run: a value and its verdict, or the state that the run ended in; None was never started."""
    if run is None:
        return [Row(check, engine, None, "interrupted", "not started", "") for check in experiment.checks]
    status, result = run.status, run.result
    if status.state not in MEASURED or result is None:
        state = status.state if status.state not in MEASURED else "failed"
        why = "; ".join(text for text in (status.reason, status.detail) if text) or "the result cannot be read"
        return [Row(check, engine, None, state, why, run.name) for check in experiment.checks]
    return [_row(check, engine, found, run.name) for check, found in measured(experiment, result)]


def measured(experiment: Experiment, result: Result) -> list[tuple[Check, float]]:
    """Every check of an experiment with what was measured."""
    found = experiment.measure(result)
    return [(check, float(found[check.id])) for check in experiment.checks]


def _row(check: Check, engine: str, value: float, run: str) -> Row:
    if not math.isfinite(value):
        return Row(check, engine, None, "inaccurate", "what was measured is not a finite number", run)
    return Row(check, engine, value, "ok" if check.accepts(value) else "inaccurate", "", run)
