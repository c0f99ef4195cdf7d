"""The formats by name, by the content of a file, and by its ending."""

from __future__ import annotations

from pathlib import Path

from dembench import plugins
from dembench.atomic import replacing
from dembench.initial.formats import (
    arrays,
    coordinates,
    liggghts_data,
    liggghts_dump,
    musen,
    table,
    vtk_legacy,
    vtk_xml,
)
from dembench.initial.formats.base import Format
from dembench.initial.formats.state import FIELDS, State, StateError
from dembench.initial.rows import CoordinatesError

FORMATS = (
    liggghts_data.FORMAT,
    liggghts_dump.FORMAT,
    musen.FORMAT,
    vtk_legacy.FORMAT,
    vtk_xml.POLYDATA,
    vtk_xml.GRID,
    table.FORMAT,
    coordinates.FORMAT,
    coordinates.SILO,
    arrays.FORMAT,
)
_HEAD = 4096


def names() -> list[str]:
    """Names of all formats."""
    return [known.name for known in FORMATS]


def format_named(name: str) -> Format:
    """The format of that name; CoordinatesError names the nearest where there is none."""
    for known in FORMATS:
        if known.name == name:
            return known
    raise CoordinatesError(
        f"no format is called '{name}'.{plugins.nearest(name, names())} Accepted are {', '.join(names())}."
    )


def format_of(path: Path) -> Format:
    """The format of a file that is there, by its content.

    Raises:
        CoordinatesError: It cannot be read, or is of no known format.
    """
    try:
        with open(path, "rb") as stream:
            head = stream.read(_HEAD)
    except OSError as error:
        raise CoordinatesError(f"{path}: {error.strerror}") from None
    for known in FORMATS:
        if known.recognises(head):
            return known
    raise CoordinatesError(f"{path}: of no known format; known are {', '.join(names())}")


def format_for(path: Path) -> Format:
    """The format in which a new file is written, by its ending.

    Raises:
        CoordinatesError: No format has the ending, or several have.
    """
    found = [known for known in FORMATS if path.suffix.lower() in known.endings]
    if len(found) == 1:
        return found[0]
    if found:
        several = ", ".join(known.name for known in found)
        raise CoordinatesError(f"{path}: files of several formats end like this; name one of {several}")
    endings = ", ".join(f"{ending} ({known.name})" for known in FORMATS for ending in known.endings)
    raise CoordinatesError(f"{path}: no format has the ending '{path.suffix}'; accepted are {endings}")


def read(path: Path, known: Format | None = None, frame: int = -1) -> State:
    """The state in a file.

    Args:
        path: The file.
        known: Its format; None recognises it by its content.
        frame: Which of its frames: 0 the first, -1 the last.

    Raises:
        CoordinatesError: It cannot be read; the message names the file, the line, the value and what is accepted.
    """
    try:
        return (known or format_of(path)).read(path, frame)
    except StateError as error:
        raise CoordinatesError(f"{path}: {error}") from None


def write(state: State, path: Path, known: Format | None = None) -> None:
    """Writes a state under a temporary name that is then renamed.

    Args:
        state: The state.
        path: The file.
        known: Its format; None takes the one of its ending.

    Raises:
        CoordinatesError: The state lacks what the format needs, or says what it cannot hold.
    """
    known = known or format_for(path)
    lacking = [name for name in known.needs if getattr(state, name) is None]
    if lacking:
        options = " ".join(f"--{name}" for name in lacking)
        raise CoordinatesError(f"{path}: {known.name} needs {', '.join(lacking)}, which is not known; give {options}")
    lost = [name for name in state.said() if name not in known.holds]
    if lost:
        places = ", ".join(name for name in FIELDS if name in known.holds) or "positions"
        raise CoordinatesError(
            f"{path}: {known.name} has no place for {', '.join(lost)}, only for {places}; --drop {','.join(lost)}"
        )
    try:
        with replacing(path) as temporary:
            known.write(state, temporary)
    except StateError as error:
        raise CoordinatesError(f"{path}: {known.name}: {error}") from None
    except OSError as error:
        raise CoordinatesError(f"{path}: cannot be written: {error.strerror}") from None
