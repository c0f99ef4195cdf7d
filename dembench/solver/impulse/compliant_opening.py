"""The rows of a substep, opened in its middle: after the first half of the drift.

A row is kept for every pair whose spheres overlap at either end of the way that they go with the velocities of the
start, with the normal in the middle of it. Every row begins with the elastic impulse there: without any sweep the
substep would be one of position Verlet.

The overlap of a row is the mean of those at both ends of the way, so that a row begins with the energy that the one
before has left. Spheres that pass each other are nearer in the middle, by the sagitta (h vt)^2/(8 L) of their way about
each other, with the tangential speed vt and the distance L of their centres; so it is at mantles and edges.

The spring grows by the sliding of the motion that was really made, the velocities after all rows, and not by that which
a row foresaw: the energy in it is then the work of the motion.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.impulse.compliant_rows import (
    AHEAD,
    CompliantOptions,
    compliant_access,
    compliant_types,
)
from dembench.solver.impulse.exchange import impulse_function
from dembench.solver.laws import surface_functions
from dembench.solver.pairs import pair_lookup, radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.types import types, vec8d
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import Walls


@cache
def opening_functions(o: CompliantOptions) -> Any:
    """Warp functions `pairs`, `bigs` and `walls` that write rows of a substep, `first` being the first of them.

    They return where the rows end, and the first two also the largest overlap. Each applies the impulses with which its
    rows begin, and forgets the memory of contacts that are open. `shift`: see `compliant_types`.
    """
    precision = o.law.precision
    t = types(precision)
    real, vec3, vec4, vec8 = t.real, t.vec3, t.vec4, t.vec8
    Bodies, PairClass, Lists = t.Bodies, t.PairClass, t.Lists
    Rows = compliant_types(precision)
    native = compliant_access(precision, o.rotation)
    kin, spin, memory_of, set_memory, entry = (
        native.kin,
        native.spin,
        native.memory_of,
        native.set_memory,
        native.entry,
    )
    change_of, set_change, set_impulse, put = native.change_of, native.set_change, native.set_impulse, native.put
    ask_body = native.ask_body
    after = impulse_function(precision)
    of_pair, of_wall = pair_lookup(precision, o.pairs, o.radii)
    of_feature = wall_functions(o.walls)
    separation = image_functions(precision, o.periodic).separation
    surface = surface_functions(o.law)
    arm_of, spring_of = surface.arm, surface.spring
    distance_of, velocity_of = of_feature.distance, of_feature.velocity
    mean_distance_of = of_feature.mean_distance
    radius = radius_function(precision, o.radii)
    friction, linear, shared = o.law.friction, o.law.linear, o.shared

    @wp.func
    def first_impulse(n: vec3, overlap: real, xi: vec3, c: PairClass, h: real):
        """Elastic impulse of an overlap and a spring, within the bound of Coulomb."""
        p = vec3()
        if overlap > real(0.0):
            root = real(1.0)
            if wp.static(not linear):
                root = wp.sqrt(overlap)
            normal = h * c.kn * overlap * root
            p = normal * n
            if wp.static(friction):
                lt = (-h * c.kt * root) * xi
                bound = c.mu * normal
                size2 = wp.dot(lt, lt)
                if size2 > bound * bound:
                    lt = lt * (bound / wp.sqrt(size2))
                p = p + lt
        return p

    @wp.func
    def sagitta(v: vec3, vn: real, h: real, distance: real):
        return real(0.125) * h * h * (wp.dot(v, v) - vn * vn) / distance

    @wp.func
    def open_row(
        rows: Rows,
        at: int,
        i: int,
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
        """Writes a row; returns the impulse with which it begins."""
        half = real(0.5) * h
        vn = wp.dot(v, n)
        g = v
        xi = vec3()
        if wp.static(friction):
            g = v + wp.cross(n, ai * wi + aj * wj)
            if memory[3] != real(0.0):
                xi = spring_of(memory, n, g - vn * n, real(0.5) * grown)
        p = first_impulse(n, overlap, xi + half * (g - vn * n), c, h)
        put(rows, at, i, j, slot, vec8(n[0], n[1], n[2], overlap, g[0], g[1], g[2], ai))
        set_impulse(rows, at, vec8(xi[0], xi[1], xi[2], aj, p[0], p[1], p[2], real(0.0)))
        return p

    @wp.func
    def pairs(
        b: Bodies,
        lists: Lists,
        base: int,
        count: int,
        one: PairClass,
        table: wp.array(dtype=PairClass),
        columns: int,
        h: real,
        grown: real,
        reach: wp.float64,
        rows: Rows,
        first: int,
        shift: int,
    ):
        """Rows of the near pairs of a region, sorted by i: what concerns i is read and written once per run.

        No two small bodies approach by more than `reach` within the substep; `one` are the constants that all pairs
        share, where they do.
        """
        found = int(first)
        largest = real(0.0)
        current = int(-1)
        ki = vec8d()
        ui = vec8()
        wi = vec3()
        c = PairClass()
        if wp.static(shared):
            c = one
        for q in range(count):
            k = entry(lists.near, base + q)
            i, j = entry(lists.i, k), entry(lists.j, k)
            if q + AHEAD < count:
                ask_body(b, rows, entry(lists.j, entry(lists.near, base + q + AHEAD)))
            if i != current:
                if current >= 0:
                    set_change(rows, current, ui)
                current = i + 0
                ki = kin(b, i)
                ui = change_of(rows, i)
                if wp.static(friction):
                    w = spin(b, i)
                    wi = vec3(w[0], w[1], w[2])
            kj = kin(b, j)
            d = separation(b, ki, kj)
            ri, rj = radius(b, ki), radius(b, kj)
            sum = ri + rj
            r2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
            kept = int(0)
            if r2 < (sum + reach) * (sum + reach):
                # (sum^2 - r^2)/(sum + r) keeps the overlap exact in single precision where sum - r would not
                e = vec3(real(d[0]), real(d[1]), real(d[2]))
                r = wp.length(e)
                overlap = real(sum * sum - r2) / (real(sum) + r)
                n = vec3(real(1.0), real(0.0), real(0.0))
                if r > real(0.0):
                    n = e * (real(1.0) / r)
                v = vec3(real(d[3]), real(d[4]), real(d[5]))
                vn = wp.dot(v, n)
                mean = overlap - sagitta(v, vn, h, real(sum))
                if mean + real(0.5) * h * wp.abs(vn) > real(0.0):
                    kept = 1
                    wj = vec3()
                    if wp.static(friction):
                        s = spin(b, j)
                        wj = vec3(s[0], s[1], s[2])
                    if wp.static(not shared):
                        c = of_pair(b, i, j, table, columns)
                        rows.c[found - shift] = c
                    ai, aj = arm_of(ri, overlap), arm_of(rj, overlap)
                    m = vec4()
                    if wp.static(friction):
                        m = memory_of(lists, k)
                    p = open_row(rows, found, i, j, k, n, mean, v, wi, wj, ai, aj, m, c, h, grown)
                    found += 1
                    largest = wp.max(largest, overlap)
                    turn = wp.cross(n, p)
                    ui = after(ui, p, turn, ai)
                    set_change(rows, j, after(change_of(rows, j), -p, turn, aj))
            if wp.static(friction):
                if kept == 0 and memory_of(lists, k)[3] != real(0.0):
                    set_memory(lists.memory, k, vec4())
        if current >= 0:
            set_change(rows, current, ui)
        return found, largest

    @wp.func
    def bigs(
        b: Bodies,
        lists: Lists,
        count: int,
        n_small: int,
        total: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        h: real,
        grown: real,
        rows: Rows,
        first: int,
        shift: int,
    ):
        """Rows of the candidates of large bodies."""
        found = int(first)
        largest = real(0.0)
        for q in range(count):
            i, j = lists.big_i[q], lists.big_j[q]
            slot = (j - n_small) * total + i
            ki, kj = kin(b, i), kin(b, j)
            d = separation(b, ki, kj)
            ri, rj = radius(b, ki), radius(b, kj)
            sum = ri + rj
            inside = sum * sum - (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            e = vec3(real(d[0]), real(d[1]), real(d[2]))
            r = wp.length(e)
            overlap = real(inside) / (real(sum) + r)
            n = vec3(real(1.0), real(0.0), real(0.0))
            if r > real(0.0):
                n = e * (real(1.0) / r)
            v = vec3(real(d[3]), real(d[4]), real(d[5]))
            memory, wi, wj = vec4(), vec3(), vec3()
            if wp.static(friction):
                memory = lists.big_memory[slot]
                si, sj = spin(b, i), spin(b, j)
                wi, wj = vec3(si[0], si[1], si[2]), vec3(sj[0], sj[1], sj[2])
            vn = wp.dot(v, n)
            mean = overlap - sagitta(v, vn, h, real(sum))
            if mean + real(0.5) * h * wp.abs(vn) > real(0.0):
                c = of_pair(b, i, j, table, columns)
                rows.c[found - shift] = c
                ai, aj = arm_of(ri, overlap), arm_of(rj, overlap)
                p = open_row(rows, found, i, j, slot, n, mean, v, wi, wj, ai, aj, memory, c, h, grown)
                found += 1
                largest = wp.max(largest, overlap)
                turn = wp.cross(n, p)
                set_change(rows, i, after(change_of(rows, i), p, turn, ai))
                set_change(rows, j, after(change_of(rows, j), -p, turn, aj))
            elif wp.static(friction):
                if memory[3] != real(0.0):
                    lists.big_memory[slot] = vec4()
        return found, largest

    @wp.func
    def walls(
        b: Bodies,
        lists: Lists,
        base: int,
        count: int,
        features: Walls,
        poses: int,
        fixed: int,
        table: wp.array(dtype=PairClass),
        columns: int,
        h: real,
        grown: real,
        fall: real,
        rows: Rows,
        first: int,
        shift: int,
    ):
        """Rows of the bodies of a thread at walls, whose poses begin at `poses`.

        `fixed` is the index of what does not move, and `fall` what gravity adds to a speed within the substep.
        """
        found = int(first)
        for q in range(base, base + count):
            i, f = lists.wall_i[q], lists.wall_f[q]
            k = kin(b, i)
            x = wp.vec3d(k[0], k[1], k[2])
            distance, normal = distance_of(features, f, poses, x)
            radius_i = radius(b, k)
            overlap = real(radius_i - distance)
            n = vec3(real(normal[0]), real(normal[1]), real(normal[2]))
            ai = arm_of(radius_i, overlap)
            dv = wp.vec3d(k[3], k[4], k[5]) - velocity_of(features, f, poses, x - wp.float64(ai) * normal)
            v = vec3(real(dv[0]), real(dv[1]), real(dv[2]))
            mean = overlap
            if overlap + h * (wp.length(v) + fall) > real(0.0):
                way = wp.float64(h) * wp.vec3d(k[3], k[4], k[5])
                mean = real(radius_i - mean_distance_of(features, f, poses, x, way, wp.float64(h), distance, normal))
            memory, w = vec4(), vec3()
            if wp.static(friction):
                memory = lists.wall_memory[q]
                s = spin(b, i)
                w = vec3(s[0], s[1], s[2])
            if mean + real(0.5) * h * (wp.abs(wp.dot(v, n)) + fall) > real(0.0):
                c = of_wall(b, i, features.features[f].kind, table, columns)
                rows.c[found - shift] = c
                p = open_row(
                    rows,
                    found,
                    i,
                    fixed,
                    q,
                    n,
                    mean,
                    v,
                    w,
                    vec3(),
                    ai,
                    real(0.0),
                    memory,
                    c,
                    h,
                    grown,
                )
                found += 1
                set_change(rows, i, after(change_of(rows, i), p, wp.cross(n, p), ai))
            elif wp.static(friction):
                if memory[3] != real(0.0):
                    lists.wall_memory[q] = vec4()
        return found

    return SimpleNamespace(pairs=pairs, bigs=bigs, walls=walls)
