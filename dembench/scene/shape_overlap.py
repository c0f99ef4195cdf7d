"""Gaps and overlaps of bodies of any shape, and of these with walls."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from dembench.scene.overlap import touching
from dembench.scene.shapes import Clump, Grain

if TYPE_CHECKING:
    from dembench.scene.scene import Domain, Species


class Shaped:
    """Bodies in space, of any shape.

    Args:
        species: Species of the scene.
        kind: Index of the species of every body, shape (n,).
        position: Centres of mass [m], shape (n, 3).
        orientation: Unit quaternions (x, y, z, w), shape (n, 4); None means that none is turned.
    """

    def __init__(
        self, species: tuple[Species, ...], kind: np.ndarray, position: np.ndarray, orientation: np.ndarray | None
    ):
        self._forms = [s.shape or Clump(spheres=((0, 0, 0, s.radius),)) for s in species]
        self._radii = np.array([s.radius for s in species])
        self._kind, self._position = kind, position
        self._turn = Rotation.from_quat(np.tile([0.0, 0, 0, 1], (len(kind), 1)) if orientation is None else orientation)

    def probes(self, i: int) -> np.ndarray:
        """Spheres with which body i touches, in space, rows (x, y, z, r) [m]."""
        found = self._forms[self._kind[i]].probes()
        return np.column_stack([self._turn[i].apply(found[:, :3]) + self._position[i], found[:, 3]])

    def gap(self, i: int, j: int) -> float:
        """Gap of two bodies [m], negative where they overlap, infinite where they are far apart."""
        fields = [k for k in (i, j) if isinstance(self._forms[self._kind[k]], Grain)]
        if not fields:
            a, b = self.probes(i), self.probes(j)
            distance = np.linalg.norm(a[:, None, :3] - b[None, :, :3], axis=2)
            return float((distance - a[:, None, 3] - b[None, :, 3]).min())
        return min(self._gap_to_field(k, i + j - k) for k in fields)

    def _gap_to_field(self, k: int, other: int) -> float:
        """Smallest gap of the probes of another body to the surface of a grain."""
        grain = self._forms[self._kind[k]]
        probes = self.probes(other)
        local = self._turn[k].apply(probes[:, :3] - self._position[k], inverse=True) + grain.solid.centre
        nodes = (local - np.array(grain.origin)) / grain.spacing
        distance = map_coordinates(grain.values, nodes.T, order=1, mode="constant", cval=np.inf)
        return float((distance - probes[:, 3]).min())

    def overlaps(self, domain: Domain | None = None) -> Iterator[tuple[int, int, float]]:
        """Pairs of bodies that overlap: both indices and the overlap [m]."""
        for i, j, _depth in zip(*touching(self._position, self._radii[self._kind], domain), strict=True):
            gap = self.gap(int(i), int(j))
            if gap < 0:
                yield int(i), int(j), -gap
