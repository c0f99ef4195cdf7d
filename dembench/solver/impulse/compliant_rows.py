"""Compliant rows: contacts that carry the soft-sphere law through a substep; their records and what all parts share."""

from dataclasses import dataclass, field
from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.laws import LawOptions
from dembench.solver.pairs import ONE, TABLE
from dembench.solver.types import types, vec8d
from dembench.solver.walls.records import WallOptions

FAR = 1e30
"""Gap of a row that is not open in a substep [scene units]."""
A, B, C = 8, 7, 5
"""Numbers of a row in the arrays a, b and c."""
FLAGS, TRAVEL = 10, 10
"""Lengths of `state` and `travel` before what each segment of the rows, and each thread, has there."""
PER_SEGMENT, PER_THREAD = 2, 7
"""Entries of a segment in `state` and of a thread in `travel`."""
OWN, BRIDGE = wp.constant(0), wp.constant(1)
"""Kinds of segments of the rows: those of a thread, and those across the ranges of threads and of large bodies."""


@dataclass(frozen=True)
class CompliantOptions:
    """What of the compliant step is compiled in.

    Attributes:
        law: Options of the contact law.
        pairs: How pair constants are looked up.
        alike: Whether all small bodies are of one kind, so that their pairs share one row of the table.
        walls: What of the walls is needed.
        bigs: Whether there are large bodies.
        periodic: Whether some axis of the domain is periodic.
        rotation: Whether bodies have spins.
        radii: Whether bodies have different radii.
        threads: Whether several threads share a step.
    """

    law: LawOptions = field(default_factory=LawOptions)
    pairs: str = ONE
    alike: bool = True
    walls: WallOptions = field(default_factory=WallOptions)
    bigs: bool = False
    periodic: bool = False
    rotation: bool = True
    radii: bool = True
    threads: bool = False

    @property
    def shared(self) -> bool:
        """Whether all pairs of small bodies have the same constants."""
        return self.alike and self.pairs in (ONE, TABLE)


@cache
def compliant_types(precision: str) -> Any:
    """The record CompliantRows.

    The rows stand in blocks of LANES, see `compliant_schedule`, and the blocks in segments, one for each thread and
    last the bridge; a lane without a row has the slot -1 and bodies that do not move.

    i, j: indices into u, j behind the last body where i meets a wall; slot: place of the contact memory.

    Of each block there are numbers of its lanes side by side. a: normal from j to i (0-2), overlap in the middle of the
    substep (negative: gap; FAR apart: not open) and lever arm of i (7); velocity of the surface of i past that of j
    (4-6) at its start. b: tangential spring (0-2), lever arm of j, impulse on i (4-6). c: constants of the pair, kn,
    kt, dn, dt, mu; where all pairs of small bodies have the same ones, they stand there once, in the first block, and
    c_base says where those of the other rows of a segment begin.

    u: change of velocity in the substep (0-2), inverse mass, change of angular velocity (4-6), inverse moment of
    inertia, of bodies and, behind them, of what does not move, once for each thread. mask, stamp: see
    `blocks`.
    """
    t = types(precision)
    real, vec8 = t.real, t.vec8

    class CompliantRows:
        i: wp.array(dtype=wp.int32)
        j: wp.array(dtype=wp.int32)
        slot: wp.array(dtype=wp.int32)
        a: wp.array(dtype=real)
        b: wp.array(dtype=real)
        c: wp.array(dtype=real)
        c_base: wp.array(dtype=wp.int32)
        u: wp.array(dtype=vec8)
        mask: wp.array(dtype=wp.uint64)
        stamp: wp.array(dtype=wp.int32)

    CompliantRows.__qualname__ = CompliantRows.__name__ = f"CompliantRows_{precision}"
    return wp.struct(CompliantRows)


@cache
def compliant_access(precision: str, rotation: bool) -> Any:
    """Direct access to the arrays of the rows, as Warp functions.

    The generated access allows negative indices and any stride, which doubles the instructions of a row; here both are
    known.
    """
    t = types(precision)
    vec4, vec8, Bodies = t.vec4, t.vec8, t.Bodies
    Rows = compliant_types(precision)

    @wp.func_native("return b.kin.data[i];")
    def kin(b: Bodies, i: int) -> vec8d: ...

    @wp.func_native("return b.spin.data[i];")
    def spin(b: Bodies, i: int) -> vec4: ...

    @wp.func_native("return rows.u.data[i];")
    def change_of(rows: Rows, i: int) -> vec8: ...

    @wp.func_native("rows.u.data[i] = u;")
    def set_change(rows: Rows, i: int, u: vec8): ...

    return SimpleNamespace(
        kin=kin,
        spin=spin,
        change_of=change_of,
        set_change=set_change,
    )


@cache
def constants_function(o: CompliantOptions) -> Any:
    """A Warp function (rows, segment, other): the block of c that belongs to the block `other` of a segment.

    That is the first one with rows of walls or of large bodies.
    """
    Rows = compliant_types(o.law.precision)
    shared = o.shared

    @wp.func
    def constants(rows: Rows, segment: int, other: int):
        at = int(other)
        if wp.static(shared):
            at = rows.c_base[segment] + 0
        return at

    return constants
