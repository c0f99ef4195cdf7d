"""Compliant rows on full lists: each body solves its own contacts, all at once, until they agree (Jacobi).

The law of a row is that of the half lists, see `impulse/compliant_sweep.py`. Both bodies of a pair keep the row, in the
order lower index, higher index, and find its impulse with identical arithmetic from the velocities that the sweep
before has left: no thread writes what another one reads, momentum is kept to the rounding of sums, and the bits of a
result hang on no order.

Plain Jacobi sweeps may diverge where a body has many contacts. Mass splitting (Tonge, Benevolenski & Voroshilov 2012,
doi 10.1145/2185520.2185601): a body with n rows gives each of them a part m/n of its mass, and takes the sum of their
impulses with its whole mass. With A, the inverse mass that all rows see together, and D, its blocks of single rows with
split masses, A <= D by the inequality of Cauchy and Schwarz, and Jacobi sweeps converge for D > A/2, to which both the
compliance of the rows adds. So parts of 2 m/n, at most m, are enough. In a dense bed in twice the substep that its
contacts ask for, 50 sweeps then leave 1e-6 of the impulses; 69 with m/n; whole masses stall. In four times of it they
diverge. Colours (Gauss-Seidel) would need fewer sweeps but several launches for each, and as many of them as a large
body has neighbours.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.impulse.compliant_opening import opening_functions
from dembench.solver.impulse.compliant_rows import CompliantOptions
from dembench.solver.impulse.compliant_sweep import NEWTON, SQUARES
from dembench.solver.laws import surface_functions
from dembench.solver.types import types

SHUT = wp.constant(-1)
"""Slot of the row of a large body's candidate that is too far away."""
WALL = wp.constant(-1)
"""In place of the other body where a row is one of a wall."""


@cache
def full_rows_type(precision: str) -> Any:
    """Record of the rows.

    Those of body i, `count` in number, stand at [k total + i]; behind them there is one for each candidate of a large
    body. j: the other body or WALL; slot: place of the contact memory. In the rows the first body is that of the lower
    index, or the one at a wall.

    a: normal from the second body to the first (0-2), overlap in the middle of the substep (negative: gap), velocity of
    the surface of the first past that of the second (4-6) at its start, lever arm of the first (7). b: tangential
    spring (0-2), lever arm of the second (3), impulse on the first (4-6). c: constants of the contact.

    u: change of velocity in the substep (0-2), inverse mass, change of angular velocity (4-6), inverse moment of
    inertia; of all bodies, twice: sweeps read one half and write the other. parts: into how many each body is split.
    """
    t = types(precision)
    vec8 = t.vec8

    class FullRows:
        count: wp.array(dtype=wp.int32)
        j: wp.array(dtype=wp.int32)
        slot: wp.array(dtype=wp.int32)
        a: wp.array(dtype=vec8)
        b: wp.array(dtype=vec8)
        c: wp.array(dtype=t.PairClass)
        u: wp.array(dtype=vec8)
        parts: wp.array(dtype=t.real)

    FullRows.__qualname__ = FullRows.__name__ = f"FullRows_{precision}"
    return wp.struct(FullRows)


