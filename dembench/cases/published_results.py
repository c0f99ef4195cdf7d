"""Results of single codes that were published, as a case hands them to its page."""

from __future__ import annotations

from dataclasses import dataclass


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
    """

    code: str
    quantity: str
    value: float
    deviation: float | None
    unit: str
    source: str
