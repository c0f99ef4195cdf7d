"""Energy stored in the normal springs of a scene's law, from positions alone."""

from __future__ import annotations

import numpy as np

from dembench.scene import LinearSpring, Scene
from dembench.scene.overlap import Touching


class NormalSprings:
    """The normal springs of a scene: 8/15 E* sqrt(R*) d^(5/2) of Hertz, k d^2/2 of a linear spring (d overlap).

    With 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2 and 1/R* = 1/r1 + 1/r2 (Johnson 1985, Contact Mechanics, ch. 4). A wall
    is as flat as a plane and touches a body once, at its nearest point.
    """

    def __init__(self, scene: Scene) -> None:
        """Prepares the stiffness of every pair of materials."""
        self._scene = scene
        self._radius = scene.radii()
        materials = list(scene.materials)
        self._compliance = np.array([(1 - m.poisson**2) / m.young for m in materials])
        index = {m.name: k for k, m in enumerate(materials)}
        self._material = np.array([index[s.material] for s in scene.species])[scene.bodies.species]
        self._walls = [(wall, index[wall.material]) for wall in scene.walls]

    def energy(self, position: np.ndarray, present: np.ndarray, pairs: Touching) -> float:
        """Stored energy [J].

        Args:
            position: Centres of the bodies that are there [m], shape (k, 3).
            present: Their indices, shape (k,).
            pairs: Those of them that overlap, as of `dembench.scene.overlap.touching`.
        """
        radius, material = self._radius[present], self._material[present]
        i, j, overlap = pairs
        reduced = radius[i] * radius[j] / (radius[i] + radius[j])
        total = self._stored(overlap, reduced, self._compliance[material[i]] + self._compliance[material[j]])
        for wall, own in self._walls:
            overlap = radius - wall.signed_distance(position)
            k = np.flatnonzero(overlap > 0)
            total += self._stored(overlap[k], radius[k], self._compliance[material[k]] + self._compliance[own])
        return total

    def _stored(self, overlap: np.ndarray, reduced_radius: np.ndarray, compliance: np.ndarray) -> float:
        law = self._scene.law
        if isinstance(law, LinearSpring):
            return float(0.5 * law.normal_stiffness * (overlap**2).sum())
        return float((8 / 15 * np.sqrt(reduced_radius) / compliance * overlap**2.5).sum())
