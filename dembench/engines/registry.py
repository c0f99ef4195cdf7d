"""The engines: those of this package and those that other packages announce by the entry point `dembench.engines`."""

from __future__ import annotations

import difflib
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points

from dembench.engines.base import Engine

BUILT_IN = {
    "peclet": "dembench.engines.peclet:Peclet",
    "peclet-hertz": "dembench.engines.peclet_hertz:PecletHertz",
    "liggghts": "dembench.engines.liggghts:Liggghts",
}


class UnknownEngine(ValueError):
    """A name that no engine has."""


@cache
def _announced() -> dict[str, str]:
    return {point.name: point.value for point in entry_points(group="dembench.engines")}


def names() -> list[str]:
    """Names of all engines, the built-in ones first."""
    return [*BUILT_IN, *sorted(set(_announced()) - set(BUILT_IN))]


@cache
def engine(name: str) -> Engine:
    """The engine of that name.

    Raises:
        UnknownEngine: No engine has that name; the nearest known one is named.
    """
    target = BUILT_IN.get(name) or _announced().get(name)
    if target is None:
        near = difflib.get_close_matches(name, names(), n=1)
        hint = f" Did you mean '{near[0]}'?" if near else ""
        raise UnknownEngine(f"no engine is called '{name}'.{hint} Known are {', '.join(names())}.")
    module, _, attribute = target.partition(":")
    return getattr(import_module(module), attribute)()
