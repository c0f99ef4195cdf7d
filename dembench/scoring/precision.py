"""What an error costs: Pareto front, cheapest setting for a target, order of accuracy, performance profile."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

COARSE = 0.3
"""Error above which a step is too coarse to show an order of accuracy [-]."""
ROUNDING = 1e-7
"""Error below which single precision rounds [-]."""
FLOOR = 2.0
"""Multiple of its smallest error up to which a method shows its limit, not its order [-]."""
LEAST_POINTS = 3


def front(times: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Indices of the points that no other beats in both time and error, by time; what is no number is left out."""
    found: list[int] = []
    best = np.inf
    for k in np.lexsort((errors, times)):
        if np.isfinite(times[k]) and errors[k] < best:
            best = errors[k]
            found.append(int(k))
    return found


def cheapest(times: Sequence[float], errors: Sequence[float], target: float) -> int | None:
    """Index of the shortest time with an error of at most `target`; None where none reaches it."""
    reached = [k for k in range(len(times)) if np.isfinite(times[k]) and errors[k] <= target]
    return min(reached, key=lambda k: times[k], default=None)


@dataclass(frozen=True)
class Order:
    """Order of accuracy that was measured.

    Attributes:
        slope: Exponent p of error = C dt^p.
        low, high: Its 95 % interval; infinite with two degrees of freedom too few.
        points: Number of points in the regression.
    """

    slope: float
    low: float
    high: float
    points: int


def order(steps: Sequence[float], errors: Sequence[float]) -> Order | None:
    """Order of accuracy by regression of log error on log step.

    Left out are errors above `COARSE`, where no expansion holds, those below `ROUNDING`, and everything from the
    smallest error on towards finer steps, with errors within `FLOOR` of it: there rounding or the model's limit shows.

    Args:
        steps: Time steps [s].
        errors: Their errors [-].

    Returns:
        The order; None with fewer than `LEAST_POINTS` points, as of an error that does not follow the step.
    """
    h, e = np.asarray(steps, dtype=float), np.asarray(errors, dtype=float)
    known = np.isfinite(e) & (e > ROUNDING) & (e < COARSE)
    if known.sum() < LEAST_POINTS:
        return None
    h, e = h[known], e[known]
    least = int(np.argmin(e))
    kept = (h > h[least]) & (e > FLOOR * e[least])
    kept[least] = len(e) > 1 and h[least] == h.min()
    if kept.sum() < LEAST_POINTS:
        return None
    fit = stats.linregress(np.log(h[kept]), np.log(e[kept]))
    free = int(kept.sum()) - 2
    half = float(stats.t.ppf(0.975, free) * fit.stderr)
    return Order(float(fit.slope), float(fit.slope) - half, float(fit.slope) + half, int(kept.sum()))


@dataclass(frozen=True)
class Profile:
    """Share of problems that a solver does within a factor of the fastest one.

    Attributes:
        ratio: Factors, ascending from 1, shape (r,).
        share: Shares [-], shape (r,).
    """

    ratio: np.ndarray
    share: np.ndarray


def profiles(costs: Mapping[str, Mapping[str, float]]) -> dict[str, Profile]:
    """Performance profiles, E. D. Dolan & J. J. More 2002, Math. Program. 91, 201.

    Args:
        costs: Cost of every problem by solver; infinite or absent where the solver does not do it. Problems that no
            solver does are left out.

    Returns:
        The profile of every solver over the same factors: those at which one of them changes.
    """
    problems = sorted({p for own in costs.values() for p, cost in own.items() if np.isfinite(cost)})
    best = {p: min(own.get(p, np.inf) for own in costs.values()) for p in problems}
    ratios = {solver: np.array([own.get(p, np.inf) / best[p] for p in problems]) for solver, own in costs.items()}
    if not problems:
        return {}
    finite = np.concatenate(list(ratios.values()))
    at = np.unique(np.concatenate([[1.0], finite[np.isfinite(finite)]]))
    return {s: Profile(at, np.array([(r <= x * (1 + 1e-12)).mean() for x in at])) for s, r in ratios.items()}
