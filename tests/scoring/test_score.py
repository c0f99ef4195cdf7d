"""Errors by kind, ranges and verdicts."""

import math

import pytest

from dembench.cases.base import Quantity, Reference
from dembench.scoring.score import by_kind, compare, verdict


def quantity(value):
    return Quantity("depth", "Depth", value, "m")


def reference(value=-2.0, low=-2.5, high=-1.5, kind="publication", necessary=False):
    return Reference("depth", value, low, high, "m", "somewhere", kind, necessary)


@pytest.mark.parametrize(
    "value,within", [(-2.5, True), (-1.5, True), (-2.500001, False), (-1.4, False), (math.nan, False)]
)
def test_a_range_includes_its_ends(value, within):
    assert compare(quantity(value), reference()).within is within


def test_publications_are_measured_in_half_widths():
    found = compare(quantity(-1.75), reference())
    assert found.error == pytest.approx(0.25) and found.scaled == pytest.approx(0.5)


@pytest.mark.parametrize("kind", ["closed form", "converged run"])
def test_closed_forms_are_measured_relative_to_the_value(kind):
    found = compare(quantity(-1.9), reference(kind=kind))
    assert found.error == pytest.approx(0.1) and found.scaled == pytest.approx(0.05)


def test_an_unknown_spread_judges_nothing():
    found = compare(quantity(-9.0), reference(low=None, high=None))
    assert found.within is None and found.scaled is None and found.error == pytest.approx(-7.0)
    assert verdict([found]) == "unscored"


@pytest.mark.parametrize("value,error,within", [(-1.0, 0.0, True), (-3.0, 0.5, False), (5.0, 0.0, True)])
def test_a_bound_measures_what_is_beyond_it(value, error, within):
    found = compare(quantity(value), reference(value=None, high=None))
    assert (found.error, found.within, found.scaled) == (pytest.approx(error), within, None)


def test_a_bound_is_not_met_by_a_value_that_is_no_number():
    found = compare(quantity(math.nan), reference(value=None, low=None, high=1.0))
    assert found.within is False and math.isnan(found.error)


def test_verdicts():
    good, bad = compare(quantity(-2.0), reference()), compare(quantity(0.0), reference())
    met = compare(quantity(-2.0), reference(necessary=True))
    missed = compare(quantity(0.0), reference(necessary=True))
    assert verdict([]) == "unscored"
    assert verdict([good]) == verdict([good, met]) == "ok"
    assert verdict([good, bad]) == verdict([good, missed]) == verdict([missed]) == "inaccurate"
    assert verdict([met]) == "unscored"


def test_kinds_are_kept_apart():
    scores = [compare(quantity(-2.0), reference(kind=kind)) for kind in ("publication", "closed form", "publication")]
    assert {kind: len(found) for kind, found in by_kind(scores).items()} == {"publication": 2, "closed form": 1}
