"""Published results of single codes: which variant has which."""

from __future__ import annotations

import pytest

from dembench.cases.base import Preset
from dembench.cases.registry import parse_case


@pytest.mark.parametrize(
    ("case", "preset", "count"),
    [
        ("case1", "published", 8),
        ("case1[orifice=small,material=M2]", "published", 1),
        ("case1[wall_friction=0.4]", "published", 0),
        ("case1", "quick", 0),
        ("case3", "published", 8),
        ("case3[bed=50k]", "published", 0),
    ],
)
def test_a_variant_has_those_that_were_published_for_it(case: str, preset: Preset, count: int) -> None:
    found, parameters = parse_case(case)
    results = found.published_results(parameters, preset)
    assert len(results) == count
    assert all(r.code and r.unit and r.source for r in results)


def test_rates_are_those_of_the_single_codes() -> None:
    found, parameters = parse_case("case1")
    rates = {r.code: r.value for r in found.published_results(parameters, "published") if r.unit == "1/s"}
    assert rates["LIGGGHTS"] == 24504 and rates["peclet impulse"] == 22466
