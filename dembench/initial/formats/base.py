"""What a file format is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dembench.initial.formats.state import FIELDS, State


@dataclass(frozen=True)
class Format:
    """A file format of states of spheres.

    Attributes:
        name: Name on the command line.
        title: What it is, for lists.
        endings: Endings of its files; several formats may share one.
        recognises: Whether the first bytes of a file are those of the format.
        read: Reads one frame of a file (0 the first, -1 the last); raises CoordinatesError or StateError.
        write: Writes a state that has what `needs` names and says no more than `holds`; raises StateError where a value
            has no place in the format.
        holds: Fields that it has a place for.
        needs: Fields that it cannot do without.
    """

    name: str
    title: str
    endings: tuple[str, ...]
    recognises: Callable[[bytes], bool]
    read: Callable[[Path, int], State]
    write: Callable[[State, Path], None]
    holds: tuple[str, ...] = FIELDS
    needs: tuple[str, ...] = ()
