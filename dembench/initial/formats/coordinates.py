"""The published coordinate formats: rows of radius, x, y, z with a header, and rows of x, y, z without."""

from __future__ import annotations

from pathlib import Path

from dembench.initial.formats.base import Format
from dembench.initial.formats.state import State, state_of
from dembench.initial.published import HEADER, read_centres, read_coordinates


def recognises(head: bytes) -> bool:
    """Whether the first line is the header of the drum and the impact."""
    return head.split(b"\n", 1)[0].decode("ascii", "replace").split() == HEADER


def recognises_centres(head: bytes) -> bool:
    """Whether the first line has three numbers, as the silo files."""
    try:
        return len([float(field) for field in head.split(b"\n", 1)[0].split()]) == 3
    except ValueError:
        return False


def read(path: Path, frame: int = 0) -> State:
    """Reads a file of the drum or the impact; a last row of six fields is no particle."""
    found = read_coordinates(path)
    return state_of(found.position, radius=found.radius)


def read_silo(path: Path, frame: int = 0) -> State:
    """Reads a file of the silo, which knows no radii."""
    return state_of(read_centres(path, 0.0).position)


def write(state: State, path: Path) -> None:
    """Writes a file as those of the drum and the impact."""
    assert state.radius is not None
    rows = zip(state.radius.tolist(), *state.position.T.tolist(), strict=True)
    _write(path, [" ".join(HEADER), *(" " + " ".join(map(repr, row)) for row in rows), ""])


def write_silo(state: State, path: Path) -> None:
    """Writes a file as those of the silo."""
    _write(path, [" ".join(map(repr, row)) for row in state.position.tolist()])


def _write(path: Path, lines: list[str]) -> None:
    path.write_bytes("".join(f"{line}\r\n" for line in lines).encode("ascii"))


FORMAT = Format(
    "published",
    "published file of drum and impact",
    (".txt",),
    recognises,
    read,
    write,
    holds=("radius",),
    needs=("radius",),
)
SILO = Format("published-silo", "published file of the silo", (".txt",), recognises_centres, read_silo, write_silo, ())
