"""Errors of closed forms and of paths, against effects that are planted."""

from __future__ import annotations

import numpy as np
import pytest

from dembench.scoring import errors

TIME = np.linspace(0, 1, 101)


def test_a_relative_error_is_measured_on_the_scale_that_was_fixed():
    """1.02 for 1 on a scale of 2 is an error of 1 %; the value may be 0, where an error relative to itself is none."""
    assert errors.relative(1.02, 1.0, 2.0) == pytest.approx(0.01)
    assert errors.relative(0.001, 0.0, 0.1) == pytest.approx(0.01)
    assert np.isnan(errors.relative(np.nan, 1.0, 1.0))
    with pytest.raises(ValueError, match="positive"):
        errors.relative(1.0, 0.0, 0.0)


def test_the_horizon_is_where_two_runs_have_diverged():
    """A distance of 1e-12 d exp(t/0.04) reaches 1e-2 d at 0.04 ln(1e10) = 0.921 s, so at the sample 0.93 s."""
    one = np.zeros((len(TIME), 2, 3))
    other = one.copy()
    other[:, 1, 0] = 0.002 * 1e-12 * np.exp(TIME / 0.04)
    assert errors.horizon(TIME, one, other, 0.002) == pytest.approx(0.93)
    assert errors.horizon(TIME, one, one, 0.002) == np.inf


def test_paths_are_compared_up_to_the_horizon_only():
    """A body of two is off by 0.1 d throughout and by 10 d after the horizon: the error is 0.1/sqrt(2) d."""
    reference = np.zeros((len(TIME), 2, 3))
    position = reference.copy()
    position[:, 0, 2] = 0.1 * 0.004
    position[TIME > 0.5, 0, 2] = 10 * 0.004
    found = errors.trajectory(TIME, position, reference, np.array([0.004, 0.002]), until=0.5)
    assert found.rms == pytest.approx(0.1 / np.sqrt(2))
    assert found.largest == pytest.approx(0.1)
    assert found.until == pytest.approx(0.5)


def test_bodies_that_have_left_are_left_out_of_the_error():
    """A body that is not a number in one of the runs adds nothing; shapes that differ are refused."""
    reference = np.zeros((3, 2, 3))
    position = reference + np.array([0.003, 0, 0])
    position[1:, 1] = np.nan
    assert errors.trajectory(TIME[:3], position, reference, 0.001).rms == pytest.approx(3.0)
    with pytest.raises(ValueError, match="shapes"):
        errors.trajectory(TIME[:3], position[:2], reference, 0.001)


def test_the_second_run_of_a_pair_starts_one_billionth_of_a_thousandth_of_a_diameter_off(small_scene):
    """Every body has moved by 1e-12 of its own diameter, neighbours to opposite sides, and nothing else is changed."""
    scene = small_scene()
    moved = errors.shifted(scene)
    offset = moved.bodies.position - scene.bodies.position
    # positions of 0.1 m resolve 1.4e-17 m, a hundredth of the smallest shift
    np.testing.assert_allclose(offset[:, 0] / (2 * scene.radii()), [1e-12, -1e-12, 1e-12, -1e-12], rtol=0.02)
    assert not offset[:, 1:].any()
    np.testing.assert_array_equal(moved.bodies.velocity, scene.bodies.velocity)
    assert moved.digest() != scene.digest()
