"""The cases: those of this package and those that other packages announce by the entry point `dembench.cases`."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from pydantic import ValidationError

from dembench import plugins
from dembench.cases.base import Case, CaseError
from dembench.scene.base import Model

BUILT_IN = {
    "case1": "dembench.cases.silo:Silo",
    "case2": "dembench.cases.drum:Drum",
    "case3": "dembench.cases.impact:Impact",
}
GROUP = "dembench.cases"

_TEXT = re.compile(r"(?P<name>[A-Za-z][A-Za-z0-9_-]*)(?:\[(?P<parameters>[^\[\]]*)\])?")


def names() -> list[str]:
    """Names of all cases, the built-in ones first."""
    return plugins.names(BUILT_IN, GROUP)


@cache
def case(name: str) -> Case:
    """The case of that name.

    Raises:
        CaseError: No case has that name; the nearest known one is named.
    """
    found: Case = plugins.find("case", name, BUILT_IN, GROUP, CaseError)
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


def softening(text: str, preset: str | None) -> str:
    """How the materials of a problem are softer than the published ones; empty where they are not or nothing is known.

    Args:
        text: A case as typed, or the name of a scene file.
        preset: Its preset; None for a scene file.
    """
    if preset is None:
        return ""
    try:
        found, parameters = parse_case(text)
    except CaseError:
        return ""
    return found.softening(parameters, preset)  # type: ignore[arg-type]


def problem_title(text: str, preset: str | None) -> str:
    """A problem in words, as tables and messages name it: `case1, quick, softened`; see `softening`.

    Softer materials are another problem: nothing that names one leaves the word out.
    """
    words = [text, preset or "", "softened" if softening(text, preset) else ""]
    return ", ".join(word for word in words if word)


def _parameters(name: str, model: type[Model], values: dict[str, str]) -> Model:
    known = list(model.model_fields)
    for key in values:
        if key not in known:
            raise CaseError(
                f"{name} has no parameter '{key}'.{plugins.nearest(key, known)} Accepted are {', '.join(known)}."
            )
    try:
        return model(**values)
    except ValidationError as error:
        fault = error.errors()[0]
        raise CaseError(f"{name}[{fault['loc'][0]}]: {fault['msg']} (given: {fault['input']!r})") from None
