"""Blocks of compliant rows: no body twice in a block, every near pair in one row, and few lanes without a row."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import warp as wp
from grains import crowd

from dembench.solver import Simulation
from dembench.solver.impulse.compliant_stepper import CompliantImpulses
from dembench.solver.lanes import LANES
from dembench.solver.workspace import Workspace


@pytest.mark.parametrize("threads", [1, 2])
def test_rows_of_a_block_share_no_body_and_every_near_pair_has_one(threads: int) -> None:
    simulation = Simulation(crowd(young=1e7), 2e-5, method="impulse", rows="compliant", threads=threads)
    simulation.step(20)
    stepper = simulation._stepper
    assert isinstance(stepper, CompliantImpulses)
    state, rows = stepper.state, stepper._rows
    i, j, slot = (a.numpy().reshape(-1, LANES) for a in (rows.i, rows.j, rows.slot))
    expected = {
        (region, int(k))
        for region, count in enumerate(state.near_count.numpy()[: 2 * threads])
        for k in state.lists.near.numpy()[state.base.numpy()[region] :][:count]
    }
    found, filled, blocks = [], 0, 0
    for part, segment in enumerate(stepper._segments()):
        for block in range(segment.begin, segment.end):
            used = slot[block] >= 0
            bodies = np.concatenate([i[block][used], j[block][used]])
            moving = bodies[bodies < state.total]
            assert len(moving) == len(set(moving))
            assert (i[block][~used] >= state.total).all() and (j[block][~used] >= state.total).all()
            if block < segment.other:
                pairs = slot[block][used]
                assert (state.lists.i.numpy()[pairs] == i[block][used]).all()
                assert (state.lists.j.numpy()[pairs] == j[block][used]).all()
                found += [int(k) for k in pairs]
                filled, blocks = filled + used.sum(), blocks + 1
        if not segment.own:
            bigs = segment.end - segment.other
            assert bigs == (slot[segment.other : segment.end] >= 0).sum() == state.near_count.numpy()[2 * threads] > 0
        else:
            walls = (slot[segment.other : segment.end] >= 0).sum()
            assert walls == state.wall_count.numpy()[part] > 0
    assert sorted(found) == sorted(k for _, k in expected)
    assert filled / (blocks * LANES) > 0.9


def test_constants_that_all_pairs_share_stand_once() -> None:
    """Rows with constants of their own give the same bits and contacts; at walls and at the ball both have them."""
    shared, own = (Simulation(crowd(young=1e7), 2e-5, method="impulse", force=force) for force in ((), ("pair_table",)))
    for simulation in (shared, own):
        simulation.step(20)
    assert np.array_equal(shared.position, own.position)
    assert np.array_equal(shared.angular_velocity, own.angular_velocity)
    ours, theirs = shared.contacts(), own.contacts()
    assert ours.energy.sum() > 0
    assert np.array_equal(ours.energy, theirs.energy)
    rows = [simulation._stepper._rows for simulation in (shared, own)]
    assert len(rows[0].slot) == len(rows[1].slot)
    assert 2 * len(rows[0].c) < len(rows[1].c)


@pytest.mark.parametrize("threads", [1, 2])
def test_what_the_memory_of_rows_held_before_changes_nothing(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not a number in all of it, at every rebuild: lanes without an open row stay so."""
    ends = []
    arrays = Workspace.arrays

    def spoilt(self: Workspace, *wanted: tuple[int, Any]) -> list[wp.array]:
        arrays(self, *wanted)
        self._held[0].fill_(255)
        return arrays(self, *wanted)

    for kind in (arrays, spoilt):
        monkeypatch.setattr(Workspace, "arrays", kind)
        simulation = Simulation(crowd(young=1e7), 2e-5, method="impulse", rows="compliant", threads=threads)
        simulation.step(60)
        assert simulation.counters()["list rebuilds"] > 2
        ends.append((simulation.position, simulation.velocity, simulation.angular_velocity))
    for one, other in zip(*ends, strict=True):
        assert np.array_equal(one, other)
