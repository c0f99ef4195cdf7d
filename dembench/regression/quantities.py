"""Quantities of cases over the seeds, and what of them counts as a change."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dembench.cases.base import CaseError, Quantity, Reference
from dembench.cases.registry import parse_case
from dembench.regression import RegressionError
from dembench.regression.metrics import QUANTITY, SHARE_OF_CHECK, Key, Metric
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
        own: dict[str, _OverSeeds] = {}
        for record in seeds:
            for s in _scores(record):
                own.setdefault(s.quantity.name, _OverSeeds(s.quantity)).add(record.name, s)
        found += [quantity.metric(Key(problem, engine, name)) for name, quantity in own.items()]
    return found


class _OverSeeds:
    """A quantity over the seeds with its references."""

    def __init__(self, quantity: Quantity) -> None:
        self._quantity = quantity
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
        values, q = tuple(self._values.values()), self._quantity
        state = "ok" if self._accepted else "inaccurate"
        target = next((r.value for r in self._references if r.value is not None), None)
        return Metric(key, q.title, q.unit, "quantity", values, q.worse, margin_of(q, self._references), target, state)


def margin_of(quantity: Quantity, references: Sequence[Reference]) -> Margin:
    """Change that does not matter: the quantity's own, as of a check where a closed form has a band, else a share."""
    if quantity.margin is not None:
        return Margin(quantity.margin, relative=False)
    bands = [(r.low, r.high) for r in references if r.kind == "closed form"]
    halves = [0.5 * (high - low) for low, high in bands if low is not None and high is not None]
    return Margin(SHARE_OF_CHECK * min(halves), relative=False) if halves else QUANTITY


def _scores(record: RunRecord) -> list[Score]:
    if record.status.state not in MEASURED or record.result is None:
        return []
    try:
        case, parameters = parse_case(record.spec.case)
    except CaseError as error:
        raise RegressionError(f"{record.directory}: {error}") from None
    preset: Any = record.spec.preset
    return score(case, record.result.scene, record.result, parameters, preset)
