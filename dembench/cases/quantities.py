"""Small measures on recorded series."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from dembench.cases.base import Quantity, Recorded, Reference
from dembench.scene import Scene

AT_REST = 0.01
LARGEST_OVERLAP = 0.05
"""Overlap of grains in diameters above which they are no grains of their shape [-]."""
OVERLAP_MARGIN = 0.1 * LARGEST_OVERLAP
"""Change of the largest overlap, in diameters, that does not matter [-]."""
SHARE = 0.01
"""Change of a quantity that does not matter, as a share of its scale [-]."""

Titles = Mapping[str, tuple[str, str]]
"""Title and unit of quantities by name, in the order of tables."""


def titled(
    titles: Titles, found: Mapping[str, float | None], margins: Mapping[str, float], excesses: Collection[str] = ()
) -> list[Quantity]:
    """The quantities that were found, with their titles and units, in the order of tables.

    Args:
        titles: Titles and units.
        found: Values; None for what the record does not cover.
        margins: Changes that do not matter, in the units of the quantities; see `Quantity`.
        excesses: Quantities of which more is worse.
    """
    return [
        Quantity(name, title, value, unit, margins.get(name), "higher" if name in excesses else "either")
        for name, (title, unit) in titles.items()
        if (value := found.get(name)) is not None
    ]


def overlap_in_diameters(scene: Scene, result: Recorded) -> float | None:
    """Largest overlap on record in diameters of the smallest bodies [-]; None where none is recorded."""
    overlap = result.observables.get("overlap")
    if overlap is None or not len(overlap.time):
        return None
    return float(np.max(overlap.value)) / (2 * float(scene.radii().min()))


def kept_shape() -> Reference:
    """The condition that no overlap is larger than grains that keep their shape have."""
    return Reference(
        quantity="overlap",
        value=None,
        low=None,
        high=LARGEST_OVERLAP,
        unit="1",
        source=f"grains keep their shape; band: {LARGEST_OVERLAP:.0%} of the diameter",
        kind="closed form",
        necessary=True,
    )


def sample_at(time: np.ndarray, value: np.ndarray, when: float) -> float | None:
    """The value at `when` [s], linear between samples; None where the record does not reach it."""
    if len(time) == 0 or when < time[0] or when > time[-1] * (1 + 1e-9):
        return None
    return float(np.interp(when, time, value))


def crossings(time: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Times at which a series changes its sign [s], linear between samples; a sample of zero counts with the next."""
    k = np.flatnonzero((value[:-1] < 0) != (value[1:] < 0))
    return time[k] + (time[k + 1] - time[k]) * value[k] / (value[k] - value[k + 1])


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


@dataclass(frozen=True)
class Extremum:
    """A peak or a trough of a sampled curve: time [s] and value of the parabola through three samples."""

    time: float
    value: float
    peak: bool


def extrema(time: np.ndarray, value: np.ndarray, swing: float) -> list[Extremum]:
    """Peaks and troughs by turns, each at least `swing` away from its neighbours; the ends are none.

    A run of equal samples, as of a count that stays at zero, has its extremum in the middle.
    """
    turns = _turns(value, swing)
    found = []
    for k, peak in turns:
        last = k
        while last + 1 < len(value) and value[last + 1] == value[k]:
            last += 1
        if k == 0 or last == len(value) - 1:
            continue
        if last > k:
            found.append(Extremum(float(0.5 * (time[k] + time[last])), float(value[k]), peak))
        else:
            found.append(Extremum(*_parabola(time[k - 1 : k + 2], value[k - 1 : k + 2]), peak))
    return found


def _turns(value: np.ndarray, swing: float) -> list[tuple[int, bool]]:
    """Indices where the curve turns by at least `swing`, and whether each is a peak."""
    found: list[tuple[int, bool]] = []
    low = high = 0
    rising: bool | None = None
    for k in range(1, len(value)):
        if value[k] > value[high]:
            high = k
        if value[k] < value[low]:
            low = k
        if rising is not False and value[k] <= value[high] - swing:
            if rising is not None or high > 0:
                found.append((high, True))
            rising, low = False, k
        elif rising is not True and value[k] >= value[low] + swing:
            if rising is not None or low > 0:
                found.append((low, False))
            rising, high = True, k
    return found


def _parabola(time: np.ndarray, value: np.ndarray) -> tuple[float, float]:
    """Vertex of the parabola through three points at equal distances."""
    before, middle, after = value
    bend = before - 2 * middle + after
    shift = 0.5 * (before - after) / bend
    step = 0.5 * (time[2] - time[0])
    return float(time[1] + shift * step), float(middle - 0.25 * (before - after) * shift)
