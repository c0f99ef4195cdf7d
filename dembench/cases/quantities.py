"""Small measures on recorded series."""

from __future__ import annotations

import numpy as np


def sample_at(time: np.ndarray, value: np.ndarray, when: float) -> float | None:
    """The value at `when` [s], linear between samples; None where the record does not reach it."""
    if len(time) == 0 or when < time[0] or when > time[-1] * (1 + 1e-9):
        return None
    return float(np.interp(when, time, value))


def lowest(time: np.ndarray, value: np.ndarray, end: float) -> tuple[float, float] | None:
    """Time [s] and value of the lowest sample; None where the record stops while still falling before `end` [s]."""
    if len(time) == 0:
        return None
    k = int(np.argmin(value))
    if k == len(value) - 1 and time[-1] < end * (1 - 1e-9):
        return None
    return float(time[k]), float(value[k])
