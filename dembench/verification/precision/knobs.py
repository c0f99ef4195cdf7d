"""The setting that a sweep turns: which values an engine takes, from coarse to fine."""

from __future__ import annotations

import types
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, Union, get_args, get_origin

import numpy as np

from dembench.engines import registry
from dembench.plugins import nearest
from dembench.runs.plan import EngineChoice, RequestError
from dembench.scene import Scene

DT = "dt"
SPAN = (8.0, 0.125)
"""Factors of the coarsest and the finest time step, of the scene's step of the closed division."""
OWN = 0.01
"""Relative difference from which an engine's own time step is a value beside those of the series [-]."""


@dataclass(frozen=True)
class Value:
    """One value of the knob of an engine.

    Attributes:
        text: As typed; of a time step its factor.
        rank: Place from coarse (0) to fine.
        factor: Factor of the time step of the closed division; None for other knobs.
    """

    text: str
    rank: int
    factor: float | None = None


def values(
    knob: str,
    engines: Sequence[EngineChoice],
    points: int,
    typed: Sequence[str] = (),
    span: tuple[float, float] = SPAN,
) -> dict[int, list[Value]]:
    """The values of a knob for each engine, by its place in the list.

    A time step takes factors in a geometric series, the same for all engines; a whole number 1, 2, 4, ...; another
    number the factors of its default; a choice each of its words. An engine without the setting gets one point.

    Args:
        knob: Name of the setting.
        engines: Engines with settings as typed; none of them sets the knob.
        points: Number of values.
        typed: Values as typed, from coarse to fine; for a time step factors. Empty takes those above.
        span: Coarsest and finest factor.

    Raises:
        RequestError: No engine has the setting, one of them sets it, or its values have to be typed.
    """
    known = [registry.engine(choice.engine).settings_type.model_fields for choice in engines]
    if not any(knob in fields for fields in known):
        everything = list(dict.fromkeys(name for fields in known for name in fields))
        raise RequestError(
            f"no engine here has a setting '{knob}'.{nearest(knob, everything)} There are {', '.join(everything)}."
        )
    for choice in engines:
        if knob in choice.overrides:
            raise RequestError(f"{choice.engine}[{knob}={choice.overrides[knob]}]: the sweep sets {knob} itself")
    made = {}
    for k, fields in enumerate(known):
        if knob not in fields:
            made[k] = [Value("", 0)]
        elif knob == DT:
            made[k] = _steps(points, typed, span)
        else:
            texts = list(typed) or _texts(knob, fields[knob].annotation, points, fields[knob].default, span)
            made[k] = [Value(text, rank) for rank, text in enumerate(texts)]
    return made


def _steps(points: int, typed: Sequence[str], span: tuple[float, float]) -> list[Value]:
    try:
        factors = [float(text) for text in typed] or [float(f) for f in np.geomspace(*span, points)]
    except ValueError:
        raise RequestError(f"'{','.join(typed)}' are no factors of a time step; write them as 4,2,1,0.5") from None
    if min(factors) <= 0:
        raise RequestError(f"{min(factors):g} is no factor of a time step; it must be above 0")
    ordered = sorted(factors, reverse=True)
    return [Value(f"{factor:.4g}", rank, factor) for rank, factor in enumerate(ordered)]


def _texts(knob: str, annotation: Any, points: int, default: Any, span: tuple[float, float]) -> list[str]:
    """Values of a setting of that type."""
    kind = annotation
    while get_origin(kind) in (Union, types.UnionType):
        kind = next(part for part in get_args(kind) if part is not type(None))
    if get_origin(kind) is not None and get_origin(kind) is not Literal:
        kind = get_args(kind)[0]
    if get_origin(kind) is Literal:
        return [str(word) for word in get_args(kind)]
    if kind is bool:
        return ["false", "true"]
    if kind is int:
        return [str(2**k) for k in range(points)]
    if kind is float and isinstance(default, float) and default > 0:
        return [f"{factor * default:.6g}" for factor in np.geomspace(min(span), max(span), points)]
    raise RequestError(f"the values of '{knob}' have to be given, as --values 1,2,4")


def with_own_step(taken: Sequence[Value], choice: EngineChoice, scene: Scene, given: Mapping[str, str]) -> list[Value]:
    """Factors of the time step with that of the step which an engine takes by itself, where it is not the scene's.

    Args:
        taken: The factors.
        choice: The engine as typed.
        scene: The scene.
        given: Settings that come with the scene.
    """
    own = registry.engine(choice.engine).settings(scene, "closed", {**_known(choice, given), **choice.overrides}).dt
    factor = own / scene.closed_step()
    if abs(factor - 1) <= OWN:
        return list(taken)
    factors = sorted({value.factor for value in taken if value.factor is not None} | {factor}, reverse=True)
    return [Value(f"{factor:.4g}", rank, factor) for rank, factor in enumerate(factors)]


def chosen(choice: EngineChoice, knob: str, value: Value, scene: Scene, given: Mapping[str, str]) -> EngineChoice:
    """An engine with the knob at a value, on one scene.

    Args:
        choice: The engine as typed.
        knob: Name of the setting.
        value: Its value.
        scene: The scene, whose closed division has the step that a factor is of.
        given: Settings that come with the scene.
    """
    own = _known(choice, given)
    if not value.text:
        return replace(choice, given=own)
    if value.factor is None:
        return EngineChoice(choice.engine, {**choice.overrides, knob: value.text}, given=own)
    fitted = scene.fitted_step(scene.closed_step() * value.factor)
    return EngineChoice(choice.engine, {**choice.overrides, DT: f"{fitted:.12g}"}, given=own)


def _known(choice: EngineChoice, given: Mapping[str, str]) -> dict[str, str]:
    """The settings that come with a scene and that the engine has."""
    fields = registry.engine(choice.engine).settings_type.model_fields
    return {key: text for key, text in given.items() if key in fields}
