"""What chaotic bulk allows to be said: statements about ensembles of seeds, never about single runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from scipy import integrate, stats

CONFIDENCE = 0.95
RESAMPLES = 9999
"""Resamples of a bootstrap interval."""
RESOLUTION = 1e-9
"""Spread, as a share of the range of a curve, below which rounding decides: all seeds still fall freely [-]."""
NEAR = 3.0
"""Distance of two means, in pooled standard deviations, within which a point of a curve counts as equal [-]."""
SHARE_NEAR = 0.95
"""Share of the points of a curve that must be near [-]."""


@dataclass(frozen=True)
class Margin:
    """Largest difference that does not matter, given before anything is measured.

    Attributes:
        value: As a share of the reference where `relative`, else in the unit of the quantity.
        relative: Which of the two.
    """

    value: float
    relative: bool = True

    def of(self, reference: float) -> float:
        """The margin in the unit of the quantity."""
        return self.value * abs(reference) if self.relative else self.value

    def text(self) -> str:
        """In words: `2 %`, or a number in the unit of the quantity."""
        return f"{100 * self.value:g} %" if self.relative else f"{self.value:g}"


MARGINS = {
    "rate": Margin(0.02),
    "depth": Margin(5e-4, relative=False),
    "period": Margin(0.02),
    "amplitude": Margin(0.05),
}
"""Margins of the quantities of bulk cases: discharge rate, depth of a crater [m], period and amplitude of a swing."""


class Ensemble:
    """A number or a curve over the seeds of one variant.

    Attributes:
        values: Shape (k,) or (k, t): the seed first.
    """

    def __init__(self, values: Sequence[Any] | np.ndarray) -> None:
        """The values; ValueError without any."""
        self.values = np.asarray(values, dtype=float)
        if self.values.ndim == 0 or not len(self.values):
            raise ValueError("an ensemble needs at least one seed")

    def __len__(self) -> int:
        """Number of seeds."""
        return len(self.values)

    @cached_property
    def mean(self) -> np.ndarray:
        """Mean over the seeds, shape () or (t,)."""
        return np.asarray(self.values.mean(axis=0))

    @cached_property
    def deviation(self) -> np.ndarray:
        """Standard deviation between seeds (k - 1), shape () or (t,); not a number with one seed."""
        if len(self) < 2:
            return np.full_like(self.mean, np.nan)
        return np.asarray(self.values.std(axis=0, ddof=1))

    @property
    def error(self) -> np.ndarray:
        """Standard error of the mean."""
        return self.deviation / np.sqrt(len(self))


@dataclass(frozen=True)
class Interval:
    """An estimate with its interval of confidence; both ends are not a number where nothing can be said."""

    value: float
    low: float
    high: float


def bootstrap_interval(
    statistic: Callable[..., Any],
    *samples: Sequence[float] | np.ndarray,
    paired: bool = False,
    confidence: float = CONFIDENCE,
) -> Interval:
    """A statistic of samples with its bootstrap percentile interval (B. Efron 1979, Ann. Statist. 7, 1).

    The same samples give the same interval. With fewer than two values in a sample the interval is not known.

    Args:
        statistic: Function of as many samples and the keyword `axis`, as `numpy.mean` is of one.
        samples: The samples.
        paired: Whether the values of the samples belong together, as those of the same seeds do.
        confidence: Share of cases in which the interval holds the true value.
    """
    arrays = tuple(np.asarray(sample, dtype=float) for sample in samples)
    value = float(statistic(*arrays, axis=-1))
    if min(map(len, arrays)) < 2:
        return Interval(value, np.nan, np.nan)
    options: dict[str, Any] = {"n_resamples": RESAMPLES, "method": "percentile", "vectorized": True}
    found = stats.bootstrap(
        arrays, statistic, paired=paired, confidence_level=confidence, rng=np.random.default_rng(0), **options
    ).confidence_interval
    return Interval(value, float(found.low), float(found.high))


def bias(test: Ensemble, reference: Ensemble, paired: bool = False) -> Interval:
    """Relative difference of two means, mean(test)/mean(reference) - 1, with its bootstrap interval."""
    return bootstrap_interval(_relative_difference, test.values, reference.values, paired=paired)


def _relative_difference(test: np.ndarray, reference: np.ndarray, axis: int) -> np.ndarray:
    return np.asarray(test.mean(axis=axis) / reference.mean(axis=axis) - 1)


@dataclass(frozen=True)
class Distance:
    """How far two ensembles of curves are apart.

    Attributes:
        value: Distance of the mean curves in units of the spread between the seeds of the reference, D [-].
        limit: Largest distance that scatter alone makes plausible, 2 sqrt(1/k_test + 1/k_reference) [-].
        physical: The same distance over the range of the reference curve [-].
    """

    value: float
    limit: float
    physical: float

    @property
    def indistinguishable(self) -> bool:
        """Whether the ensembles cannot be told apart."""
        return self.value <= self.limit


def distance(test: Ensemble, reference: Ensemble, time: np.ndarray | None = None) -> Distance:
    """Distance of two ensembles of curves, D = ||mean_test - mean_ref|| / ||s_ref|| with the norm L2 over time.

    A spread below `RESOLUTION` of the range counts as that.

    Args:
        test, reference: Curves at the same times, shape (k, t), or numbers, shape (k,). The reference has two or more.
        time: Times, shape (t,), which give the weights; None for equal ones.

    Raises:
        ValueError: The curves have different lengths, or the reference has one seed.
    """
    if test.mean.shape != reference.mean.shape:
        raise ValueError(f"curves of {test.mean.shape} and {reference.mean.shape} samples cannot be compared")
    if len(reference) < 2:
        raise ValueError("a reference of one seed has no spread to measure a distance in; give two or more")
    span = float(np.ptp(reference.mean)) or float(np.abs(reference.mean).max())
    apart = _norm(test.mean - reference.mean, time)
    spread = max(_norm(reference.deviation, time), RESOLUTION * span)
    return Distance(_over(apart, spread), distance_limit(len(test), len(reference)), _over(apart, span))


def distance_limit(test: int, reference: int) -> float:
    """Largest distance at which ensembles of so many seeds count as indistinguishable, 2 sqrt(1/k_t + 1/k_r) [-]."""
    return 2 * float(np.sqrt(1 / test + 1 / reference))


def _norm(values: np.ndarray, time: np.ndarray | None) -> float:
    """Root mean square over time."""
    if time is None or values.ndim == 0:
        return float(np.sqrt(np.mean(values**2)))
    return float(np.sqrt(integrate.trapezoid(values**2, time) / (time[-1] - time[0])))


def _over(a: float, b: float) -> float:
    if b:
        return a / b
    return np.inf if a else 0.0


@dataclass(frozen=True)
class Pointwise:
    """How two ensembles of curves compare at every time.

    Attributes:
        z: Distance of the means over the pooled standard deviation, shape (t,).
        near: Share of the times with |z| < `NEAR` [-].
        rmse: Root mean square of the distance over the range of the reference curve [-].
    """

    z: np.ndarray
    near: float
    rmse: float

    def passes(self, tolerance: float) -> bool:
        """Whether enough points are near and the normalised error is within a tolerance [-]."""
        return self.near >= SHARE_NEAR and self.rmse <= tolerance


def pointwise(test: Ensemble, reference: Ensemble) -> Pointwise:
    """Two ensembles of curves, shape (k, t), compared at every time.

    Where no seed scatters, equal means have z = 0 and others an infinite one.

    Raises:
        ValueError: The curves have different lengths, or both ensembles have one seed.
    """
    if test.values.ndim != 2 or test.mean.shape != reference.mean.shape:
        raise ValueError(f"curves of {test.mean.shape} and {reference.mean.shape} samples cannot be compared")
    free = [(len(e) - 1, e.deviation) for e in (test, reference) if len(e) > 1]
    if not free:
        raise ValueError("one of the ensembles needs two or more seeds")
    pooled = np.sqrt(sum(n * s**2 for n, s in free) / sum(n for n, _ in free))
    apart = test.mean - reference.mean
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(apart == 0, 0.0, apart / pooled)
    rmse = _over(_norm(apart, None), float(np.ptp(reference.mean)))
    return Pointwise(z, float(np.mean(np.abs(z) < NEAR)), rmse)


Word = Literal["equivalent", "different", "undecided"]


@dataclass(frozen=True)
class Equivalence:
    """Whether two means differ by less than what matters.

    Attributes:
        difference: mean(test) - mean(reference) with its interval at twice the level of the test (90 % at 5 %).
        margin: Largest difference that does not matter, in the same unit.
        p: Probability of such data if the means differ by the margin or more [-].
        verdict: `equivalent`; `different` where the whole interval is beyond the margin; else `undecided`.
    """

    difference: Interval
    margin: float
    p: float
    verdict: Word


def equivalent(
    test: Ensemble, reference: Ensemble, margin: Margin, *, paired: bool = False, level: float = 1 - CONFIDENCE
) -> Equivalence:
    """Two one-sided t-tests against a margin given beforehand.

    D. J. Schuirmann 1987, J. Pharmacokinet. Biopharm. 15, 657. Welch's test, or that of
    the differences where the seeds are paired. Too few seeds are never equivalent.

    Args:
        test, reference: Numbers over seeds, shape (k,).
        margin: Largest difference that does not matter.
        paired: Whether the values belong to the same seeds in the same order.
        level: Probability of calling different means equivalent.

    Raises:
        ValueError: The margin is not positive, or paired ensembles differ in length.
    """
    a, b = test.values, reference.values
    limit = margin.of(float(reference.mean))
    if not limit > 0:
        raise ValueError(f"the margin is {limit:g}; a positive one is needed")
    if paired and len(a) != len(b):
        raise ValueError(f"paired ensembles have as many seeds; these have {len(a)} and {len(b)}")
    apart = float(test.mean - reference.mean)
    if paired:
        free, error = float(len(a) - 1), _standard_error(a - b)
    else:
        free, error = _welch(a, b)
    if not free > 0:
        return Equivalence(Interval(apart, np.nan, np.nan), limit, np.nan, "undecided")
    half = error * float(stats.t.ppf(1 - level, free))
    low, high = apart - half, apart + half
    p = float(stats.t.sf((limit - abs(apart)) / error, free)) if error else float(abs(apart) >= limit)
    word: Word = "equivalent" if p < level else "different" if low > limit or high < -limit else "undecided"
    return Equivalence(Interval(apart, low, high), limit, p, word)


def _welch(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Degrees of freedom and standard error of a difference of means (B. L. Welch 1947, Biometrika 34, 28)."""
    if min(len(a), len(b)) < 2:
        return 0.0, np.nan
    va, vb = _standard_error(a) ** 2, _standard_error(b) ** 2
    if va + vb == 0:
        return float(len(a) + len(b) - 2), 0.0
    return (va + vb) ** 2 / (va**2 / (len(a) - 1) + vb**2 / (len(b) - 1)), float(np.sqrt(va + vb))


def _standard_error(values: np.ndarray) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else np.nan
