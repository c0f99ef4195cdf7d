"""What decides, on the device, how the loops of compliant rows on full lists go on: steps, substeps, sweeps.

A block of steps is one recorded graph of three nested conditional loops, so the host looks only when the steps are done
or the lists no longer hold every contact. Decisions are made by kernels of one thread, from what one thread per body
has found and a few blocks have gathered.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.full_lists import MARK, full_lists_type
from dembench.solver.impulse.compliant_rows import CompliantOptions
from dembench.solver.impulse.compliant_substeps import stiffness_functions
from dembench.solver.pairs import pair_lookup
from dembench.solver.types import types
from dembench.solver.walls.loads import load_functions as wall_load_functions
from dembench.solver.walls.motion import place
from dembench.solver.walls.records import Walls

STALE, BROKEN, LEFT, DONE, WANTED, SWEEPS, WITHIN, FEWEST, MOST, UNSOLVED, CONTROL = (wp.constant(k) for k in range(11))
"""Places in `control` (int32), and its length: whether the lists do not cover the substep, whether a velocity is not
finite, substeps left of the step, steps done and wanted, sweeps made in the substep, substeps made in the step, fewest
and most substeps of a step, substeps that ended at the largest number of sweeps."""
H, MADE, FIRST, BUILT, WALL_SPEED, FASTEST, LIMIT, BIG_LIMIT, SUBSTEPS, SWEEPS_MADE, CLOCK = (
    wp.constant(k) for k in range(11)
)
"""Places in `clock` (float64), and its length: the substep and the last one made, steps made before the block, when the
lists were built, bounds of the speeds of walls and of bodies, how far small and large bodies may go from where they
were then, substeps and sweeps made in all."""
BLOCKS = 64
"""Blocks that gather what the bodies have found."""
vec4d = wp.types.vector(4, wp.float64)


@cache
def loop_kernels(o: CompliantOptions) -> Any:
    """Kernels `measure` (a thread for each body), `gather` (BLOCKS blocks) and, of one thread, `divide` a step into
    substeps, `enter` and `leave` a substep, and `judge` a sweep.

    going, stepping, solving (int32, shape (1,)): conditions of the loops over steps, substeps and sweeps. changed is
    set by a sweep that is not the last one.
    """
    t = types(o.law.precision)
    Bodies, PairClass = t.Bodies, t.PairClass
    FullLists = full_lists_type(o.law.precision)
    stiffness = stiffness_functions(o)
    of_two, at_wall, joined, rate = stiffness.of_two, stiffness.at_wall, stiffness.joined, stiffness.rate
    of_pair, _of_wall = pair_lookup(o.law.precision, o.pairs, o.radii)
    present, timed, loads = o.walls.present, o.walls.timed, o.walls.loads
    clear_loads = wall_load_functions(o.walls).clear
    everywhere = wp.constant(wp.float64(1e30))

    @wp.func
    def ahead_of(control: wp.array(dtype=wp.int32), clock: wp.array(dtype=wp.float64), dt: wp.float64):
        """What is left of the step, or the next one [scene units]."""
        ahead = dt
        if control[LEFT] > 0:
            ahead = wp.float64(control[LEFT]) * clock[H]
        return ahead

    @wp.func
    def end_of(control: wp.array(dtype=wp.int32), clock: wp.array(dtype=wp.float64), dt: wp.float64):
        """When the substep ends [scene units]."""
        steps = clock[FIRST] + wp.float64(control[DONE] + 1)
        return dt * steps - wp.float64(control[LEFT] - 1) * clock[H]

    @wp.kernel(enable_backward=False, module="unique")
    def measure(
        # inputs
        n: int,
        total: int,
        dt: wp.float64,
        weight: wp.float64,
        b: Bodies,
        lists: FullLists,
        walls: Walls,
        pair_table: wp.array(dtype=PairClass),
        pair_columns: int,
        wall_table: wp.array(dtype=PairClass),
        wall_columns: int,
        control: wp.array(dtype=wp.int32),
        clock: wp.array(dtype=wp.float64),
        # outputs
        needs: wp.array(dtype=vec4d),
    ):
        """What the contacts of a body need, see `stiffness_functions`, and its squared speed.

        Of the sums of a contact of two each gets half.
        """
        i = wp.tid()
        ahead = ahead_of(control, clock, dt)
        alone, shared = wp.vec3d(), wp.vec3d()
        if i < n:
            for q in range(lists.count[i]):
                j = lists.partner[q * n + i] & (MARK - 1)
                c = of_pair(b, i, j, pair_table, pair_columns)
                need = of_two(b, i, j, c, ahead, everywhere)
                if j < n:
                    shared = joined(shared, need)
                else:
                    alone = joined(alone, need)
        else:
            for j in range(n, total):
                if j != i:
                    c = of_pair(b, i, j, pair_table, pair_columns)
                    shared = joined(shared, of_two(b, i, j, c, ahead, everywhere))
        if wp.static(present):
            for q in range(lists.wall_count[i]):
                f = lists.wall[q * total + i] & (MARK - 1)
                fall = ahead * weight
                alone = joined(alone, at_wall(b, i, f, walls, 0, wall_table, wall_columns, ahead, fall))
        k = b.kin[i]
        v = wp.vec3d(k[3], k[4], k[5])
        half = wp.float64(0.5)
        sum, number = alone[1] + half * shared[1], alone[2] + half * shared[2]
        needs[i] = vec4d(wp.max(alone[0], shared[0]), sum, number, wp.dot(v, v))

    @wp.kernel(enable_backward=False, module="unique")
    def gather(
        # inputs
        total: int,
        needs: wp.array(dtype=vec4d),
        # outputs
        gathered: wp.array(dtype=vec4d),
    ):
        block, lane = wp.tid()
        sum, largest, fastest = wp.vec2d(), wp.float64(0.0), wp.float64(0.0)
        i = block * wp.block_dim() + lane
        while i < total:
            need = needs[i]
            sum = sum + wp.vec2d(need[1], need[2])
            largest = wp.max(largest, need[0])
            fastest = wp.max(fastest, need[3])
            i += wp.static(BLOCKS) * wp.block_dim()
        # all threads of a block take part in what reads an element of a tile
        sums = wp.tile_sum(wp.tile(sum, preserve_type=True))[0]
        most, speed = wp.tile_max(wp.tile(largest))[0], wp.tile_max(wp.tile(fastest))[0]
        if lane == 0:
            gathered[block] = vec4d(most, sums[0], sums[1], speed)

    @wp.kernel(enable_backward=False, module="unique")
    def divide(
        # inputs
        bodies: int,
        substeps: int,
        dt: wp.float64,
        gathered: wp.array(dtype=vec4d),
        # outputs
        control: wp.array(dtype=wp.int32),
        clock: wp.array(dtype=wp.float64),
        stepping: wp.array(dtype=wp.int32),
    ):
        """Divides the next step, or what is left of one, into `substeps`, or, if 0, as its contacts need."""
        need, fastest = wp.vec3d(), wp.float64(0.0)
        for block in range(wp.static(BLOCKS)):
            of = gathered[block]
            need = joined(need, wp.vec3d(of[0], of[1], of[2]))
            fastest = wp.max(fastest, of[3])
        ahead = ahead_of(control, clock, dt)
        if control[LEFT] == 0:
            control[WITHIN] = 0
            control[LEFT] = substeps
        if substeps == 0:
            control[LEFT] = wp.max(int(wp.ceil(ahead * rate(need, bodies))), 1)
        clock[H] = ahead / wp.float64(control[LEFT])
        clock[FASTEST] = wp.sqrt(fastest)
        stepping[0] = 1

    @wp.kernel(enable_backward=False, module="unique")
    def enter(
        # inputs
        sweeps: int,
        dt: wp.float64,
        # outputs
        walls: Walls,
        control: wp.array(dtype=wp.int32),
        clock: wp.array(dtype=wp.float64),
        solving: wp.array(dtype=wp.int32),
        changed: wp.array(dtype=wp.int32),
    ):
        """Takes the walls to the middle of the substep; `sweeps`: see `judge`."""
        if wp.static(timed):
            end = end_of(control, clock, dt)
            middle = end - wp.float64(0.5) * clock[H]
            place(walls, 0, middle, middle)
            if clock[WALL_SPEED] * (end - clock[BUILT]) > clock[LIMIT]:
                control[STALE] = 1
        if wp.static(loads):
            if control[WITHIN] == 0:
                clear_loads(walls, 0)
        control[SWEEPS] = 0
        solving[0] = wp.min(sweeps - 1, 1)
        changed[0] = 0

    @wp.kernel(enable_backward=False, module="unique")
    def judge(
        # inputs
        sweeps: int,
        # outputs
        control: wp.array(dtype=wp.int32),
        solving: wp.array(dtype=wp.int32),
        changed: wp.array(dtype=wp.int32),
    ):
        """Whether another sweep follows, of which `sweeps` are allowed with that at the end of the substep."""
        control[SWEEPS] = control[SWEEPS] + 1
        if changed[0] == 0 or control[SWEEPS] >= sweeps - 1:
            solving[0] = 0
            control[UNSOLVED] = control[UNSOLVED] + changed[0]
        changed[0] = 0

    @wp.kernel(enable_backward=False, module="unique")
    def leave(
        # inputs
        dt: wp.float64,
        # outputs
        walls: Walls,
        control: wp.array(dtype=wp.int32),
        clock: wp.array(dtype=wp.float64),
        going: wp.array(dtype=wp.int32),
        stepping: wp.array(dtype=wp.int32),
    ):
        """Counts the substep that was made, unless the lists did not cover it."""
        if control[STALE] == 0:
            if wp.static(timed):
                end = end_of(control, clock, dt)
                place(walls, 0, end, end)
            clock[MADE] = clock[H]
            clock[SUBSTEPS] = clock[SUBSTEPS] + wp.float64(1.0)
            clock[SWEEPS_MADE] = clock[SWEEPS_MADE] + wp.float64(control[SWEEPS] + 1)
            control[LEFT] = control[LEFT] - 1
            control[WITHIN] = control[WITHIN] + 1
            if control[LEFT] == 0:
                control[DONE] = control[DONE] + 1
                if control[FEWEST] == 0 or control[WITHIN] < control[FEWEST]:
                    control[FEWEST] = control[WITHIN]
                control[MOST] = wp.max(control[MOST], control[WITHIN])
        stop = control[STALE] + control[BROKEN]
        if stop > 0 or control[LEFT] == 0:
            stepping[0] = 0
        if stop > 0 or (control[LEFT] == 0 and control[DONE] == control[WANTED]):
            going[0] = 0

    return SimpleNamespace(measure=measure, gather=gather, divide=divide, enter=enter, judge=judge, leave=leave)
