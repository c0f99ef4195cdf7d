"""Projected Gauss-Seidel on velocities: accumulated normal and tangential impulses, Coulomb cone.

The cone counts the load that the position pass of the last step carried beside the normal impulse: where the sweeps do
not converge, that pass carries a part of the weight.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.rows import ImpulseOptions, row_types
from dembench.solver.types import types


@cache
def change_function(precision: str) -> Any:
    """Velocities of a body after an impulse at a lever, as a Warp function (u, impulse, n x impulse, lever) -> u."""
    t = types(precision)
    real, vec3, vec8 = t.real, t.vec3, t.vec8

    @wp.func
    def change(u: vec8, p: vec3, turn: vec3, arm: real):
        m, i = u[3], arm * u[7]
        return vec8(
            u[0] + m * p[0],
            u[1] + m * p[1],
            u[2] + m * p[2],
            u[3],
            u[4] - i * turn[0],
            u[5] - i * turn[1],
            u[6] - i * turn[2],
            u[7],
        )

    return change


@cache
def sweep_functions(o: ImpulseOptions) -> Any:
    """Warp functions (warm_start, sweep, remember).

    sweep(rows, count, reverse) visits every row once and returns the largest change of a relative velocity.
    """
    t = types(o.precision)
    real, vec3, vec4, vec8 = t.real, t.vec3, t.vec4, t.vec8
    Rows = row_types(o.precision)
    change = change_function(o.precision)
    friction = o.friction

    @wp.func
    def warm_start(rows: Rows, count: int):
        """Applies the impulses that the rows bring along from the last step."""
        for r in range(count):
            a, b = rows.a[r], rows.b[r]
            n = vec3(a[0], a[1], a[2])
            lt = vec3(b[4], b[5], b[6])
            if b[1] > real(0.0):
                i, j = rows.i[r], rows.j[r]
                p = b[1] * n + lt
                turn = vec3()
                if wp.static(friction):
                    turn = wp.cross(n, lt)
                rows.u[i] = change(rows.u[i], p, turn, a[7])
                rows.u[j] = change(rows.u[j], -p, turn, b[0])

    @wp.func
    def sweep(rows: Rows, count: int, reverse: int):
        largest = real(0.0)
        for q in range(count):
            r = q
            if reverse == 1:
                r = count - 1 - q
            a, b = rows.a[r], rows.b[r]
            i, j = rows.i[r], rows.j[r]
            ui, uj = rows.u[i], rows.u[j]
            n = vec3(a[0], a[1], a[2])
            v = vec3(ui[0] - uj[0], ui[1] - uj[1], ui[2] - uj[2])
            vn = wp.dot(v, n)
            ln = wp.max(real(0.0), b[1] + (a[3] - vn) * a[4])
            dn = ln - b[1]
            lt = vec3(b[4], b[5], b[6])
            p = dn * n
            turn = vec3()
            if wp.static(friction):
                s = vec3(
                    a[7] * ui[4] + b[0] * uj[4],
                    a[7] * ui[5] + b[0] * uj[5],
                    a[7] * ui[6] + b[0] * uj[6],
                )
                slip = v - vn * n + wp.cross(n, s)
                wanted = lt - a[5] * slip
                bound = a[6] * (ln + b[7])
                size2 = wp.dot(wanted, wanted)
                if size2 > bound * bound:
                    wanted = wanted * (bound / wp.sqrt(size2))
                dt = wanted - lt
                lt = wanted
                p = p + dt
                turn = wp.cross(n, dt)
            if wp.dot(p, p) > real(0.0):
                rows.u[i] = change(ui, p, turn, a[7])
                rows.u[j] = change(uj, -p, turn, b[0])
                rows.b[r] = vec8(b[0], ln, b[2], b[3], lt[0], lt[1], lt[2], b[7])
                largest = wp.max(largest, wp.length(p) / a[4])
        return largest

    @wp.func
    def remember(rows: Rows, first: int, last: int, memory: wp.array(dtype=vec4)):
        """Keeps the impulses of rows first..last, and the load of the position pass, for the next step."""
        for r in range(first, last):
            a, b = rows.a[r], rows.b[r]
            push = rows.push[r]
            memory[rows.slot[r]] = vec4(b[4] + push * a[0], b[5] + push * a[1], b[6] + push * a[2], b[1])

    return warm_start, sweep, remember