@cache
def row_functions(o: CompliantOptions) -> Any:
    """Warp functions `put`, `solve`, `given` and `inertia`.

    put(rows, at, j, slot, ...) writes a row in the middle of a substep and returns the elastic impulse on its first
    body with which it begins; solve(rows, at, ui, uj, pi, pj, h) a row with the velocities and the parts of its two
    bodies, and returns its impulse on the first body, the change of that, the spring that it leaves and whether they
    touch at the end; given is what an impulse on a body changes; inertia(bodies, i) the inverse moment of inertia.
    """
    t = types(o.law.precision)
    real, vec3, vec4, vec8, Bodies, PairClass = t.real, t.vec3, t.vec4, t.vec8, t.Bodies, t.PairClass
    Rows = full_rows_type(o.law.precision)
    first_impulse, spring_of = opening_functions(o).first_impulse, surface_functions(o.law).spring
    rotation, friction, linear, no_tension = o.rotation, o.law.friction, o.law.linear, o.law.no_tension
    squares = wp.constant(SQUARES["linear" if linear else "hertz"])

    @wp.func
    def inertia(b: Bodies, i: int):
        g = real(0.0)
        if wp.static(rotation):
            g = b.inv_i[i]
        return g

    @wp.func
    def given(m: real, g: real, p: vec3, turn: vec3, arm: real):
        """Change of velocity and spin by an impulse p, with inverse mass m and moment of inertia g; turn is n x p."""
        z = real(0.0)
        s = z
        if wp.static(friction):
            s = -arm * g
        return vec8(m * p[0], m * p[1], m * p[2], z, s * turn[0], s * turn[1], s * turn[2], z)

    @wp.func
    def put(
        rows: Rows,
        at: int,
        j: int,
        slot: int,
        n: vec3,
        overlap: real,
        v: vec3,
        wi: vec3,
        wj: vec3,
        ai: real,
        aj: real,
        memory: vec4,
        c: PairClass,
        h: real,
        grown: real,
    ):
        half = real(0.5) * h
        vn = wp.dot(v, n)
        g = v
        xi = vec3()
        if wp.static(friction):
            g = v + wp.cross(n, ai * wi + aj * wj)
            if memory[3] != real(0.0):
                xi = spring_of(memory, n, g - vn * n, real(0.5) * grown)
        p = first_impulse(n, overlap, xi + half * (g - vn * n), c, h)
        rows.j[at] = j
        rows.slot[at] = slot
        rows.a[at] = vec8(n[0], n[1], n[2], overlap, g[0], g[1], g[2], ai)
        rows.b[at] = vec8(xi[0], xi[1], xi[2], aj, p[0], p[1], p[2], real(0.0))
        rows.c[at] = c
        return p

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
    def solve(rows: Rows, at: int, ui: vec8, uj: vec8, pi: real, pj: real, h: real):
        zero, half = real(0.0), real(0.5)
        a, b, c = rows.a[at] * real(1.0), rows.b[at] * real(1.0), rows.c[at]
        n = vec3(a[0], a[1], a[2])
        overlap, ai, aj = a[3], a[7], b[3]
        old = vec3(b[4], b[5], b[6])
        g = vec3(a[4] + ui[0] - uj[0], a[5] + ui[1] - uj[1], a[6] + ui[2] - uj[2])
        if wp.static(friction):
            s = vec3(ai * ui[4] + aj * uj[4], ai * ui[5] + aj * uj[5], ai * ui[6] + aj * uj[6])
            g = g + wp.cross(n, s)
        vn = wp.dot(g, n)
        whole, w = ui[3] + uj[3], pi * ui[3] + pj * uj[3]
        normal_old = wp.dot(old, n)
        free = vn - w * normal_old
        start = vec3(a[4], a[5], a[6])
        before = wp.dot(start, n)
        ahead = half * h
        first = overlap + ahead * before

        v, force, quarter = vn + zero, zero, zero
        for _k in range(wp.static(NEWTON)):
            value, slope, quarter, stiffness = normal_law(c, first, overlap - ahead * v)
            dashpot = c.dn * quarter * (real(1.0) + real(squares) * h * h * whole * stiffness)
            value = value - dashpot * half * (before + v)
            slope = half * (h * slope + dashpot)
            step = (free + w * h * value - v) / (real(1.0) + w * h * slope)
            force = value - slope * step
            v = v + step
        if wp.static(no_tension):
            force = wp.max(force, zero)
        p = (h * force) * n
        xi = vec3()
        left = overlap - ahead * v
        if wp.static(friction):
            xi = vec3(b[0], b[1], b[2])
            lt = old - normal_old * n
            wt = w + ai * ai * pi * ui[7] + aj * aj * pj * uj[7]
            slid, slip = start - before * n, g - vn * n
            kt = zero
            touching = touching_share(first, left)
            if wp.static(linear):
                kt = touching * c.kt
            elif left > zero:
                kt = touching * c.kt * wp.sqrt(left)
            resist = half * touching * kt * h + c.dt * quarter
            # how far the spring would be stretched is asked with whole masses: with parts, the law would depend on them
            whole_t = whole + ai * ai * ui[7] + aj * aj * uj[7]
            other, rest = slip - whole_t * lt, slip - wt * lt
            stuck = (kt * xi + half * resist * (slid + other)) * (-h / (real(1.0) + ahead * resist * whole_t))
            end = xi + touching * ahead * (slid + other + whole_t * stuck)
            lt = (kt * xi + half * resist * (slid + rest)) * (-h / (real(1.0) + ahead * resist * wt))
            bound = c.mu * wp.abs(force)
            stretched = kt * kt * wp.dot(end, end)
            if bound == zero:
                # also where no spring is stretched any more: a dashpot needs friction, too
                end = vec3()
                lt = vec3()
                stuck = vec3()
            elif stretched > bound * bound:
                end = end * (bound / wp.sqrt(stretched))
                lt = end * (-h * kt)
                stuck = lt * real(1.0)
            xi = end - ahead * (other + whole_t * stuck)
            p = p + lt
        touches = int(0)
        if left > zero:
            touches = 1
        rows.b[at] = vec8(b[0], b[1], b[2], b[3], p[0], p[1], p[2], zero)
        return p, p - old, xi, touches

    return SimpleNamespace(inertia=inertia, given=given, put=put, solve=solve)
