"""Compares the quantities of a run with their references, and gives the run its verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from dembench.cases.base import Case, Kind, Preset, Quantity, Recorded, Reference
from dembench.scene import Scene

Verdict = Literal["ok", "inaccurate", "unscored"]


@dataclass(frozen=True)
class Score:
    """One quantity of a run beside one of its references.

    Attributes:
        quantity: The quantity.
        reference: The reference, or None where there is none.
        error: Quantity minus reference value in the quantity's unit; for a pure bound the distance beyond it, 0 inside.
            None without a reference.
        scaled: The error by the measure of its kind: relative to the value for closed forms and converged runs, in half
            widths of the accepted range for publications and ensembles. None where there is no such measure.
        within: Whether the quantity lies in the accepted range; None where no range is known.
    """

    quantity: Quantity
    reference: Reference | None
    error: float | None
    scaled: float | None
    within: bool | None


def score(case: Case, scene: Scene, result: Recorded, parameters: Any, preset: Preset) -> list[Score]:
    """Every quantity of a result with each of its references, or with none.

    Args:
        case: The case of the run.
        scene: Its scene, cut where the run was cut.
        result: Its result.
        parameters: The case's parameters.
        preset: The preset of the run.
    """
    references = case.references(scene, parameters, preset)
    scores = []
    for quantity in case.quantities(scene, result):
        own = [r for r in references if r.quantity == quantity.name]
        scores += [compare(quantity, r) for r in own] or [Score(quantity, None, None, None, None)]
    return scores


def compare(quantity: Quantity, reference: Reference) -> Score:
    """The score of a quantity against one reference; a value that is no number is within no range."""
    x, low, high = quantity.value, reference.low, reference.high
    within = None if low is None and high is None else (low is None or x >= low) and (high is None or x <= high)
    if reference.value is not None:
        error = x - reference.value
    else:
        below = low - x if low is not None else 0.0
        above = x - high if high is not None else 0.0
        error = max(below, above, 0.0) if not math.isnan(x) else x
    return Score(quantity, reference, error, _scaled(error, reference), within)


def _scaled(error: float, reference: Reference) -> float | None:
    if reference.value is None:
        return None
    if reference.kind in ("closed form", "converged run"):
        return error / abs(reference.value) if reference.value else None
    if reference.low is None or reference.high is None:
        return None
    return error / (0.5 * (reference.high - reference.low))


def verdict(scores: Iterable[Score]) -> Verdict:
    """`inaccurate` where a quantity is outside its range, `ok` where one is inside, else `unscored`.

    Necessary conditions can only make a run inaccurate: meeting them says nothing about what the case is for.
    """
    judged = [s for s in scores if s.within is not None and s.reference is not None]
    if not all(s.within for s in judged):
        return "inaccurate"
    return "ok" if any(s.reference is not None and not s.reference.necessary for s in judged) else "unscored"


def by_kind(scores: Sequence[Score]) -> dict[Kind, list[Score]]:
    """The scores with a reference, apart by its kind: errors of different kinds never share an axis."""
    found: dict[Kind, list[Score]] = {}
    for s in scores:
        if s.reference is not None:
            found.setdefault(s.reference.kind, []).append(s)
    return found
