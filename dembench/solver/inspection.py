"""The contacts of a state: who touches whom, where, how hard, and how fast the surfaces slide."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dembench.solver.periodic import wrapped


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
        point: Middle of the overlap, shape (k, 3); None for spheres, where it follows from the normal.
    """

    i: np.ndarray
    j: np.ndarray
    feature: np.ndarray
    normal: np.ndarray
    overlap: np.ndarray
    normal_force: np.ndarray
    tangential_force: np.ndarray
    energy: np.ndarray
    point: np.ndarray | None = None


@dataclass(frozen=True)
class Contacts:
    """The contacts of a simulation, ordered by i, then j, then feature of the wall.

    Two bodies that are no spheres may touch at several points, each a contact.

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


def contacts_of(simulation: Any, found: Touching) -> Contacts:
    """Contacts of a simulation in SI units and by id, from those that its stepper found."""
    state, u, scene = simulation.state, simulation.units, simulation.scene
    kin = state.bodies.kin.numpy()
    spin = np.zeros((len(kin), 3))
    if state.needs.rotation:
        spin = state.bodies.spin.numpy()[:, :3].astype(np.float64)
    identity = state.identity.numpy()
    walls = tuple(wall.name for wall in scene.walls)
    of_feature = state.walls.record.features.numpy()["owner"]
    i, j, pairs = found.i.copy(), found.j.copy(), found.j >= 0
    # i is the body of the lower id, so that a pair stands in one way only
    swap = np.flatnonzero(pairs)[identity[i[pairs]] > identity[j[pairs]]]
    i[swap], j[swap] = found.j[swap], found.i[swap]
    sign = np.ones((len(i), 1))
    sign[swap] = -1
    normal = sign * found.normal
    lever = -(kin[i, 6] - found.overlap / 2)[:, None] * normal
    other = ((kin[j, 6] - found.overlap / 2)[:, None] * normal)[pairs]
    if found.point is not None:
        lever, other = found.point - kin[i, :3], (found.point - kin[j, :3])[pairs]
    point = kin[i, :3] + lever
    slip = kin[i, 3:6] + np.cross(spin[i], lever)
    slip[pairs] -= kin[j[pairs], 3:6] + np.cross(spin[j[pairs]], other)
    slip[~pairs] -= state.walls.surface_velocity(found.feature[~pairs], point[~pairs])
    slip -= (slip * normal).sum(axis=1)[:, None] * normal
    wall = np.full(len(i), -1)
    wall[~pairs] = of_feature[found.feature[~pairs]]
    ids = np.where(pairs, identity[np.maximum(j, 0)], -1)
    order = np.lexsort((found.feature, ids, identity[i]))
    return Contacts(
        i=identity[i][order],
        j=ids[order],
        wall=wall[order],
        walls=walls,
        point=wrapped(scene, point[order] * u.length),
        normal=normal[order],
        overlap=found.overlap[order] * u.length,
        normal_force=found.normal_force[order] * u.force,
        tangential_force=(sign * found.tangential_force)[order] * u.force,
        slip=slip[order] * u.velocity,
        energy=found.energy[order] * u.energy,
    )
