"""Two sets of runs against each other: the same within a margin given beforehand, better, worse, or not decided."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from dembench.regression import RegressionError
from dembench.regression.gather import Gathered
from dembench.regression.intervals import Estimate, difference
from dembench.regression.metrics import Key, Metric, margin_text, parse_margin
from dembench.scoring.ensembles import Ensemble, Interval, Margin, equivalent

Word = Literal["indistinguishable", "better", "worse", "different", "undecided"]


@dataclass(frozen=True)
class Comparison:
    """One metric in both sets.

    Attributes:
        key: What it is of; the engine is that of both where it is the same.
        first, second: The metric in A and B.
        margin: Largest difference that does not matter, given beforehand.
        change: B minus A with its interval, in the unit of the metric.
        word: `indistinguishable`: the whole interval is within the margin. `better`, `worse`: B beyond it where a
            direction is known, `different` where none is. `undecided`: neither; more seeds make the interval narrower.
    """

    key: Key
    first: Metric
    second: Metric
    margin: Margin
    change: Interval
    word: Word

    def plain(self) -> dict[str, Any]:
        """As JSON data."""
        known = math.isfinite(self.change.low) and math.isfinite(self.change.high)
        return {
            **self.key._asdict(),
            "title": self.first.title,
            "unit": self.first.unit,
            "a": self.first.value,
            "b": self.second.value,
            "n": [len(self.first.values), len(self.second.values)],
            "change": self.change.value,
            "interval": [self.change.low, self.change.high] if known else None,
            "margin": margin_text(self.margin),
            "verdict": self.word,
        }


def margins(texts: Sequence[str]) -> dict[str, Margin]:
    """Margins by the names of metrics from texts as `rate=2%` or `depth=5e-4`.

    Raises:
        RegressionError: A text has another form, or a name comes twice.
    """
    found: dict[str, Margin] = {}
    for text in texts:
        name, equals, size = text.partition("=")
        if not (name.strip() and equals):
            raise RegressionError(f"'{text}' is no margin; write NAME=2%, or NAME=NUMBER in the unit of the metric")
        if name.strip() in found:
            raise RegressionError(f"the margin of {name.strip()} is given twice")
        found[name.strip()] = parse_margin(size)
    return found


def compare(a: Gathered, b: Gathered, given: Mapping[str, Margin]) -> list[Comparison]:
    """Every metric that both sets have a value of.

    Where each set has one engine and they differ, these are compared; else engines of the same name. Metrics without a
    margin of their own get that of a baseline.

    Raises:
        RegressionError: The sets have nothing in common, or a margin is for a metric that neither has.
    """
    first, second = _by_key(a), _by_key(b)
    engines = [{key.engine for key in keys} for keys in (first, second)]
    if all(len(names) == 1 for names in engines) and engines[0] != engines[1]:
        versus = " | ".join(names.pop() for names in engines)
        first, second = ({k._replace(engine=versus): m for k, m in keys.items()} for keys in (first, second))
    common = [key for key in first if key in second]
    if not common:
        raise RegressionError("the two sets of runs have no metric in common; give runs of the same problems")
    if unknown := [name for name in given if name not in {key.name for key in common}]:
        names = ", ".join(sorted({key.name for key in common}))
        raise RegressionError(f"no metric that both have is called '{unknown[0]}'; they are {names}")
    return [_compared(key, first[key], second[key], given.get(key.name, first[key].margin)) for key in common]


def _by_key(found: Gathered) -> dict[Key, Metric]:
    return {metric.key: metric for metric in found.metrics if metric.values}


def _compared(key: Key, a: Metric, b: Metric, margin: Margin) -> Comparison:
    size = margin.of(a.value)
    if a.kind == "speed":
        change = difference(_estimate(b), _estimate(a), "speed")
        return Comparison(key, a, b, margin, change, _word(a, b, change, size))
    if size > 0 and min(len(a.values), len(b.values)) > 1:
        found = equivalent(Ensemble(b.values), Ensemble(a.values), Margin(size, relative=False))
        change = found.difference
    else:
        change = Interval(b.value - a.value, math.nan, math.nan)
        if a.values == b.values:
            change = Interval(0.0, 0.0, 0.0)
    return Comparison(key, a, b, margin, change, _word(a, b, change, size))


def _word(a: Metric, b: Metric, change: Interval, margin: float) -> Word:
    if -margin <= change.low and change.high <= margin:
        return "indistinguishable"
    if not (change.low > margin or change.high < -margin):
        return "undecided"
    if a.worse != "either":
        return "worse" if (a.worse == "higher") == (change.value > 0) else "better"
    if a.target is None:
        return "different"
    nearer = abs(b.value - a.target) < abs(a.value - a.target)
    return "better" if nearer else "worse"


def _estimate(metric: Metric) -> Estimate:
    return Estimate(metric.value, metric.spread, len(metric.values))
