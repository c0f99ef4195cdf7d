"""What the rows of the last step say: who touches whom and how hard, and how well the contact problem is solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from dembench.solver.inspection import Touching

SLIDING = 1 - 1e-4
"""A contact slides where its tangential impulse is this fraction of its bound."""


@dataclass(frozen=True)
class RowTable:
    """Rows of the last step as numpy arrays in scene units, after the velocity sweeps.

    Attributes:
        i, j: Indices into the sorted arrays, shape (k,); j is the number of bodies or more for a wall.
        slot: Where the impulses are remembered, shape (k,).
        a, b, u: As in the record Rows, shapes (k, 8), (k, 8), (m, 8).
    """

    i: np.ndarray
    j: np.ndarray
    slot: np.ndarray
    a: np.ndarray
    b: np.ndarray
    u: np.ndarray

    @classmethod
    def of(cls, rows: Any, spans: Sequence[tuple[int, int]]) -> RowTable:
        """The rows of a record Rows that stand in some spans, each from one index to before another."""
        chosen = np.concatenate([np.arange(*span) for span in spans])
        i, j, slot, a, b = (getattr(rows, name).numpy()[chosen] for name in ("i", "j", "slot", "a", "b"))
        return cls(i, j, slot, a.astype(float), b.astype(float), rows.u.numpy().astype(float))

    @property
    def normal(self) -> np.ndarray:
        """Unit vectors from j to i, shape (k, 3)."""
        return self.a[:, :3]

    @property
    def load(self) -> np.ndarray:
        """Normal impulses, shape (k,)."""
        return self.b[:, 1]

    @property
    def tangential(self) -> np.ndarray:
        """Tangential impulses on i, shape (k, 3)."""
        return self.b[:, 4:7]

    @property
    def bound(self) -> np.ndarray:
        """Largest tangential impulse, shape (k,)."""
        return self.a[:, 6] * (self.load + self.b[:, 7])

    @cached_property
    def velocity(self) -> np.ndarray:
        """Velocity of the surface of i past that of j, shape (k, 3)."""
        ui, uj = self.u[self.i], self.u[self.j]
        turning = self.a[:, 7:8] * ui[:, 4:7] + self.b[:, :1] * uj[:, 4:7]
        return ui[:, :3] - uj[:, :3] + np.cross(self.normal, turning)

    def sliding(self) -> int:
        """Number of loaded contacts at their Coulomb bound."""
        pull = np.linalg.norm(self.tangential, axis=1)
        return int(((self.load > 0) & (self.bound > 0) & (pull >= SLIDING * self.bound)).sum())

    def residuals(self) -> np.ndarray:
        """Natural map of the contact problem of each row as a velocity, shape (k,); 0 where the row is solved.

        Normal: min(l/m, v + gap/dt), the gap at least 0; tangential: t/m_t - P(t/m_t - slip) with P the projection on
        the Coulomb disc; l and t impulses, m and m_t effective masses. Source: the natural map of FCLIB, Acary et al.
        2014.
        """
        along = (self.velocity * self.normal).sum(axis=1)
        slip = self.velocity - along[:, None] * self.normal
        mass, turning = self.a[:, 4], self.a[:, 5]
        normal = np.minimum(self.load / mass, along - np.minimum(self.a[:, 3], 0))
        pull, disc = self.tangential / turning[:, None], self.bound / turning
        wanted = pull - slip
        length = np.linalg.norm(wanted, axis=1)
        cut = np.minimum(1.0, np.divide(disc, length, out=np.ones_like(disc), where=length > 0))
        return np.hypot(normal, np.linalg.norm(pull - cut[:, None] * wanted, axis=1))

    def residual(self) -> float:
        """Norm of the natural map over that of the loads as velocities [-]; 0 without load."""
        scale = float(np.linalg.norm(self.load / self.a[:, 4]))
        return float(np.linalg.norm(self.residuals())) / scale if scale else 0.0

    def touching(self, bodies: int, features: np.ndarray, dt: float) -> Touching:
        """The contacts that carry load, with the overlaps that they had before the step.

        Args:
            bodies: Number of bodies.
            features: Wall feature of every listed wall contact.
            dt: The step.
        """
        loaded = self.load > 0
        i, j = self.i[loaded], self.j[loaded]
        walls = j >= bodies
        feature = np.full(len(i), -1)
        feature[walls] = features[self.slot[loaded][walls]]
        return Touching(
            i=i,
            j=np.where(walls, -1, j),
            feature=feature,
            normal=self.normal[loaded],
            overlap=self.a[loaded, 3] * dt,
            normal_force=self.load[loaded] / dt,
            tangential_force=self.tangential[loaded] / dt,
            energy=np.zeros(len(i)),
        )
