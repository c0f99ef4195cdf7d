"""The contacts of a soft-sphere state: evaluated by the functions of the step, which leave the memory as it is."""

from functools import cache
from typing import Any

import numpy as np
import warp as wp

from dembench.solver.contacts import StepOptions, force_functions
from dembench.solver.inspection import Touching
from dembench.solver.laws import contact_energy
from dembench.solver.pairs import pair_lookup
from dembench.solver.periodic import image_functions
from dembench.solver.types import types
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import Walls


@cache
def contact_kernel(o: StepOptions) -> Any:
    """The kernel that writes down every contact of the lists.

    `who`: the bodies i and j and the wall feature, -1 for what there is not; `where`: normal and overlap; `force`:
    force on i and elastic energy; `count`: number of contacts. The arrays must hold as many contacts as are listed.
    """
    t = types(o.law.precision)
    real, vec3, vec4 = t.real, t.vec3, t.vec4
    Bodies, PairClass, Lists = t.Bodies, t.PairClass, t.Lists
    functions = force_functions(o)
    pair, wall, spin = functions[0], functions[1], functions[2]
    of_pair, of_wall = pair_lookup(o.law.precision, o.pairs, o.radii)
    distance_of = wall_functions(o.walls).distance
    separation = image_functions(o.law.precision, o.periodic).separation
    energy_of = contact_energy(o.law)
    present, bigs, friction = o.walls.present, o.bigs, o.law.friction

    @wp.func
    def put_pair(
        b: Bodies,
        i: int,
        j: int,
        memory: vec4,
        table: wp.array(dtype=PairClass),
        columns: int,
        dt: real,
        found: int,
        who: wp.array(dtype=wp.vec3i),
        where: wp.array(dtype=vec4),
        force: wp.array(dtype=vec4),
    ):
        count = found
        ki, kj = b.kin[i], b.kin[j]
        c = of_pair(b, i, j, table, columns)
        on_i, _on_j, after, overlap = pair(b, i, j, ki, kj, spin(b, i), spin(b, j), memory, c, dt)
        if overlap > real(0.0):
            d = separation(b, ki, kj)
            e = vec3(real(d[0]), real(d[1]), real(d[2]))
            n = vec3(real(1.0), real(0.0), real(0.0))
            if wp.length(e) > real(0.0):
                n = wp.normalize(e)
            who[count] = wp.vec3i(i, j, -1)
            where[count] = vec4(n[0], n[1], n[2], overlap)
            force[count] = vec4(on_i[0], on_i[1], on_i[2], energy_of(overlap, after, c))
            count = count + 1
        return count

    @wp.kernel(enable_backward=False, module="unique")
    def inspect(
        # inputs
        parts: int,
        n: int,
        total: int,
        b: Bodies,
        lists: Lists,
        base: wp.array(dtype=wp.int32),
        pair_count: wp.array(dtype=wp.int32),
        wall_capacity: int,
        wall_count: wp.array(dtype=wp.int32),
        walls: Walls,
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        dt: real,
        # outputs
        who: wp.array(dtype=wp.vec3i),
        where: wp.array(dtype=vec4),
        force: wp.array(dtype=vec4),
        count: wp.array(dtype=wp.int32),
    ):
        found = int(0)
        for region in range(2 * parts):
            for k in range(base[region], base[region] + pair_count[region]):
                i, j, memory = lists.i[k], lists.j[k], vec4()
                if wp.static(friction):
                    memory = lists.memory[k]
                found = put_pair(b, i, j, memory, pair_table, pair_columns, dt, found, who, where, force)
        if wp.static(bigs):
            for j in range(n, total):
                for i in range(j):
                    kept = vec4()
                    if wp.static(friction):
                        kept = lists.big_memory[(j - n) * total + i]
                    found = put_pair(b, i, j, kept, pair_table, pair_columns, dt, found, who, where, force)
        if wp.static(present):
            for part in range(parts):
                for slot in range(part * wall_capacity, part * wall_capacity + wall_count[part]):
                    body, f = lists.wall_i[slot] + 0, lists.wall_f[slot] + 0
                    before = vec4()
                    if wp.static(friction):
                        before = lists.wall_memory[slot]
                    load, spring, depth = wall(b, body, walls, f, 0, before, wall_table, wall_columns, dt)
                    if depth > real(0.0):
                        at = b.kin[body]
                        _distance, n_wall = distance_of(walls, f, 0, wp.vec3d(at[0], at[1], at[2]))
                        of_body = of_wall(b, body, walls.features[f].kind, wall_table, wall_columns)
                        who[found] = wp.vec3i(body, -1, f)
                        where[found] = vec4(real(n_wall[0]), real(n_wall[1]), real(n_wall[2]), depth)
                        force[found] = vec4(load[0], load[1], load[2], energy_of(depth, spring, of_body))
                        found += 1
        count[0] = found

    return inspect


def touching(o: StepOptions, state: Any, tables: Any, dt: float) -> Touching:
    """The contacts of a state under a law.

    The springs grow by a step: without that a contact that slides, whose spring is just at its limit, would look like
    one that sticks.

    Args:
        o: What of the step is compiled in.
        state: With half lists that hold every pair that touches.
        tables: Its PairTables.
        dt: Time step [scene units].
    """
    s, t = state, types(o.law.precision)
    room = int(s.pair_count.numpy().sum()) + int(s.wall_count.numpy().sum()) + s.big_rows * s.total + 1
    who = wp.zeros(room, dtype=wp.vec3i, device="cpu")
    where, force = (wp.zeros(room, dtype=t.vec4, device="cpu") for _ in range(2))
    count = wp.zeros(1, dtype=wp.int32, device="cpu")
    inputs = [s.parts, s.n, s.total, s.bodies, s.lists, s.base, s.pair_count, s.wall_capacity, s.wall_count]
    inputs += [s.walls.record, tables.pairs, tables.pair_columns, tables.walls, tables.wall_columns, dt]
    wp.launch(contact_kernel(o), dim=1, device="cpu", inputs=inputs, outputs=[who, where, force, count])
    k = int(count.numpy()[0])
    place, load = where.numpy()[:k].astype(np.float64), force.numpy()[:k].astype(np.float64)
    normal = place[:, :3]
    along = (load[:, :3] * normal).sum(axis=1)
    return Touching(
        i=who.numpy()[:k, 0],
        j=who.numpy()[:k, 1],
        feature=who.numpy()[:k, 2],
        normal=normal,
        overlap=place[:, 3],
        normal_force=along,
        tangential_force=load[:, :3] - along[:, None] * normal,
        energy=load[:, 3],
    )
