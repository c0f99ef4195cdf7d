"""Checkpoints of the in-tree engines: `checkpoints/<step>/` with the state and what the record needs to go on.

`state.npz` is what `Simulation.save` writes, before anything is recorded at that step; `record.json` holds step, time
[s] and the seconds spent so far. A directory has its final name only when it is complete and on the disk; the two
newest are kept.
"""

from __future__ import annotations

import json
import os
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dembench.engines.base import CHECKPOINTS

STATE, RECORD = "state.npz", "record.json"
KEPT = 2


@dataclass(frozen=True)
class Stored:
    """A checkpoint on the disk.

    Attributes:
        path: Its directory.
        step: Step number.
        time: Simulated time [s].
        spent: Seconds spent so far, by part of the run.
    """

    path: Path
    step: int
    time: float
    spent: dict[str, float]


def write(deck: Path, save: Callable[[Path], Any], step: int, time: float, spent: dict[str, float]) -> None:
    """Writes a checkpoint and removes those that it makes superfluous.

    Args:
        deck: Deck directory.
        save: Writes the state to a file.
        step, time, spent: See `Stored`.
    """
    final = deck / CHECKPOINTS / str(step)
    temporary = final.with_suffix(".tmp")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    save(temporary / STATE)
    (temporary / RECORD).write_text(json.dumps({"step": step, "time": time, "spent": spent}))
    for name in (STATE, RECORD):
        flush(temporary / name)
    os.rename(temporary, final)
    for path in _written(deck)[KEPT:]:
        shutil.rmtree(path)


def latest(deck: Path) -> tuple[Stored | None, list[int]]:
    """The last whole checkpoint of a deck, and the steps of later ones that are damaged; it only reads."""
    damaged: list[int] = []
    for path in _written(deck):
        found = _stored(path)
        if found is not None:
            return found, damaged
        damaged.append(int(path.name))
    return None, damaged


def remove_after(deck: Path, step: int) -> None:
    """Removes all checkpoints later than a step, and what is left of one that was being written."""
    for path in (deck / CHECKPOINTS).iterdir():
        if not path.name.isdecimal() or int(path.name) > step:
            shutil.rmtree(path)


def flush(path: Path) -> None:
    """Makes sure that a file is on the disk."""
    with open(path, "rb") as stream:
        os.fsync(stream.fileno())


def _written(deck: Path) -> list[Path]:
    """Directories of the checkpoints, the newest first."""
    folder = deck / CHECKPOINTS
    found = [path for path in folder.iterdir() if path.name.isdecimal()] if folder.is_dir() else []
    return sorted(found, key=lambda path: -int(path.name))


def _stored(path: Path) -> Stored | None:
    """A checkpoint whose files are whole to the last byte (CRC-32 of every array), or None."""
    try:
        with zipfile.ZipFile(path / STATE) as archive:
            if archive.testzip() is not None:
                return None
        return Stored(path, **json.loads((path / RECORD).read_text()))
    except (OSError, ValueError, TypeError, EOFError, zipfile.BadZipFile):
        return None
