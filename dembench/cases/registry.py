"""The cases: those of this package and those that other packages announce by the entry point `dembench.cases`."""

from __future__ import annotations

import difflib
import re
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from pydantic import ValidationError

from dembench.cases.base import Case, CaseError
from dembench.scene.base import Model

BUILT_IN = {"case3": "dembench.cases.impact:Impact"}

_TEXT = re.compile(r"(?P<name>[A-Za-z][A-Za-z0-9_-]*)(?:\[(?P<parameters>[^\[\]]*)\])?")


@cache
def _announced() -> dict[str, str]:
    return {point.name: point.value for point in entry_points(group="dembench.cases")}


def names() -> list[str]:
    """Names of all cases, the built-in ones first."""
    return [*BUILT_IN, *sorted(set(_announced()) - set(BUILT_IN))]


@cache
def case(name: str) -> Case:
    """The case of that name.

    Raises:
        CaseError: No case has that name; the nearest known one is named.
    """
    target = BUILT_IN.get(name) or _announced().get(name)
    if target is None:
        raise CaseError(f"no case is called '{name}'.{_nearest(name, names())} Known are {', '.join(names())}.")
    module, _, attribute = target.partition(":")
    found: Case = getattr(import_module(module), attribute)()
    return found


def parse_case(text: str) -> tuple[Case, Any]:
    """The case and its parameters from a text such as `case3[bed=25k]`.

    Raises:
        CaseError: The text has another form, or the case, a parameter or a value is not known.
    """
    match = _TEXT.fullmatch(text.strip())
    if match is None:
        raise CaseError(f"'{text}' is no case; write a name, or a name with parameters as in case3[bed=25k]")
    found = case(match["name"])
    values: dict[str, str] = {}
    for part in (match["parameters"] or "").split(","):
        if not part.strip():
            continue
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not key or not value:
            raise CaseError(f"{found.name}: '{part.strip()}' is no parameter; write name=value")
        if key in values:
            raise CaseError(f"{found.name}: parameter '{key}' is given more than once")
        values[key] = value
    return found, _parameters(found.name, found.parameters, values)


def _parameters(name: str, model: type[Model], values: dict[str, str]) -> Model:
    known = list(model.model_fields)
    for key in values:
        if key not in known:
            raise CaseError(f"{name} has no parameter '{key}'.{_nearest(key, known)} Accepted are {', '.join(known)}.")
    try:
        return model(**values)
    except ValidationError as error:
        fault = error.errors()[0]
        raise CaseError(f"{name}[{fault['loc'][0]}]: {fault['msg']} (given: {fault['input']!r})") from None


def _nearest(name: str, known: list[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1)
    return f" Did you mean '{near[0]}'?" if near else ""
