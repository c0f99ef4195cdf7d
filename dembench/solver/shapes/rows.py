"""Rigid rows of bodies of any shape: full inertia of both bodies, one row per contact point.

Rows are chosen at the start of the step with their gaps, v' >= -gap/dt, as for spheres. A contact that meets faster
than the event speed rebounds with e and beta (Walton 1993), all contacts of a body at once: what a face does cannot be
told by colliding its points one after the other. A visit of a row tries to stick: the impulse that brings the contact
point to its target velocity in all three directions, by the inverse of the 3 x 3 matrix that joins impulse and velocity
there. Where that leaves the Coulomb cone, the normal and then the tangential impulse are solved for alone and the
latter is cut.

The rows of one pair, or of one body and wall feature, form a block. A sweep visits every block once and its rows until
they agree: a face on many points is one contact to the sweeps, as a sphere is, and gets no spin from their order.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.shapes.geometry import ends_pair
from dembench.solver.shapes.narrow import narrow_functions
from dembench.solver.shapes.records import Contact
from dembench.solver.types import types, vec8d
from dembench.solver.walls.records import WallOptions, Walls

VISITS = wp.constant(50)
"""At most this often the rows of a block are visited in a sweep."""
AGREED = wp.constant(wp.float64(1e-6))
"""The rows of a block agree where no relative velocity changes by more than this part of the largest change."""


@wp.struct
class Row:
    """What a sweep needs of a contact beside its geometry.

    begin, end: rows of the block; target: velocity of a against b that it is brought to; impulse: of b on a; response:
    velocity per impulse, and its inverse; slide: impulse per tangential velocity that is stable in every direction;
    friction; carried, push: load that the position pass carried in the last step, and in this one.
    """

    begin: wp.int32
    end: wp.int32
    target: wp.vec3d
    impulse: wp.vec3d
    response: wp.mat33d
    inverse: wp.mat33d
    slide: wp.float64
    friction: wp.float64
    carried: wp.float64
    push: wp.float64


@wp.func
def response_of(inverse_mass: wp.float64, inverse: wp.mat33d, lever: wp.vec3d):
    """Velocity of a point of a body per impulse at that point."""
    x = wp.skew(lever)
    return inverse_mass * wp.identity(n=3, dtype=wp.float64) - x * inverse * x


@cache
def row_functions(friction: bool, options: WallOptions) -> Any:
    """Warp functions `row_of`, `blocks`, `exchange` and `sweep`.

    row_of(...) makes the row of a contact with the impulse of the last step; blocks(contacts, rows, first, count) finds
    the blocks; exchange(bodies, inertia, contact, impulse) adds an impulse to both bodies; sweep(...) visits every
    block once.
    """
    t = types("float64")
    Bodies, PairClass = t.Bodies, t.PairClass
    relative = narrow_functions(options).relative
    present = options.present

    @wp.func
    def apply(b: Bodies, inertia: wp.array(dtype=wp.mat33d), i: int, lever: wp.vec3d, p: wp.vec3d):
        """Adds an impulse at a lever to the velocities of a body."""
        k, m = b.kin[i], b.inv_m[i]
        b.kin[i] = vec8d(k[0], k[1], k[2], k[3] + m * p[0], k[4] + m * p[1], k[5] + m * p[2], k[6], k[7])
        w = inertia[i] * wp.cross(lever, p)
        b.spin[i] = b.spin[i] + wp.vec4d(w[0], w[1], w[2], wp.float64(0.0))

    @wp.func
    def exchange(b: Bodies, inertia: wp.array(dtype=wp.mat33d), c: Contact, p: wp.vec3d):
        """An impulse of b on a."""
        apply(b, inertia, c.a, c.ra, p)
        if c.b >= 0:
            apply(b, inertia, c.b, c.rb, -p)

    @wp.func
    def row_of(
        b: Bodies,
        walls: Walls,
        inertia: wp.array(dtype=wp.mat33d),
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        c: Contact,
        dt: wp.float64,
        event: wp.float64,
    ):
        zero, one, two = wp.float64(0.0), wp.float64(1.0), wp.float64(2.0)
        row = Row()
        law = PairClass()
        row.response = response_of(b.inv_m[c.a], inertia[c.a], c.ra)
        if c.b >= 0:
            row.response = row.response + response_of(b.inv_m[c.b], inertia[c.b], c.rb)
            law = pair_table[b.kind[c.a] * pair_columns + b.kind[c.b]]
        elif wp.static(present):
            law = wall_table[b.kind[c.a] * wall_columns + walls.features[c.feature].kind]
        row.inverse = wp.inverse(row.response)
        v = relative(b, walls, c)
        vn = wp.dot(v, c.n)
        if vn < -event and c.gap + vn * dt < zero:
            row.target = (-law.e * vn) * c.n - law.beta * (v - vn * c.n)
        else:
            row.target = wp.min(-c.gap / dt, zero) * c.n
        # the largest eigenvalue of the tangential part, from its trace and the trace of its square
        tangent = wp.identity(n=3, dtype=wp.float64) - wp.outer(c.n, c.n)
        part = tangent * row.response * tangent
        trace = wp.trace(part)
        spread = wp.sqrt(wp.max(two * wp.trace(part * part) - trace * trace, zero))
        row.slide = two / (trace + spread)
        row.friction = law.mu
        before = wp.vec3d(c.memory[0], c.memory[1], c.memory[2])
        normal = wp.max(wp.dot(before, c.n), zero)
        row.carried = c.memory[3]
        if normal > zero:
            row.impulse = normal * c.n
            if wp.static(friction):
                row.impulse = row.impulse + cut(before - wp.dot(before, c.n) * c.n, law.mu * (normal + row.carried))
        return row

    @wp.func
    def cut(p: wp.vec3d, bound: wp.float64):
        """A tangential impulse, shortened to the bound."""
        size = wp.length(p)
        out = p
        if size > bound:
            out = p * (bound / size)
        return out

    @wp.func
    def visit(
        b: Bodies,
        walls: Walls,
        inertia: wp.array(dtype=wp.mat33d),
        c: Contact,
        rows: wp.array(dtype=Row),
        r: int,
    ):
        """Solves one row; returns the change of the relative velocity."""
        zero = wp.float64(0.0)
        row = rows[r]
        missing = row.target - relative(b, walls, c)
        before = wp.vec3d(row.impulse[0], row.impulse[1], row.impulse[2])
        old = wp.dot(before, c.n)
        after = wp.vec3d()
        sticks = int(0)
        if wp.static(friction):
            if row.friction > zero:
                tried = before + row.inverse * missing
                normal = wp.dot(tried, c.n)
                if normal > zero:
                    if wp.length(tried - normal * c.n) <= row.friction * (normal + row.carried):
                        after = tried
                        sticks = 1
        if sticks == 0:
            along = wp.dot(c.n, row.response * c.n)
            normal = wp.max(old + wp.dot(missing, c.n) / along, zero)
            after = normal * c.n
            if wp.static(friction):
                left = missing - row.response * ((normal - old) * c.n)
                wanted = before - old * c.n + row.slide * (left - wp.dot(left, c.n) * c.n)
                after = after + cut(wanted, row.friction * (normal + row.carried))
        p = after - before
        changed = zero
        if wp.dot(p, p) > zero:
            exchange(b, inertia, c, p)
            changed = wp.length(row.response * p)
            rows[r].impulse = after
        return changed

    @wp.func
    def sweep(
        b: Bodies,
        walls: Walls,
        inertia: wp.array(dtype=wp.mat33d),
        contacts: wp.array(dtype=Contact),
        rows: wp.array(dtype=Row),
        first: int,
        count: int,
        still: wp.float64,
        reverse: int,
    ):
        """Visits every block once; returns the largest change of a relative velocity at the first visits of rows."""
        largest = wp.float64(0.0)
        q = int(0)
        while q < count:
            at = q
            if reverse == 1:
                at = count - 1 - q
            begin, end = rows[at].begin + 0, rows[at].end + 0
            initial = wp.float64(0.0)
            visits = int(0)
            while visits < VISITS:
                changed = wp.float64(0.0)
                for k in range(begin, end):
                    r = k
                    if (visits + reverse) % 2 == 1:
                        r = begin + end - 1 - k
                    changed = wp.max(changed, visit(b, walls, inertia, contacts[first + r], rows, r))
                if visits == 0:
                    initial = changed
                visits += 1
                if changed <= wp.max(still, AGREED * initial):
                    visits = VISITS
            largest = wp.max(largest, initial)
            q += end - begin
        return largest

    @wp.func
    def blocks(contacts: wp.array(dtype=Contact), rows: wp.array(dtype=Row), first: int, count: int):
        """Tells every row where its block begins and ends."""
        begin = int(0)
        for r in range(count):
            if ends_pair(contacts, first + r, first + count):
                for k in range(begin, r + 1):
                    rows[k].begin = begin
                    rows[k].end = r + 1
                begin = r + 1

    return SimpleNamespace(row_of=row_of, blocks=blocks, exchange=exchange, sweep=sweep)
