"""Text files of rows of numbers: reading them with errors that name file, line, value and what is accepted."""

from __future__ import annotations

from pathlib import Path

import numpy as np


class CoordinatesError(ValueError):
    """A file of an initial state that cannot be used: names the file, the line and what is accepted."""


def text_lines(path: Path) -> list[str]:
    """The lines of a text file up to the last that is not empty.

    Raises:
        CoordinatesError: The file cannot be read.
    """
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except OSError as error:
        raise CoordinatesError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise CoordinatesError(f"{path}: not a plain text file") from None
    while lines and not lines[-1].strip():
        lines.pop()
    return lines


def numbers(path: Path, number: int, line: str, accepted: str) -> list[float]:
    """The finite numbers of a line.

    Args:
        path: The file, for errors.
        number: Number of the line, from 1, for errors.
        line: The line; its fields are separated by white space.
        accepted: What a row must be, for errors.

    Raises:
        CoordinatesError: A field is no finite number.
    """
    try:
        values = [float(field) for field in line.split()]
    except ValueError:
        raise CoordinatesError(f"{path}:{number}: {line.strip()[:60]!r} is not all numbers; {accepted}") from None
    if not np.isfinite(values).all():
        raise CoordinatesError(f"{path}:{number}: {line.strip()[:60]!r} is not all finite; {accepted}")
    return values
