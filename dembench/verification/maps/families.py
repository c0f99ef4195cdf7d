"""The maps, and which of them a list of axes asks for."""

from __future__ import annotations

from collections.abc import Sequence

from dembench.plugins import nearest
from dembench.runs.plan import RequestError
from dembench.verification.maps import grains, impacts, lattices
from dembench.verification.maps.rigs import AXES, Family

FAMILIES: tuple[Family, ...] = (impacts.FAMILY, lattices.FAMILY, grains.FAMILY)
OF = {"coordination": "lattices", "overlap": "lattices", "mass ratio": "grains"}
"""The map that an axis belongs to alone; every other axis asks for impacts."""


def axes(text: Sequence[str]) -> list[str]:
    """The axes of a list as typed, `mass-ratio` for `mass ratio`; all where it is empty.

    Raises:
        RequestError: One is not known.
    """
    found = [name.replace("-", " ") for name in text] or list(AXES)
    for name in found:
        if name not in AXES:
            known = [axis.replace(" ", "-") for axis in AXES]
            typed = name.replace(" ", "-")
            raise RequestError(f"no axis '{typed}'.{nearest(typed, known)} There are {', '.join(known)}.")
    return found


def families(asked: Sequence[str]) -> list[Family]:
    """The maps that axes ask for."""
    names = {OF.get(axis, "impacts") for axis in asked}
    return [family for family in FAMILIES if family.name in names]
