"""Reads the published coordinate files of the three cases as they are. Source: doi 10.5281/zenodo.8252892.

A file of particles has one header line `Radius[m] PosX[m] PosY[m] PosZ[m]` and one particle per row; those of the silo
have neither header nor radii, only x, y, z. The impact files end with a row about the ball, in one of two forms: six
fields (its data), which are no particle, or the ball itself as a particle of its own radius.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path, PurePath

import numpy as np

from dembench.initial.rows import CoordinatesError, numbers, text_lines

HEADER = ["Radius[m]", "PosX[m]", "PosY[m]", "PosZ[m]"]
ACCEPTED = "a row has the four numbers radius, x, y, z; the last may have six (the ball's data) or be the ball itself"
ACCEPTED_BARE = "a row of a silo file has the three numbers x, y, z"

FILES = {
    **{
        f"silo {orifice} {material}": (f"*partcoordinates {material.lower()} ({orifice} orifice).txt",)
        for orifice in ("large", "small")
        for material in ("M1", "M2")
    },
    "drum": ("*partcoordinates.txt",),
    **{f"impact {bed}": (f"*{bed}particles.txt",) for bed in ("25k", "50k", "100k")},
    **{
        f"{orifice} silo walls": (f"*walls ({orifice} orifice).txt", f"*silo_walls_{orifice}.txt")
        for orifice in ("large", "small")
    },
    "drum walls": ("*drum_walls.txt", "*drum*/walls.txt", "*mixer*/walls.txt"),
    "impact walls": ("*penetration_walls.txt", "*penetration*/walls.txt", "*impact*/walls.txt"),
}
"""Endings of the paths, in lower case, by which the files are known, in the data record and where it was copied to."""


class NoSuchFile(CoordinatesError):
    """A directory without a file that it was searched for."""


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


def find_file(given: Path, name: str) -> Path:
    """A published file: `given` itself, or the one file in that directory, however deep, that is known by `name`.

    Args:
        given: A file or a directory.
        name: One of `FILES`.

    Raises:
        NoSuchFile: The directory has none.
        CoordinatesError: There is no such file or directory, or it has more than one.
    """
    if given.is_file():
        return given
    if not given.is_dir():
        raise CoordinatesError(f"{given}: no such file or directory; give the file of the {name} or its directory")
    found = [path for path in sorted(given.rglob("*.txt")) if path.is_file() and name in names_of(path.resolve())]
    if not found:
        raise NoSuchFile(f"{given}: no file of the {name} there; accepted are {', '.join(FILES[name])}")
    if len(found) > 1:
        names = ", ".join(str(path.relative_to(given)) for path in found)
        raise CoordinatesError(f"{given}: {names} can all be the {name}; give one of them")
    return found[0]


def names_of(path: PurePath) -> list[str]:
    """The names in `FILES` by which a path is known, from its last directory and its file name."""
    ending = "/".join(path.parts[-2:]).lower()
    return [name for name, patterns in FILES.items() if any(fnmatchcase(ending, pattern) for pattern in patterns)]


def read_coordinates(path: Path, radii: Sequence[float] | None = None, ball: float | None = None) -> Coordinates:
    """Reads a file of the drum or of the impact; a last row about the ball is left out.

    Args:
        path: The file.
        radii: Radii [m] that the particles may have; None accepts all above 0.
        ball: Radius [m] by which the ball is known in a last row of four fields; None where there is no such row.

    Raises:
        CoordinatesError: The file cannot be read, a row is none of those accepted, or a radius is another.
    """
    lines = text_lines(path)
    if not lines or lines[0].split() != HEADER:
        raise CoordinatesError(f"{path}:1: expected the header '{' '.join(HEADER)}'")
    rows = [numbers(path, number, line, ACCEPTED) for number, line in enumerate(lines[1:], 2)]
    if rows and (len(rows[-1]) == 6 or (len(rows[-1]) == 4 and rows[-1][0] == ball)):
        rows.pop()
    for number, row in enumerate(rows, 2):
        if len(row) == 4 and not (row[0] > 0 if radii is None else row[0] in radii):
            listed = "those above 0" if radii is None else " and ".join(f"{radius:g} m" for radius in radii)
            raise CoordinatesError(f"{path}:{number}: radius {row[0]:g} m; accepted are {listed}")
    table = _table(path, rows, 2, 4, ACCEPTED)
    return Coordinates(path, np.ascontiguousarray(table[:, 1:]), np.ascontiguousarray(table[:, 0]))


def read_centres(path: Path, radius: float) -> Coordinates:
    """Reads a file of the silo, which has neither header nor radii; all particles get `radius` [m].

    Raises:
        CoordinatesError: The file cannot be read, or a row is none of those accepted.
    """
    lines = text_lines(path)
    if lines and lines[0].split() == HEADER:
        raise CoordinatesError(f"{path}:1: has the header of another case; {ACCEPTED_BARE}")
    rows = [numbers(path, number, line, ACCEPTED_BARE) for number, line in enumerate(lines, 1)]
    table = _table(path, rows, 1, 3, ACCEPTED_BARE)
    return Coordinates(path, table, np.full(len(table), radius))


def _table(path: Path, rows: list[list[float]], first: int, fields: int, accepted: str) -> np.ndarray:
    """Rows of `fields` numbers, the first of them in line `first`, as an array."""
    if not rows:
        raise CoordinatesError(f"{path}: no particles")
    for number, row in enumerate(rows, first):
        if len(row) != fields:
            raise CoordinatesError(f"{path}:{number}: {len(row)} fields; {accepted}")
    return np.array(rows)
