"""Memory that is handed on: arrays side by side, the same memory for the next ones, more where they need it."""

from __future__ import annotations

import numpy as np
import warp as wp

from dembench.solver.workspace import ALIGNED, Workspace


def test_arrays_stand_side_by_side_and_the_next_ones_take_their_place() -> None:
    workspace = Workspace()
    first, second, none = workspace.arrays((5, wp.int32), (3, wp.vec4), (0, wp.float64))
    first.numpy()[:], second.numpy()[:] = 1, 2.0
    assert (first.numpy() == 1).all()
    assert second.shape == (3,)
    assert none.shape == (0,)
    assert first.ptr % ALIGNED == second.ptr % ALIGNED == 0
    [other] = workspace.arrays((2, wp.float64))
    assert other.ptr == first.ptr


def test_it_grows_where_more_is_asked_for() -> None:
    workspace = Workspace()
    workspace.arrays((5, wp.int32))
    large, larger = workspace.arrays((1000, wp.int32), (2000, wp.float64))
    large.numpy()[:], larger.numpy()[:] = np.arange(1000), 0.0
    assert (large.numpy() == np.arange(1000)).all()
