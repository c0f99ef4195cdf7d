"""Names that a user types: what they stand for, and the nearest known one where they stand for nothing."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any


@cache
def announced(group: str) -> Mapping[str, str]:
    """Names and targets ("module:attribute") that installed packages announce as entry points of a group."""
    return {point.name: point.value for point in entry_points(group=group)}


def names(built_in: Mapping[str, str], group: str) -> list[str]:
    """The built-in names, then the announced ones."""
    return [*built_in, *sorted(set(announced(group)) - set(built_in))]


def find(kind: str, name: str, built_in: Mapping[str, str], group: str, unknown: type[ValueError]) -> Any:
    """What a name stands for, called without arguments.

    Raises:
        ValueError: Of type `unknown`, where no `kind` has that name; the nearest known one is named.
    """
    known = names(built_in, group)
    if name not in known:
        raise unknown(f"no {kind} is called '{name}'.{nearest(name, known)} Known are {', '.join(known)}.")
    target = built_in.get(name) or announced(group)[name]
    module, _, attribute = target.partition(":")
    return getattr(import_module(module), attribute)()


def nearest(name: str, known: Iterable[str]) -> str:
    """A question that names the nearest known name, with a blank before it; empty where none is near."""
    near = difflib.get_close_matches(name, list(known), n=1)
    return f" Did you mean '{near[0]}'?" if near else ""
