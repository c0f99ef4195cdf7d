"""The contacts of a state: who touches whom, where, how hard, and how fast the surfaces slide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Touching:
    """Contacts as a stepper hands them over: indices into its sorted arrays, scene units.

    Attributes:
        i, j: The two bodies, shape (k,); j is -1 where i touches a wall.
        feature: Index of the wall feature, shape (k,); -1 where i touches a body.
        normal: Unit vector from j, or from the wall, to i, shape (k, 3).
        overlap: Overlap, shape (k,).
        normal_force: Force along the normal on i, shape (k,).
        tangential_force: The rest of the force on i, shape (k, 3).
        energy: Elastic energy stored in the contact, shape (k,).
    """

    i: np.ndarray
    j: np.ndarray
    feature: np.ndarray
    normal: np.ndarray
    overlap: np.ndarray
    normal_force: np.ndarray
    tangential_force: np.ndarray
    energy: np.ndarray


@dataclass(frozen=True)
class Contacts:
    """The contacts of a simulation, ordered by i, then j, then wall.

    Attributes:
        i, j: Ids of the two bodies, i < j, shape (k,); j is -1 where i touches a wall.
        wall: Index into `walls`, shape (k,); -1 where i touches a body.
        walls: Names of the walls.
        point: Middle of the overlap [m], shape (k, 3).
        normal: Unit vector from j, or from the wall, to i, shape (k, 3).
        overlap: Overlap [m], shape (k,).
        normal_force: Force along the normal on i [N], shape (k,); on j it is the opposite.
        tangential_force: Tangential force on i [N], shape (k, 3); on j it is the opposite.
        slip: Tangential velocity of the surface of i past that of j or the wall [m/s], shape (k, 3).
        energy: Elastic energy stored in the contact [J], shape (k,).
    """

    i: np.ndarray
    j: np.ndarray
    wall: np.ndarray
    walls: tuple[str, ...]
    point: np.ndarray
    normal: np.ndarray
    overlap: np.ndarray
    normal_force: np.ndarray
    tangential_force: np.ndarray
    slip: np.ndarray
    energy: np.ndarray

    def __len__(self) -> int:
        return len(self.i)

    def force(self) -> np.ndarray:
        """Whole force on i [N], shape (k, 3)."""
        return self.normal_force[:, None] * self.normal + self.tangential_force

    def sum_by_body(self, ids: np.ndarray) -> np.ndarray:
        """Sum of the contact forces on each of some bodies [N], shape (len(ids), 3).

        Args:
            ids: Ids of the bodies, ascending.
        """
        total = np.zeros((len(ids), 3))
        force, pairs = self.force(), self.j >= 0
        np.add.at(total, np.searchsorted(ids, self.i), force)
        np.add.at(total, np.searchsorted(ids, self.j[pairs]), -force[pairs])
        return total
