"""Reads published particle coordinates as they are.

The files have one header line `Radius[m] PosX[m] PosY[m] PosZ[m]` and one particle per row. The impact files end with
a row about the ball, in one of two forms: six fields (its data), which are no particle, or the ball itself as a
particle of its own radius. Source: Dosta et al. 2024, doi 10.5281/zenodo.8252892.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

HEADER = ["Radius[m]", "PosX[m]", "PosY[m]", "PosZ[m]"]
ACCEPTED = "a row has the four numbers radius, x, y, z; the last may have six (the ball's data) or be the ball itself"


class CoordinatesError(ValueError):
    """A coordinate file that cannot be used: names the file, the line and what is accepted."""


@dataclass(frozen=True)
class Coordinates:
    """Particles of a coordinate file.

    Attributes:
        path: The file.
        position: Centres [m], shape (n, 3), float64.
        radius: Radii [m], shape (n,).
    """

    path: Path
    position: np.ndarray
    radius: np.ndarray


def find_coordinates(given: Path, ending: str) -> Path:
    """The coordinate file: `given` itself, or the one file in the directory `given` whose name ends with `ending`.

    Raises:
        CoordinatesError: There is none, or more than one.
    """
    if given.is_file():
        return given
    if not given.is_dir():
        raise CoordinatesError(f"{given}: no such file or directory; give a coordinate file or the directory with it")
    found = sorted(path for path in given.iterdir() if path.name.endswith(ending))
    if not found:
        raise CoordinatesError(f"{given}: no file there is called '...{ending}'")
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise CoordinatesError(f"{given}: {names} all end with '{ending}'; name one of them")
    return found[0]


def read_coordinates(path: Path, ball_radius: float) -> Coordinates:
    """Reads a coordinate file; a last row about the ball is left out.

    Args:
        path: The file.
        ball_radius: Radius [m] by which the ball is known in the last row.

    Raises:
        CoordinatesError: The file cannot be read, or a row is none of those accepted.
    """
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except OSError as error:
        raise CoordinatesError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise CoordinatesError(f"{path}: not a plain text file") from None
    if not lines or lines[0].split() != HEADER:
        raise CoordinatesError(f"{path}:1: expected the header '{' '.join(HEADER)}'")
    while not lines[-1].strip():
        lines.pop()
    rows = [_numbers(path, number, line) for number, line in enumerate(lines[1:], start=2)]
    if rows and (len(rows[-1]) == 6 or (len(rows[-1]) == 4 and rows[-1][0] == ball_radius)):
        rows.pop()
    if not rows:
        raise CoordinatesError(f"{path}: no particles")
    for number, row in enumerate(rows, start=2):
        if len(row) != 4:
            raise CoordinatesError(f"{path}:{number}: {len(row)} fields; {ACCEPTED}")
        if row[0] <= 0:
            raise CoordinatesError(f"{path}:{number}: radius {row[0]:g} m; it must be above 0")
    table = np.array(rows)
    return Coordinates(path, np.ascontiguousarray(table[:, 1:]), np.ascontiguousarray(table[:, 0]))


def _numbers(path: Path, number: int, line: str) -> list[float]:
    try:
        values = [float(field) for field in line.split()]
    except ValueError:
        raise CoordinatesError(f"{path}:{number}: {line.strip()[:60]!r} is not all numbers; {ACCEPTED}") from None
    if not np.isfinite(values).all():
        raise CoordinatesError(f"{path}:{number}: {line.strip()[:60]!r} is not all finite; {ACCEPTED}")
    return values
