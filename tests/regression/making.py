"""Metrics, baselines and gathered sets for tests, without runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dembench.regression.baseline import Baseline
from dembench.regression.bless import bless
from dembench.regression.gather import Gathered
from dembench.regression.metrics import SPEED, Key, Metric

DATE = "2026-01-02T03:04:05+00:00"


def metric(name: str, *values: float, problem: str = "case3, quick", **fields: Any) -> Metric:
    """A quantity of one engine, in metres unless said otherwise."""
    about: dict[str, Any] = {"title": name.capitalize(), "unit": "m", "kind": "quantity", **fields}
    return Metric(Key(problem, "standin", name, about.pop("processor", "")), values=tuple(values), **about)


def speed(values: Sequence[float], processor: str = "chip", name: str = "speed") -> Metric:
    """A speed of one engine."""
    return metric(
        name, *values, kind="speed", unit="1", worse="higher", margin=SPEED, processor=processor, title="CPU time"
    )


def gathered(*metrics: Metric) -> Gathered:
    """A set of metrics as runs would give it."""
    return Gathered(tuple(metrics), versions={"dembench": "1.0"}, processor="chip")


def blessed(*metrics: Metric) -> Baseline:
    """The baseline of a first blessing."""
    return bless(gathered(*metrics), Baseline(), "first values", DATE)
