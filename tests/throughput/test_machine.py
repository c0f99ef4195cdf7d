"""The limits of the machine and the roofline that they make."""

from __future__ import annotations

import math

import pytest

from dembench.throughput import machine
from dembench.throughput.machine import Machine, Work, least_work


def test_the_roof_is_the_lower_of_both_limits() -> None:
    """10 GB/s and 20 GFlop/s meet at 2 operations per byte."""
    limits = Machine(1, 1e10, 4e10, 2e10, 1.0)
    assert limits.attainable(Work(flops=100, moved=200)) == 1e10 / 200
    assert limits.attainable(Work(flops=100, moved=10)) == 2e10 / 100
    assert limits.attainable(Work(flops=100, moved=50)) == pytest.approx(2e8)


def test_each_contact_adds_its_operations_and_bytes() -> None:
    """A lone body reads and writes nine numbers; a contact its shear spring, and two indices."""
    alone, packed = least_work(0.0), least_work(2.5)
    assert (alone.flops, alone.moved) == (21, 144)
    assert packed.flops - alone.flops == pytest.approx(2.5 * 129)
    assert packed.moved - alone.moved == pytest.approx(2.5 * 56)
    assert packed.intensity == pytest.approx(343.5 / 284)


def test_limits_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """By real work on small arrays: what comes out are rates."""
    monkeypatch.setattr(machine, "COPIED", 1 << 18)
    monkeypatch.setattr(machine, "MATRIX", 64)
    monkeypatch.setattr(machine, "WHILE", 0.0)
    found = machine._measure(2)
    assert found.cores == 2
    assert all(math.isfinite(v) and v > 0 for v in (found.bandwidth, found.single, found.double))
