"""What an impulse does to a body."""

from functools import cache
from typing import Any

import warp as wp

from dembench.solver.types import types


@cache
def impulse_function(precision: str) -> Any:
    """Velocities of a body after an impulse, as a Warp function (u, impulse, n x impulse, lever arm) -> u."""
    t = types(precision)
    real, vec3, vec8 = t.real, t.vec3, t.vec8

    @wp.func
    def after(u: vec8, p: vec3, turn: vec3, arm: real):
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

    return after
