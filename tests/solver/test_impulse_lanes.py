"""Rigid rows in blocks: no body twice in a block, a place for every row, and the answers of rows visited one by one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from grains import crowd, pairs

from dembench.solver import Simulation
from dembench.solver.impulse import stepper
from dembench.solver.impulse.segments import BLOCKS, END, FLAGS, PER_SEGMENT, REST
from dembench.solver.lanes import LANES


@dataclass
class Segment:
    """Rows of a segment: its first and last one, those in blocks, shape (blocks, LANES), and those outside."""

    first: int
    end: int
    blocks: np.ndarray
    rest: np.ndarray


def segments(simulation: Simulation) -> list[Segment]:
    """The segments of the rows of the last step, the bridge last."""
    of = simulation._stepper
    assert isinstance(of, stepper.Impulses)
    order, flags = of._rows.order.numpy(), of._flags.numpy()[FLAGS:].reshape(-1, PER_SEGMENT)
    base, (at, outside) = of._rows.base.numpy(), of._rows.places.numpy().reshape(-1, 2).T
    return [
        Segment(
            base[s],
            flag[END],
            order[at[s] : at[s] + flag[BLOCKS] * LANES].reshape(-1, LANES),
            order[outside[s] : outside[s] + flag[REST]],
        )
        for s, flag in enumerate(flags)
    ]


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("room", [stepper.ROOM, 0.1])
def test_every_row_has_one_place_and_no_body_is_twice_in_a_block(
    monkeypatch: pytest.MonkeyPatch, room: float, threads: int
) -> None:
    monkeypatch.setattr(stepper, "ROOM", room)
    simulation = Simulation(crowd(), 2e-5, method="impulse", rows="rigid", threads=threads)
    simulation.step(20)
    rows, found = simulation._stepper._rows, segments(simulation)
    i, j, nil = rows.i.numpy(), rows.j.numpy(), len(rows.i) - threads
    ball, ranges = len(simulation.position) - 1, simulation.state.ranges.numpy()
    assert sum(s.end - s.first for s in found) == simulation.counters()["rows"] > 1000
    for number, segment in enumerate(found):
        for block in segment.blocks:
            used = block[block < nil]
            bodies = np.concatenate([i[used], j[used]])
            assert len(bodies) == len(set(bodies))
        in_blocks = segment.blocks[segment.blocks < nil]
        assert sorted([*in_blocks, *segment.rest]) == list(range(segment.first, segment.end))
        outside = j[segment.rest] if number < threads else np.minimum(j[segment.rest], ball)
        if room > 1:
            assert (outside >= ball).all(), "only rows of the ball and of walls stand outside"
        if number < threads:
            inside = np.concatenate([i[in_blocks], j[in_blocks]])
            assert (inside >= ranges[number]).all() and (inside < ranges[number + 1]).all()
            assert not room > 1 or (segment.blocks < nil).mean() > 0.8
        else:
            across = i[in_blocks], j[in_blocks]
            assert (np.searchsorted(ranges, across[0], "right") != np.searchsorted(ranges, across[1], "right")).all()
            assert threads == 1 or len(across[0]) > 50


@pytest.mark.parametrize("threads", [1, 2])
def test_a_lane_without_a_row_does_nothing(threads: int) -> None:
    simulation = Simulation(crowd(), 2e-5, method="impulse", rows="rigid", threads=threads)
    simulation.step(20)
    rows = simulation._stepper._rows
    for values in (rows.a, rows.b, rows.u, rows.shift, rows.apart, rows.push):
        assert not values.numpy()[-threads:].any()


@pytest.mark.parametrize(("precision", "tolerance"), [("float32", 2e-6), ("float64", 1e-13)])
def test_blocks_and_single_rows_give_the_same(
    monkeypatch: pytest.MonkeyPatch, precision: str, tolerance: float
) -> None:
    """Pairs that share no body: the order of visits is of no account, so only the rounding differs."""
    found = []
    for room, window in ((stepper.ROOM, stepper.WINDOW), (0.0, 0)):
        monkeypatch.setattr(stepper, "ROOM", room)
        monkeypatch.setattr(stepper, "WINDOW", window)
        simulation = Simulation(pairs(), 1e-4, method="impulse", rows="rigid", precision=precision)
        simulation.step(3)
        found.append(simulation)
        own = segments(simulation)[0]
        assert (len(own.rest) == 0) == (room > 0) and (len(own.blocks) > 0) == (room > 0)
    one, other = found
    assert one.counters()["rows"] == other.counters()["rows"] > 10
    for values in ("position", "velocity", "angular_velocity"):
        a, b = getattr(one, values), getattr(other, values)
        assert np.abs(a - b).max() <= tolerance * np.abs(a).max(), values
