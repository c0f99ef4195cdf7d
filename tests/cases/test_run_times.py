"""Published run times: which belong to which case, and that every entry says where it comes from."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from dembench.cases.registry import parse_case
from dembench.cases.run_times import published_run_times


@pytest.mark.parametrize(
    ("case", "parameters", "count"),
    [
        ("case1", {"orifice": "large", "material": "M1"}, 7),
        ("case1", {"orifice": "small", "material": "M1"}, 4),
        ("case1", {"orifice": "small", "material": "M2"}, 1),
        ("case2", {}, 5),
        ("case3", {"bed": "25k"}, 6),
        ("case3", {"bed": "50k"}, 1),
        ("case3", {"bed": "100k"}, 5),
    ],
)
def test_entries_hold_for_the_parameters_that_they_name(case: str, parameters: dict[str, str], count: int) -> None:
    found = published_run_times(case, SimpleNamespace(**parameters))
    assert len(found) == count
    for time in found:
        assert 0 < time.low <= time.high and time.hardware and time.source
        assert set(time.marks) <= set("acx")


def test_a_contended_time_is_not_the_clean_one() -> None:
    times = [t for t in published_run_times("case3", SimpleNamespace(bed="25k")) if t.code == "MUSEN 1.75"]
    assert sorted((t.low, t.marks) for t in times) == [(61, ""), (1346, "c")]


def test_a_precision_that_is_not_on_record_is_not_claimed() -> None:
    times = published_run_times("case1", SimpleNamespace(orifice="large", material="M1"))
    assert [(t.low, t.device) for t in times if "TITAN" in t.hardware] == [(1680, "GPU")]


def test_a_preset_of_our_own_has_none() -> None:
    case, parameters = parse_case("case3")
    assert len(case.run_times(parameters, "published")) == 6
    assert case.run_times(parameters, "quick") == []
