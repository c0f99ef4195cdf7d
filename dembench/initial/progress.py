"""How long work tells what it is doing."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[float, str], None]
"""Called with the fraction done (0 to 1) and one line about what is going on."""


def silent(fraction: float, message: str) -> None:
    """A progress that shows nothing."""
