"""What bodies do to walls: force, torque about the centre of the motion, and the work that a wall does on bodies.

A wall feels the opposite of what it does to a body: with force f and torque t on a body at x, it takes -f and, about
its centre c, -((x - c) x f + t); the power that it spends is f . v + t . w, with v and w velocity at x and spin of its
surface. No contact point is needed.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import WallOptions, Walls

FORCE, TORQUE, WORK, COLUMNS = 0, 3, 6, 7
"""Columns of Walls.loads: force and torque of the last step on the wall, work on bodies since the start."""


@cache
def load_functions(o: WallOptions) -> Any:
    """Warp functions `clear` and `add`.

    clear(walls, part): forgets the forces and torques that a thread has added in the last step.
    add(walls, part, k, first, x, f, t, dt): feature k acts with force f and torque t on a body at x for a time dt.
    """
    of_feature = wall_functions(o)
    velocity_of, spin_of = of_feature.velocity, of_feature.spin

    @wp.func
    def clear(walls: Walls, part: int):
        for w in range(walls.loads.shape[1]):
            for c in range(wp.static(WORK)):
                walls.loads[part, w, c] = wp.float64(0.0)

    @wp.func
    def add(
        walls: Walls,
        part: int,
        k: int,
        first: int,
        x: wp.vec3d,
        f: wp.vec3d,
        t: wp.vec3d,
        dt: wp.float64,
    ):
        owner, m = walls.features[k].owner, walls.features[k].motion
        arm = x + wp.vec3d()
        if m >= 0:
            arm = x - walls.poses[first + m].centre
        torque = wp.cross(arm, f) + t
        for c in range(3):
            wp.atomic_add(walls.loads, part, owner, wp.static(FORCE) + c, -f[c])
            wp.atomic_add(walls.loads, part, owner, wp.static(TORQUE) + c, -torque[c])
        power = wp.dot(f, velocity_of(walls, k, first, x)) + wp.dot(t, spin_of(walls, k, first))
        wp.atomic_add(walls.loads, part, owner, wp.static(WORK), power * dt)

    return SimpleNamespace(clear=clear, add=add)
