"""Bodies that come into a simulation between two steps: what they may be, and whether there is room for them."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from dembench.scene import Bodies
from dembench.scene.checks import LARGEST_OVERLAP
from dembench.solver.guard import SolverError
from dembench.solver.pairs import ONE, RADII


class Newcomers:
    """Bodies that are about to come into a simulation.

    Args:
        simulation: The simulation.
        position, velocity, angular_velocity, species, radius: See `Simulation.insert`.

    Attributes:
        species, radii, masses: Of the new bodies, [m] and [kg], shape (k,).

    Raises:
        SolverError: A value is not accepted, or there is no room.
    """

    def __init__(
        self, simulation: Any, position: Any, velocity: Any, angular_velocity: Any, species: Any, radius: Any
    ) -> None:
        scene = simulation.scene
        try:
            bodies = Bodies(position=position, velocity=velocity, angular_velocity=angular_velocity)
            n = len(bodies)
            self.species = np.broadcast_to(np.asarray(species, dtype=np.int32), (n,))
            given = None if radius is None else np.broadcast_to(np.asarray(radius, dtype=np.float64), (n,))
        except ValueError as error:
            raise SolverError(f"insert: {error}") from None
        accepted = _species_that_fit(simulation)
        unfit = np.setdiff1d(self.species, accepted)
        if len(unfit):
            names = ", ".join(str(k) for k in accepted)
            raise SolverError(f"species: {unfit[0]} is given; accepted are those of the bodies at the start: {names}")
        of_species = np.array([s.radius for s in scene.species])[self.species]
        state = simulation.state
        if given is not None and state.lookup != RADII and not np.array_equal(given, of_species):
            raise SolverError("radius: accepted are those of the species, for the scene gives no radii by body")
        self.radii = of_species if given is None else given
        same = simulation.radii.max(initial=0.0)
        if not state.needs.radii and same and (self.radii != same).any():
            raise SolverError(
                f"radius: {self.radii[self.radii != same][0]:g} m is given; accepted is {same:g} m, which all bodies "
                "have; Simulation(..., force=('polydisperse',)) takes others"
            )
        state.refuse_rotation("angular_velocity", bodies.angular_velocity)
        if not (self.radii > 0).all():
            raise SolverError(f"radius: {self.radii.min():g} m is given; accepted are numbers above 0")
        self.masses = np.array([scene.material(s.material).density for s in scene.species])[self.species]
        self.masses = self.masses * (4 / 3 * np.pi * self.radii**3)
        _check_room(simulation, bodies.position, self.radii)
        self._bodies, self._lookup, self._units = bodies, state.lookup, simulation.units

    def columns(self) -> dict[str, np.ndarray]:
        """Columns of the arrays of bodies by name, in scene units."""
        b, u = self._bodies, self._units
        mass, radius = self.masses / u.mass, self.radii / u.length
        blank = np.zeros((len(radius), 1))
        one = self._lookup == ONE
        return {
            "kin": np.hstack([b.position / u.length, b.velocity / u.velocity, radius[:, None], blank]),
            "spin": np.hstack([b.angular_velocity * u.time, blank]),
            "inv_m": 1 / mass,
            "inv_i": 1 / (0.4 * mass * radius**2),
            "kind": np.zeros_like(self.species) if one else self.species,
        }


def _species_that_fit(simulation: Any) -> list[int]:
    """Species for which the kernels were made: those of the bodies at the start, or of the small ones if all alike."""
    scene = simulation.scene
    small = simulation.state.small_species
    only = len(small) == 1 and simulation.state.lookup != RADII
    return [int(k) for k in (small if only else np.unique(scene.bodies.species))]


def _check_room(simulation: Any, position: np.ndarray, radius: np.ndarray) -> None:
    """Refuses bodies that overlap each other, those that are there or a wall at rest by more than 1 % of a radius.

    Raises:
        SolverError: Names the pair, or the body and the wall.
    """
    first = simulation.state.limit
    all_ids = np.concatenate([simulation.ids, first + np.arange(len(position))])
    others = np.concatenate([simulation.position, position])
    radii = np.concatenate([simulation.radii, radius])
    domain = simulation.scene.domain
    box = np.where(domain.periodic, np.subtract(domain.upper, domain.lower), 0.0)
    others -= np.where(box > 0, domain.lower, 0.0)
    others = np.where(box > 0, np.mod(others, np.where(box > 0, box, 1.0)), others)
    near = cKDTree(others, boxsize=box).query_ball_point(others[-len(position) :], radius + radii.max())
    for k, candidates in enumerate(near):
        own = len(others) - len(position) + k
        partners = np.array([c for c in candidates if c != own], dtype=int)
        offset = others[partners] - others[own]
        offset -= box * np.round(offset / np.where(box > 0, box, 1.0))
        distance = np.linalg.norm(offset, axis=1)
        overlap = (radius[k] + radii[partners] - distance) / np.minimum(radius[k], radii[partners])
        if len(overlap) and overlap.max() > LARGEST_OVERLAP:
            worst = partners[int(np.argmax(overlap))]
            raise SolverError(
                f"position: particles {all_ids[own]} and {all_ids[worst]} would overlap by {overlap.max():.2%} of the "
                f"smaller radius; accepted is up to {LARGEST_OVERLAP:.0%}"
            )
    for wall in simulation.scene.walls:
        if wall.motion is None and hasattr(wall, "signed_distance"):
            overlap = 1 - wall.signed_distance(position) / radius
            worst = int(np.argmax(overlap))
            if overlap[worst] > LARGEST_OVERLAP:
                raise SolverError(
                    f"position: particle {first + worst} would overlap wall {wall.name} by {overlap[worst]:.2%} of its "
                    f"radius; accepted is up to {LARGEST_OVERLAP:.0%}"
                )
