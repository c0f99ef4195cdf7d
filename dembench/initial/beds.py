"""Settled packings as files: those that ship with the package for the quick presets, and those that users make."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dembench.initial.cache import load, store
from dembench.initial.filling import Filling, inputs
from dembench.share import share


class BedError(ValueError):
    """A file that is no bed."""


@dataclass(frozen=True)
class Bed:
    """A settled packing and how it was made.

    Attributes:
        plan: What was filled into which container.
        seed: Seed of the filling.
        position: Centres [m], shape (n, 3), layer upon layer.
    """

    plan: Filling
    seed: int
    position: np.ndarray


def read_bed(path: Path) -> Bed:
    """A bed from a file.

    Raises:
        BedError: The file is not there, is damaged or is no bed.
    """
    try:
        position, found = load(path)
        bed = Bed(Filling.model_validate(found["plan"]), int(found["seed"]), position)
    except (ValueError, KeyError, TypeError) as error:
        raise BedError(f"{path}: no bed that `dembench initial make` has written: {error}") from None
    if position.shape != (bed.plan.count, 3):
        raise BedError(f"{path}: an array of shape {position.shape}; its plan has {bed.plan.count} particles")
    return bed


def write_bed(path: Path, bed: Bed) -> None:
    """Writes a bed; the file appears when it is complete."""
    store(path, inputs(bed.plan, bed.seed), bed.position)


def shipped(name: str) -> np.ndarray | None:
    """Centres of the bed of that name [m], shape (n, 3), from `data/beds/`; None where none ships."""
    path = shipped_file(name)
    return None if path is None else read_bed(path).position


def shipped_file(name: str) -> Path | None:
    """The file of the bed of that name; None where none ships."""
    try:
        return share("data", "beds", f"{name}.npz")
    except FileNotFoundError:
        return None
