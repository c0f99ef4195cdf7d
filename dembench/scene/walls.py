"""Wall shapes: what they are, how far a point is from them, and as triangles.

Every shape offers `signed_distance(points)`, positive in the void where particles live and negative inside the wall,
and `triangulate()`. A particle has one contact per feature of a wall: a plane, each closed face of a box, a mantle.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from dembench.scene.base import Direction, NotNegative, Positive, Vector
from dembench.scene.mesh import Mesh
from dembench.scene.sdf import Sdf
from dembench.scene.wall import Wall


class Plane(Wall):
    """An infinite plane; the void is on the side of the normal.

    Attributes:
        point: A point of the plane [m].
        normal: Direction into the void.
    """

    kind: Literal["plane"] = "plane"
    point: Vector
    normal: Direction

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """Distance of points [m], shape (n, 3), to the plane [m], shape (n,)."""
        return (np.asarray(points) - np.array(self.point)) @ np.array(self.normal)

    def triangulate(self, extent: float = 1.0) -> np.ndarray:
        """Two triangles of a square of half-width `extent` [m] about the point, shape (2, 3, 3)."""
        u, v = _tangents(np.array(self.normal))
        centre = np.array(self.point)
        a, b, c, d = (centre + extent * (s * u + t * v) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
        return np.array([[a, b, c], [a, c, d]])


Face = Literal["x-", "x+", "y-", "y+", "z-", "z+"]
FACES: tuple[Face, ...] = ("x-", "x+", "y-", "y+", "z-", "z+")


class Box(Wall):
    """An axis-aligned box around the void; every closed face acts as an infinite plane.

    Attributes:
        lower, upper: Inner corners [m].
        open_faces: Faces that are left out, of "x-", "x+", "y-", "y+", "z-", "z+".
    """

    kind: Literal["box"] = "box"
    lower: Vector
    upper: Vector
    open_faces: tuple[Face, ...] = ()

    @model_validator(mode="after")
    def _ordered(self) -> Box:
        for axis in range(3):
            if not self.lower[axis] < self.upper[axis]:
                raise ValueError(
                    f"lower {self.lower[axis]:g} must be below upper {self.upper[axis]:g} on axis {'xyz'[axis]}"
                )
        return self

    def planes(self) -> list[Plane]:
        """The closed faces as planes."""
        found = []
        for k, face in enumerate(FACES):
            if face in self.open_faces:
                continue
            axis, upper = divmod(k, 2)
            normal = [0.0, 0.0, 0.0]
            normal[axis] = -1.0 if upper else 1.0
            found.append(
                Plane(
                    name=self.name,
                    material=self.material,
                    motion=self.motion,
                    point=self.upper if upper else self.lower,
                    normal=tuple(normal),
                )
            )
        return found

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """Distance of points [m], shape (n, 3), to the nearest closed face [m], shape (n,)."""
        faces = [plane.signed_distance(points) for plane in self.planes()]
        return np.min(faces, axis=0) if faces else np.full(len(points), np.inf)

    def triangulate(self) -> np.ndarray:
        """Two triangles per closed face, normals into the void, shape (n, 3, 3)."""
        low, high = np.array(self.lower), np.array(self.upper)
        triangles = []
        for k, face in enumerate(FACES):
            if face in self.open_faces:
                continue
            axis, upper = divmod(k, 2)
            b, c = (axis + 1) % 3, (axis + 2) % 3
            corners = []
            for s, t in ((0, 0), (1, 0), (1, 1), (0, 1)):
                corner = np.empty(3)
                corner[axis] = (high if upper else low)[axis]
                corner[b] = (high if s else low)[b]
                corner[c] = (high if t else low)[c]
                corners.append(corner)
            if upper:
                corners.reverse()
            triangles += [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]
        return np.array(triangles)


class _Axial(Wall):
    """A wall of revolution between two points of its axis; the void is inside unless `outside`.

    Attributes:
        start, end: Ends of the axis [m].
        closed_start, closed_end: Whether the end has a flat cap.
        outside: The void is outside the mantle; such a wall has no caps.
    """

    start: Vector
    end: Vector
    closed_start: bool = False
    closed_end: bool = False
    outside: bool = False

    @model_validator(mode="after")
    def _has_axis(self) -> _Axial:
        if self.start == self.end:
            raise ValueError(f"start and end of wall {self.name} are the same point {self.start}")
        if self.outside and (self.closed_start or self.closed_end):
            raise ValueError(f"wall {self.name}: a wall with the void outside cannot have closed ends")
        return self

    def _axis(self) -> tuple[np.ndarray, np.ndarray, float]:
        start, end = np.array(self.start), np.array(self.end)
        length = float(np.linalg.norm(end - start))
        return start, (end - start) / length, length

    def _radii(self) -> tuple[float, float]:
        raise NotImplementedError

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """Distance of points [m], shape (n, 3), to the mantle and the closed ends [m], shape (n,)."""
        start, axis, length = self._axis()
        r0, r1 = self._radii()
        relative = np.asarray(points) - start
        along = relative @ axis
        radial = np.linalg.norm(relative - along[:, None] * axis, axis=1)
        slant = math.hypot(length, r1 - r0)
        cos, sin = length / slant, (r1 - r0) / slant
        mantle = (r0 - radial) * cos + along * sin
        foot = along * cos + (radial - r0) * sin
        open_start, open_end = not self.closed_start, not self.closed_end
        rim_start, rim_end = np.hypot(along, radial - r0), np.hypot(along - length, radial - r1)
        nearest = np.abs(mantle)
        nearest = np.where(open_start & (foot < 0), rim_start, nearest)
        nearest = np.where(open_end & (foot > slant), rim_end, nearest)
        beyond = (open_start & (along < 0)) | (open_end & (along > length))
        behind = ~beyond & ((mantle > 0) if self.outside else (mantle < 0))
        mantle = np.where(behind, -nearest, nearest)
        if self.closed_start:
            mantle = np.minimum(mantle, along)
        if self.closed_end:
            mantle = np.minimum(mantle, length - along)
        return mantle

    def triangulate(self, segments: int = 100) -> np.ndarray:
        """The mantle as `segments` quads of two triangles, the closed ends as fans, shape (n, 3, 3)."""
        start, axis, length = self._axis()
        r0, r1 = self._radii()
        u, v = _tangents(axis)
        angle = 2 * math.pi * np.arange(segments + 1) / segments
        ring = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v
        lower, upper = start + r0 * ring, start + length * axis + r1 * ring
        triangles = []
        for k in range(segments):
            quad = [[lower[k], upper[k], lower[k + 1]], [lower[k + 1], upper[k], upper[k + 1]]]
            triangles += [t[::-1] for t in quad] if self.outside else quad
            if self.closed_start:
                triangles.append([start, lower[k], lower[k + 1]])
            if self.closed_end:
                triangles.append([start + length * axis, upper[k + 1], upper[k]])
        found = np.array(triangles)
        area = np.linalg.norm(np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]), axis=1)
        return found[area > 0]


class Cylinder(_Axial):
    """A circular cylinder of one radius [m] between two points of its axis."""

    kind: Literal["cylinder"] = "cylinder"
    radius: Positive

    def _radii(self) -> tuple[float, float]:
        return self.radius, self.radius


class Frustum(_Axial):
    """A truncated cone with the radii [m] of its two ends."""

    kind: Literal["frustum"] = "frustum"
    radius_start: NotNegative
    radius_end: NotNegative

    @model_validator(mode="after")
    def _has_area(self) -> Frustum:
        if self.radius_start == 0 and self.radius_end == 0:
            raise ValueError(f"wall {self.name}: radius_start and radius_end are both 0")
        return self

    def _radii(self) -> tuple[float, float]:
        return self.radius_start, self.radius_end


def _tangents(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors that complete `axis` to a right-handed basis."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    u = np.cross(axis, helper)
    u /= np.linalg.norm(u)
    return u, np.cross(axis, u)


WallShape = Annotated[Plane | Box | Cylinder | Frustum | Mesh | Sdf, Field(discriminator="kind")]


def geometry_moves(wall: WallShape) -> bool:
    """Whether a motion changes where a wall is, and not only how its surface moves.

    A plane that slides in itself or turns about its normal and a mantle that turns about its axis stay where they are.
    """
    motion = wall.motion
    if motion is None or motion.surface:
        return False
    velocity, spin = np.array(motion.velocity), np.array(motion.angular_velocity)
    if motion.frequency and any(motion.amplitude):
        return True
    if isinstance(wall, Plane) and not (velocity.any() and spin.any()):
        normal = np.array(wall.normal)
        return not _parallel(spin, normal) or abs(velocity @ normal) > 1e-12 * np.linalg.norm(velocity)
    if isinstance(wall, Cylinder | Frustum):
        axis = np.array(wall.end) - np.array(wall.start)
        on_axis = _parallel(np.array(motion.centre) - np.array(wall.start), axis) or not spin.any()
        return not (_parallel(spin, axis) and on_axis) or bool(velocity.any())
    return bool(velocity.any() or spin.any())


def _parallel(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.linalg.norm(np.cross(a, b)) <= 1e-9 * np.linalg.norm(a) * np.linalg.norm(b))
