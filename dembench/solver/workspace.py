"""Memory that is handed on: the rows of a substep and what a rebuild of the lists needs are never there together."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import warp as wp

ALIGNED = 64
"""Arrays begin at multiples of this, a cache line [B]."""


BLOCK = 1 << 12
"""Rows that are treated at a time where all at once would need memory for copies of them."""


def blocks(n: int, size: int = BLOCK) -> Iterator[slice]:
    """Cuts n rows into blocks of at most `size`, ascending."""
    for first in range(0, n, size):
        yield slice(first, min(first + size, n))


def unwritten(n: int, dtype: Any) -> wp.array:
    """Zeros on the host; pages of them that nobody writes take no memory, where `wp.zeros` writes them all."""
    number = wp.dtype_to_numpy(getattr(dtype, "_wp_scalar_type_", dtype))
    zeros = np.zeros((n, *getattr(dtype, "_shape_", ())), dtype=number)
    return wp.array(zeros, dtype=dtype, device="cpu", copy=False)


class Workspace:
    """Memory on the host for arrays that live until the next ones are asked for; it grows and never shrinks.

    To ask again costs nothing, where new arrays would have to be mapped page by page at every rebuild.
    """

    def __init__(self) -> None:
        # in a list, as it is no state that a file would have to keep
        self._held: list[wp.array] = []

    def arrays(self, *wanted: tuple[int, Any]) -> list[wp.array]:
        """Arrays of given lengths and types with any content; those that were asked for before are gone."""
        sizes = [n * wp.types.type_size_in_bytes(dtype) for n, dtype in wanted]
        begins = [0]
        for size in sizes:
            begins.append(begins[-1] + -(-size // ALIGNED) * ALIGNED)
        if not self._held or len(self._held[0]) < begins[-1] + ALIGNED:
            self._held.clear()
            self._held.append(unwritten(begins[-1] + ALIGNED, wp.uint8))
        base = -(-self._held[0].ptr // ALIGNED) * ALIGNED
        return [
            wp.array(ptr=base + begin, dtype=dtype, shape=n, device="cpu")
            for (n, dtype), begin in zip(wanted, begins, strict=False)
        ]
