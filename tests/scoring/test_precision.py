"""What an error costs: fronts, targets, orders and profiles of points that are planted."""

from __future__ import annotations

import numpy as np
import pytest

from dembench.scoring.precision import cheapest, front, order, profiles

STEPS = np.geomspace(1e-3, 1e-6, 10)


def test_the_front_holds_what_no_other_point_beats():
    """Of five points two are beaten in both, one has no error; a tie in time keeps the better one."""
    times = [1.0, 2.0, 2.0, 4.0, 3.0, 0.1]
    errors = [0.10, 0.05, 0.20, 0.01, 0.06, np.nan]
    assert front(times, errors) == [0, 1, 3]


def test_the_cheapest_point_reaches_the_target():
    """A faster point misses the target and one without a time cannot be bought."""
    times, errors = [1.0, 3.0, 2.0, np.nan], [0.5, 0.01, 0.009, 0.0]
    assert cheapest(times, errors, 0.01) == 2
    assert cheapest(times, errors, 1e-4) is None


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_a_planted_order_is_measured_between_coarse_steps_and_the_floor(exponent):
    """Errors C h^p with a floor of 1e-6 and scatter of 5 %: what is too coarse or at the floor does not count."""
    scatter = 1 + 0.05 * np.random.default_rng(0).standard_normal(len(STEPS))
    errors = np.hypot((STEPS / 1e-3) ** exponent * scatter, 1e-6)
    found = order(STEPS, errors)
    assert found is not None
    assert found.slope == pytest.approx(exponent, abs=0.05)
    assert found.low < exponent < found.high
    assert found.points <= 9


def test_an_error_that_does_not_follow_the_step_has_no_order():
    """A constant error, as of another law, and too few points give none."""
    assert order(STEPS, np.full(10, 0.05)) is None
    assert order(STEPS[:2], STEPS[:2]) is None
    assert order(STEPS, np.full(10, np.nan)) is None


def test_rounding_that_grows_with_the_number_of_steps_does_not_hide_the_order():
    """Below 1e-5 s errors grow again: only what lies above the smallest one is used."""
    errors = 1e5 * STEPS**2 + 1e-9 / STEPS
    found = order(STEPS, errors)
    assert found is not None and found.slope == pytest.approx(2.0, abs=0.1)


def test_profiles_count_problems_within_a_factor_of_the_best():
    """One engine is the fastest on two of three problems, the other within a factor of 2 on all that it solves."""
    found = profiles({"a": {"p": 1.0, "q": 1.0, "r": np.inf}, "b": {"p": 2.0, "q": 1.5, "r": 5.0}, "c": {}})
    np.testing.assert_allclose(found["a"].ratio, [1, 1.5, 2])
    np.testing.assert_allclose(found["a"].share, [2 / 3, 2 / 3, 2 / 3])
    np.testing.assert_allclose(found["b"].share, [1 / 3, 2 / 3, 1])
    np.testing.assert_allclose(found["c"].share, [0, 0, 0])


def test_problems_that_nobody_solves_count_for_nobody():
    """Without a solved problem there is no profile."""
    assert profiles({"a": {"p": np.inf}, "b": {}}) == {}
