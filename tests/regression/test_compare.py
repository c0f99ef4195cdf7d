"""Two sets of runs: equivalent within a margin given beforehand, apart, or not decided."""

from __future__ import annotations

import pytest
from making import gathered, metric, speed

from dembench.regression import RegressionError
from dembench.regression.compare import compare, margins
from dembench.regression.metrics import Metric


def word(a: Metric, b: Metric, margin: str) -> str:
    (found,) = compare(gathered(a), gathered(b), margins([f"{a.key.name}={margin}"]))
    return found.word


RATE = (23000.0, 23100.0, 22950.0, 23050.0, 22900.0)


def test_seeds_decide_within_the_margin() -> None:
    """A spread of 80 of 23000 per second over five seeds: half the 90 % interval is 1.86 x 80 sqrt(2/5) = 94, 0.4 %."""
    a = metric("rate", *RATE)
    assert word(a, metric("rate", *(1.002 * r for r in RATE)), "2%") == "indistinguishable"
    assert word(a, metric("rate", *(1.002 * r for r in RATE)), "0.3%") == "undecided"
    assert word(a, metric("rate", *(1.05 * r for r in RATE)), "2%") == "different"


def test_a_direction_or_a_reference_says_which_is_better() -> None:
    low, high = metric("time", 1.0, 1.01, worse="higher"), metric("time", 1.5, 1.51, worse="higher")
    assert word(low, high, "2%") == "worse" and word(high, low, "2%") == "better"
    near, far = metric("rate", 1.0, 1.01, target=1.0), metric("rate", 1.5, 1.51, target=1.0)
    assert word(near, far, "2%") == "worse" and word(far, near, "2%") == "better"


def test_one_seed_decides_only_where_nothing_differs() -> None:
    assert word(metric("rate", 1.0), metric("rate", 1.001), "2%") == "undecided"
    assert word(metric("rate", 1.0), metric("rate", 1.0), "2%") == "indistinguishable"


def test_speeds_are_compared_by_their_smallest_repeats() -> None:
    a = speed([1.0, 1.01, 1.02, 1.3])
    assert word(a, speed([1.3, 1.31, 1.32, 1.6]), "8%") == "worse"
    assert word(a, speed([1.01, 1.02, 1.03, 1.5]), "8%") == "indistinguishable"


def test_two_engines_are_compared_where_each_set_has_one() -> None:
    other = metric("rate", *RATE)
    other = type(other)(other.key._replace(engine="another"), *list(vars(other).values())[1:])
    (found,) = compare(gathered(metric("rate", *RATE)), gathered(other), {})
    assert (found.key.engine, found.word) == ("standin | another", "indistinguishable")


def test_sets_without_anything_in_common_are_refused() -> None:
    with pytest.raises(RegressionError, match="no metric in common"):
        compare(gathered(metric("rate", 1.0)), gathered(metric("depth", 1.0)), {})
    with pytest.raises(RegressionError, match="given twice"):
        margins(["rate=1%", "rate=2%"])
