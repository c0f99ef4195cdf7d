"""Rigid rows: options of the step, the records that its parts share, and access to them."""

from dataclasses import dataclass, field
from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.pairs import ONE
from dembench.solver.types import types
from dembench.solver.walls.records import WallOptions


@dataclass(frozen=True)
class ImpulseOptions:
    """What of the impulse step is compiled in.

    Attributes:
        precision: "float32" or "float64".
        friction: Tangential impulses and spins.
        pairs: How pair constants are looked up.
        walls: What of the walls is needed.
        bigs: Whether there are large bodies.
        stabilization: Conjugate gradients carry on where the sweeps end, for matter at rest.
        periodic: Whether some axis of the domain is periodic.
        radii: Whether bodies have different radii.
        threads: Whether several threads share a step.
    """

    precision: str = "float32"
    friction: bool = True
    pairs: str = ONE
    walls: WallOptions = field(default_factory=WallOptions)
    bigs: bool = False
    stabilization: bool = True
    periodic: bool = False
    radii: bool = True
    threads: bool = False

    @property
    def bridged(self) -> bool:
        """Whether there can be rows in the bridge, see `segments`."""
        return self.threads or self.bigs


@cache
def row_types(precision: str) -> Any:
    """The record Rows.

    Rows stand in segments, see `segments`: base and places say where those and their places in `order` begin. i, j:
    indices into u; slot: where the impulses are remembered; a: normal (0-2), overlap over dt, normal and tangential
    effective mass, friction, radius of i; b: radius of j, normal impulse, normal and tangential restitution, tangential
    impulse (4-6), load that the last position pass carried; blow: impulses of collisions, where the loads of walls are
    asked for; push: load that the position pass of this step carries; u: velocity (0-2), inverse mass, angular velocity
    (4-6), inverse inertia of bodies and, behind them, of the walls listed, those of each thread from `fixed` on; hit:
    1 + the last collision sweep in which each of these collided; x: positions at the start of the step; order, mask,
    stamp: see `row_lanes` and `blocks`; apart: difference of two positions (0-2) at the start of the position pass, and
    sum of radii; shift: what the pass has moved a body (0-2), and its inverse mass. The last rows, one for each thread,
    have the last entries of u and of shift: they are those of lanes without a row.
    """
    t = types(precision)
    vec8 = t.vec8

    class Rows:
        base: wp.array(dtype=wp.int32)
        places: wp.array(dtype=wp.int32)
        fixed: wp.array(dtype=wp.int32)
        i: wp.array(dtype=wp.int32)
        j: wp.array(dtype=wp.int32)
        slot: wp.array(dtype=wp.int32)
        a: wp.array(dtype=vec8)
        b: wp.array(dtype=vec8)
        push: wp.array(dtype=t.real)
        blow: wp.array(dtype=t.vec3)
        u: wp.array(dtype=vec8)
        hit: wp.array(dtype=wp.int32)
        x: wp.array(dtype=wp.vec3d)
        order: wp.array(dtype=wp.int32)
        mask: wp.array(dtype=wp.uint64)
        stamp: wp.array(dtype=wp.int32)
        apart: wp.array(dtype=t.vec4)
        shift: wp.array(dtype=t.vec4)

    Rows.__qualname__ = Rows.__name__ = f"Rows_{precision}"
    return wp.struct(Rows)


@cache
def row_access(precision: str) -> Any:
    """Direct access to the rows as Warp functions; the generated one allows negative indices and any stride.

    set_row(rows, r, i, j, slot, a, b): a new row; first(rows, r) and second(rows, r): indices i and j; constants(rows,
    r): a; impulses(rows, r) and set_impulses(rows, r, b): b; state(rows, i) and set_state(rows, i, u): u;
    collided(rows, i): hit.
    """
    t = types(precision)
    Rows, vec8 = row_types(precision), t.vec8

    @wp.func_native("return rows.i.data[r];")
    def first(rows: Rows, r: int) -> int: ...

    @wp.func_native("return rows.j.data[r];")
    def second(rows: Rows, r: int) -> int: ...

    @wp.func_native("return rows.a.data[r];")
    def constants(rows: Rows, r: int) -> vec8: ...

    @wp.func_native("return rows.b.data[r];")
    def impulses(rows: Rows, r: int) -> vec8: ...

    @wp.func_native("rows.b.data[r] = b;")
    def set_impulses(rows: Rows, r: int, b: vec8): ...

    @wp.func_native("return rows.u.data[i];")
    def state(rows: Rows, i: int) -> vec8: ...

    @wp.func_native("rows.u.data[i] = u;")
    def set_state(rows: Rows, i: int, u: vec8): ...

    @wp.func_native("return rows.hit.data[i];")
    def collided(rows: Rows, i: int) -> int: ...

    @wp.func_native(
        "rows.i.data[r] = i; rows.j.data[r] = j; rows.slot.data[r] = slot;"
        "rows.a.data[r] = a; rows.b.data[r] = b; rows.push.data[r] = 0;"
    )
    def set_row(rows: Rows, r: int, i: int, j: int, slot: int, a: vec8, b: vec8): ...

    return SimpleNamespace(
        collided=collided,
        set_row=set_row,
        first=first,
        second=second,
        constants=constants,
        impulses=impulses,
        set_impulses=set_impulses,
        state=state,
        set_state=set_state,
    )


@cache
def limit_types(precision: str) -> Any:
    """The record Limits: what bounds the work and the accuracy of a step, in scene units.

    velocity_sweeps, position_sweeps, stabilization_sweeps: largest number per step; event: approach speed from which a
    contact is a collision; still: change of a relative velocity at which the sweeps end; fast: slip or approach speed
    of flowing material; share: of the load in fast contacts, up to which matter counts as at rest; calm: mean change of
    velocities at which the stabilization ends; margin: gap at the end of the step up to which a row is kept; slop:
    overlap at which the position pass ends; near: least gap up to which pairs count as near.
    """
    real = types(precision).real

    class Limits:
        velocity_sweeps: wp.int32
        position_sweeps: wp.int32
        stabilization_sweeps: wp.int32
        event: real
        still: real
        fast: real
        share: real
        calm: real
        margin: real
        slop: real
        near: wp.float64

    Limits.__qualname__ = Limits.__name__ = f"Limits_{precision}"
    return wp.struct(Limits)
