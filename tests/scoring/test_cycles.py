"""Oscillating curves: planted differences of period, phase, amplitude and decay come out one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dembench.scoring import cycles

TIME = np.linspace(0, 6, 601)


def swing(
    period: float = 1.0, amplitude: float = 10.0, decay: float = 0.1, phase: float = 0.3, noise: float = 0.0
) -> np.ndarray:
    """A damped oscillation about 50."""
    made = amplitude * np.exp(-decay * TIME) * np.cos(2 * np.pi * TIME / period + phase) + 50
    return made + noise * np.random.default_rng(0).standard_normal(len(TIME))


@pytest.mark.parametrize("phase", [-2.5, -0.8, 0.3, 2.9])
def test_a_fit_finds_the_oscillation_that_was_planted(phase):
    """Without noise the least squares come back to the planted numbers, whatever the phase."""
    found = cycles.fit(TIME, swing(period=1.3, decay=0.2, phase=phase))
    assert (found.period, found.amplitude, found.decay, found.offset) == pytest.approx((1.3, 10, 0.2, 50), rel=1e-6)
    assert found.phase == pytest.approx(phase, abs=1e-6)
    assert found.residual < 1e-9


@pytest.mark.parametrize(
    ("planted", "expected"),
    [
        ({}, (0.0, 0.0, 0.0, 0.0)),
        ({"period": 1.02}, (0.02, None, None, 0.0)),
        ({"phase": 0.3 - 0.1 * 2 * np.pi}, (0.0, 0.1, 0.0, 0.0)),
        ({"amplitude": 10.5}, (0.0, 0.0, 0.05, 0.0)),
        ({"decay": 0.3}, (0.0, 0.0, None, 0.2)),
    ],
    ids=["none", "period", "phase", "amplitude", "decay"],
)
def test_each_error_stands_for_itself(planted: dict[str, Any], expected: tuple[float | None, ...]):
    """One number of the curve is changed and the others stay.

    What is bound to change with it is not asked for. The samples lie 0.01 periods apart and turns are found between
    them, the damping shifts all turns alike: errors of 0.005 are those of the method. With another phase the same turn
    comes later, and the swing has decayed by exp(-0.1 * 0.1) = 1 % more.
    """
    found = cycles.compare(TIME, swing(**planted), swing())
    for value, known, tolerance in zip(
        (found.period, found.phase, found.amplitude, found.decay), expected, (1e-3, 5e-3, 1.2e-2, 1e-3), strict=True
    ):
        assert known is None or value == pytest.approx(known, abs=tolerance)


def test_noise_changes_little():
    """2 % noise on every sample: the errors of two equal curves stay below 1 %, 1 %, 5 % and 2 %.

    Peaks of noisy samples are too high by two or three deviations in both curves alike, of which 3 % of a swing remain.
    """
    found = cycles.compare(TIME, swing(noise=0.2), swing())
    assert abs(found.period) < 0.01
    assert abs(found.phase) < 0.01
    assert abs(found.amplitude) < 0.05
    assert abs(found.decay) < 0.02


def test_a_curve_that_does_not_swing_has_no_errors_of_cycles():
    """A discharge falls all the way: there is no period to compare."""
    with pytest.raises(cycles.NoCycles, match="three turns"):
        cycles.compare(TIME, np.exp(-TIME), swing())
