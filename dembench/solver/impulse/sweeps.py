"""Projected Gauss-Seidel on velocities: accumulated normal and tangential impulses, Coulomb cone.

The cone counts the load that the position pass of the last step carried beside the normal impulse: where the sweeps do
not converge, that pass carries a part of the weight.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.impulse.exchange import impulse_function
from dembench.solver.impulse.row_lanes import lane_functions
from dembench.solver.impulse.rows import ImpulseOptions, row_access, row_types
from dembench.solver.impulse.segments import BLOCKS, END, REST, Share, flag, joining_functions
from dembench.solver.types import types


@cache
def row_arithmetic(o: ImpulseOptions) -> Any:
    """What all visits of a row share, as Warp functions.

    velocity(ui, uj, n, ri, rj): velocity of the surface of i past that of j at the contact; its part along n is that of
    the centres. apply(rows, i, j, ui, uj, n, ri, rj, normal, tangential): adds an impulse, a length along n and a
    vector across it, to i and takes it from j. in_cone(impulse, bound): the tangential impulse cut to the bound.
    """
    t = types(o.precision)
    real, vec3, vec8 = t.real, t.vec3, t.vec8
    Rows = row_types(o.precision)
    set_state = row_access(o.precision).set_state
    change = impulse_function(o.precision)
    friction = o.friction

    @wp.func
    def velocity(ui: vec8, uj: vec8, n: vec3, ri: real, rj: real):
        v = vec3(ui[0] - uj[0], ui[1] - uj[1], ui[2] - uj[2])
        if wp.static(friction):
            s = vec3(ri * ui[4] + rj * uj[4], ri * ui[5] + rj * uj[5], ri * ui[6] + rj * uj[6])
            v = v + wp.cross(n, s)
        return v

    @wp.func
    def apply(rows: Rows, i: int, j: int, ui: vec8, uj: vec8, n: vec3, ri: real, rj: real, normal: real, across: vec3):
        p = normal * n
        turn = vec3()
        if wp.static(friction):
            p = p + across
            turn = wp.cross(n, across)
        set_state(rows, i, change(ui, p, turn, ri))
        set_state(rows, j, change(uj, -p, turn, rj))

    @wp.func
    def in_cone(impulse: vec3, bound: real):
        size2 = wp.dot(impulse, impulse)
        out = impulse
        if size2 > bound * bound:
            out = impulse * (bound / wp.sqrt(size2))
        return out

    return SimpleNamespace(velocity=velocity, apply=apply, in_cone=in_cone)


@cache
def sweep_functions(o: ImpulseOptions) -> Any:
    """Warp functions (warm_start, sweep, remember), which all threads call.

    sweep(rows, share, still, reverse) visits every row once and returns in how many a relative velocity changed by more
    than `still`. In each segment the rows in blocks come first, the others then, and the bridge comes last; `reverse`
    turns all of this around.
    """
    t = types(o.precision)
    real, vec3, vec4, vec8 = t.real, t.vec3, t.vec4, t.vec8
    Rows = row_types(o.precision)
    arithmetic, lanes = row_arithmetic(o), lane_functions(o)
    velocity, apply, in_cone = arithmetic.velocity, arithmetic.apply, arithmetic.in_cone
    sweep_blocks, blocks_at, outside = lanes.velocities, lanes.blocks_at, lanes.outside
    joining, bridged = joining_functions(o.threads), o.bridged
    wait, give, joined = joining.wait, joining.give, joining.total
    access = row_access(o.precision)
    first, second, state = access.first, access.second, access.state
    constants, impulses, set_impulses = access.constants, access.impulses, access.set_impulses
    friction = o.friction

    @wp.func
    def apply_rows(rows: Rows, begin: int, end: int):
        for r in range(begin, end):
            b = rows.b[r]
            if b[1] > real(0.0):
                a = rows.a[r]
                i, j = rows.i[r], rows.j[r]
                n = vec3(a[0], a[1], a[2])
                apply(rows, i, j, rows.u[i], rows.u[j], n, a[7], b[0], b[1], vec3(b[4], b[5], b[6]))

    @wp.func
    def warm_start(rows: Rows, share: Share):
        """Applies the impulses that the rows bring along from the last step."""
        apply_rows(rows, rows.base[share.part], flag(share, share.part, END))
        if wp.static(bridged):
            wait(share)
            if share.part == 0:
                apply_rows(rows, rows.base[share.parts], flag(share, share.parts, END))
            wait(share)

    @wp.func
    def sweep_rest(rows: Rows, begin: int, rest: int, still: real, reverse: int):
        changed = int(0)
        for q in range(rest):
            r = rows.order[begin + q]
            if reverse == 1:
                r = rows.order[begin + rest - 1 - q]
            a, b = constants(rows, r), impulses(rows, r)
            i, j = first(rows, r), second(rows, r)
            ui, uj = state(rows, i), state(rows, j)
            n = vec3(a[0], a[1], a[2])
            v = velocity(ui, uj, n, a[7], b[0])
            vn = wp.dot(v, n)
            ln = wp.max(real(0.0), b[1] + (wp.min(a[3], real(0.0)) - vn) * a[4])
            normal = ln - b[1]
            lt, across = vec3(), vec3()
            if wp.static(friction):
                old = vec3(b[4], b[5], b[6])
                lt = in_cone(old - a[5] * (v - vn * n), a[6] * (ln + b[7]))
                across = lt - old
            size2 = normal * normal + wp.dot(across, across)
            if size2 > real(0.0):
                apply(rows, i, j, ui, uj, n, a[7], b[0], normal, across)
                set_impulses(rows, r, vec8(b[0], ln, b[2], b[3], lt[0], lt[1], lt[2], b[7]))
                if size2 > still * still * a[4] * a[4]:
                    changed += 1
        return changed

    @wp.func
    def sweep_segment(rows: Rows, share: Share, segment: int, still: real, reverse: int):
        changed, blocks = int(0), flag(share, segment, BLOCKS)
        if reverse == 0:
            changed = sweep_blocks(rows, blocks_at(rows, segment), blocks, still, 0)
        changed += sweep_rest(rows, outside(rows, segment), flag(share, segment, REST), still, reverse)
        if reverse == 1:
            changed += sweep_blocks(rows, blocks_at(rows, segment), blocks, still, 1)
        return changed

    @wp.func
    def sweep(rows: Rows, share: Share, still: real, reverse: int):
        changed = int(0)
        if wp.static(bridged):
            if reverse == 1:
                if share.part == 0:
                    changed += sweep_segment(rows, share, share.parts, still, 1)
                wait(share)
        changed += sweep_segment(rows, share, share.part, still, reverse)
        if wp.static(bridged):
            give(share, wp.vec4d(wp.float64(changed)))
            if reverse == 0 and share.part == 0:
                changed += sweep_segment(rows, share, share.parts, still, 0)
            changed = int(joined(share, wp.vec4d(wp.float64(changed)))[0])
        return changed

    @wp.func
    def remember(rows: Rows, begin: int, end: int, memory: wp.array(dtype=vec4)):
        """Keeps the impulses of rows begin..end, and the load of the position pass, for the next step."""
        for r in range(begin, end):
            a, b = rows.a[r], rows.b[r]
            # more than the normal impulse is not a load but an overlap that relaxes
            push = wp.min(rows.push[r], b[1])
            memory[rows.slot[r]] = vec4(b[4] + push * a[0], b[5] + push * a[1], b[6] + push * a[2], b[1])

    return warm_start, sweep, remember
