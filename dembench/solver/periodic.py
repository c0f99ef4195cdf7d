"""Periodic domains: the nearest image of a pair, and positions that are taken back into the domain.

Positions run on beyond a periodic face until the lists are built anew; every difference of two positions goes to the
nearest image. A pair that is not listed is farther apart than the skin in all of its images, so lists need no ghosts.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Scene
from dembench.solver.types import types, vec8d

SMALLEST_BOX = 2.4
"""Shortest periodic axis in sums of the two largest radii: a pair must not touch through two images at a time, and the
skin of the lists needs room, too."""
SAMPLES = 256
"""Places at which walls are compared across the faces of a periodic axis."""


def box_lengths(scene: Scene) -> np.ndarray:
    """Lengths of the periodic axes of the domain [m], 0 on the others, shape (3,)."""
    domain = scene.domain
    return np.where(domain.periodic, np.subtract(domain.upper, domain.lower), 0.0)


def unsupported_boxes(scene: Scene) -> list[str]:
    """Periodic axes that are too short for the bodies, and walls that differ between joined faces, one line each."""
    if not any(scene.domain.periodic) or not len(scene.bodies):
        return []
    largest = np.sort(scene.radii())[-2:]
    least = SMALLEST_BOX * float(largest.sum()) * (2 if len(largest) == 1 else 1)
    return [
        f"a periodic {axis} of {length:g} m: at least {least:g} m for these radii"
        for axis, length in zip("xyz", box_lengths(scene), strict=True)
        if 0 < length < least
    ] + [
        f"wall {wall.name} in a periodic {axis}: it is not the same at both faces"
        for k, axis in enumerate("xyz")
        if scene.domain.periodic[k]
        for wall in scene.walls
        if not _continues(scene, wall, k)
    ]


def _continues(scene: Scene, wall: Any, axis: int) -> bool:
    """Whether bodies near one face of a periodic axis meet the wall as those near the other do: at sampled places."""
    reach = 2 * float(scene.radii().max())
    every = max(1, len(scene.bodies) // SAMPLES)
    distances = []
    for face in (scene.domain.lower[axis], scene.domain.upper[axis]):
        places = np.repeat(scene.bodies.position[::every], 3, axis=0)
        places[:, axis] = face + np.tile([-reach, 0, reach], len(places) // 3)
        distances.append(np.minimum(wall.signed_distance(places), reach))
    return bool(np.allclose(*distances, rtol=0, atol=1e-6 * reach))


def wrapped(scene: Scene, position: np.ndarray) -> np.ndarray:
    """Positions [m], shape (n, 3), taken back into the domain along its periodic axes."""
    box, low = box_lengths(scene), np.array(scene.domain.lower)
    return np.where(box > 0, low + np.mod(position - low, np.where(box > 0, box, 1.0)), position)


@cache
def image_functions(precision: str, periodic: bool) -> Any:
    """Warp functions of the nearest image; plain differences where the domain is not periodic.

    nearest(bodies, d): difference of two positions, vec3d, to the nearest image. separation(bodies, ki, kj): difference
    of two rows of `kin`, its position to the nearest image. folded(c, n, inverse): cell c of n on an axis, around the
    corner where `inverse`, that of the axis in `inverse_box`, is positive and there is more than one cell.
    """
    Bodies = types(precision).Bodies

    @wp.func
    def nearest(b: Bodies, d: wp.vec3d):
        out = d
        if wp.static(periodic):
            turns = wp.cw_mul(d, b.inverse_box)
            turns = wp.vec3d(wp.rint(turns[0]), wp.rint(turns[1]), wp.rint(turns[2]))
            out = d - wp.cw_mul(turns, b.box)
        return out

    @wp.func
    def separation(b: Bodies, ki: vec8d, kj: vec8d):
        d = ki - kj
        if wp.static(periodic):
            x = nearest(b, wp.vec3d(d[0], d[1], d[2]))
            d = vec8d(x[0], x[1], x[2], d[3], d[4], d[5], d[6], d[7])
        return d

    @wp.func
    def folded(c: int, n: int, inverse: wp.float64):
        out = c
        if wp.static(periodic):
            if inverse > wp.float64(0.0) and n > 1:
                if c < 0:
                    out = c + n
                if c >= n:
                    out = c - n
        return out

    return SimpleNamespace(nearest=nearest, separation=separation, folded=folded)


@cache
def wrap_kernel(precision: str) -> Any:
    """The kernel that takes all positions back into the domain, one thread per body."""
    Bodies = types(precision).Bodies

    @wp.kernel(enable_backward=False, module="unique")
    def wrap(
        # inputs
        low: wp.vec3d,
        # outputs
        b: Bodies,
    ):
        i = wp.tid()
        k = b.kin[i]
        p = wp.cw_mul(wp.vec3d(k[0], k[1], k[2]) - low, b.inverse_box)
        shift = wp.cw_mul(wp.vec3d(wp.floor(p[0]), wp.floor(p[1]), wp.floor(p[2])), b.box)
        b.kin[i] = vec8d(k[0] - shift[0], k[1] - shift[1], k[2] - shift[2], k[3], k[4], k[5], k[6], k[7])

    return wrap
