"""A Jacobi sweep over the rows of compliant contacts on full lists; what a row does: see `full_impulse_rows.py`."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.full_impulse_loops import STALE, SWEEPS, H
from dembench.solver.full_impulse_rows import SHUT, WALL, full_rows_type, row_functions
from dembench.solver.full_lists import full_lists_type
from dembench.solver.impulse.compliant_rows import CompliantOptions
from dembench.solver.types import types


@cache
def visit_function(o: CompliantOptions) -> Any:
    """A Warp function visit(bodies, rows, i, at, here, h) that solves a row of body i.

    It reads the changes of velocity that begin at `here`.
    """
    t = types(o.law.precision)
    real, vec3, vec8, Bodies = t.real, t.vec3, t.vec8, t.Bodies
    FullRows = full_rows_type(o.law.precision)
    of_row = row_functions(o)
    solve, given, inertia = of_row.solve, of_row.given, of_row.inertia

    @wp.func
    def visit(b: Bodies, rows: FullRows, i: int, at: int, here: int, h: real):
        """Solves a row of body i: what it changes of it, its impulse on the first body, the spring, whether they touch.

        The change of the impulse (3) and its size (7) stand where the change of velocity has no numbers.
        """
        j = rows.j[at] + 0
        ui, uj = rows.u[here + i] * real(1.0), vec8()
        pi, pj = rows.parts[i] + real(0.0), real(0.0)
        arm, sign = rows.a[at][7], real(1.0)
        if j != WALL:
            uj = rows.u[here + j] * real(1.0)
            pj = rows.parts[j] + real(0.0)
            if j < i:
                ui, uj = uj, ui
                pi, pj = pj, pi
                arm, sign = rows.b[at][3], real(-1.0)
        p, change, xi, touches = solve(rows, at, ui, uj, pi, pj, h)
        a = rows.a[at] * real(1.0)
        turn = wp.cross(vec3(a[0], a[1], a[2]), change)
        gained = given(b.inv_m[i], inertia(b, i), sign * change, turn, arm)
        gained[3] = wp.length(change)
        gained[7] = wp.length(p)
        return gained, p, xi, touches

    return visit


@cache
def sweep_kernels(o: CompliantOptions) -> Any:
    """Kernels `sweep`, of small bodies, and `sweep_big`, of large ones.

    changed[0] is set where a sweep has changed the impulses on a body by more than `residual` of their sum.
    """
    t = types(o.law.precision)
    real, vec8, Bodies = t.real, t.vec8, t.Bodies
    FullLists, FullRows = full_lists_type(o.law.precision), full_rows_type(o.law.precision)
    visit = visit_function(o)

    @wp.func
    def settle(
        rows: FullRows,
        i: int,
        here: int,
        there: int,
        residual: real,
        gained: vec8,
        changed: wp.array(dtype=wp.int32),
    ):
        """A body's change of velocity after a sweep."""
        u = rows.u[here + i] * real(1.0)
        shares = vec8(real(0.0), real(0.0), real(0.0), gained[3], real(0.0), real(0.0), real(0.0), gained[7])
        rows.u[there + i] = u + gained - shares
        if gained[3] > residual * gained[7]:
            changed[0] = 1

    @wp.kernel(enable_backward=False, module="unique")
    def sweep(
        # inputs
        total: int,
        residual: real,
        b: Bodies,
        control: wp.array(dtype=wp.int32),
        clock: wp.array(dtype=wp.float64),
        # outputs
        rows: FullRows,
        changed: wp.array(dtype=wp.int32),
    ):
        """Solves the rows of the small bodies."""
        i = wp.tid()
        if control[STALE] != 0:
            return
        h = real(clock[H])
        here = control[SWEEPS] % 2 * total
        sum = vec8()
        for k in range(rows.count[i]):
            gained, _p, _xi, _touches = visit(b, rows, i, k * total + i, here, h)
            sum = sum + gained
        settle(rows, i, here, total - here, residual, sum, changed)

    @wp.kernel(enable_backward=False, module="unique")
    def sweep_big(
        # inputs
        n: int,
        total: int,
        behind: int,
        residual: real,
        b: Bodies,
        lists: FullLists,
        control: wp.array(dtype=wp.int32),
        clock: wp.array(dtype=wp.float64),
        # outputs
        rows: FullRows,
        changed: wp.array(dtype=wp.int32),
    ):
        """Solves the rows of the large bodies; the first thread of a block has those at walls."""
        row, lane = wp.tid()
        i = n + row
        h = real(clock[H])
        here = control[SWEEPS] % 2 * total
        sum = vec8()
        if control[STALE] == 0:
            for q in range(lists.big_start[row] + lane, lists.big_start[row + 1], wp.block_dim()):
                if rows.slot[behind + q] != SHUT:
                    gained, _p, _xi, _touches = visit(b, rows, i, behind + q, here, h)
                    sum = sum + gained
            if lane == 0:
                for k in range(rows.count[i]):
                    by_wall, _q, _zeta, _meets = visit(b, rows, i, k * total + i, here, h)
                    sum = sum + by_wall
        gains = wp.tile_sum(wp.tile(sum, preserve_type=True))[0]
        if lane == 0 and control[STALE] == 0:
            settle(rows, i, here, total - here, residual, gains, changed)

    return SimpleNamespace(sweep=sweep, sweep_big=sweep_big)
