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

AHEAD = wp.constant(12)
"""How many rows ahead the second body of a row is asked for."""
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

    The rows stand in segments, one for each thread and last the bridge.

    i, j: indices into u, j behind the last body where i meets a wall; slot: place of the contact memory.

    a: normal from j to i (0-2), overlap (negative: gap) and lever arm of i (7), all in the middle of the substep;
    velocity of the surface of i past that of j (4-6) at its start.

    b: tangential spring (0-2), lever arm of j, impulse on i (4-6).

    c: constants of the rows, or, where pairs share theirs, of the rows of walls, at the places of their candidates, and
    behind them of those of large bodies. Those of row r stand at r - shift, with a shift for each segment.

    u: change of velocity in the substep (0-2), inverse mass, change of angular velocity (4-6), inverse moment of
    inertia, of bodies and, behind them, of what does not move, once for each thread.
    """
    t = types(precision)
    vec8 = t.vec8

    class CompliantRows:
        i: wp.array(dtype=wp.int32)
        j: wp.array(dtype=wp.int32)
        slot: wp.array(dtype=wp.int32)
        a: wp.array(dtype=vec8)
        b: wp.array(dtype=vec8)
        c: wp.array(dtype=t.PairClass)
        u: wp.array(dtype=vec8)

    CompliantRows.__qualname__ = CompliantRows.__name__ = f"CompliantRows_{precision}"
    return wp.struct(CompliantRows)


@cache
def compliant_access(precision: str, rotation: bool) -> Any:
    """Direct access to the arrays of the rows, as Warp functions; see `sync.row_functions` for the reason."""
    t = types(precision)
    vec4, vec8, Bodies, Lists = t.vec4, t.vec8, t.Bodies, t.Lists
    Rows = compliant_types(precision)

    @wp.func_native("return b.kin.data[i];")
    def kin(b: Bodies, i: int) -> vec8d: ...

    @wp.func_native("return b.spin.data[i];")
    def spin(b: Bodies, i: int) -> vec4: ...

    @wp.func_native("return lists.memory.data[k];")
    def memory_of(lists: Lists, k: int) -> vec4: ...

    @wp.func_native("values.data[k] = m;")
    def set_memory(values: wp.array(dtype=vec4), k: int, m: vec4): ...

    @wp.func_native("return values.data[k];")
    def entry(values: wp.array(dtype=wp.int32), k: int) -> int: ...

    @wp.func_native("return rows.u.data[i];")
    def change_of(rows: Rows, i: int) -> vec8: ...

    @wp.func_native("rows.u.data[i] = u;")
    def set_change(rows: Rows, i: int, u: vec8): ...

    @wp.func_native("return rows.a.data[r];")
    def geometry_of(rows: Rows, r: int) -> vec8: ...

    @wp.func_native("return rows.b.data[r];")
    def impulse_of(rows: Rows, r: int) -> vec8: ...

    @wp.func_native("rows.b.data[r] = b;")
    def set_impulse(rows: Rows, r: int, b: vec8): ...

    @wp.func_native("rows.i.data[r] = i; rows.j.data[r] = j; rows.slot.data[r] = slot; rows.a.data[r] = a;")
    def put(rows: Rows, r: int, i: int, j: int, slot: int, a: vec8): ...

    @wp.func_native("__builtin_prefetch(&rows.u.data[i], 1);")
    def ask_change(rows: Rows, i: int): ...

    @wp.func_native(
        "__builtin_prefetch(&b.kin.data[i]);"
        + ("__builtin_prefetch(&b.spin.data[i]);" if rotation else "")
        + "__builtin_prefetch(&rows.u.data[i], 1);"
    )
    def ask_body(b: Bodies, rows: Rows, i: int): ...

    return SimpleNamespace(
        kin=kin,
        spin=spin,
        memory_of=memory_of,
        set_memory=set_memory,
        entry=entry,
        change_of=change_of,
        set_change=set_change,
        geometry_of=geometry_of,
        impulse_of=impulse_of,
        set_impulse=set_impulse,
        put=put,
        ask_change=ask_change,
        ask_body=ask_body,
    )
