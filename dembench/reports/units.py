"""Units for people: which multiple of an SI unit a series is shown in."""

from __future__ import annotations

import numpy as np

from dembench.reports.tables import significant

_STEPS = ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n"))
_SCALED = ("m", "s", "J")
_WRITTEN = {"1": "", "m s-1": "m/s", "rad s-1": "rad/s"}


def shown_in(unit: str, *series: np.ndarray | list[float] | float) -> tuple[float, str]:
    """Factor and unit in which values [unit] are read easily; the same for all series of a figure or column.

    Lengths, times and energies below 0.5 get the prefix milli, micro or nano; everything else stays as it is.
    """
    written = _WRITTEN.get(unit, unit)
    if unit not in _SCALED:
        return 1.0, written
    largest = 0.0
    for values in series:
        finite = np.abs(np.asarray(values, dtype=float))
        finite = finite[np.isfinite(finite)]
        largest = max(largest, float(finite.max(initial=0.0)))
    for factor, prefix in _STEPS:
        if largest == 0 or largest * factor >= 0.5:
            return factor, prefix + written
    return _STEPS[-1][0], _STEPS[-1][1] + written


def labelled(title: str, unit: str) -> str:
    """Label of an axis: the title and, in brackets, the unit."""
    return f"{title} [{unit}]" if unit else title


def measure(value: float, unit: str, digits: int = 4) -> str:
    """A value [unit] with so many significant digits, in the multiple of its unit that reads easily."""
    factor, written = shown_in(unit, value)
    return f"{significant(value * factor, digits)} {written}".strip()
