"""What counts as a change of a quantity: its own margin, the band of a closed form, or a share of the value."""

from __future__ import annotations

import pytest

from dembench.cases.base import Quantity, Reference
from dembench.regression.metrics import QUANTITY, SHARE_OF_CHECK
from dembench.regression.quantities import margin_of
from dembench.scoring.ensembles import Margin


def reference(kind: str = "closed form", **fields: float | None) -> Reference:
    """A reference of the fall; without a value and a range unless said otherwise."""
    return Reference("fall", *(fields.get(name) for name in ("value", "low", "high")), "m", "test", kind)  # type: ignore[arg-type]


def test_what_can_be_zero_has_a_margin_of_its_own() -> None:
    found = margin_of(Quantity("fall", "Fall", 0.0, "m", margin=1e-3), [reference(value=1.0, low=0.9, high=1.1)])
    assert found == Margin(1e-3, relative=False)


def test_the_band_of_a_closed_form_gives_the_margin_and_others_do_not() -> None:
    fall = Quantity("fall", "Fall", -0.1, "m")
    found = margin_of(fall, [reference(value=-0.1, low=-0.1001, high=-0.0999)])
    assert found.of(fall.value) == pytest.approx(SHARE_OF_CHECK * 1e-4) and not found.relative
    assert margin_of(fall, [reference("ensemble", value=-0.1, low=-0.2, high=0.0)]) == QUANTITY


def test_a_safety_bound_far_away_says_nothing_about_changes() -> None:
    """Farther from a bound on one side is neither better nor a scale."""
    gap = Quantity("fall", "Gap", 8e-3, "m")
    assert margin_of(gap, [reference(low=-1e-4)]) == QUANTITY and gap.worse == "either"
