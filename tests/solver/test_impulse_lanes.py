"""Rigid rows in blocks: no body twice in a block, a place for every row, and the answers of rows visited one by one."""

from __future__ import annotations

import numpy as np
import pytest
from grains import RADIUS, crowd, grains

from dembench.scene import Scene
from dembench.solver import Simulation
from dembench.solver.impulse import stepper
from dembench.solver.impulse.row_lanes import BLOCKS
from dembench.solver.lanes import LANES


def pairs(n: int = 50) -> Scene:
    """Pairs of grains far from each other that meet, slide and overlap, each in its own way."""
    random = np.random.default_rng(5)
    first = 10 * RADIUS * np.array([(k % 7, k // 7, 0) for k in range(n)], float)
    towards = random.normal(size=(n, 3))
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    second = first + random.uniform(1.98, 2.02, (n, 1)) * RADIUS * towards
    position, shape = np.stack([first, second], axis=1).reshape(-1, 3), (2 * n, 3)
    velocity, spin = random.normal(scale=0.2, size=shape), random.normal(scale=100, size=shape)
    return grains(position, velocity, spin, gravity=(0, 0, -9.81))


def places(simulation: Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Rows in blocks, shape (blocks, LANES), and those outside."""
    of = simulation._stepper
    assert isinstance(of, stepper.Impulses)
    order, (blocks, rest) = of._rows.order.numpy(), of._flags.numpy()[BLOCKS:]
    room = len(order) - len(of._rows.i)
    return order[: blocks * LANES].reshape(-1, LANES), order[room : room + rest]


@pytest.mark.parametrize("room", [stepper.ROOM, 0.1])
def test_every_row_has_one_place_and_no_body_is_twice_in_a_block(monkeypatch: pytest.MonkeyPatch, room: float) -> None:
    monkeypatch.setattr(stepper, "ROOM", room)
    simulation = Simulation(crowd(), 2e-5, method="impulse", rows="rigid")
    simulation.step(20)
    blocks, rest = places(simulation)
    rows = simulation._stepper._rows
    i, j, nil = rows.i.numpy(), rows.j.numpy(), len(rows.i) - 1
    for block in blocks:
        used = block[block != nil]
        bodies = np.concatenate([i[used], j[used]])
        assert len(bodies) == len(set(bodies))
    found = [*blocks[blocks != nil], *rest]
    assert sorted(found) == list(range(int(simulation.counters()["rows"])))
    if room > 1:
        assert (blocks != nil).mean() > 0.8
        assert (j[rest] >= len(simulation.position) - 1).all(), "only rows of the ball and of walls stand outside"


def test_a_lane_without_a_row_does_nothing() -> None:
    simulation = Simulation(crowd(), 2e-5, method="impulse", rows="rigid")
    simulation.step(20)
    rows = simulation._stepper._rows
    for values in (rows.a, rows.b, rows.u, rows.shift, rows.apart, rows.push):
        assert not values.numpy()[-1].any()


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
        blocks, rest = places(simulation)
        assert (len(rest) == 0) == (room > 0) and (len(blocks) > 0) == (room > 0)
    one, other = found
    assert one.counters()["rows"] == other.counters()["rows"] > 10
    for values in ("position", "velocity", "angular_velocity"):
        a, b = getattr(one, values), getattr(other, values)
        assert np.abs(a - b).max() <= tolerance * np.abs(a).max(), values
