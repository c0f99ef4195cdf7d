"""Numbers for people: decimals that line up, true minus signs, units that read easily."""

from __future__ import annotations

import numpy as np
import pytest

from dembench.reports.tables import decimals, grouped, numbers, significant
from dembench.reports.units import measure, shown_in


def test_a_column_has_one_number_of_decimals() -> None:
    texts = [cell.text for cell in numbers([1743.21, 30.254, None, float("nan"), 0.0])]
    assert texts == ["1\u202f743.2", "30.3", "", "", "0.0"]


def test_raw_values_are_kept_for_sorting() -> None:
    assert [cell.value for cell in numbers([1743.218, None])] == [1743.218, None]


def test_decimals_follow_the_smallest_value() -> None:
    assert decimals([123.0, 4.5]) == 2
    assert decimals([0.0012], digits=2) == 4
    assert decimals([], digits=2) == 0


def test_minus_signs_are_minus_signs() -> None:
    assert grouped(-1e-9, 2) == "0.00"
    assert grouped(-1234.5, 1) == "\u22121\u202f234.5"
    assert significant(-0.1384) == "\u22120.1384"
    assert significant(5e-7) == "5e\u22127"
    assert significant(None) == ""


@pytest.mark.parametrize(
    ("unit", "values", "expected"),
    [
        ("m", [-0.1384, 0.0], (1e3, "mm")),
        ("m", [3e-6], (1e6, "µm")),
        ("m", [2.0, 1e-6], (1.0, "m")),
        ("s", [0.06], (1e3, "ms")),
        ("1", [1e-5], (1.0, "")),
        ("m s-1", [1e-5], (1.0, "m/s")),
        ("m", [np.nan], (1.0, "m")),
    ],
)
def test_units_follow_the_largest_value(unit: str, values: list[float], expected: tuple[float, str]) -> None:
    assert shown_in(unit, values) == expected


def test_a_measure_has_its_unit() -> None:
    assert measure(-0.1384, "m") == "\u2212138.4 mm"
    assert measure(5e-7, "s") == "0.5 µs"
