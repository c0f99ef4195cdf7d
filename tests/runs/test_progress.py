"""The estimate of the time left."""

from __future__ import annotations

import pytest

from dembench.runs.progress import WINDOW, Progress


def reached(*points: tuple[float, float], duration: float = 10.0) -> Progress:
    """Progress after looks at (wall time, simulated time)."""
    progress = Progress()
    for progress.elapsed, time in points:
        progress.reach(time, duration)
    return progress


def test_at_constant_speed_the_time_left_is_known_after_two_looks():
    """1 s of 10 s in 30 s of wall time: 9 s need 270 s."""
    progress = reached((0, 0), (30, 1))
    assert (progress.time, progress.fraction) == (1, 0.1)
    assert progress.left() == pytest.approx(270)


def test_while_nothing_new_is_seen_it_counts_down():
    assert reached((0, 0), (30, 1), (60, 1)).left() == pytest.approx(240)
    assert reached((0, 0), (30, 1), (1000, 1)).left() == 0


def test_before_two_looks_nothing_is_known():
    assert reached((0, 0)).left() is None
    assert reached((0, 0), (50, 0)).left() is None


def test_reading_and_compiling_do_not_count():
    """The first step is seen at 100 s, after 90 s of preparations in which nothing moves."""
    assert reached((0, 0), (90, 0), (100, 1)).left() == pytest.approx(90)


def test_a_resumed_run_counts_its_own_attempt():
    """From 8 of 10 s on, 1 s of wall time for 0.1 s: the rest takes 19 s, whatever came before."""
    assert reached((0, 8), (1, 8.1)).left() == pytest.approx(19)


def test_the_recent_speed_counts():
    """Ten times slower since two windows: 4 s are left at 0.001 of them per second."""
    fast = [(float(t), 0.01 * t) for t in range(0, 501, 10)]
    slow = [(500.0 + t, 5 + 0.001 * t) for t in range(10, int(2 * WINDOW) + 1, 10)]
    progress = reached(*fast, *slow)
    assert progress.left() == pytest.approx((10 - progress.time) / 0.001, rel=1e-6)
