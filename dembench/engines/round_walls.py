"""Round walls in programs without them: where an infinite cylinder is exact, and the triangles that stand for the rest.

LIGGGHTS and LAMMPS have infinite cylinders along the axes, at rest or turning about themselves, and no cones. Such a
primitive is taken only where it cannot be told from the wall; everywhere else the wall becomes a polygon whose sides
touch the round wall from the side of the wall, so that no body starts inside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dembench.scene import Cylinder, Frustum, Motion, Region, Scene

MOST_RADII = 8
"""Number of different radii up to which a turning cylinder is a primitive: one for each of them."""
FEWEST_SIDES = 24
SAGITTA = 0.01
"""Largest distance of a polygon from the round wall, as a share of the smallest radius [-]."""


def axis_of(direction: Sequence[float] | np.ndarray) -> int | None:
    """The coordinate axis that a direction lies on, or None."""
    along = np.flatnonzero(direction)
    return int(along[0]) if len(along) == 1 else None


def half_space(region: Region) -> tuple[int, int, float] | None:
    """Axis, side (-1 or 1) and coordinate [m] of a region that holds everything beyond a plane across an axis."""
    bounded = [axis for axis in range(3) if (region.lower[axis], region.upper[axis]) != (None, None)]
    if len(bounded) != 1:
        return None
    (axis,) = bounded
    lower, upper = region.lower[axis], region.upper[axis]
    if lower is None and upper is not None:
        return axis, -1, upper
    return (axis, 1, lower) if lower is not None and upper is None else None


def turns_about_itself(wall: Cylinder | Frustum) -> bool:
    """Whether the motion of a wall is a rotation about its own axis and nothing else."""
    motion = wall.motion or Motion()
    axis = np.subtract(wall.end, wall.start)
    moves = any(motion.velocity) or (motion.frequency > 0 and any(motion.amplitude)) or motion.surface
    if moves or not any(motion.angular_velocity):
        return False
    apart = np.cross(np.subtract(motion.centre, wall.start), axis)
    skew = np.cross(motion.angular_velocity, axis)
    return not (apart.any() or skew.any())


def is_primitive(wall: Cylinder | Frustum, scene: Scene) -> bool:
    """Whether a primitive cylinder along one of the axes is this wall, as far as any body of the scene can tell."""
    if not isinstance(wall, Cylinder) or wall.outside or axis_of(np.subtract(wall.end, wall.start)) is None:
        return False
    if wall.motion is not None:
        if not turns_about_itself(wall) or len(np.unique(scene.radii())) > MOST_RADII:
            return False
        return all(end.closed or _at_domain_end(end, scene) for end in _ends(wall))
    return all(
        end.closed or _at_domain_end(end, scene) or _continued(end, scene) or _is_top(end, scene) for end in _ends(wall)
    )


def open_tops(wall: Cylinder, scene: Scene) -> list[tuple[int, int, float]]:
    """Open ends where the primitive goes on above the wall: axis, direction (-1 or 1) and coordinate [m].

    The program's box ends there, so that a body which flies over the rim ends the run instead of meeting a wall that
    is not there.
    """
    axis = axis_of(np.subtract(wall.end, wall.start))
    assert axis is not None, "a primitive lies along an axis"
    return [
        (axis, 1 if end.point[axis] > end.far[axis] else -1, float(end.point[axis]))
        for end in _ends(wall)
        if not (end.closed or _at_domain_end(end, scene) or _continued(end, scene))
    ]


def polygon(wall: Cylinder | Frustum, segments: int) -> np.ndarray:
    """Triangles [m], shape (n, 3, 3), of a wall with flat sides that touch the round one from the side of the wall."""
    if wall.outside:
        return wall.triangulate(segments)
    wider = 1 / math.cos(math.pi / segments)
    if isinstance(wall, Cylinder):
        return wall.model_copy(update={"radius": wall.radius * wider}).triangulate(segments)
    radii = {"radius_start": wall.radius_start * wider, "radius_end": wall.radius_end * wider}
    return wall.model_copy(update=radii).triangulate(segments)


def sides_for(scene: Scene) -> int:
    """Number of sides of a polygon that stays within `SAGITTA` radii of the smallest body of every round wall."""
    round_walls = [w for w in scene.walls if isinstance(w, Cylinder | Frustum)]
    widest = max((end.radius for wall in round_walls for end in _ends(wall)), default=0.0)
    away = SAGITTA * scene.extreme_radii()[0]
    return max(FEWEST_SIDES, math.ceil(math.pi / math.acos(widest / (widest + away))))


def discs(wall: Cylinder) -> np.ndarray:
    """The closed ends of a cylinder as rings of nearly equilateral triangles [m], shape (n, 3, 3)."""
    axis = np.subtract(wall.end, wall.start)
    axis = axis / np.linalg.norm(axis)
    u = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    u /= np.linalg.norm(u)
    flat = _disc(wall.radius, 8)
    found = []
    for end, closed, flip in ((wall.start, wall.closed_start, 1), (wall.end, wall.closed_end, -1)):
        if closed:
            points = end + flat[..., :1] * u + flat[..., 1:] * np.cross(axis, u)
            found.append(points[:, ::flip])
    return np.concatenate(found)


def _disc(radius: float, rings: int) -> np.ndarray:
    """Triangles of a polygon about a circle in the plane [m], shape (n, 3, 2), counter-clockwise."""
    rim = radius / math.cos(math.pi / (6 * rings))
    angles = [2 * math.pi * np.arange(max(1, 6 * k)) / max(1, 6 * k) for k in range(rings + 1)]
    circles = [rim * k / rings * np.column_stack([np.cos(a), np.sin(a)]) for k, a in enumerate(angles)]
    triangles = []
    for k in range(1, rings + 1):
        inner, outer = circles[k - 1], circles[k]
        for sector in range(6):
            for j in range(k):
                a, b = outer[sector * k + j], outer[(sector * k + j + 1) % len(outer)]
                below = sector * (k - 1) + j
                triangles.append([inner[below % len(inner)], a, b])
                if j < k - 1:
                    triangles.append([inner[below % len(inner)], b, inner[(below + 1) % len(inner)]])
    return np.array(triangles)


# ---- ends


class _End(NamedTuple):
    """One end of a wall of revolution and the other one: points and radii [m], and whether they are closed."""

    point: np.ndarray
    radius: float
    closed: bool
    far: np.ndarray
    far_radius: float
    far_closed: bool

    def outward(self) -> np.ndarray:
        """Unit vector along the axis out of the wall."""
        return (self.point - self.far) / np.linalg.norm(self.point - self.far)


def _ends(wall: Cylinder | Frustum) -> tuple[_End, _End]:
    radii = (wall.radius_start, wall.radius_end) if isinstance(wall, Frustum) else (wall.radius, wall.radius)
    first = np.array(wall.start), radii[0], wall.closed_start
    last = np.array(wall.end), radii[1], wall.closed_end
    return _End(*first, *last), _End(*last, *first)


def _at_domain_end(end: _End, scene: Scene) -> bool:
    axis = axis_of(end.point - end.far)
    return axis is not None and not scene.domain.lower[axis] < end.point[axis] < scene.domain.upper[axis]


def _continued(end: _End, scene: Scene) -> bool:
    """Whether a coaxial wall at rest goes on at an open end and keeps all bodies from what is beyond.

    It must begin with the same radius and not widen; at its own end it must be closed, reach the end of the domain or
    have a sink behind it, nearer than half the way from its rim to the primitive.
    """
    small = 1e-9 * end.radius
    for wall in scene.walls:
        if not isinstance(wall, Cylinder | Frustum) or wall.outside or wall.motion:
            continue
        for near in _ends(wall):
            way = near.far - near.point
            along = way @ end.outward()
            if (
                np.linalg.norm(near.point - end.point) > small
                or abs(near.radius - end.radius) > small
                or np.linalg.norm(way - along * end.outward()) > small
                or along <= 0
                or near.far_radius > end.radius
            ):
                continue
            last = _End(near.far, near.far_radius, near.far_closed, near.point, near.radius, near.closed)
            if last.closed or _at_domain_end(last, scene):
                return True
            if _sink_behind(last, scene) < (end.radius - last.radius) / 2:
                return True
    return False


def _sink_behind(end: _End, scene: Scene) -> float:
    """Distance from an end along the axis to the sink that takes everything beyond [m]; infinite without one."""
    axis = axis_of(end.point - end.far)
    if axis is None:
        return math.inf
    side = 1 if end.point[axis] > end.far[axis] else -1
    taken = [half for sink in scene.sinks if (half := half_space(sink.region))]
    ways = [max(0.0, side * (border - float(end.point[axis]))) for *where, border in taken if where == [axis, side]]
    return min(ways, default=math.inf)


def _is_top(end: _End, scene: Scene) -> bool:
    """Whether an open end is the upper one of a vertical wall and all bodies start at rest below it."""
    up, gravity, bodies = end.outward(), np.array(scene.gravity), scene.bodies
    below = (bodies.position - end.point) @ up + scene.radii() < 0
    return not np.cross(gravity, up).any() and gravity @ up < 0 and bool(below.all()) and not bodies.velocity.any()
