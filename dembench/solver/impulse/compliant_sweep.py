"""Gauss-Seidel over compliant rows: the force of each row is solved together with the velocities that it leaves.

A substep h is a half drift, a change of velocities, and a half drift, so a contact goes the way h (v0 + v)/2 with the
separation speeds v0 before and v after it, from the overlap d0 to d1. With the elastic energy U(d) and the stiffness kt
and dashpots c and ct of the law (`laws.py`):

    normal      Fn = (U(d0) - U(d1))/(d0 - d1) - c (1 + s2 (h omega)^2) (v0 + v)/2
    tangential  Ft = -s kt (xi0 + xi1)/2 - ct (vt0 + vt)/2,      xi1 = xi0 + s h (vt0 + vt)/2
    sliding     s |kt xi1| > mu |Fn|: Ft = mu |Fn| along that spring, no dashpot; nothing where mu |Fn| = 0

The elastic force is the mean over the way of the substep, so its work is the change of U: an elastic contact gives back
what it took, whatever the substep (discrete gradient: Gonzalez 1996, doi 10.1007/BF02440162), and only the dashpots and
friction dissipate. s is the part of the way on which the two touch; c and ct are means over the way; kt is taken at d1,
so that no spring is bent with less than the stiffness that it is left with; s2: see SQUARES. For h -> 0 all this is the
soft-sphere law.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.compliant_rows import (
    AHEAD,
    OWN,
    CompliantOptions,
    compliant_access,
    compliant_types,
)
from dembench.solver.impulse.exchange import impulse_function
from dembench.solver.types import types

NEWTON = 2
"""Newton iterations of the normal force in a visit."""
SQUARES = {"linear": 1 / 6, "hertz": 1 / 8}
"""Part of (h omega)^2 by which a dashpot is larger in a substep h. The mean of two speeds dissipates less than the
speeds between them: 1/6 of (h omega)^2 less in a linear contact, where the substep is the implicit midpoint rule with
its longer contact; 1/8 measured for Hertz contacts of any restitution."""


@cache
def visit_function(o: CompliantOptions) -> Any:
    """One visit of a row as a Warp function (a, b, ui, uj, c, h) -> (impulse, n x change, change, spring, touches).

    a, b, ui, uj: see `compliant_types`; c: constants of the pair; h: substep. The impulse is on i, change what it has
    gained, spring what it leaves: together with the sliding in the second half of the substep it is the spring of its
    end.
    """
    t = types(o.law.precision)
    real, vec3, vec8, PairClass = t.real, t.vec3, t.vec8, t.PairClass
    friction, linear, no_tension = o.law.friction, o.law.linear, o.law.no_tension
    squares = wp.constant(SQUARES["linear" if linear else "hertz"])

    @wp.func
    def touching_share(before: real, after: real):
        """The part of a way on which the two touch, by the overlaps at its ends (negative: gaps)."""
        share = real(1.0)
        if wp.min(before, after) <= real(0.0):
            deeper = wp.max(wp.max(before, after), real(0.0))
            share = real(0.0)
            if deeper > real(0.0):
                share = deeper / wp.abs(after - before)
        return share

    @wp.func
    def normal_law(c: PairClass, before: real, after: real):
        """Mean elastic force on the way between two overlaps (negative: gaps), its derivative by the second, the mean
        over the way of the power 1/4 of the overlap, and the mean tangent stiffness that goes with it."""
        zero, half = real(0.0), real(0.5)
        force, slope, quarter, stiffness = zero, zero, zero, zero
        deeper = wp.max(before, after)
        if wp.min(before, after) > zero:
            if wp.static(linear):
                force = half * c.kn * (before + after)
                slope = half * c.kn
                quarter = real(1.0)
                stiffness = c.kn
            else:
                s0, s1 = wp.sqrt(before), wp.sqrt(after)
                inverse = real(1.0) / (s0 + s1)
                both = s0 * s1
                share = real(0.4) * c.kn * inverse
                force = share * (after * after + before * before + both * (before + after + both))
                cubes = after * (real(1.5) * s1 + real(3.0) * s0) + before * (real(2.0) * s1 + s0)
                slope = share * inverse * cubes
                root = wp.sqrt(half * (before + after))
                quarter = wp.sqrt(root)
                stiffness = real(1.5) * c.kn * root
        elif deeper > zero:
            # they touch on a part of the way only
            span = after - before
            part = touching_share(before, after)
            if wp.static(linear):
                force = half * c.kn * deeper * part
                slope = -force / span
                if after > zero:
                    slope = (c.kn * after - force) / span
                quarter = part
                stiffness = c.kn * part
            else:
                root = wp.sqrt(deeper)
                force = real(0.4) * c.kn * deeper * root * part
                slope = -force / span
                if after > zero:
                    slope = (c.kn * after * root - force) / span
                quarter = real(0.8) * part * wp.sqrt(root)
                stiffness = real(1.5) * c.kn * root * part
        return force, slope, quarter, stiffness

    @wp.func
    def visit(a: vec8, b: vec8, ui: vec8, uj: vec8, c: PairClass, h: real):
        zero, half = real(0.0), real(0.5)
        n = vec3(a[0], a[1], a[2])
        overlap, ai, aj = a[3], a[7], b[3]
        old = vec3(b[4], b[5], b[6])
        g = vec3(a[4] + ui[0] - uj[0], a[5] + ui[1] - uj[1], a[6] + ui[2] - uj[2])
        if wp.static(friction):
            s = vec3(ai * ui[4] + aj * uj[4], ai * ui[5] + aj * uj[5], ai * ui[6] + aj * uj[6])
            g = g + wp.cross(n, s)
        vn = wp.dot(g, n)
        w = ui[3] + uj[3]
        normal_old = wp.dot(old, n)
        free = vn - w * normal_old
        start = vec3(a[4], a[5], a[6])
        before = wp.dot(start, n)
        ahead = half * h
        first = overlap + ahead * before

        v, force, quarter = vn + zero, zero, zero
        for _k in range(wp.static(NEWTON)):
            value, slope, quarter, stiffness = normal_law(c, first, overlap - ahead * v)
            dashpot = c.dn * quarter * (real(1.0) + real(squares) * h * h * w * stiffness)
            value = value - dashpot * half * (before + v)
            slope = half * (h * slope + dashpot)
            step = (free + w * h * value - v) / (real(1.0) + w * h * slope)
            force = value - slope * step
            v = v + step
        if wp.static(no_tension):
            force = wp.max(force, zero)
        p = (h * force) * n
        xi = vec3()
        if wp.static(friction):
            xi = vec3(b[0], b[1], b[2])
            lt = old - normal_old * n
            wt = w + ai * ai * ui[7] + aj * aj * uj[7]
            slid = start - before * n
            slip = g - vn * n - wt * lt
            left = overlap - ahead * v
            kt = zero
            touching = touching_share(first, left)
            if wp.static(linear):
                kt = touching * c.kt
            elif left > zero:
                kt = touching * c.kt * wp.sqrt(left)
            resist = half * touching * kt * h + c.dt * quarter
            lt = (kt * xi + half * resist * (slid + slip)) * (-h / (real(1.0) + ahead * resist * wt))
            end = xi + touching * ahead * (slid + slip + wt * lt)
            bound = c.mu * wp.abs(force)
            stretched = kt * kt * wp.dot(end, end)
            if bound == zero:
                # also where no spring is stretched any more: a dashpot needs friction, too
                end = vec3()
                lt = vec3()
            elif stretched > bound * bound:
                end = end * (bound / wp.sqrt(stretched))
                lt = end * (-h * kt)
            xi = end - ahead * (slip + wt * lt)
            p = p + lt
        change = p - old
        touches = real(0.0)
        if overlap - ahead * v > zero:
            touches = real(1.0)
        return p, wp.cross(n, change), change, xi, touches

    return visit


@cache
def sweep_function(o: CompliantOptions) -> Any:
    """A Warp function (rows, first, other, end, ...) that visits the rows of a segment once, either way.

    Rows first..other are those of pairs of small bodies, rows other..end those of walls or, in the bridge, of large
    bodies; pairs that share their constants have `one`, see `compliant_types` for those of others. In the last sweep of
    a substep the springs are remembered.
    """
    t = types(o.law.precision)
    real, vec4, vec8, PairClass, Lists = t.real, t.vec4, t.vec8, t.PairClass, t.Lists
    Rows = compliant_types(o.law.precision)
    native = compliant_access(o.law.precision, o.rotation)
    entry, change_of, set_change = native.entry, native.change_of, native.set_change
    geometry_of, impulse_of, set_impulse, set_memory = (
        native.geometry_of,
        native.impulse_of,
        native.set_impulse,
        native.set_memory,
    )
    ask_change = native.ask_change
    visit, after = visit_function(o), impulse_function(o.law.precision)
    shared, friction = o.shared, o.law.friction

    @wp.func
    def sweep(
        rows: Rows,
        first: int,
        other: int,
        end: int,
        shift: int,
        one: PairClass,
        h: real,
        reverse: int,
        last: int,
        kind: int,
        lists: Lists,
    ):
        current = int(-1)
        ui = vec8()
        for q in range(first, end):
            r = q
            ahead = wp.min(q + AHEAD, end - 1)
            if reverse == 1:
                r = end - 1 + first - q
                ahead = end - 1 + first - ahead
            ask_change(rows, entry(rows.j, ahead))
            i, j = entry(rows.i, r), entry(rows.j, r)
            if i != current:
                if current >= 0:
                    set_change(rows, current, ui)
                current = i + 0
                ui = change_of(rows, i)
            uj = change_of(rows, j)
            a, b = geometry_of(rows, r), impulse_of(rows, r)
            c = one
            if wp.static(shared):
                if r >= other:
                    c = rows.c[r - shift]
            else:
                c = rows.c[r - shift]
            p, turn, change, xi, touches = visit(a, b, ui, uj, c, h)
            ui = after(ui, change, turn, a[7])
            set_change(rows, j, after(uj, -change, turn, b[3]))
            set_impulse(rows, r, vec8(b[0], b[1], b[2], b[3], p[0], p[1], p[2], real(0.0)))
            if wp.static(friction):
                if last == 1:
                    kept = vec4(xi[0], xi[1], xi[2], touches)
                    slot = entry(rows.slot, r)
                    if r < other:
                        set_memory(lists.memory, slot, kept)
                    elif kind == OWN:
                        set_memory(lists.wall_memory, slot, kept)
                    else:
                        set_memory(lists.big_memory, slot, kept)
        if current >= 0:
            set_change(rows, current, ui)

    return sweep
