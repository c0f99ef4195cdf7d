"""Measures on recorded series."""

import numpy as np
import pytest

from dembench.cases.quantities import crossings, lowest, sample_at

TIME = np.arange(6) * 1e-3


def test_values_between_samples_are_linear():
    value = np.array([0.0, -1.0, -4.0, -9.0, -16.0, -25.0])
    assert sample_at(TIME, value, 2e-3) == -4.0
    assert sample_at(TIME, value, 2.5e-3) == pytest.approx(-6.5)
    assert sample_at(TIME, value, TIME[-1]) == -25.0


@pytest.mark.parametrize("when", [-1e-3, 5.1e-3])
def test_nothing_is_known_beyond_the_record(when):
    assert sample_at(TIME, np.zeros(6), when) is None
    assert sample_at(np.empty(0), np.empty(0), 0.0) is None


def test_lowest_of_a_rebound():
    assert lowest(TIME, np.array([0, -3, -5, -6, -5.5, -5])) == (3e-3, -6)


def test_a_record_that_ends_in_the_fall_has_no_lowest_point():
    assert lowest(TIME, np.array([0, -3, -5, -6, -6.5, -6.6])) is None
    assert lowest(TIME[:1], np.zeros(1)) is None
    assert lowest(np.empty(0), np.empty(0)) is None


def test_a_record_that_ends_at_rest_has_its_lowest_point_at_the_end():
    assert lowest(TIME, np.array([0, -3, -5, -6, -6.01, -6.02])) == (5e-3, -6.02)


def test_crossings_of_zero_are_linear_between_samples():
    assert crossings(TIME, np.array([1.0, -1.0, -2.0, 2.0, 0.0, -1.0])) == pytest.approx([0.5e-3, 2.5e-3, 4e-3])
