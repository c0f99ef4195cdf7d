"""Order of accuracy in the time step (SR14): one problem with steps that are halved, and the slope of its error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from dembench.results import Result
from dembench.verification.checks import Check, Experiment, Tier, Trial, at_least, deviation
from dembench.verification.precision import problems

STEPS = (25, 50, 100, 200)
"""Steps in an elastic contact."""
DAMPED = problems.RESTITUTION
"""Restitution of the damped collisions."""


def name_of(kind: str, steps: int) -> str:
    """Name of the trial with so many steps in a contact."""
    return f"order_{kind}_{steps}"


def _trials(kind: str, restitution: float) -> tuple[Trial, ...]:
    """The collisions of 256 pairs; engines that divide a step further by themselves are told not to."""
    contact = problems.collision(1.0).duration
    return tuple(
        Trial(
            name_of(kind, n),
            partial(problems.bounce, restitution, name_of(kind, n)),
            {"dt": f"{contact / n:.9g}", "substeps": "1"},
        )
        for n in STEPS
    )


def slope(values: Sequence[float] | np.ndarray) -> float:
    """Exponent p of the steps in values ~ dt^p for `STEPS`, by least squares of the logarithms."""
    return float(-np.polyfit(np.log(STEPS), np.log(values), 1)[0])


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def errors(results: Mapping[str, Result], kind: str, restitution: float) -> list[tuple[float, float]]:
    """Root mean square relative errors of restitution and duration of all pairs, for each step."""
    exact, found = problems.collision(restitution), []
    for n in STEPS:
        e, duration = problems.rebounds(results[name_of(kind, n)])
        found.append((_rms(e / exact.restitution - 1), _rms(duration / exact.duration - 1)))
    return found


def _experiment(kind: str, title: str, restitution: float, checks: tuple[Check, ...], tier: Tier) -> Experiment:
    def measure(results: Mapping[str, Result]) -> Mapping[str, float]:
        found = errors(results, kind, restitution)
        quantity = 1 if restitution == 1 else 0
        values = (slope([error[quantity] for error in found]), found[-1][quantity])
        return {check.id: value for check, value in zip(checks, values, strict=True)}

    return Experiment(f"order_{kind}", title, _trials(kind, restitution), measure, checks, tier)


def experiments() -> tuple[Experiment, ...]:
    """Elastic collisions, and damped ones in the long tier.

    The overlap sets in as x^(3/2), which leaves a method of second order its order; the dashpot does not (see
    `dembench.engines.base.order_of_contacts`), and one that lags is of first order.
    """
    verlet = "second order of velocity Verlet"
    elastic = (
        at_least("SR14a", "elastic collisions: order of the error of the duration", "1", 2.0, verlet, tolerance=0.2),
        deviation("SR14b", "elastic collisions: error of the duration at 200 steps", 1e-3, verlet),
    )
    first = "at least first order with a dashpot"
    damped = (
        at_least("SR14c", "damped collisions: order of the error of the restitution", "1", 1.0, first, tolerance=0.15),
        deviation("SR14d", "damped collisions: error of the restitution at 200 steps", 0.02, first),
    )
    return (
        _experiment("elastic", "Elastic collisions with steps that are halved", 1.0, elastic, "default"),
        _experiment("damped", "Damped collisions with steps that are halved", DAMPED, damped, "long"),
    )
