"""The project's own npz: arrays by the names of the fields, as beside a scene."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from dembench.initial.formats.base import Format
from dembench.initial.formats.state import FIELDS, State, state_of
from dembench.initial.rows import CoordinatesError


def recognises(head: bytes) -> bool:
    """Whether it is a zip archive."""
    return head.startswith(b"PK\x03\x04")


def read(path: Path, frame: int = 0) -> State:
    """Reads the arrays; the file has one frame."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files if name in ("position", *FIELDS)}
            names = stored.files
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise CoordinatesError(f"{path}: no readable npz file: {error}") from None
    if "position" not in arrays:
        raise CoordinatesError(f"{path}: has the arrays {', '.join(names)}; accepted are position, {', '.join(FIELDS)}")
    return state_of(**arrays)


def write(state: State, path: Path) -> None:
    """Writes the arrays that the state knows."""
    arrays = {name: array for name in ("position", *FIELDS) if (array := getattr(state, name)) is not None}
    with open(path, "wb") as stream:
        np.savez_compressed(stream, **arrays)


FORMAT = Format("npz", "arrays of this program", (".npz",), recognises, read, write)
