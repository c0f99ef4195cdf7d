"""How far a value may be from the truth, and a difference of two values: for means, and for smallest times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import stats

from dembench.scoring.ensembles import CONFIDENCE, Interval

Kind = Literal["quantity", "check", "speed"]
"""Quantity of a case, checked value of a suite, CPU time over that of the reference workload."""


@dataclass(frozen=True)
class Estimate:
    """A value with how far the values scatter that it was taken from, and their number.

    Attributes:
        value: Mean, or of speeds the smallest.
        spread: See `spread`.
        n: Number of values.
    """

    value: float
    spread: float
    n: int


def spread(values: Sequence[float], kind: Kind) -> float:
    """Scatter of values: their standard deviation; of speeds the distance from the smallest to the one of `rank`.

    0 for a single value.
    """
    if len(values) < 2:
        return 0.0
    if kind == "speed":
        ordered = sorted(values)
        return float(ordered[rank(len(values)) - 1] - ordered[0])
    return float(np.std(values, ddof=1))


def rank(n: int) -> int:
    """Which of n ordered values the smallest of a resample exceeds as rarely as an interval of confidence allows.

    The smallest of n values that are drawn from n with replacement is larger than the k-th with probability
    ((n - k)/n)^n; the first k is taken for which this is at most (1 - confidence)/2. It is 3 for 4 to 8 values.
    """
    return next(k for k in range(1, n + 1) if ((n - k) / n) ** n <= (1 - CONFIDENCE) / 2)


def difference(new: Estimate, old: Estimate, kind: Kind) -> Interval:
    """Difference new - old with its interval of confidence.

    Means: Student's interval with the standard deviation of both sides pooled, so that a single value has the scatter
    that the other side knows; where nobody knows any, the values are taken for exact. Smallest times: disturbances only
    add, so the undisturbed time lies below the smallest; the basic bootstrap interval of a smallest value, [2 x_1 -
    x_k, x_1] with k of `rank` (A. C. Davison and D. V. Hinkley 1997, Bootstrap Methods and their Application, sec.
    5.2). A single time has no end below.
    """
    apart = new.value - old.value
    if kind == "speed":
        below = new.spread if new.n > 1 else math.inf
        above = old.spread if old.n > 1 else math.inf
        return Interval(apart, apart - below, apart + above)
    free = new.n + old.n - 2
    if free == 0:
        return Interval(apart, apart, apart)
    pooled = math.sqrt(((new.n - 1) * new.spread**2 + (old.n - 1) * old.spread**2) / free)
    half = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, free)) * pooled * math.sqrt(1 / new.n + 1 / old.n)
    return Interval(apart, apart - half, apart + half)
