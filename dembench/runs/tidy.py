"""What is removed from the deck of a run that ended well."""

from __future__ import annotations

import shutil
from pathlib import Path

RAW_FRAMES = "frames"
"""Directory of a deck in which an engine writes its raw frames: they are in the observables, and bulky."""


def remove_raw_frames(deck: Path) -> None:
    """Removes the raw frames of a deck; its text, its tracks and all logs stay."""
    shutil.rmtree(deck / RAW_FRAMES, ignore_errors=True)
