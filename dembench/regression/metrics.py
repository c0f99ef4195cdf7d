"""Metrics: numbers that are compared from one version to the next, and what of them counts as a change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import BeforeValidator, PlainSerializer

from dembench.cases.base import Worse
from dembench.cases.quantities import SHARE
from dembench.regression import RegressionError, intervals
from dembench.regression.intervals import Kind
from dembench.scoring.ensembles import Margin
from dembench.verification.checks import Check

SPEED = Margin(0.08)
"""Slowdown that does not matter: the smallest of eight repeats scatters by one to two per cent on a busy machine."""
QUANTITY = Margin(SHARE)
"""Change of a quantity of a case that does not matter; where it scatters over seeds, the interval is added to it."""
SHARE_OF_CHECK = 0.25
"""Change of a checked value that does not matter, as a share of the tolerance of the check."""


class Key(NamedTuple):
    """What a metric is of.

    Attributes:
        problem: Case with preset, scene file, or suite.
        engine: Engine with its settings as typed; empty for a benchmark of a function.
        name: Quantity, id of a check, or `speed`.
        processor: Processor on which a speed was measured; empty for what does not depend on it.
    """

    problem: str
    engine: str
    name: str
    processor: str = ""

    def __str__(self) -> str:
        return " / ".join(part for part in self if part)


@dataclass(frozen=True)
class Metric:
    """A number as a set of runs gives it.

    Attributes:
        key: What it is of.
        title: What it is, for tables.
        unit: SI unit; "1" for a number without one.
        kind: `quantity` of a case, `check` of a suite, or `speed`: CPU time over that of the reference workload.
        values: One for each seed or repeat; empty where the runs gave none.
        worse: Which change is a regression.
        margin: Largest change that does not matter.
        target: Exact value; None where none is known.
        state: `ok` or `inaccurate`, else why there is no value: `failed`, `timeout`, ...
        detail: One line about the state.
    """

    key: Key
    title: str
    unit: str
    kind: Kind
    values: tuple[float, ...]
    worse: Worse = "either"
    margin: Margin = QUANTITY
    target: float | None = None
    state: str = "ok"
    detail: str = ""

    @property
    def value(self) -> float:
        """What stands for the values: the smallest of speeds, which is the least disturbed, else the mean."""
        return float(min(self.values) if self.kind == "speed" else np.mean(self.values))

    @property
    def spread(self) -> float:
        """How far the values scatter; see `dembench.regression.intervals`."""
        return intervals.spread(self.values, self.kind)


def margin_of(check: Check) -> Margin:
    """Change of a checked value that does not matter: a share of its tolerance, or of its bound where that is exact."""
    return Margin(SHARE_OF_CHECK * (check.tolerance or abs(check.expected)), relative=False)


def worse_of(check: Check) -> Worse:
    """The direction in which a checked value gets worse."""
    directions: dict[str, Worse] = {"at most": "higher", "at least": "lower"}
    return directions.get(check.sense, "either")


def parse_margin(text: object) -> Margin:
    """A margin from a text or number: `2%` of the expected value, or `5e-4` in the unit of the metric.

    Raises:
        RegressionError: It is neither, or negative.
    """
    if isinstance(text, Margin):
        return text
    word = str(text).strip()
    try:
        share = word.endswith("%")
        size = float(word.removesuffix("%")) / (100 if share else 1)
    except ValueError:
        size = -1.0
    if not 0 <= size < np.inf:
        raise RegressionError(f"'{text}' is no margin; write a share as 2%, or a number in the unit of the metric")
    return Margin(size, relative=share)


def margin_text(margin: Margin) -> str:
    """A margin as it is written: `2%` or `0.0005`."""
    return f"{100 * margin.value:.6g}%" if margin.relative else f"{margin.value:.6g}"


Tolerance = Annotated[Margin, BeforeValidator(parse_margin), PlainSerializer(margin_text, return_type=str)]
"""A margin in a file: `"2%"` or `"0.0005"`."""
