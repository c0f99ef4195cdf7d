"""Small measures on recorded series."""

from __future__ import annotations

import numpy as np

AT_REST = 0.01


def sample_at(time: np.ndarray, value: np.ndarray, when: float) -> float | None:
    """The value at `when` [s], linear between samples; None where the record does not reach it."""
    if len(time) == 0 or when < time[0] or when > time[-1] * (1 + 1e-9):
        return None
    return float(np.interp(when, time, value))


def lowest(time: np.ndarray, value: np.ndarray) -> tuple[float, float] | None:
    """Time [s] and value of the lowest sample; None where the record ends in the fall.

    It ends in the fall where the last sample is the lowest and the last step down is more than 1 % of the largest.
    """
    if len(time) < 2:
        return None
    k = int(np.argmin(value))
    down = -np.diff(value)
    if k == len(value) - 1 and down[-1] > AT_REST * down.max():
        return None
    return float(time[k]), float(value[k])
