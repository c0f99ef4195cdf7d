"""Stabilization of deep statics: conjugate gradients on top of the velocity sweeps.

A Gauss-Seidel sweep carries an impulse through few layers, so a deep column sinks before its weight has reached the
floor. Here two sweeps, one in each direction, give a direction z, and the impulses go to the point of least energy in
the plane of z and the whole step before, p (locally optimal conjugate gradients; the nonsmooth form after
Silcowitz-Hansen, Niebe, Erleben 2010, doi 10.1007/s00371-010-0502-6, where the weights of z and p are heuristic). With
A the matrix of the contact problem and g its residual there, s and t of the step s z + t p solve

    s zAz + t zAp = -z g,    s zAp + t pAp = -p g,

and as A = J M^-1 J^T the products are kinetic energies of changes of velocity. Impulses stay in their cones and every
change is the impulse of a row, so momentum is kept. It ends when a step changes velocities by less than `calm`, root
mean square: the relative velocities of neighbours say little, as they add up over many layers.

This is for matter at rest: `flows` tells whether more than a share of the normal load stands in contacts that slide
fast or have collided, and then the stabilization stays off.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.rows import ImpulseOptions, limit_types, row_types
from dembench.solver.impulse.segments import (
    END,
    Share,
    bodies_of,
    body_of,
    flag,
    joining_functions,
    segment_of,
    segments_of,
)
from dembench.solver.impulse.sweeps import row_arithmetic, sweep_functions
from dembench.solver.types import types


@cache
def search_types(precision: str) -> Any:
    """The record Search: what the stabilization keeps.

    z, p: change of the tangential (0-2) and normal impulse of each row by the sweeps and by the last step; u, du:
    velocities of the bodies before the step and their change by the last one, as in Rows.u.
    """
    t = types(precision)

    class Search:
        z: wp.array(dtype=t.vec4)
        p: wp.array(dtype=t.vec4)
        u: wp.array(dtype=t.vec8)
        du: wp.array(dtype=t.vec8)

    Search.__qualname__ = Search.__name__ = f"Search_{precision}"
    return wp.struct(Search)


@cache
def stabilization_functions(o: ImpulseOptions) -> Any:
    """Warp functions (flows, stabilize).

    All threads call them. flows(rows, share, limits, blow) adds `blow`, the impulse of fast collisions, to the load in
    fast contacts. stabilize(rows, search, share, limits) returns the number of sweeps.
    """
    t = types(o.precision)
    real, vec3, vec4, vec8 = t.real, t.vec3, t.vec4, t.vec8
    Rows, Limits = row_types(o.precision), limit_types(o.precision)
    Search = search_types(o.precision)
    arithmetic = row_arithmetic(o)
    velocity, apply, in_cone = arithmetic.velocity, arithmetic.apply, arithmetic.in_cone
    _warm_start, sweep, _remember = sweep_functions(o)
    friction, bridged = o.friction, o.bridged
    joining = joining_functions(o.threads)
    wait, sum_of = joining.wait, joining.sum_of
    zero = wp.constant(wp.float64(0.0))

    @wp.func
    def flows(rows: Rows, share: Share, limits: Limits, blow: real):
        moving, load = real(0.0), real(0.0)
        for k in range(segments_of(share)):
            s = segment_of(share, k)
            for r in range(rows.base[s], flag(share, s, END)):
                b = rows.b[r]
                if b[1] > real(0.0):
                    a = rows.a[r]
                    load += b[1]
                    n = vec3(a[0], a[1], a[2])
                    if wp.length(velocity(rows.u[rows.i[r]], rows.u[rows.j[r]], n, a[7], b[0])) > limits.fast:
                        moving += b[1]
        found = sum_of(share, wp.vec4d(wp.float64(moving), wp.float64(load), zero, zero))
        return found[0] + wp.float64(blow) > wp.float64(limits.share) * found[1]

    @wp.func
    def impulses(b: vec8):
        return vec4(b[4], b[5], b[6], b[1])

    @wp.func
    def product(p: vec8, q: vec8, u: vec8):
        """Inner product of two changes of velocity of a body with the inverse masses of u."""
        s = real(0.0)
        if u[3] > real(0.0):
            s += (p[0] * q[0] + p[1] * q[1] + p[2] * q[2]) / u[3]
        if u[7] > real(0.0):
            s += (p[4] * q[4] + p[5] * q[5] + p[6] * q[6]) / u[7]
        return wp.float64(s)

    @wp.func
    def curvatures(rows: Rows, search: Search, share: Share):
        """zAz, zAp, pAp."""
        zz, zp, pp = wp.float64(0.0), wp.float64(0.0), wp.float64(0.0)
        for k in range(bodies_of(share)):
            i = body_of(share, k)
            u = rows.u[i]
            z = u - search.u[i]
            p = search.du[i]
            zz += product(z, z, u)
            zp += product(z, p, u)
            pp += product(p, p, u)
        return sum_of(share, wp.vec4d(zz, zp, pp, zero))

    @wp.func
    def slopes(rows: Rows, search: Search, share: Share):
        """zg, pg; z comes in as the impulses before the sweeps and becomes their change."""
        zg, pg = wp.float64(0.0), wp.float64(0.0)
        for k in range(segments_of(share)):
            s = segment_of(share, k)
            for r in range(rows.base[s], flag(share, s, END)):
                a, b = rows.a[r], rows.b[r]
                n = vec3(a[0], a[1], a[2])
                v = velocity(rows.u[rows.i[r]], rows.u[rows.j[r]], n, a[7], b[0])
                vn = wp.dot(v, n)
                slip = v - vn * n
                g = vec4(slip[0], slip[1], slip[2], vn - wp.min(a[3], real(0.0)))
                z = impulses(b) - search.z[r]
                search.z[r] = z
                zg += wp.float64(wp.dot(z, g))
                pg += wp.float64(wp.dot(search.p[r], g))
        return sum_of(share, wp.vec4d(zg, pg, zero, zero))

    @wp.func
    def advance_rows(rows: Rows, search: Search, begin: int, end: int, s: real, t: real):
        for r in range(begin, end):
            a, b = rows.a[r], rows.b[r]
            i, j = rows.i[r], rows.j[r]
            n = vec3(a[0], a[1], a[2])
            z = vec4(search.z[r])
            d = s * z + t * search.p[r]
            ln = wp.max(real(0.0), b[1] + d[3])
            lt, across = vec3(), vec3()
            if wp.static(friction):
                old = vec3(b[4], b[5], b[6])
                lt = in_cone(old + vec3(d[0], d[1], d[2]), a[6] * (ln + b[7]))
                across = lt - old
            search.p[r] = z + vec4(across[0], across[1], across[2], ln - b[1])
            apply(rows, i, j, rows.u[i], rows.u[j], n, a[7], b[0], ln - b[1], across)
            rows.b[r] = vec8(b[0], ln, b[2], b[3], lt[0], lt[1], lt[2], b[7])

    @wp.func
    def advance(rows: Rows, search: Search, share: Share, s: real, t: real):
        """Makes the step s z + t p as far as the cones allow; p becomes z and the step.

        Returns the root mean square over the bodies of the change of velocity by both.
        """
        advance_rows(rows, search, rows.base[share.part], flag(share, share.part, END), s, t)
        if wp.static(bridged):
            wait(share)
            if share.part == 0:
                advance_rows(rows, search, rows.base[share.parts], flag(share, share.parts, END), s, t)
            wait(share)
        squares = wp.float64(0.0)
        for k in range(bodies_of(share)):
            i = body_of(share, k)
            du = rows.u[i] - search.u[i]
            search.du[i] = du
            squares += wp.float64(du[0] * du[0] + du[1] * du[1] + du[2] * du[2])
        found = sum_of(share, wp.vec4d(squares, zero, zero, zero))
        return real(wp.sqrt(found[0] / wp.float64(wp.max(share.total, 1))))

    @wp.func
    def stabilize(rows: Rows, search: Search, share: Share, limits: Limits):
        for k in range(segments_of(share)):
            s = segment_of(share, k)
            for r in range(rows.base[s], flag(share, s, END)):
                search.p[r] = vec4()
        for k in range(bodies_of(share)):
            search.du[body_of(share, k)] = vec8()
        made = int(0)
        going = int(1)
        while going == 1:
            for k in range(segments_of(share)):
                s = segment_of(share, k)
                for r in range(rows.base[s], flag(share, s, END)):
                    search.z[r] = impulses(rows.b[r])
            for k in range(bodies_of(share)):
                i = body_of(share, k)
                search.u[i] = rows.u[i]
            sweep(rows, share, limits.still, 0)
            sweep(rows, share, limits.still, 1)
            made += 2
            c = curvatures(rows, search, share)
            g = slopes(rows, search, share)
            along, back = wp.float64(0.0), wp.float64(0.0)
            det = c[0] * c[2] - c[1] * c[1]
            # z and p of the same direction, as in the first step: along z alone
            if det > wp.float64(1.0e-6) * c[0] * c[2]:
                along = (g[1] * c[1] - g[0] * c[2]) / det
                back = (g[0] * c[1] - g[1] * c[0]) / det
            elif c[0] > wp.float64(0.0):
                along = -g[0] / c[0]
            moved = advance(rows, search, share, real(along), real(back))
            if moved <= limits.calm or made >= limits.stabilization_sweeps:
                going = 0
        return made

    return flows, stabilize
