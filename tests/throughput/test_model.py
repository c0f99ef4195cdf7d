"""The model of the time of a step finds the costs that rates were made from and leaves out what they do not tell."""

from __future__ import annotations

import dataclasses

import pytest

from dembench.throughput.model import fitted
from dembench.throughput.rates import Rate

COSTS = {"body": 20e-9, "pair": 15e-9, "beyond": 8e-9, "serial": 5e-9, "step": 4e-6}
CACHE, PER_BODY, BASE = 32e6, 500.0, 1.5e8


def rate(bodies: int, touching: float = 2.0, cores: int = 1, **more: object) -> Rate:
    """A rate by the formula of the model."""
    outside = max(0.0, 1 - CACHE / (PER_BODY * bodies))
    work = COSTS["body"] + COSTS["pair"] * touching + COSTS["beyond"] * outside
    time = work / cores + COSTS["serial"] * (1 - 1 / cores) + COSTS["step"] / bodies
    known = {"bodies": bodies, "touching": touching, "samples": 5, "peak_memory": BASE + PER_BODY * bodies}
    return dataclasses.replace(Rate("bed", "alpha", cores, 1 / time), **{**known, **more})  # type: ignore[arg-type]


SIZES = (1000, 5000, 25_000, 100_000, 1_000_000)


def test_the_costs_that_made_the_rates_are_found() -> None:
    rows = [rate(n, z, p) for n in SIZES for z in (1.0, 2.5) for p in (1, 2)]
    (model,) = fitted(rows, CACHE)
    assert {name: getattr(model, name) for name in COSTS} == pytest.approx(COSTS, rel=1e-6)
    assert set(model.terms) == set(COSTS) and model.deviation < 1e-9
    assert model.memory == pytest.approx((BASE, PER_BODY)) and model.limit(16e9) == pytest.approx(
        (16e9 - BASE) / PER_BODY
    )
    assert model.time(3e5, 2.0, 4) == pytest.approx(
        (20e-9 + 30e-9 + 8e-9 * (1 - CACHE / 1.5e8)) / 4 + 5e-9 * 3 / 4 + 4e-6 / 3e5
    )
    assert model.gain(1e6, 2.0) == pytest.approx(model.time(1e6, 2.0, 1) / 5e-9)


def test_what_the_rates_do_not_tell_is_left_out() -> None:
    """One coordination, one core, no cache known: bodies and pairs are one cost, and no gain of cores is claimed."""
    (model,) = fitted([rate(n) for n in SIZES[:3]], None)
    assert model.terms == ("body", "step") and model.pair == model.beyond == model.serial == 0
    assert model.body == pytest.approx(50e-9) and model.gain(1e6, 2.0) is None


def test_rates_that_do_not_follow_the_model_show_a_deviation() -> None:
    rows = [rate(n) for n in SIZES[:4]]
    rows[1] = dataclasses.replace(rows[1], particle_steps_per_second=0.5 * (rows[1].particle_steps_per_second or 0))
    (model,) = fitted(rows, CACHE)
    assert model.deviation > 0.2


def test_few_rates_and_laws_of_their_own_make_no_model() -> None:
    assert fitted([rate(n) for n in SIZES[:2]], CACHE) == []
    assert fitted([rate(n, law="a law of its own") for n in SIZES], CACHE) == []
    (model,) = fitted([rate(n, settings={"ranks": 1}) for n in SIZES], CACHE)
    assert model.divided
