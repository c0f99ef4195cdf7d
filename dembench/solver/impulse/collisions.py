"""The collision phase: pairs that meet faster than the event speed collide one after the other.

Every visit takes the approach speed of that moment for a collision of its own, so a blow travels through a chain of
touching grains as it does through real ones, and the order of the rows does not decide who leaves. The law of one
collision is Walton's: normal impulse (1 + e) m* |vn|; tangential impulse (1 + beta) m_t |vt|, at most mu times the
normal one (Walton 1993; Foerster et al. 1994, doi 10.1063/1.868282). No collision creates energy.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.rows import ImpulseOptions, limit_types, row_types
from dembench.solver.impulse.sweeps import row_arithmetic
from dembench.solver.types import types


@cache
def collide_function(o: ImpulseOptions) -> Any:
    """A Warp function (rows, count, limits, sweep) that returns the number of collisions and the sum of the normal
    impulses of the fast ones.

    Sweep 0 visits every row; the later ones, in alternating direction, those of a body that collided since.
    """
    t = types(o.precision)
    real, vec3 = t.real, t.vec3
    Rows, Limits = row_types(o.precision), limit_types(o.precision)
    arithmetic = row_arithmetic(o)
    loads = o.walls.loads
    velocity, apply, in_cone = arithmetic.velocity, arithmetic.apply, arithmetic.in_cone

    @wp.func
    def collide(rows: Rows, count: int, limits: Limits, sweep: int):
        hits = int(0)
        blow = real(0.0)
        for q in range(count):
            r = q
            if sweep % 2 == 1:
                r = count - 1 - q
            i, j = rows.i[r], rows.j[r]
            if wp.max(rows.hit[i], rows.hit[j]) < sweep:
                continue
            a, b = rows.a[r], rows.b[r]
            ui, uj = rows.u[i], rows.u[j]
            n = vec3(a[0], a[1], a[2])
            v = velocity(ui, uj, n, a[7], b[0])
            vn = wp.dot(v, n)
            # a gap that stays open within the step needs a faster approach
            if vn < wp.min(-limits.event, a[3]):
                normal = -(real(1.0) + b[2]) * vn * a[4]
                across = in_cone(-(real(1.0) + b[3]) * a[5] * (v - vn * n), a[6] * normal)
                apply(rows, i, j, ui, uj, n, a[7], b[0], normal, across)
                if wp.static(loads):
                    rows.blow[r] = rows.blow[r] + normal * n + across
                rows.hit[i] = sweep + 1
                rows.hit[j] = sweep + 1
                hits += 1
                if vn < -limits.fast:
                    blow += normal
        return hits, blow

    return collide
