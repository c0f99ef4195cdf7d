"""How an engine is drawn, on every page the same."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from dembench.engines.registry import UnknownEngine, engine

FOREIGN = ("#a06a00", "#00808a", "#8e3b8e", "#7a5230", "#c2185b", "#5c6f1f")
"""Colours of engines that are not known here, chosen by their names: results of other codes have such."""


@dataclass(frozen=True)
class Look:
    """How an engine is drawn: its fixed colour, and whether its lines are dashed."""

    title: str
    colour: str
    dashed: bool


def look(name: str) -> Look:
    """The look that an engine declares; that of an engine which is not known here is dashed, its colour by its name."""
    try:
        found = engine(name)
    except (UnknownEngine, ImportError):
        return Look(name, FOREIGN[hashlib.sha256(name.encode()).digest()[0] % len(FOREIGN)], True)
    return Look(found.title, found.colour, found.dashed)
