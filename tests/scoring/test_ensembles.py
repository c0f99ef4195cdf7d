"""Statements about ensembles: planted differences are found, none is found where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from dembench.scoring.ensembles import (
    MARGINS,
    Ensemble,
    Margin,
    bias,
    bootstrap_interval,
    distance,
    equivalent,
    pointwise,
)

TIME = np.linspace(0, 5, 51)
TRIALS = 300


def curves(rng: np.random.Generator, seeds: int, offset: float = 0.0, spread: float = 1.0) -> Ensemble:
    """Decaying curves, each seed off by a number of its own."""
    return Ensemble(100 * np.exp(-TIME) + offset + spread * rng.standard_normal((seeds, 1)))


def test_spreads_are_those_of_numpy():
    """Mean, deviation with k - 1 and standard error over the seeds; one seed has no deviation."""
    sample = Ensemble([1.0, 2.0, 4.0])
    assert (sample.mean, sample.deviation) == pytest.approx((7 / 3, np.std([1, 2, 4], ddof=1)))
    assert sample.error == pytest.approx(sample.deviation / np.sqrt(3))
    assert np.isnan(Ensemble([1.0]).deviation) and len(Ensemble([1.0])) == 1
    with pytest.raises(ValueError, match="at least one"):
        Ensemble([])


def test_the_distance_of_equal_ensembles_stays_within_its_limit():
    """D of two ensembles of one law is below 2 sqrt(1/5 + 1/10) = 1.1 in 90 % of cases.

    With k = 5 and 10 seeds off as a whole, D is |t| sqrt(1/5 + 1/10) with t of Student's kind but for the variance of
    the reference alone, 9 degrees of freedom: P(|t| > 2) = 0.077. Of 300 trials 23 +- 5 are beyond it.
    """
    rng = np.random.default_rng(1)
    found = [distance(curves(rng, 5), curves(rng, 10), TIME) for _ in range(TRIALS)]
    assert found[0].limit == pytest.approx(1.0954, abs=1e-4)
    assert 8 <= sum(not d.indistinguishable for d in found) <= 38


def test_a_planted_distance_is_found_in_units_of_the_spread():
    """Seeds at -1, 0 and 1 about a curve have the deviation 1; a test 3 above the mean has D = 3, 3 % of the range."""
    base = 100 * TIME / TIME[-1]
    found = distance(Ensemble([base + 3]), Ensemble([base - 1, base, base + 1]), TIME)
    assert found.value == pytest.approx(3.0)
    assert found.physical == pytest.approx(0.03)
    assert found.limit == pytest.approx(2 * np.sqrt(1 + 1 / 3))
    assert not found.indistinguishable
    with pytest.raises(ValueError, match="two or more"):
        distance(Ensemble([base]), Ensemble([base]))


def test_seeds_that_do_not_scatter_yet_do_not_make_rounding_a_distance():
    """All seeds fall freely: curves that differ by 1e-13 of their range are not thousands of spreads apart.

    One that is off by 1e-6 is.
    """
    base = -4.9 * TIME**2
    reference = Ensemble([base, base * (1 + 1e-16), base])
    assert distance(Ensemble([base * (1 + 1e-13)]), reference).value < 1e-3
    assert distance(Ensemble([base * (1 + 1e-6)]), reference).value > 100


def test_time_weighs_the_parts_of_a_curve():
    """A difference that lasts for the first of ten seconds counts by its time, not by its many samples."""
    time = np.concatenate([np.linspace(0, 1, 1001), np.linspace(2, 10, 9)])
    base = np.zeros_like(time)
    test = np.where(time <= 1, 1.0, 0.0)
    found = distance(Ensemble([test]), Ensemble([base - 1, base + 1]), time)
    # L2 of the step: one second of 1 and half of the trapezoid to the next sample, over ten seconds; deviation sqrt(2)
    assert found.value == pytest.approx(np.sqrt((1 + 0.5) / 10 / 2), rel=1e-3)


def test_the_pointwise_form_finds_a_part_of_a_curve_that_is_off():
    """Ten of 51 samples are five deviations off: 80 % are near, which does not pass; without them all are."""
    rng = np.random.default_rng(3)
    reference = Ensemble(100 * TIME + rng.standard_normal((10, 51)))
    test = reference.values[:5] + np.where(np.arange(51) < 10, 8.0, 0.0)
    found = pointwise(Ensemble(test), reference)
    assert found.near == pytest.approx(41 / 51)
    assert not found.passes(0.05)
    assert pointwise(Ensemble(reference.values[:5]), reference).passes(0.05)


def test_where_nothing_scatters_equal_points_are_near_and_others_are_not():
    """All start alike: z = 0 where both do, infinite where one does not."""
    flat = np.tile([5.0, 4.0, 3.0], (3, 1))
    found = pointwise(Ensemble(flat + np.array([0, 0, 0.1])), Ensemble(flat))
    np.testing.assert_array_equal(found.z, [0, 0, np.inf])


def test_a_bias_has_an_interval_that_holds_the_truth():
    """Means of 1.05 and 1 with deviations of 1 %: in about 95 % of trials the interval holds 5 %.

    Percentile intervals of ten values are too narrow, by (n - 1)/n and the normal quantile: 91 % is what they reach.
    """
    rng = np.random.default_rng(5)
    held = 0
    for _ in range(60):
        found = bias(Ensemble(1.05 + 0.01 * rng.standard_normal(10)), Ensemble(1 + 0.01 * rng.standard_normal(10)))
        assert found.low < found.value < found.high
        held += found.low <= 0.05 <= found.high
    assert held >= 48


def test_a_bootstrap_interval_is_the_same_for_the_same_samples():
    """Nothing is left to chance that could flip a verdict between two looks; one value has no interval."""
    sample = np.random.default_rng(2).standard_normal(8)
    assert bootstrap_interval(np.mean, sample) == bootstrap_interval(np.mean, sample)
    alone = bootstrap_interval(np.mean, [3.0])
    assert alone.value == 3.0 and np.isnan(alone.low) and np.isnan(alone.high)


def test_paired_seeds_cancel_what_they_share():
    """Seeds that scatter by 10 % and a bias of exactly 1 %: the paired interval is that, the other one is wide."""
    values = 1 + 0.1 * np.random.default_rng(4).standard_normal(8)
    paired = bias(Ensemble(1.01 * values), Ensemble(values), paired=True)
    assert (paired.low, paired.high) == pytest.approx((0.01, 0.01))
    alone = bias(Ensemble(1.01 * values), Ensemble(values))
    assert alone.high - alone.low > 0.05


def test_equal_means_are_equivalent_and_those_at_the_margin_are_not():
    """Of means apart by the margin of a rate, 2 %, at most 5 % pass; of equal ones nearly all."""
    rng = np.random.default_rng(7)

    def share(offset: float) -> float:
        made = [
            (1 + offset + 0.005 * rng.standard_normal(5), 1 + 0.005 * rng.standard_normal(10)) for _ in range(TRIALS)
        ]
        words = [equivalent(Ensemble(a), Ensemble(b), MARGINS["rate"]).verdict for a, b in made]
        return words.count("equivalent") / TRIALS

    assert share(0.0) > 0.98
    assert share(0.02) < 0.05 + 3 * np.sqrt(0.05 * 0.95 / TRIALS)


def test_the_verdict_is_different_only_beyond_the_margin():
    """Depths that are 2 mm apart are different, 0.5 mm with much scatter undecided, one seed never decided."""
    depth = MARGINS["depth"]
    reference = Ensemble([0.020, 0.0201, 0.0199, 0.0202])
    assert equivalent(Ensemble([0.0221, 0.0219, 0.0220]), reference, depth).verdict == "different"
    assert equivalent(Ensemble([0.0190, 0.0225, 0.0205]), reference, depth).verdict == "undecided"
    alone = equivalent(Ensemble([0.020]), reference, depth)
    assert alone.verdict == "undecided" and np.isnan(alone.p)


def test_values_without_scatter_are_judged_by_their_difference():
    """Reruns of deterministic codes: the same number is equivalent, one beyond the margin is not."""
    same, other = Ensemble([2.0, 2.0, 2.0]), Ensemble([2.1, 2.1, 2.1])
    assert equivalent(same, same, Margin(0.01)).verdict == "equivalent"
    assert equivalent(other, same, Margin(0.01)).verdict == "different"


def test_paired_equivalence_follows_the_differences():
    """Seeds that scatter by 10 % with differences of 0.1 %: equivalent within 2 % only when paired."""
    rng = np.random.default_rng(11)
    values = 1 + 0.1 * rng.standard_normal(5)
    near = values * (1 + 0.001 * rng.standard_normal(5))
    assert equivalent(Ensemble(near), Ensemble(values), Margin(0.02), paired=True).verdict == "equivalent"
    assert equivalent(Ensemble(near), Ensemble(values), Margin(0.02)).verdict == "undecided"
