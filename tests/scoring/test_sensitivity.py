"""An answer to a parameter is told from the scatter of seeds, and from nothing at all."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import tukey_hsd

from dembench.scoring.sensitivity import CONFIDENCE, response

ANY = 1e-9
"""A share so small that the scatter alone decides."""


def _noise(rng: np.random.Generator, values: int = 5, seeds: int = 3) -> np.ndarray:
    return 100 + rng.normal(size=(values, seeds))


def test_seeds_alone_are_taken_for_an_answer_as_seldom_as_the_confidence_says() -> None:
    """Of 4000 curves without an effect 40 should pass for one, with a standard deviation of 6.3: 15 to 65 are four."""
    rng = np.random.default_rng(1)
    found = [response(list(_noise(rng)), ANY) for _ in range(4000)]
    passed = sum(not one.flat for one in found if one is not None)
    assert CONFIDENCE == 0.99 and 15 <= passed <= 65


@pytest.mark.parametrize("effect", [0.0, 2.0, 6.0, 12.0])
def test_the_verdict_is_that_of_tukeys_test(effect: float) -> None:
    """With as many seeds per value the test of the extreme pair in SciPy has p < 0.01 where the curve is not flat."""
    for seed in range(5):
        samples = _noise(np.random.default_rng(seed)) + effect * np.linspace(0, 1, 5)[:, None]
        found = response(list(samples), ANY)
        assert found is not None
        assert found.flat == (tukey_hsd(*samples).pvalue.min() > 1 - CONFIDENCE)


def test_a_large_effect_is_found_and_its_size_is_the_range_of_the_means() -> None:
    found = response([[10.0, 10.2], [12.0, 12.2], [11.0, 11.2]], 0.02)
    assert found is not None and not found.flat
    assert found.change == pytest.approx(2.0)
    assert found.least == pytest.approx(0.02 * 12.1)


def test_a_dead_parameter_is_flat_although_its_seeds_differ_from_each_other() -> None:
    """The same seeds give the same numbers: no range exceeds none only because nothing scatters."""
    assert response([[10.0, 10.5]] * 4, 0.02).flat
    assert response([[10.0]] * 4, 0.02).flat
    assert response([[10.0], [10.0 + 1e-12], [10.0]], 0.02).flat
    assert response([[0.0], [0.0]], 0.02).flat


def test_with_one_seed_the_least_change_decides() -> None:
    assert response([[100.0], [101.9]], 0.02).flat
    assert not response([[100.0], [103.0]], 0.02).flat


def test_too_little_is_no_response() -> None:
    assert response([[1.0, 2.0], []], 0.02) is None
    assert response([[1.0], [float("nan")]], 0.02) is None
    assert response([[1.0], [], [3.0]], 0.02) is not None
