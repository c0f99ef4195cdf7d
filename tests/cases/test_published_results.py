"""Published results of single codes: which variant has which."""

from __future__ import annotations

import pytest

from dembench.cases.base import Preset
from dembench.cases.published_results import PublishedResult
from dembench.cases.registry import parse_case


@pytest.mark.parametrize(
    ("case", "preset", "count"),
    [
        ("case1", "published", 31),
        ("case1[orifice=small,material=M2]", "published", 1),
        ("case1[wall_friction=0.4]", "published", 0),
        ("case1", "quick", 0),
        ("case2", "published", 61),
        ("case2", "quick", 0),
        ("case2[pairs=global]", "published", 0),
        ("case3", "published", 37),
        ("case3[bed=50k]", "published", 1),
        ("case3[bed=100k]", "published", 12),
    ],
)
def test_a_variant_has_those_that_were_published_for_it(case: str, preset: Preset, count: int) -> None:
    found, parameters = parse_case(case)
    results = found.published_results(parameters, preset)
    assert len(results) == count
    assert all(r.code and r.unit and r.source for r in results)


def recorded(case: str, quantity: str) -> dict[str, PublishedResult]:
    """Results of one quantity by code; the quantity by the beginning of its title."""
    found, parameters = parse_case(case)
    return {r.code: r for r in found.published_results(parameters, "published") if r.quantity.startswith(quantity)}


def test_rates_are_those_of_the_single_codes() -> None:
    rates = recorded("case1", "Discharge rate, fit")
    assert rates["LIGGGHTS"].value == 24504 and rates["peclet impulse"].value == 22466


@pytest.mark.parametrize("material", ["M1", "M2"])
def test_ratios_are_those_of_the_rates(material: str) -> None:
    large, small = (
        recorded(f"case1[orifice={orifice},material={material}]", "Discharge rate, fit")
        for orifice in ("large", "small")
    )
    ratios = recorded(f"case1[material={material}]", "Discharge rate over")
    assert set(ratios) == set(small)
    for code, ratio in ratios.items():
        assert ratio.value == pytest.approx(large[code].value / small[code].value, abs=0.0051)


def test_the_silo_empties_in_order() -> None:
    times = [recorded("case1", f"Time until {what}") for what in ("2 %", "500", "the silo")]
    for code in ("LIGGGHTS", "peclet Hertz", "peclet impulse"):
        left = [t[code].value for t in times]
        assert left == sorted(left) and 4 < left[0] < left[-1] < 5


def test_periods_and_decays_of_the_drum_are_those_of_its_peaks() -> None:
    """All were rounded: times to 1 ms, counts to 1, decays to 0.001."""
    for before, after in (("First", "Second"), ("Second", "Third")):
        nth, later = before.lower(), after.lower()
        periods = recorded("case2", f"Time from {nth} to {later} peak")
        decays = recorded("case2", f"{after} peak over the {nth}")
        assert len(periods) == len(decays) == 4
        for code, period in periods.items():
            start, end = (recorded("case2", f"Time of the {n} peak")[code].value for n in (nth, later))
            assert period.value == pytest.approx(end - start, abs=0.0016)
            low, high = (recorded("case2", f"{n} peak of M1 in zone 2")[code].value for n in (before, after))
            assert decays[code].value == pytest.approx(high / low, abs=0.00051)


def test_ranges_and_deviations_stay_what_they_are() -> None:
    ends = recorded("case3", "Displacement at the end")
    assert (ends["seven codes"].value, ends["seven codes"].deviation) == (-0.0492, 0.0098)
    assert (ends["seven codes, single runs"].value, ends["seven codes, single runs"].high) == (-0.0758, -0.0313)
    assert ends["peclet impulse, published file"].value == -0.1402
    fine = recorded("case3", "Deepest point of the ball, between")
    assert (fine["LIGGGHTS"].value, fine["LIGGGHTS"].deviation) == (-0.13885, 0.00003)
    assert recorded("case3[bed=100k]", "Displacement at the end")["peclet Hertz"].value == -0.0973
    slip = recorded("case2", "Slip at the wall")
    assert {code: (r.value, r.high) for code, r in slip.items()} == {
        "peclet Hertz": (0.06, 0.15),
        "peclet impulse": (0.02, 0.04),
    }
