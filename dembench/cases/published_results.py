"""Results of single codes that were published, as a case hands them to its page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class PublishedResult:
    """A number that somebody published for one code.

    Attributes:
        code: The code, as published.
        quantity: What it is, for tables.
        value: In `unit`.
        deviation: Standard deviation over initial conditions; None for a single run.
        unit: SI unit.
        source: Where it comes from.
        high: Upper end of the range that was published, from `value`; None for a number.
    """

    code: str
    quantity: str
    value: float
    deviation: float | None
    unit: str
    source: str
    high: float | None = None


def recorded(entries: Sequence[Mapping[str, Any]], titles: Mapping[str, tuple[str, str]]) -> list[PublishedResult]:
    """The results in entries of `data/published/`, quantity by quantity.

    Args:
        entries: Each has `code`, `source` and quantities by name: a number, a range, or mean and standard deviation.
        titles: Title and unit by name of quantity.
    """
    found = []
    for name, (title, unit) in titles.items():
        for entry in entries:
            match entry.get(name):
                case None:
                    continue
                case [low, high]:
                    value, deviation, end = low, None, high
                case {"mean": value, "deviation": deviation}:
                    end = None
                case value:
                    deviation, end = None, None
            found.append(PublishedResult(entry["code"], title, value, deviation, unit, entry["source"], end))
    return found
