"""Verdicts: each metric beside what the baseline expects of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from dembench.regression.baseline import Baseline, Expectation
from dembench.regression.gather import Gathered
from dembench.regression.intervals import Estimate, difference
from dembench.regression.metrics import Key, Metric
from dembench.regression.records import engine_of, problem_of
from dembench.scoring.ensembles import Interval

Word = Literal["ok", "improvement", "undecided", "new", "regression", "missing", "failed"]
REGRESSIONS: tuple[Word, ...] = ("regression", "missing", "failed")
"""Verdicts that fail a check."""
_ORDER: tuple[Word, ...] = (*REGRESSIONS, "undecided", "improvement", "new", "ok")


@dataclass(frozen=True)
class Verdict:
    """One metric beside its expectation.

    Attributes:
        key: What the metric is of.
        title, unit: Of the metric.
        word: `regression`: the whole interval of the change is beyond the tolerance, or what was accepted no longer is.
            `undecided`: the change is beyond the tolerance, a part of its interval is not. `improvement`: all of it is
            beyond for the better. `missing`: the runs do not give it. `failed`: a run without result. `new`: nothing is
            expected.
        metric: What the runs gave; None where nothing.
        expected: What the baseline expects; None where nothing.
        change: Found minus expected with its interval, in `unit`; None where one is not known.
        margin: Largest change that does not matter, in `unit`; not a number without an expectation.
        detail: One line: what else to know.
    """

    key: Key
    title: str
    unit: str
    word: Word
    metric: Metric | None = None
    expected: Expectation | None = None
    change: Interval | None = None
    margin: float = math.nan
    detail: str = ""

    @property
    def fails(self) -> bool:
        """Whether it fails a check."""
        return self.word in REGRESSIONS

    def relative(self) -> Interval | None:
        """The change as a share of what was expected; None where that is 0 or there is none."""
        if self.change is None or self.expected is None or not self.expected.value:
            return None
        scale = abs(self.expected.value)
        return Interval(self.change.value / scale, self.change.low / scale, self.change.high / scale)

    def plain(self) -> dict[str, Any]:
        """As JSON data."""
        found, expected, change = self.metric, self.expected, self.change
        return {
            **self.key._asdict(),
            "title": self.title,
            "unit": self.unit,
            "verdict": self.word,
            "value": found.value if found and found.values else None,
            "n": len(found.values) if found else 0,
            "expected": expected.value if expected else None,
            "change": change.value if change else None,
            "interval": [_finite(change.low), _finite(change.high)] if change else None,
            "tolerance": _finite(self.margin),
            "worse": expected.worse if expected else None,
            "detail": self.detail,
        }


def judge(found: Gathered, baseline: Baseline) -> list[Verdict]:
    """A verdict for every metric of the runs and of the baseline, and for every failed run; the worst first.

    Speeds are known of single processors: what the baseline holds of others is left out, and a speed on a processor
    that it does not know is new.
    """
    metrics = {metric.key: metric for metric in found.metrics}
    processors = {key.processor for key in metrics}
    verdicts = [_failed(record) for record in found.failed]
    for expected in baseline.metrics:
        if expected.key in metrics:
            verdicts.append(_beside(metrics[expected.key], expected))
        elif not expected.processor or expected.processor in processors or not any(processors):
            verdicts.append(Verdict(expected.key, expected.title, expected.unit, "missing", expected=expected))
    known = baseline.by_key()
    verdicts += [_new(metric, baseline.metrics) for key, metric in metrics.items() if key not in known]
    return sorted(verdicts, key=lambda v: (_ORDER.index(v.word), v.key))


def counts(verdicts: Sequence[Verdict]) -> str:
    """How many there are of each kind: `2 regressions, 1 undecided, 40 ok`."""
    numbers = {word: sum(v.word == word for v in verdicts) for word in _ORDER}
    plural = {"regression", "improvement"}
    return ", ".join(f"{n} {word}{'s' if word in plural and n != 1 else ''}" for word, n in numbers.items() if n)


def _beside(metric: Metric, expected: Expectation) -> Verdict:
    margin = expected.tolerance.of(expected.value)
    about: dict[str, Any] = {"metric": metric, "expected": expected, "margin": margin, "detail": metric.detail}
    if not metric.values:
        detail = f"{metric.state}: {metric.detail}" if metric.detail else metric.state
        return Verdict(metric.key, metric.title, metric.unit, "missing", **{**about, "detail": detail})
    change = difference(
        Estimate(metric.value, metric.spread, len(metric.values)),
        Estimate(expected.value, expected.spread, expected.n),
        metric.kind,
    )
    word, detail = _word(metric, expected, change, margin)
    return Verdict(metric.key, metric.title, metric.unit, word, **{**about, "change": change, "detail": detail})


def _word(metric: Metric, expected: Expectation, change: Interval, margin: float) -> tuple[Word, str]:
    if metric.state != expected.state:
        if expected.state == "ok":
            return "regression", "it was inside what is accepted and is no longer"
        return "improvement", "it was outside what is accepted and is inside now"
    if abs(change.value) <= margin:
        return "ok", ""
    higher = change.value > 0
    worse = expected.worse == "either" or (expected.worse == "higher") == higher
    if worse and metric.kind == "check" and expected.target is not None and _nearer(metric.value, expected) > margin:
        return "improvement", "nearer to the exact value"
    beyond = change.low > margin if higher else change.high < -margin
    if not worse:
        return ("improvement" if beyond else "ok"), ""
    if beyond:
        share_of_0 = expected.tolerance.relative and not margin
        hint = f"a share of 0 allows nothing; give a tolerance in {expected.unit} in the baseline"
        return "regression", hint if share_of_0 else ""
    if not math.isfinite(change.low):
        return "undecided", "a single time may be disturbed; repeat it"
    return "undecided", "it may be scatter; with more seeds or repeats the interval is narrower"


def _nearer(value: float, expected: Expectation) -> float:
    """By how much a value is nearer to the exact one than the expected value is."""
    assert expected.target is not None
    return abs(expected.value - expected.target) - abs(value - expected.target)


def _new(metric: Metric, expected: Sequence[Expectation]) -> Verdict:
    elsewhere = [e.processor for e in expected if e.key[:3] == metric.key[:3]]
    detail = f"known of {', '.join(elsewhere)} only; `dembench bless` adds this processor" if elsewhere else ""
    if not metric.values:
        detail = "; ".join(text for text in (metric.state, metric.detail) if text)
    return Verdict(metric.key, metric.title, metric.unit, "new", metric=metric, detail=detail)


def _failed(record: Any) -> Verdict:
    status = record.status
    detail = "; ".join(text for text in (status.label(), status.detail) if text)
    return Verdict(Key(problem_of(record), engine_of(record), record.name), "run", "1", "failed", detail=detail)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
