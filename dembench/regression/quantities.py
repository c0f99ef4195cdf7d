"""Quantities of cases over the seeds, and what of them counts as a change."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dembench.cases.base import CaseError, Reference
from dembench.cases.registry import parse_case
from dembench.regression import RegressionError
from dembench.regression.metrics import QUANTITY, SHARE_OF_CHECK, Key, Metric, Worse
from dembench.regression.records import engine_of, grouped, problem_of
from dembench.runs.directory import RunRecord
from dembench.scoring.ensembles import Margin
from dembench.scoring.score import Score, score
from dembench.verification.rows import MEASURED


def quantities(records: Sequence[RunRecord]) -> list[Metric]:
    """Quantities over the seeds; the first repeat of a seed stands for all, since its others have the same bits.

    Raises:
        RegressionError: A case is not known here.
    """
    found = []
    first = [r for r in records if r.spec.preset is not None and r.spec.repeat == 1]
    for (problem, engine), seeds in grouped(first, lambda run: (problem_of(run), engine_of(run))).items():
        own: dict[str, _Quantity] = {}
        for record in seeds:
            for s in _scores(record):
                own.setdefault(s.quantity.name, _Quantity(s.quantity.title, s.quantity.unit)).add(record.name, s)
        found += [quantity.metric(Key(problem, engine, name)) for name, quantity in own.items()]
    return found


class _Quantity:
    """A quantity over the seeds with its references."""

    def __init__(self, title: str, unit: str) -> None:
        self._title, self._unit = title, unit
        self._values: dict[str, float] = {}
        self._references: list[Reference] = []
        self._accepted = True

    def add(self, run: str, found: Score) -> None:
        """Adds the score of a run against one reference."""
        self._values[run] = found.quantity.value
        self._accepted &= found.within is not False
        if found.reference is not None:
            self._references.append(found.reference)

    def metric(self, key: Key) -> Metric:
        """The metric of all runs."""
        values = tuple(self._values.values())
        worse, margin = _what_counts(self._references, float(np.mean(values)))
        state = "ok" if self._accepted else "inaccurate"
        target = next((r.value for r in self._references if r.value is not None), None)
        return Metric(key, self._title, self._unit, "quantity", values, worse, margin, target, state)


def _what_counts(references: Sequence[Reference], value: float) -> tuple[Worse, Margin]:
    """Direction and margin; where all references are bounds on one side, the bound gives a scale, too."""
    lows = [r.low for r in references if r.low is not None]
    highs = [r.high for r in references if r.high is not None]
    if bool(lows) == bool(highs) or any(r.value is not None for r in references):
        return "either", QUANTITY
    scale = max(abs(bound) for bound in (lows or highs))
    size = max(QUANTITY.of(value), SHARE_OF_CHECK * scale)
    return ("lower" if lows else "higher"), Margin(size, relative=False)


def _scores(record: RunRecord) -> list[Score]:
    if record.status.state not in MEASURED or record.result is None:
        return []
    try:
        case, parameters = parse_case(record.spec.case)
    except CaseError as error:
        raise RegressionError(f"{record.directory}: {error}") from None
    preset: Any = record.spec.preset
    return score(case, record.result.scene, record.result, parameters, preset)
