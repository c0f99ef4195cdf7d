"""The engines: those of this package and those that other packages announce by the entry point `dembench.engines`."""

from __future__ import annotations

from functools import cache

from dembench import plugins
from dembench.engines.base import Engine

BUILT_IN = {
    "peclet": "dembench.engines.peclet:Peclet",
    "peclet-hertz": "dembench.engines.peclet_hertz:PecletHertz",
    "liggghts": "dembench.engines.liggghts:Liggghts",
    "lammps": "dembench.engines.lammps:Lammps",
    "musen": "dembench.engines.musen:Musen",
    "yade": "dembench.engines.yade:Yade",
    "kratos": "dembench.engines.kratos:Kratos",
    "peclet-dem": "dembench.engines.peclet_dem:PecletDem",
}
GROUP = "dembench.engines"
EXPLICIT = "peclet-hertz"
"""The engine whose steps are forecast unless another is named: that of the automatic time step."""


class UnknownEngine(ValueError):
    """A name that no engine has."""


def names() -> list[str]:
    """Names of all engines, the built-in ones first."""
    return plugins.names(BUILT_IN, GROUP)


@cache
def engine(name: str) -> Engine:
    """The engine of that name.

    Raises:
        UnknownEngine: No engine has that name; the nearest known one is named.
    """
    found: Engine = plugins.find("engine", name, BUILT_IN, GROUP, UnknownEngine)
    return found
