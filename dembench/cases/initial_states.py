"""Where the initial states of the cases come from: given files, beds that ship with the package, fillings."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from dembench.cases.base import CaseError, Preset
from dembench.initial.beds import shipped
from dembench.initial.filling import Filling, PackingError, filled
from dembench.initial.progress import Progress
from dembench.initial.published import FILES, Coordinates, NoSuchFile, find_file
from dembench.initial.published_walls import read_walls
from dembench.initial.rows import CoordinatesError

FACETS = 1e-4
"""Distance by which a fill for published triangles stays inside the round walls, into which facets reach by up to 8e-5
m: grains against the wall would start 3 % of their radius deep in them [m]."""


class NoInitialState(CaseError):
    """A given directory without the initial state of the case."""


def bed(
    name: str | None,
    plan: Filling,
    progress: Progress | None,
    seed: int = 0,
    start: np.ndarray | None = None,
) -> np.ndarray:
    """Centres of a settled bed [m], shape (n, 3).

    Args:
        name: Name of the bed that ships with the package for this plan; None where none does.
        plan: How the bed is made where none ships.
        progress: Called while it is made.
        seed: Seed of the filling.
        start: Centres to start from instead of a lattice [m], shape (n, 3).

    Raises:
        CaseError: The filling failed.
    """
    if name is not None and (found := shipped(name)) is not None:
        return found
    try:
        return filled(plan, seed, progress, start)
    except PackingError as error:
        raise CaseError(f"{error}; another seed may do, or give a published initial state") from None


def given_file(initial: Path | None, name: str, optional: bool = False) -> Path | None:
    """The given file of that name (see `FILES`).

    Args:
        initial: What is given; None gives None.
        name: Name of the file.
        optional: A directory that is given for the sake of another file, too, may lack this one, which gives None.

    Raises:
        NoInitialState: The directory that is given lacks the file.
        CaseError: What is given does not exist or has several such files.
    """
    if initial is None:
        return None
    try:
        return find_file(initial, name)
    except NoSuchFile as error:
        if optional:
            return None
        raise NoInitialState(f"{error}; `dembench run` without --initial generates the initial state") from None
    except CoordinatesError as error:
        raise CaseError(str(error)) from None


def given_coordinates(read: Callable[[], Coordinates]) -> Coordinates:
    """What `read` returns; a file that cannot be used is an error of the case."""
    try:
        return read()
    except CoordinatesError as error:
        raise CaseError(str(error)) from None


def check_walls(case: str, walls: str, file: str, preset: Preset, initial: Path | None) -> None:
    """Checks what is given against the walls of a case that can have published triangles.

    Args:
        case: Name of the case.
        walls: `exact` or `mesh`.
        file: Name of the file with the triangles.
        preset: Preset; `quick` has an initial state of its own.
        initial: What is given.

    Raises:
        CaseError: The triangles are missing, or something is given that nothing would be taken from.
    """
    if walls == "mesh" and initial is None:
        raise CaseError(
            f"{case}[walls=mesh] needs the published triangles: --initial DIRECTORY with {file}, or --initial dosta2024"
        )
    if walls == "exact" and preset == "quick" and initial is not None:
        raise CaseError(
            f"{case}: initial {initial}: the quick preset has an initial state of its own; leave it out, or take the "
            "preset published"
        )


def given_walls(initial: Path, name: str) -> np.ndarray:
    """Triangles of a published wall mesh [m], shape (n, 3, 3), from a directory or a file.

    Raises:
        CaseError: It is not there, or is no such mesh.
    """
    assert name in FILES, "names of files are those of the reader"
    try:
        return read_walls(find_file(initial, name), name)
    except CoordinatesError as error:
        raise CaseError(str(error)) from None


def positions_digest(position: np.ndarray) -> str:
    """SHA-256 of centres [m], shape (n, 3), as little-endian float64 in C order: by it a published bed is known."""
    return hashlib.sha256(np.ascontiguousarray(position, dtype="<f8").tobytes()).hexdigest()
