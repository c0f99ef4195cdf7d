"""What can be done to a simulation between steps, and what can be looked at beyond its arrays."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dembench.scene import features
from dembench.scene.overlap import largest_overlap
from dembench.solver.access import Access
from dembench.solver.diagnostics import WallLayer, wall_layer
from dembench.solver.energy import Energy, kinetic
from dembench.solver.export import write_csv, write_vtkhdf
from dembench.solver.full_state import FullState
from dembench.solver.guard import SolverError
from dembench.solver.insertion import Newcomers
from dembench.solver.inspection import Contacts, contacts_of
from dembench.solver.population import insert, remove
from dembench.solver.relaxing import relax
from dembench.solver.saving import array_bytes
from dembench.solver.shapes.stepper import ImpulseShapes, SoftShapes
from dembench.solver.state import State
from dembench.solver.walls.loads import FORCE, TORQUE, WORK


class Operations(Access):
    """Inspection, export, relaxation, forces from outside, removal and insertion."""

    def overlap(self) -> float:
        """Largest overlap of two bodies at present [m], 0 where none touch."""
        if features(self.scene).shapes:
            return max((depth for _i, _j, depth in self._shaped().overlaps()), default=0.0)
        return largest_overlap(self.position, self.radii, self.scene.domain)

    def contacts(self) -> Contacts:
        """The contacts of the present state with their forces; those of the impulse solver are of its last step.

        Raises:
            SolverError: The lists are full.
        """
        self._refresh()
        if isinstance(self.state, FullState):
            raise SolverError("contacts can be inspected with half lists only (lists='half')")
        return contacts_of(self, self._stepper.contacts())

    def coordination_number(self) -> float:
        """Mean number of contacts of a body with other bodies [-], 0 where there is no body."""
        found = self.contacts()
        pairs = np.unique(np.stack([found.i, found.j])[:, found.j >= 0], axis=1)
        return 2 * pairs.shape[1] / max(1, self.state.total)

    def wall_layer(self, wall: str, thickness: float) -> WallLayer:
        """How the bodies next to a moving wall follow it; `bodies` are ids.

        Args:
            wall: Name of the wall.
            thickness: Gap up to which a body belongs to the layer [m].

        Raises:
            SolverError: There is no such wall.
            ValueError: It does not move.
        """
        walls = {w.name: w for w in self.scene.walls}
        if wall not in walls:
            raise SolverError(f"wall: there is no wall '{wall}'; accepted are {', '.join(walls)}")
        state = (self.position, self.velocity, self.angular_velocity, self.radii)
        layer = wall_layer(walls[wall], thickness, *state)
        return replace(layer, bodies=self.ids[layer.bodies])

    def wall_force(self, name: str) -> np.ndarray:
        """Force of all bodies on a wall in the last step [N], shape (3,): at its end, or its mean for impulses."""
        return self._wall_loads(name)[FORCE:TORQUE] * self.units.force

    def wall_torque(self, name: str) -> np.ndarray:
        """Torque of all bodies on a wall in the last step [N m], shape (3,).

        It is about the centre of the wall's motion, where that is by now; about the origin without a motion.
        """
        return self._wall_loads(name)[TORQUE:WORK] * self.units.energy

    def wall_work(self, name: str) -> float:
        """Work that a wall has done on the bodies since the start [J]."""
        return float(self._wall_loads(name)[WORK]) * self.units.energy

    def _wall_loads(self, name: str) -> np.ndarray:
        names = self.state.walls.names
        if name not in names:
            raise SolverError(
                f"wall '{name}' is not known; accepted are {', '.join(names) or 'none: there are no walls'}"
            )
        if not self.state.walls.options.loads:
            raise SolverError(
                f"the loads of wall '{name}' are not summed; accepted is Simulation(..., wall_loads=True)"
            )
        return self.state.walls.loads()[names.index(name)]

    def largest_overlap(self) -> float:
        """Largest overlap of two bodies met in any step since the start [m]."""
        return self._stepper.largest_overlap() * self.units.length

    def kinetic_energy(self) -> float:
        """Translational and rotational kinetic energy [J]."""
        return sum(kinetic(self))

    def energy(self) -> Energy:
        """The energy and its balance, which begins with the first call and anew after a change from outside.

        Raises:
            SolverError: As for `contacts`.
        """
        return self._balance.energy(self)

    def counters(self) -> dict[str, float]:
        """Figures about the run, by name."""
        return {
            "list rebuilds": self.state.rebuilds,
            "bytes of all arrays": array_bytes(self),
            "largest overlap in any step [m]": self.largest_overlap(),
            **{
                f"left through {sink.name}": int(gone)
                for sink, gone in zip(self.scene.sinks, self.state.drained, strict=True)
            },
            **self.state.counts(),
            **self._stepper.counters(),
        }

    def export_csv(self, path: str | Path) -> None:
        """Writes the present state as a table with a row per body."""
        write_csv(Path(path), self)

    def export_vtkhdf(self, path: str | Path) -> None:
        """Appends the present state to a VTKHDF file for ParaView; a file that is not there is made.

        Raises:
            ValueError: The file has this time or a later one.
        """
        write_vtkhdf(Path(path), self)

    def relax(
        self, speed_limit: float | None = None, until: float = 0.01, steps: int = 200_000, rest: bool = True
    ) -> int:
        """Lets overlapping bodies apart, none of them faster than a limit, before a run.

        Time goes on as in `step`. Coincident centres part along a direction that is the same every time.

        Args:
            speed_limit: Largest speed [m/s]; None takes sqrt(2 g d) with the smallest diameter d, or, without gravity,
                d / 1000 in a step.
            until: Overlap that is left, of two bodies and of a body and a wall at rest, in smallest radii.
            steps: Largest number of steps.
            rest: Whether all bodies that can move are at rest afterwards.

        Returns:
            Number of steps made.

        Raises:
            SolverError: The limit is not above 0, overlaps are left after `steps`, or the lists are full.
        """
        self._changeable()
        made = relax(self, speed_limit, until, steps)
        if rest:
            held = [c.bodies for c in self.scene.constraints if c.kind == "kinematic"]
            keeps = np.isin(self.ids, np.concatenate([*held, []]))[:, None]
            self.velocity = np.where(keeps, self.velocity, 0.0)
            self.angular_velocity = np.where(keeps, self.angular_velocity, 0.0)
        return made

    # ---- forces from outside

    def set_force(self, force: Any) -> None:
        """Constant forces on the bodies [N], shape (n, 3), from now on.

        Raises:
            SolverError: The shape or a value is not accepted, or the solver cannot: full lists, bodies not spheres.
        """
        self._drivable()
        self.drive.set_force(self.ids, self._vectors("force", force))

    def set_torque(self, torque: Any) -> None:
        """Constant torques on the bodies [N m], shape (n, 3), from now on; errors as for `set_force`."""
        self._drivable()
        torques = self._vectors("torque", torque)
        self.state.refuse_rotation("torque", torques)
        self.drive.set_torque(self.ids, torques)

    def add_spring(
        self, body: int, stiffness: float, anchor: Any, velocity: Any = (0.0, 0.0, 0.0), damping: float = 0.0
    ) -> int:
        """Ties a body to an anchor that moves: a force k (a - x) + c (v_a - v) on its centre.

        The spring is explicit: stable while the step is below 2 sqrt(m / k).

        Args:
            body: Id of the body.
            stiffness, damping: k [N/m] and c [N s/m].
            anchor, velocity: Where the anchor is now [m], shape (3,), and its velocity [m/s].

        Returns:
            Index of the spring, for `spring_force`.

        Raises:
            SolverError: As for `set_force`, or there is no such body.
        """
        self._drivable()
        if body not in self.ids:
            raise SolverError(f"body: there is no body {body}; there are {self.state.total} bodies, see `ids`")
        return self.drive.add_spring(int(body), stiffness, anchor, velocity, damping, self.time)

    def spring_force(self, spring: int) -> np.ndarray:
        """Force of a spring on its body now [N], shape (3,); 0 where the body has left."""
        return self.drive.spring_forces(self.state, self.time)[spring]

    def _drivable(self) -> None:
        if isinstance(self.state, FullState) or isinstance(self._stepper, SoftShapes | ImpulseShapes):
            raise SolverError("forces from outside act on spheres with half lists only")

    # ---- bodies that leave and come

    def remove(self, ids: Any) -> None:
        """Takes bodies out; the others go on with their ids and contacts.

        Args:
            ids: Ids of the bodies, shape (k,).

        Raises:
            SolverError: One of them is not there, or the lists are full.
        """
        state = self._changeable()
        ids = np.atleast_1d(np.asarray(ids, dtype=np.int64))
        missing = np.setdiff1d(ids, self.ids)
        if len(missing):
            raise SolverError(f"ids: there is no body {missing[0]}; there are {state.total} bodies, see `ids`")
        if len(ids):
            self._balance.begin = math.nan
            self._relist(remove(state, np.isin(state.identity.numpy()[: state.total], ids)))

    def insert(
        self, position: Any, velocity: Any = None, angular_velocity: Any = None, species: Any = 0, radius: Any = None
    ) -> np.ndarray:
        """Puts new bodies in and returns their ids, shape (k,).

        Args:
            position: Centres [m], shape (k, 3).
            velocity, angular_velocity: [m/s], [rad/s], shape (k, 3); None means at rest.
            species: Index into the scene's species, a number or shape (k,): one that bodies of the scene have.
            radius: Radii [m], a number or shape (k,), where the scene gives radii by body; None means of the species.

        Raises:
            SolverError: A value is not accepted, or a body would overlap another or a wall at rest by more than 1 %.
        """
        state = self._changeable()
        if features(self.scene).shapes:
            raise SolverError("insert: scenes with bodies that are no spheres take no new bodies")
        new = Newcomers(self, position, velocity, angular_velocity, species, radius)
        ids = state.limit + np.arange(len(new.radii))
        if len(ids):
            self._species = np.concatenate([self._species, new.species])
            self._later_radii = np.append(self._later_radii, new.radii)
            self._later_masses = np.append(self._later_masses, new.masses)
            insert(state, new.columns(), ids)
            self.drive.grow(state.limit)
            self._changed = True
            self._balance.begin = math.nan
        return ids

    def _changeable(self) -> State:
        """The state, which bodies can leave and come into."""
        if not isinstance(self.state, State):
            raise SolverError("bodies can leave and come with half lists only (lists='half')")
        self._refresh()
        return self.state
