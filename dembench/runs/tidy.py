"""What is removed from the deck of a run that ended well."""

from __future__ import annotations

import shutil
from pathlib import Path

from dembench.engines.base import CHECKPOINTS, FRAMES


def remove_bulk(deck: Path) -> None:
    """Removes raw frames, which are in the observables, and checkpoints; its text, its tracks and all logs stay."""
    for name in (FRAMES, CHECKPOINTS):
        shutil.rmtree(deck / name, ignore_errors=True)
