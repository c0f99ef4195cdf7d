"""Distances and normals of the features of walls as the solver's kernels see them."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from grains import grains

from dembench.solver.units import scene_units
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.features import WallSet
from dembench.solver.walls.records import WallOptions, Walls


def distances(walls: Sequence[Any], points: Any, time: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Distance [m] of every point to every feature, shape (n, features), and the normals, at a time [s]."""
    units = scene_units(grains([[0, 0, 0]]))
    found = WallSet(grains([[0, 0, 0]], walls=tuple(walls)), units)
    found.place(time / units.time)
    x = wp.array(np.atleast_2d(points) / units.length, dtype=wp.vec3d, device="cpu")
    d = wp.zeros((len(x), found.count), dtype=wp.float64, device="cpu")
    n = wp.zeros((len(x), found.count), dtype=wp.vec3d, device="cpu")
    wp.launch(_kernel(found.options), dim=d.shape, inputs=[found.record, x], outputs=[d, n], device="cpu")
    return d.numpy() * units.length, n.numpy()


@cache
def _kernel(o: WallOptions) -> Any:
    distance_of = wall_functions(o).distance

    @wp.kernel(enable_backward=False, module="unique")
    def measure(
        # inputs
        walls: Walls,
        x: wp.array(dtype=wp.vec3d),
        # outputs
        d: wp.array2d(dtype=wp.float64),
        n: wp.array2d(dtype=wp.vec3d),
    ):
        i, k = wp.tid()
        distance, normal = distance_of(walls, k, 0, x[i])
        d[i, k] = distance
        n[i, k] = normal

    return measure
