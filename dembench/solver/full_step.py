"""The soft-sphere step for devices of many threads: full lists, one thread per small body, one block per large body.

A launch evaluates the forces at the current positions and then kicks and drifts into a second set of arrays, so that a
step is one launch (two with large bodies) and needs no atomics: every sum has one owner and a fixed order. Both bodies
of a pair evaluate it with identical arithmetic, in the order lower index, higher index, so they agree to the bit.

Lists are exact as long as no body has left the ball of half a skin around where it was when they were built. The launch
that takes a body out of it says so in `flags`, and all later launches of the block do nothing.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.contacts import StepOptions, force_functions, load_functions
from dembench.solver.full_lists import MARK, full_lists_type, hand_over_function
from dembench.solver.pairs import pair_lookup, radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.types import types, vec8d
from dembench.solver.walls.loads import load_functions as wall_load_functions
from dembench.solver.walls.motion import place
from dembench.solver.walls.records import Walls

NO_KICK, HALF_KICK, DRIFT = wp.constant(0), wp.constant(1), wp.constant(2)
"""What a launch does after the forces: nothing (initial forces), end the step, or end it and begin the next."""


@cache
def full_kernels(o: StepOptions) -> Any:
    """Kernels of the step: `begin` (half kick and drift from the stored forces), `step`, `step_big` and others.

    flags (int32): s is set where the lists do not cover the positions before step s of the block, the last where a
    velocity is not finite.
    """
    t = types(o.law.precision)
    real, vec3, vec4, vec8 = t.real, t.vec3, t.vec4, t.vec8
    Bodies, PairClass = t.Bodies, t.PairClass
    FullLists = full_lists_type(o.law.precision)
    pair, wall, spin = force_functions(o)
    of_pair, _of_wall = pair_lookup(o.law.precision, o.pairs, o.radii)
    load_of, radius = load_functions(o.law.precision, o.rotation), radius_function(o.law.precision, o.radii)
    get_load, put_load = load_of.get, load_of.put
    nearest = image_functions(o.law.precision, o.periodic).nearest
    present, rotation, friction = o.walls.present, o.rotation, o.law.friction
    meshes, loads, of_loads = o.walls.meshes, o.walls.loads, wall_load_functions(o.walls)
    clear_loads, add_load_to_wall = of_loads.clear, of_loads.add
    hand_over = hand_over_function(o.law.precision, o.walls, o.radii)

    @wp.func
    def kick(k: vec8d, load: vec8, m: real, half: wp.float64, gravity: wp.vec3d):
        """Half a step of acceleration."""
        out = k * wp.float64(1.0)
        if m > real(0.0):
            out[3] = k[3] + half * (wp.float64(load[0] * m) + gravity[0])
            out[4] = k[4] + half * (wp.float64(load[1] * m) + gravity[1])
            out[5] = k[5] + half * (wp.float64(load[2] * m) + gravity[2])
        return out

    @wp.func
    def finish(
        i: int,
        s: int,
        kicks: int,
        drift: bool,
        load: vec8,
        dt: wp.float64,
        gravity: wp.vec3d,
        limit: wp.float64,
        reference: wp.array(dtype=wp.vec3d),
        b: Bodies,
        b_out: Bodies,
        flags: wp.array(dtype=wp.int32),
    ):
        """Half kicks and the drift of body i into b_out; sets flags[s] where the body leaves its ball."""
        k = b.kin[i] * wp.float64(1.0)
        half = dt * wp.float64(0.5)
        for _ in range(kicks):
            k = kick(k, load, b.inv_m[i], half, gravity)
        if wp.static(rotation):
            w = b.spin[i] * real(1.0)
            g = real(half) * b.inv_i[i]
            turn = vec4(g * load[4], g * load[5], g * load[6], real(0.0))
            for _ in range(kicks):
                w = w + turn
            b_out.spin[i] = w
        if drift:
            x = wp.vec3d(k[0] + dt * k[3], k[1] + dt * k[4], k[2] + dt * k[5])
            k = vec8d(x[0], x[1], x[2], k[3], k[4], k[5], k[6], k[7])
            moved = x - reference[i]
            if not wp.dot(moved, moved) <= limit * limit:
                flags[s] = 1
            if not wp.isfinite(k[3] * k[3] + k[4] * k[4] + k[5] * k[5]):
                flags[s] = 1
                flags[flags.shape[0] - 1] = 1
        b_out.kin[i] = k

    @wp.kernel(enable_backward=False, module="unique")
    def begin(
        # inputs
        n: int,
        dt: wp.float64,
        gravity: wp.vec3d,
        limit: wp.float64,
        big_limit: wp.float64,
        reference: wp.array(dtype=wp.vec3d),
        # outputs
        b: Bodies,
        flags: wp.array(dtype=wp.int32),
    ):
        """Half kick from the stored forces, and drift: what DRIFT leaves to do after HALF_KICK."""
        i = wp.tid()
        reach = limit
        if i >= n:
            reach = big_limit
        finish(i, 0, 1, True, get_load(b, i), dt, gravity, reach, reference, b, b, flags)

    @wp.func
    def touch(
        b: Bodies,
        i: int,
        j: int,
        memory: vec4,
        table: wp.array(dtype=PairClass),
        columns: int,
        dt: real,
    ):
        """Load of body i against body j, the memory after, and the overlap (0 where they are apart)."""
        a, c = i, j
        if j < i:
            a, c = j, i
        ka, kc = b.kin[a], b.kin[c]
        wa, wc = vec3(), vec3()
        if wp.static(friction):
            wa, wc = spin(b, a), spin(b, c)
        constants = of_pair(b, a, c, table, columns)
        on_a, on_c, after, overlap = pair(b, a, c, ka, kc, wa, wc, memory, constants, dt)
        load = on_a
        if j < i:
            load = on_c
        return load, after, overlap

    @wp.func
    def apart(b: Bodies, i: int, j: int):
        ki, kj = b.kin[i], b.kin[j]
        d = nearest(b, wp.vec3d(ki[0] - kj[0], ki[1] - kj[1], ki[2] - kj[2]))
        reach = radius(b, ki) + radius(b, kj)
        return wp.dot(d, d) >= reach * reach

    @wp.func
    def wall_load(
        b: Bodies,
        lists: FullLists,
        i: int,
        total: int,
        walls: Walls,
        table: wp.array(dtype=PairClass),
        columns: int,
        dt: real,
    ):
        """Load of body i against the wall features in its list."""
        sum = vec8()
        z = real(0.0)
        if wp.static(meshes and friction):
            hand_over(b, b.kin[i], lists, i, total, walls)
        for q in range(lists.wall_count[i]):
            slot = q * total + i
            entry = lists.wall[slot]
            k = entry & (MARK - 1)
            memory = vec4()
            if wp.static(friction):
                if entry >= MARK:
                    memory = lists.wall_memory[slot]
            load, after, overlap = wall(b, i, walls, k, 0, memory, table, columns, dt)
            if overlap > z:
                sum = sum + load
                if wp.static(loads):
                    at = b.kin[i]
                    x = wp.vec3d(at[0], at[1], at[2])
                    f = wp.vec3d(wp.float64(load[0]), wp.float64(load[1]), wp.float64(load[2]))
                    t = wp.vec3d(wp.float64(load[4]), wp.float64(load[5]), wp.float64(load[6]))
                    add_load_to_wall(walls, 0, k, 0, x, f, t, wp.float64(dt))
                if wp.static(friction):
                    lists.wall_memory[slot] = after
                lists.wall[slot] = k + MARK
            elif entry >= MARK:
                lists.wall[slot] = k
        return sum

    @wp.kernel(enable_backward=False, module="unique")
    def move_walls(
        # inputs
        s: int,
        clock: wp.array(dtype=wp.float64),
        limit: wp.float64,
        # outputs
        walls: Walls,
        flags: wp.array(dtype=wp.int32),
    ):
        """Poses for the forces of step s of the block, and walls without loads; one thread.

        clock: steps made at the forces of step 0, time step, time of the last rebuild, bound of the walls' speed.
        flags[s] is set where walls may have come nearer than the lists allow for.
        """
        now = (clock[0] + wp.float64(s)) * clock[1]
        place(walls, 0, now, now)
        if clock[3] * (now - clock[2]) > limit:
            flags[s] = 1
        if wp.static(loads):
            if flags[s] == 0:
                clear_loads(walls, 0)

    @wp.kernel(enable_backward=False, module="unique")
    def step(
        # inputs
        s: int,
        after: int,
        memory_dt: real,
        dt: wp.float64,
        gravity: wp.vec3d,
        n: int,
        total: int,
        walls: Walls,
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        limit: wp.float64,
        reference: wp.array(dtype=wp.vec3d),
        b: Bodies,
        # outputs
        lists: FullLists,
        b_out: Bodies,
        overlaps: wp.array(dtype=real),
        flags: wp.array(dtype=wp.int32),
    ):
        """Forces on the small bodies, then as `after` says."""
        i = wp.tid()
        if flags[s] != 0:
            flags[s + 1] = 1
            return
        sum = vec8()
        largest = real(0.0)
        for q in range(lists.count[i]):
            slot = q * n + i
            entry = lists.partner[slot]
            j = entry & (MARK - 1)
            overlap = real(0.0)
            if not apart(b, i, j):
                memory = vec4()
                if wp.static(friction):
                    if entry >= MARK:
                        memory = lists.memory[slot]
                load, spring, overlap = touch(b, i, j, memory, pair_table, pair_columns, memory_dt)
                if overlap > real(0.0):
                    sum = sum + load
                    largest = wp.max(largest, overlap)
                    if wp.static(friction):
                        lists.memory[slot] = spring
                    if entry < MARK:
                        lists.partner[slot] = j + MARK
            if overlap == real(0.0) and entry >= MARK:
                lists.partner[slot] = j
        if wp.static(present):
            sum = sum + wall_load(b, lists, i, total, walls, wall_table, wall_columns, memory_dt)
        if largest > overlaps[i]:
            overlaps[i] = largest
        put_load(b, i, sum)
        finish(i, s + 1, after, after == DRIFT, sum, dt, gravity, limit, reference, b, b_out, flags)

    @wp.kernel(enable_backward=False, module="unique")
    def step_big(
        # inputs
        s: int,
        after: int,
        memory_dt: real,
        dt: wp.float64,
        gravity: wp.vec3d,
        n: int,
        total: int,
        walls: Walls,
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        limit: wp.float64,
        reference: wp.array(dtype=wp.vec3d),
        b: Bodies,
        # outputs
        lists: FullLists,
        b_out: Bodies,
        overlaps: wp.array(dtype=real),
        flags: wp.array(dtype=wp.int32),
    ):
        """The same for the large bodies: the threads of a block share the candidates of one body."""
        row, lane = wp.tid()
        i = n + row
        going = flags[s] == 0
        sum = vec8()
        largest = real(0.0)
        if going:
            for q in range(lists.big_start[row] + lane, lists.big_start[row + 1], wp.block_dim()):
                j = lists.big[q]
                slot = row * total + j
                if not apart(b, i, j):
                    memory = vec4()
                    if wp.static(friction):
                        memory = lists.big_memory[slot]
                    load, spring, overlap = touch(b, i, j, memory, pair_table, pair_columns, memory_dt)
                    if overlap > real(0.0):
                        sum = sum + load
                        largest = wp.max(largest, overlap)
                    if wp.static(friction):
                        lists.big_memory[slot] = spring
                elif wp.static(friction):
                    lists.big_memory[slot] = vec4()
        # all threads of a block take part in what reads an element of a tile
        load = wp.tile_sum(wp.tile(sum, preserve_type=True))[0]
        deepest = wp.tile_max(wp.tile(largest))[0]
        if lane == 0:
            if going:
                if wp.static(present):
                    load = load + wall_load(b, lists, i, total, walls, wall_table, wall_columns, memory_dt)
                if deepest > overlaps[i]:
                    overlaps[i] = deepest
                put_load(b, i, load)
                finish(i, s + 1, after, after == DRIFT, load, dt, gravity, limit, reference, b, b_out, flags)
            else:
                flags[s + 1] = 1

    @wp.kernel(enable_backward=False, module="unique")
    def turn(
        # inputs
        steps: int,
        flags: wp.array(dtype=wp.int32),
        # outputs
        clock: wp.array(dtype=wp.float64),
        blocks: wp.array(dtype=wp.int32),
        going: wp.array(dtype=wp.int32),
    ):
        """After a block of some steps: whether another one follows; one thread.

        blocks: how many are made and wanted.
        """
        going[0] = 0
        if flags[steps] == 0:
            blocks[0] = blocks[0] + 1
            clock[0] = clock[0] + wp.float64(steps)
            if blocks[0] < blocks[1]:
                going[0] = 1

    return SimpleNamespace(begin=begin, move_walls=move_walls, step=step, step_big=step_big, turn=turn)
