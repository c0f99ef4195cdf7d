"""Segments of the rigid rows: what each thread has of a step, and how threads join it.

Every thread has a range of the sorted bodies, and the first one has the large bodies, too. The rows of pairs within a
range and of its walls are a segment; those across two ranges and those of large bodies are the last one, the bridge,
which the first thread visits while the others wait. So the bits of a result depend on the number of threads, as those
of Gauss-Seidel sweeps do on the order of the rows, and on nothing else.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.sync import barrier

FLAGS, PER_SEGMENT = 9, 4
"""Length of `state` before what each segment has there, and its entries: where its rows of walls or of large bodies
begin and where they end; its blocks, and its rows outside them."""
JOINED, TRAVEL, PER_THREAD = 8, 16, 8
"""Where `travel` has what all threads have together, and what each of them has: a cache line of each."""
OTHER, END, BLOCKS, REST = (wp.constant(k) for k in range(PER_SEGMENT))


@wp.struct
class Share:
    """What a thread has of a step.

    Attributes:
        part, parts: Number of the thread, and of threads.
        begin, end: The small bodies of its range.
        n, total: Small bodies, and all bodies, of the scene.
        state, travel: See `impulse_kernel`.
    """

    part: wp.int32
    parts: wp.int32
    begin: wp.int32
    end: wp.int32
    n: wp.int32
    total: wp.int32
    state: wp.array(dtype=wp.int32)
    travel: wp.array(dtype=wp.float64)


@wp.func
def bodies_of(share: Share):
    """Number of bodies of a thread."""
    found = share.end - share.begin
    if share.part == 0:
        found += share.total - share.n
    return found


@wp.func
def body_of(share: Share, k: int):
    """Index of the k-th body of a thread."""
    i = share.begin + k
    if i >= share.end:
        i += share.n - share.end
    return i


@wp.func
def segments_of(share: Share):
    """Number of segments that a thread visits."""
    found = int(1)
    if share.part == 0:
        found = 2
    return found


@wp.func
def segment_of(share: Share, k: int):
    """The k-th segment that a thread visits: its own one, and the bridge."""
    segment = int(share.part)
    if k == 1:
        segment = int(share.parts)
    return segment


@wp.func
def flag(share: Share, segment: int, what: int):
    """Entry `what` of a segment in the state."""
    return share.state[wp.static(FLAGS) + wp.static(PER_SEGMENT) * segment + what] + 0


@wp.func
def set_flag(share: Share, segment: int, what: int, value: int):
    share.state[wp.static(FLAGS) + wp.static(PER_SEGMENT) * segment + what] = value


@cache
def joining_functions(threads: bool) -> Any:
    """Warp functions by which threads wait for each other and join what they have.

    wait(share): until all have come here. give(share, x) hands four numbers to the first thread, which may add to its
    own ones before total(share, x) or largest(share, x), which return what all have. With one thread these are x.
    sum_of and largest_of do both, where the first thread has nothing to add.
    """

    @wp.func
    def wait(share: Share):
        if wp.static(threads):
            barrier(share.state, share.parts)

    @wp.func
    def give(share: Share, x: wp.vec4d):
        if wp.static(threads):
            at = wp.static(TRAVEL) + wp.static(PER_THREAD) * share.part
            for c in range(4):
                share.travel[at + c] = x[c]
            barrier(share.state, share.parts)

    @wp.func
    def joined(share: Share):
        """What the first thread has put down for all."""
        barrier(share.state, share.parts)
        at = wp.static(JOINED)
        return wp.vec4d(share.travel[at], share.travel[at + 1], share.travel[at + 2], share.travel[at + 3])

    def joining(operation: Any) -> Any:
        @wp.func
        def found(share: Share, x: wp.vec4d):
            out = x
            if wp.static(threads):
                if share.part == 0:
                    for c in range(4):
                        s = x[c]
                        for p in range(1, share.parts):
                            s = operation(s, share.travel[wp.static(TRAVEL) + wp.static(PER_THREAD) * p + c])
                        share.travel[wp.static(JOINED) + c] = s
                out = joined(share)
            return out

        return found

    total, largest = joining(wp.add), joining(wp.max)

    @wp.func
    def sum_of(share: Share, x: wp.vec4d):
        give(share, x)
        return total(share, x)

    @wp.func
    def largest_of(share: Share, x: wp.vec4d):
        give(share, x)
        return largest(share, x)

    return SimpleNamespace(wait=wait, give=give, total=total, largest=largest, sum_of=sum_of, largest_of=largest_of)
