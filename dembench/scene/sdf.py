"""Walls of any shape, as signed distances on a grid."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, PlainSerializer, model_validator

from dembench.scene.base import Positive, Vector
from dembench.scene.solids import level_set
from dembench.scene.wall import Motion, Wall

STEEPEST = 1.01
"""Largest change of a signed distance along an axis, in distances between nodes; rounding and sampling explain 1 %."""

Distance = Callable[[np.ndarray], np.ndarray]
"""A signed-distance function: points [m], shape (n, 3), to distances [m], shape (n,)."""


def _grids(value: Any) -> np.ndarray:
    array = np.array(value, dtype=np.float64)
    if array.ndim == 3:
        array = array[None]
    if array.ndim != 4 or min(array.shape[1:]) < 3 or not len(array):
        raise ValueError(f"values must have shape (nx, ny, nz) or (parts, nx, ny, nz), nx >= 3, not {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"the value at node {np.argwhere(~np.isfinite(array))[0].tolist()} is not finite")
    array.setflags(write=False)
    return array


Grids = Annotated[
    Any,
    BeforeValidator(_grids),
    PlainSerializer(lambda array: array.tolist(), return_type=list),
    Field(json_schema_extra={"type": "array", "items": {"type": "array", "items": {"type": "array"}}}),
]


class Sdf(Wall):
    """A wall given by the signed distance of points to it, sampled on a grid; the void is where it is positive.

    Several parts make the void that all of them leave free; a particle has one contact with each, so that the corner
    between two parts stays sharp: a corner inside one part would be rounded to the distance between nodes. Between
    nodes distances are interpolated linearly along each axis; beyond the grid the distance at the nearest point of the
    grid counts, so that the grid should reach a radius beyond the surface wherever particles can be.

    Attributes:
        values: Signed distances at the nodes [m], shape (parts, nx, ny, nz), at least 3 nodes along each axis; one
            part may be given without the first dimension.
        origin: Position of the first node [m].
        spacing: Distance between nodes [m].
    """

    kind: Literal["sdf"] = "sdf"
    values: Grids
    origin: Vector
    spacing: Positive

    @model_validator(mode="after")
    def _is_distance(self) -> Sdf:
        for axis in (1, 2, 3):
            steepest = float(np.abs(np.diff(self.values, axis=axis)).max())
            if steepest > STEEPEST * self.spacing:
                raise ValueError(
                    f"values of wall {self.name} are no distances: they change by {steepest:g} m between two nodes "
                    f"that are {self.spacing:g} m apart; accepted is at most {STEEPEST * self.spacing:g} m"
                )
        return self

    @classmethod
    def from_function(
        cls,
        *,
        name: str,
        material: str,
        function: Distance | Sequence[Distance],
        lower: Sequence[float],
        upper: Sequence[float],
        spacing: float,
        motion: Motion | None = None,
    ) -> Sdf:
        """A wall from a signed-distance function, or from one function for each part, sampled between two corners.

        Args:
            name, material, motion: See `Wall`.
            function: Points [m], shape (n, 3), to signed distances [m], shape (n,), positive in the void.
            lower, upper: Corners of the grid [m]; it reaches up to one node beyond `upper`.
            spacing: Distance between nodes [m].
        """
        shape = [math.ceil((b - a) / spacing - 1e-9) + 1 for a, b in zip(lower, upper, strict=True)]
        nodes = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1).reshape(-1, 3)
        points = np.asarray(lower, dtype=np.float64) + spacing * nodes
        parts = [function] if callable(function) else list(function)
        values = [np.asarray(part(points), dtype=np.float64).reshape(shape) for part in parts]
        return cls(
            name=name, material=material, motion=motion, values=np.array(values), origin=tuple(lower), spacing=spacing
        )

    def __hash__(self) -> int:
        return hash((self.name, self.material, self.values.tobytes()))

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Sdf)
            and (self.name, self.material, self.motion) == (other.name, other.material, other.motion)
            and (self.origin, self.spacing) == (other.origin, other.spacing)
            and np.array_equal(self.values, other.values)
        )

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """Distance of points [m], shape (n, 3), to the nearest part [m], shape (n,)."""
        last = np.array(self.values.shape[1:]) - 1
        place = np.clip((np.asarray(points) - np.array(self.origin)) / self.spacing, 0, last)
        cell = np.minimum(place.astype(int), last - 1)
        t = place - cell
        found = np.zeros((len(self.values), len(place)))
        for corner in np.ndindex(2, 2, 2):
            weight = np.prod(np.where(corner, t, 1 - t), axis=1)
            found += weight * self.values[:, *(cell + corner).T]
        return found.min(axis=0)

    def triangulate(self) -> np.ndarray:
        """The surface of all parts together, shape (n, 3, 3), with normals into the void; it rounds their corners."""
        # the surface of a body has its normals towards positive values, as those of a wall point into the void
        found = level_set(self.values.min(axis=0), np.array(self.origin), self.spacing)
        area = np.linalg.norm(np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]), axis=1)
        return found[area > 0]
