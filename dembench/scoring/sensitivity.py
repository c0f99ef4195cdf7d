"""Whether a quantity answers to a parameter, or stays flat within what the seeds alone would do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.stats import studentized_range

CONFIDENCE = 0.99
"""Share of cases without any effect in which the seeds alone make no larger range."""


@dataclass(frozen=True)
class Response:
    """How a quantity answers to a parameter.

    Attributes:
        change: Range of its means over the parameter, in the unit of the quantity.
        scatter: Range that seeds alone make of means that are equal, at `CONFIDENCE`; 0 with one seed per value.
        least: Smallest range that counts.
    """

    change: float
    scatter: float
    least: float

    @property
    def flat(self) -> bool:
        """Whether no answer can be told from none."""
        return not self.change > max(self.scatter, self.least)


def response(samples: Sequence[Sequence[float]], least_change: float) -> Response | None:
    """How a quantity answers to a parameter.

    A quantity is flat where the range of its means is within either of two bounds:

    - the range that scatter alone makes: q s / sqrt(n), with s the standard deviation within the values of the
      parameter, n the (harmonic) mean number of seeds and q the studentized range at `CONFIDENCE` for as many means
      (Tukey's honestly significant difference, J. W. Tukey 1949, Biometrics 5, 99; for unequal numbers C. Y. Kramer
      1956, Biometrics 12, 307). A fixed number of standard deviations would cry wolf where a parameter has many values
      and few seeds, and miss an effect where it has two values and many seeds;
    - a share of its largest magnitude. A parameter without any effect gives the same numbers for the same seeds, or
      numbers apart by rounding, and a range of zero exceeds no scatter: what is small enough not to matter must not
      pass as an answer. It is the only bound where there is one seed.

    Args:
        samples: Values of the quantity, one list of seeds for each value of the parameter; empty lists are left out.
        least_change: Smallest range that counts, as a share of the largest magnitude of the means.

    Returns:
        The response; None with fewer than two values of the parameter, or where a sample is no number.
    """
    known = [np.asarray(values, dtype=float) for values in samples if len(values)]
    if len(known) < 2 or not all(np.isfinite(values).all() for values in known):
        return None
    means = np.array([values.mean() for values in known])
    counts = np.array([len(values) for values in known])
    free = int(counts.sum()) - len(known)
    scatter = 0.0
    if free:
        deviation = np.sqrt(sum(((values - values.mean()) ** 2).sum() for values in known) / free)
        seeds = len(counts) / (1 / counts).sum()
        scatter = float(_largest_range(len(known), free) * deviation / np.sqrt(seeds))
    return Response(float(np.ptp(means)), scatter, float(least_change * np.abs(means).max()))


@cache
def _largest_range(means: int, free: int) -> float:
    """Range of equal means over their standard error, at `CONFIDENCE`; `free`: degrees of freedom of that error."""
    return float(studentized_range.ppf(CONFIDENCE, means, free))
