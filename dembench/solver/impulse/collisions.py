"""The collision phase: pairs that meet faster than the event speed collide one after the other.

Every visit takes the approach speed of that moment for a collision of its own, so a blow travels through a chain of
touching grains as it does through real ones, and the order of the rows does not decide who leaves. The law of one
collision is Walton's: normal impulse (1 + e) m* |vn|; tangential impulse (1 + beta) m_t |vt|, at most mu times the
normal one (Walton 1993; Foerster et al. 1994, doi 10.1063/1.868282). No collision creates energy.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.rows import ImpulseOptions, row_types
from dembench.solver.impulse.sweeps import change_function
from dembench.solver.types import types


@cache
def collide_function(o: ImpulseOptions) -> Any:
    """A Warp function (rows, count, event, sweep) that returns the number of collisions.

    Sweep 0 visits every row; the later ones, in alternating direction, those of a body that collided since.
    """
    t = types(o.precision)
    real, vec3 = t.real, t.vec3
    Rows = row_types(o.precision)
    change = change_function(o.precision)
    friction = o.friction

    @wp.func
    def collide(rows: Rows, count: int, event: real, sweep: int):
        hits = int(0)
        for q in range(count):
            r = q
            if sweep % 2 == 1:
                r = count - 1 - q
            i, j = rows.i[r], rows.j[r]
            if wp.max(rows.hit[i], rows.hit[j]) < sweep:
                continue
            a = rows.a[r]
            ui, uj = rows.u[i], rows.u[j]
            n = vec3(a[0], a[1], a[2])
            v = vec3(ui[0] - uj[0], ui[1] - uj[1], ui[2] - uj[2])
            vn = wp.dot(v, n)
            # a gap that stays open within the step has a target below the approach speed
            if vn < wp.min(-event, a[3]):
                b = rows.b[r]
                normal = -(real(1.0) + b[2]) * vn * a[4]
                p = normal * n
                turn = vec3()
                if wp.static(friction):
                    s = vec3(
                        a[7] * ui[4] + b[0] * uj[4],
                        a[7] * ui[5] + b[0] * uj[5],
                        a[7] * ui[6] + b[0] * uj[6],
                    )
                    slip = v - vn * n + wp.cross(n, s)
                    lt = -(real(1.0) + b[3]) * a[5] * slip
                    bound = a[6] * normal
                    size2 = wp.dot(lt, lt)
                    if size2 > bound * bound:
                        lt = lt * (bound / wp.sqrt(size2))
                    p = p + lt
                    turn = wp.cross(n, lt)
                rows.u[i] = change(ui, p, turn, a[7])
                rows.u[j] = change(uj, -p, turn, b[0])
                rows.hit[i] = sweep + 1
                rows.hit[j] = sweep + 1
                hits += 1
        return hits

    return collide
