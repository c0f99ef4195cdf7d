"""Oscillating curves taken apart: period, phase, amplitude and decay, where a distance alone would mix them up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import optimize, signal

from dembench.cases.quantities import Extremum, extrema

LEAST_SWING = 0.1
"""Swing, as a share of the range of a curve, below which a turn is noise [-]."""


class NoCycles(ValueError):
    """A curve without enough turns to have a period."""


@dataclass(frozen=True)
class Fit:
    """A damped oscillation A exp(-t/tau) cos(2 pi t/T + phase) + c with t from the first sample.

    Attributes:
        period: T [s].
        amplitude: A, in the unit of the curve, positive.
        decay: 1/tau [1/s]; negative where the swing grows.
        phase: [rad], from -pi to pi.
        offset: c, in the unit of the curve.
        residual: Root mean square of what the fit leaves, over its amplitude [-].
    """

    period: float
    amplitude: float
    decay: float
    phase: float
    offset: float
    residual: float


@dataclass(frozen=True)
class CycleErrors:
    """Differences of two oscillating curves, test against reference.

    Attributes:
        period: Relative difference of the periods [-].
        phase: Lag of the test behind the reference, in periods of the reference, from -1/2 to 1/2 [-].
        amplitude: Ratio of the swings from peak to trough, mean over the cycles that both have, less 1 [-].
        decay: Difference of the decay rates times the period of the reference [-].
    """

    period: float
    phase: float
    amplitude: float
    decay: float


def turns(time: np.ndarray, value: np.ndarray) -> list[Extremum]:
    """Peaks and troughs by turns, without those that are noise.

    Raises:
        NoCycles: There are fewer than three.
    """
    found = extrema(np.asarray(time, dtype=float), np.asarray(value, dtype=float), LEAST_SWING * float(np.ptp(value)))
    if len(found) < 3:
        raise NoCycles(f"the curve turns {len(found)} times; three turns are needed for a period")
    return found


def swings(found: list[Extremum]) -> np.ndarray:
    """Heights from each turn to the next [unit of the curve], shape (turns - 1,)."""
    return np.abs(np.diff([turn.value for turn in found]))


def mean_period(found: list[Extremum]) -> float:
    """Period from the times of all turns, twice the slope of their regression [s]."""
    return 2 * float(np.polyfit(np.arange(len(found)), [turn.time for turn in found], 1)[0])


def fit(time: np.ndarray, value: np.ndarray) -> Fit:
    """A damped oscillation fitted to a curve, by least squares.

    Args:
        time: Times [s], ascending, shape (t,).
        value: Values, shape (t,).

    Raises:
        NoCycles: The curve has too few turns, or no such oscillation comes near it.
    """
    time, value = np.asarray(time, dtype=float), np.asarray(value, dtype=float)
    found = turns(time, value)
    t = time - time[0]
    period, heights = mean_period(found), swings(found)
    first = found[0].time - time[0]
    decay = -float(np.polyfit(np.arange(len(heights)), np.log(heights), 1)[0]) / (0.5 * period)
    amplitude = 0.5 * float(heights[0]) * np.exp(decay * (first + 0.25 * period))
    phase = -2 * np.pi * first / period + (0 if found[0].peak else np.pi)
    guess = (amplitude, decay, 2 * np.pi / period, phase, float(np.mean(value)))
    try:
        (a, rate, omega, angle, offset), _ = optimize.curve_fit(_damped, t, value, guess)
    except RuntimeError as error:
        raise NoCycles(f"no damped oscillation fits the curve: {error}") from None
    left = float(np.sqrt(np.mean((_damped(t, a, rate, omega, angle, offset) - value) ** 2)))
    angle = (angle if omega > 0 else -angle) + (np.pi if a < 0 else 0.0)
    wrapped = (angle + np.pi) % (2 * np.pi) - np.pi
    return Fit(2 * np.pi / abs(omega), abs(a), float(rate), float(wrapped), float(offset), left / abs(a))


def _damped(t: np.ndarray, amplitude: float, rate: float, omega: float, phase: float, offset: float) -> np.ndarray:
    return np.asarray(amplitude * np.exp(-rate * t) * np.cos(omega * t + phase) + offset)


def lag(time: np.ndarray, value: np.ndarray, reference: np.ndarray) -> float:
    """Time by which a curve comes after another, from the peak of their cross-correlation [s].

    Within half a period of the reference either way; between samples by a parabola.

    Args:
        time: Times of both at equal distances [s], shape (t,).
        value, reference: The curves, shape (t,).

    Raises:
        NoCycles: The reference has too few turns.
    """
    step = float(time[1] - time[0])
    reach = max(1, round(0.5 * mean_period(turns(time, reference)) / step))
    a, b = value - np.mean(value), reference - np.mean(reference)
    shifts = signal.correlation_lags(len(a), len(b))
    # the overlap shrinks with the shift: without the division a lag would be drawn towards zero
    product = signal.correlate(a, b) / (len(a) - np.abs(shifts))
    near = np.flatnonzero(np.abs(shifts) <= reach)
    peak = int(near[np.argmax(product[near])])
    between = 0.0
    if 0 < peak < len(product) - 1:
        before, middle, after = product[peak - 1 : peak + 2]
        bend = before - 2 * middle + after
        between = 0.5 * (before - after) / bend if bend else 0.0
    return float((shifts[peak] + between) * step)


def compare(time: np.ndarray, value: np.ndarray, reference: np.ndarray) -> CycleErrors:
    """Errors of an oscillating curve against a reference at the same times.

    Args:
        time: Times of both at equal distances [s], shape (t,).
        value, reference: The curves, shape (t,).

    Raises:
        NoCycles: One of them has too few turns.
    """
    own, known = turns(time, value), turns(time, reference)
    one, other = fit(time, value), fit(time, reference)
    period = mean_period(known)
    heights = [swings(found) for found in _aligned(own, known)]
    common = min(map(len, heights))
    return CycleErrors(
        period=mean_period(own) / period - 1,
        phase=lag(time, value, reference) / period,
        amplitude=float(np.mean(heights[0][:common] / heights[1][:common])) - 1,
        decay=(one.decay - other.decay) * period,
    )


def _aligned(own: list[Extremum], known: list[Extremum]) -> tuple[list[Extremum], list[Extremum]]:
    """The turns of both from the first peak or trough that both have: a lag may take one of them out of the record."""
    if own[0].peak == known[0].peak:
        return own, known
    return (own[1:], known) if own[0].time < known[0].time else (own, known[1:])
