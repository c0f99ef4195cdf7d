"""Sorting of particles by cell on devices of many threads: bounding box, cell index, cell starts, permutation."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.neighbours import position_function
from dembench.solver.types import types

CHUNKS = 1024
"""Partial results of the bounding box."""


@cache
def cell_function() -> Any:
    """Cell of a point as a Warp function (x, origin, 1/edges, order of the axes, cells per axis) -> vec3i."""

    @wp.func
    def cell_of(x: wp.vec3d, origin: wp.vec3d, inverse: wp.vec3d, axis: wp.vec3i, cells: wp.vec3i):
        p = wp.cw_mul(x - origin, inverse)
        return wp.vec3i(
            wp.clamp(int(wp.floor(p[axis[0]])), 0, cells[0] - 1),
            wp.clamp(int(wp.floor(p[axis[1]])), 0, cells[1] - 1),
            wp.clamp(int(wp.floor(p[axis[2]])), 0, cells[2] - 1),
        )

    return cell_of


@cache
def sort_kernels(precision: str) -> Any:
    """Kernels that sort particles; each has one thread per body unless it says otherwise."""
    t = types(precision)
    vec4, Bodies = t.vec4, t.Bodies
    position = position_function(precision)
    cell_of = cell_function()

    @wp.kernel(enable_backward=False, module="unique")
    def bounds(
        # inputs
        b: Bodies,
        n: int,
        # outputs
        low: wp.array(dtype=wp.vec3d),
        high: wp.array(dtype=wp.vec3d),
    ):
        """Bounding boxes of every CHUNKS-th body from c on, one thread per chunk c."""
        c = wp.tid()
        first = position(b, wp.min(c, n - 1))
        lower = first * wp.float64(1.0)
        upper = first * wp.float64(1.0)
        i = c + CHUNKS
        while i < n:
            x = position(b, i)
            lower = wp.min(lower, x)
            upper = wp.max(upper, x)
            i += CHUNKS
        low[c] = lower
        high[c] = upper

    @wp.kernel(enable_backward=False, module="unique")
    def key(
        # inputs
        b: Bodies,
        origin: wp.vec3d,
        inverse: wp.vec3d,
        axis: wp.vec3i,
        cells: wp.vec3i,
        # outputs
        cell: wp.array(dtype=wp.int32),
        order: wp.array(dtype=wp.int32),
    ):
        i = wp.tid()
        c = cell_of(position(b, i), origin, inverse, axis, cells)
        cell[i] = (c[0] * cells[1] + c[1]) * cells[2] + c[2]
        order[i] = i

    @wp.kernel(enable_backward=False, module="unique")
    def cell_starts(
        # inputs
        n: int,
        cell: wp.array(dtype=wp.int32),
        # outputs
        start: wp.array(dtype=wp.int32),
    ):
        """First sorted particle of each cell, one thread per cell and one more."""
        c = wp.tid()
        first = wp.lower_bound(cell, 0, n, c)
        # beyond the last particle lower_bound answers with the last one
        if cell[first] < c:
            first += 1
        start[c] = first

    @wp.kernel(enable_backward=False, module="unique")
    def permute(
        # inputs
        n: int,
        total: int,
        rows: int,
        order: wp.array(dtype=wp.int32),
        b: Bodies,
        identity: wp.array(dtype=wp.int32),
        big_memory: wp.array(dtype=vec4),
        # outputs
        b_out: Bodies,
        identity_out: wp.array(dtype=wp.int32),
        big_memory_out: wp.array(dtype=vec4),
        reference: wp.array(dtype=wp.vec3d),
    ):
        """Moves the arrays into the new order; `reference` takes the positions at which the lists are built."""
        k = wp.tid()
        i = k
        if k < n:
            i = order[k]
        b_out.kin[k] = b.kin[i]
        if k < b.spin.shape[0]:
            b_out.spin[k] = b.spin[i]
            b_out.inv_i[k] = b.inv_i[i]
        b_out.inv_m[k] = b.inv_m[i]
        b_out.kind[k] = b.kind[i]
        identity_out[k] = identity[i]
        reference[k] = position(b, i)
        kept = rows
        if big_memory.shape[0] < rows * total:
            kept = 0
        for row in range(kept):
            big_memory_out[row * total + k] = big_memory[row * total + i]

    return SimpleNamespace(bounds=bounds, key=key, cell_starts=cell_starts, permute=permute)
