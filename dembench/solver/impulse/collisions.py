"""The collision phase: pairs that meet faster than the event speed collide one after the other.

Every visit takes the approach speed of that moment for a collision of its own, so a blow travels through a chain of
touching grains as it does through real ones, and the order of the rows does not decide who leaves. The law of one
collision is Walton's: normal impulse (1 + e) m* |vn|; tangential impulse (1 + beta) m_t |vt|, at most mu times the
normal one (Walton 1993; Foerster et al. 1994, doi 10.1063/1.868282). No collision creates energy.
"""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.impulse.row_opening import PASSING
from dembench.solver.impulse.rows import ImpulseOptions, limit_types, row_access, row_types
from dembench.solver.impulse.segments import END, Share, flag, joining_functions, segment_of, segments_of
from dembench.solver.impulse.sweeps import row_arithmetic
from dembench.solver.types import types, vec8d


@cache
def collide_function(o: ImpulseOptions) -> Any:
    """A Warp function (bodies, rows, share, limits, dt), which all threads call: it returns the number of collisions
    and the sum of the normal impulses of the fast ones.

    Sweep 0 visits every row; the later ones, in alternating direction, those of a body that collided since, until none
    does; in each the bridge comes last. A body that
    meets a wall or a held body moves with its old velocity until the gap is closed and with the new one from then on:
    its place at the start of the step is shifted to where its new path would have begun, else a bounce turns above the
    floor. So do two free bodies that pass each other: their normal is that of the touch, and the shift keeps their
    angular momentum. Others fall together, and it would gain nothing. At the end the shifts go into the gaps of all
    rows.
    """
    t = types(o.precision)
    real, vec3, vec8, Bodies = t.real, t.vec3, t.vec8, t.Bodies
    Rows, Limits = row_types(o.precision), limit_types(o.precision)
    arithmetic = row_arithmetic(o)
    access = row_access(o.precision)
    first, second, state, collided = access.first, access.second, access.state, access.collided
    constants, impulses = access.constants, access.impulses
    loads, bridged = o.walls.loads, o.bridged
    joining = joining_functions(o.threads)
    give, joined = joining.give, joining.total
    velocity, apply, in_cone = arithmetic.velocity, arithmetic.apply, arithmetic.in_cone

    @wp.func
    def shift(b: Bodies, i: int, way: vec3):
        """Moves a body by `way` times its inverse mass."""
        k, m = b.kin[i], wp.float64(b.inv_m[i])
        x, y, z = wp.float64(way[0]), wp.float64(way[1]), wp.float64(way[2])
        b.kin[i] = vec8d(k[0] + m * x, k[1] + m * y, k[2] + m * z, k[3], k[4], k[5], k[6], k[7])

    @wp.func
    def shifted(b: Bodies, rows: Rows, i: int):
        k, x = b.kin[i], rows.x[i]
        return vec3(real(k[0] - x[0]), real(k[1] - x[1]), real(k[2] - x[2]))

    @wp.func
    def nearer(b: Bodies, total: int, rows: Rows, i: int, j: int, n: vec3):
        """How much shorter the shifts of both bodies have made the gap."""
        s = shifted(b, rows, i)
        if j < total:
            s = s - shifted(b, rows, j)
        return -wp.dot(s, n)

    @wp.func
    def close(b: Bodies, total: int, rows: Rows, begin: int, end: int, dt: real):
        for r in range(begin, end):
            i, j = first(rows, r), second(rows, r)
            if wp.max(collided(rows, i), collided(rows, j)) > 0:
                a = constants(rows, r)
                target = a[3] + nearer(b, total, rows, i, j, vec3(a[0], a[1], a[2])) / dt
                rows.a[r] = vec8(a[0], a[1], a[2], target, a[4], a[5], a[6], a[7])

    @wp.func
    def visit(b: Bodies, total: int, rows: Rows, begin: int, end: int, limits: Limits, dt: real, sweep: int):
        hits = int(0)
        blow = real(0.0)
        for q in range(begin, end):
            r = q
            if sweep % 2 == 1:
                r = begin + end - 1 - q
            i, j = first(rows, r), second(rows, r)
            if wp.max(collided(rows, i), collided(rows, j)) < sweep:
                continue
            a, c = constants(rows, r), impulses(rows, r)
            ui, uj = state(rows, i), state(rows, j)
            n = vec3(a[0], a[1], a[2])
            v = velocity(ui, uj, n, a[7], c[0])
            vn = wp.dot(v, n)
            if vn >= -limits.event:
                continue
            # a gap that stays open within the step needs a faster approach
            target = a[3] + nearer(b, total, rows, i, j, n) / dt
            if vn < wp.min(target, real(0.0)):
                normal = -(real(1.0) + c[2]) * vn * a[4]
                across = in_cone(-(real(1.0) + c[3]) * a[5] * (v - vn * n), a[6] * normal)
                apply(rows, i, j, ui, uj, n, a[7], c[0], normal, across)
                if wp.static(loads):
                    rows.blow[r] = rows.blow[r] + normal * n + across
                sideways = vec3(ui[0] - uj[0], ui[1] - uj[1], ui[2] - uj[2])
                passing = wp.length(sideways - vn * n) * target * dt / vn > real(PASSING) * (a[7] + c[0])
                if target < real(0.0) and (passing or ui[3] * uj[3] == real(0.0)):
                    way = -dt * target / vn * (normal * n + across)
                    shift(b, i, way)
                    if j < total:
                        shift(b, j, -way)
                rows.hit[i] = sweep + 1
                rows.hit[j] = sweep + 1
                hits += 1
                if vn < -limits.fast:
                    blow += normal
        return hits, blow

    @wp.func
    def collide(b: Bodies, rows: Rows, share: Share, limits: Limits, dt: real):
        own, own_end = rows.base[share.part] + 0, flag(share, share.part, END)
        bridge, bridge_end = rows.base[share.parts] + 0, flag(share, share.parts, END)
        sweep, hits, blow = int(0), int(0), real(0.0)
        going = int(1)
        while going == 1:
            more, hard = visit(b, share.total, rows, own, own_end, limits, dt, sweep)
            found = wp.vec4d(wp.float64(more), wp.float64(hard), wp.float64(0.0), wp.float64(0.0))
            if wp.static(bridged):
                give(share, found)
                if share.part == 0:
                    more, hard = visit(b, share.total, rows, bridge, bridge_end, limits, dt, sweep)
                    found += wp.vec4d(wp.float64(more), wp.float64(hard), wp.float64(0.0), wp.float64(0.0))
                found = joined(share, found)
            hits += int(found[0])
            blow += real(found[1])
            sweep += 1
            if found[0] == wp.float64(0.0) or sweep >= wp.max(limits.velocity_sweeps, 1):
                going = 0
        if hits > 0:
            for k in range(segments_of(share)):
                s = segment_of(share, k)
                close(b, share.total, rows, rows.base[s], flag(share, s, END), dt)
        return hits, blow

    return collide
