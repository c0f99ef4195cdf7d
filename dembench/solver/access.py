"""The state of a simulation as numpy arrays in SI units, by ascending id: read and set between steps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from dembench.scene import Scene, features
from dembench.scene.shape_overlap import Shaped
from dembench.solver.body_arrays import BodyArrays
from dembench.solver.drive import Drive
from dembench.solver.energy import Balance
from dembench.solver.full import FullSpheres
from dembench.solver.full_impulse import FullImpulses
from dembench.solver.full_state import FullState
from dembench.solver.guard import SolverError
from dembench.solver.impulse.compliant_stepper import CompliantImpulses
from dembench.solver.impulse.stepper import Impulses
from dembench.solver.periodic import wrapped
from dembench.solver.shapes.stepper import ImpulseShapes, SoftShapes
from dembench.solver.soft import SoftSpheres
from dembench.solver.units import Units
from dembench.solver.workspace import BLOCK, blocks

Stepper = SoftSpheres | FullSpheres | Impulses | CompliantImpulses | FullImpulses | SoftShapes | ImpulseShapes


class Access:
    """What a simulation holds, and its bodies as arrays.

    Attributes:
        scene, dt, steps, drive, units, state: See `Simulation`.
    """

    scene: Scene
    dt: float
    steps: int
    drive: Drive
    units: Units
    state: BodyArrays
    _stepper: Stepper
    _balance: Balance
    # by id, of all bodies that are or were there
    _species: np.ndarray
    # of those that came in
    _later_radii: np.ndarray
    _later_masses: np.ndarray
    # whether lists and forces are those of another state
    _changed: bool

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.steps * self.dt

    @property
    def ids(self) -> np.ndarray:
        """Ids of the bodies in the order of all arrays, ascending, shape (n,).

        Bodies of the scene have their index there; later ones follow. An id is never given twice.
        """
        return self.state.ids()

    def table(self, block: int = BLOCK) -> Iterator[np.ndarray]:
        """The bodies by ascending id, in tables of at most `block` of them; never are all of them copied at once.

        Yields:
            Rows of id, centre [m], velocity [m/s] and angular velocity [rad/s], shape (k, 10).
        """
        ids, places = self.state.identity.numpy(), self.state.places()
        kin, spin = (getattr(self.state.bodies, name).numpy() for name in ("kin", "spin"))
        for part in blocks(len(places), block):
            at = places[part]
            rows = np.zeros((len(at), 10))
            rows[:, 0] = ids[at]
            rows[:, 1:4] = wrapped(self.scene, kin[at, :3] * self.units.length)
            rows[:, 4:7] = kin[at, 3:6] * self.units.velocity
            if len(spin):
                rows[:, 7:] = spin[at, :3].astype(np.float64) / self.units.time
            yield rows

    @property
    def species(self) -> np.ndarray:
        """Indices into the scene's species, shape (n,)."""
        return self._species[self.ids]

    @property
    def radii(self) -> np.ndarray:
        """Radii [m], shape (n,)."""
        return np.append(self.scene.radii(), self._later_radii)[self.ids]

    @property
    def masses(self) -> np.ndarray:
        """Masses [kg], shape (n,)."""
        return np.append(self.scene.masses(), self._later_masses)[self.ids]

    @property
    def position(self) -> np.ndarray:
        """Centres [m], shape (n, 3); can be set."""
        return wrapped(self.scene, self.state.read("kin", 0, self.units.length))

    @position.setter
    def position(self, value: Any) -> None:
        self._write("position", value, "kin", 0, self.units.length)

    @property
    def velocity(self) -> np.ndarray:
        """Velocities [m/s], shape (n, 3); can be set, but fixed bodies stay at rest."""
        return self.state.read("kin", 3, self.units.velocity)

    @velocity.setter
    def velocity(self, value: Any) -> None:
        self._write("velocity", value, "kin", 3, self.units.velocity, ("fixed",))

    def motion(self, ids: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """Centres [m] and velocities [m/s] of bodies, two of shape (m, 3), cheap for a few.

        Raises:
            SolverError: One of them is gone, by the reason "lost particles".
        """
        rows = self.state.bodies.kin.numpy()[self.state.slots(ids)].astype(np.float64)
        position = wrapped(self.scene, rows[:, :3] * self.units.length)
        return position, rows[:, 3:6] * self.units.velocity

    @property
    def angular_velocity(self) -> np.ndarray:
        """Angular velocities [rad/s], shape (n, 3); can be set, but fixed and rotation-locked bodies do not turn."""
        return self.state.read("spin", 0, 1 / self.units.time)

    @angular_velocity.setter
    def angular_velocity(self, value: Any) -> None:
        self._write("angular_velocity", value, "spin", 0, 1 / self.units.time, ("fixed", "rotation-locked"))

    @property
    def orientation(self) -> np.ndarray:
        """Unit quaternions (x, y, z, w) that turn the frames of the shapes into space, shape (n, 4).

        Raises:
            SolverError: The scene has spheres only, whose orientation is not followed.
        """
        if not isinstance(self._stepper, SoftShapes | ImpulseShapes):
            raise SolverError("orientation: followed in scenes with shapes only, this one has spheres")
        return self._stepper.shapes.orientation[self.ids]

    @property
    def probes(self) -> np.ndarray:
        """Spheres with which bodies touch, rows (x, y, z, r) [m], shape (m, 4), body by body.

        The bodies themselves where they are spheres, the spheres of clumps, the probes of grains.
        """
        if features(self.scene).shapes:
            bodies = self._shaped()
            return np.vstack([bodies.probes(i) for i in range(self.state.total)])
        return np.column_stack([self.position, self.radii])

    def _shaped(self) -> Shaped:
        return Shaped(self.scene.species, self.species, self.position, self.orientation)

    # ---- changes of the state

    def _write(
        self, field: str, value: Any, name: str, first: int, scale: float, without: tuple[str, ...] = ()
    ) -> None:
        """Sets three columns of a state array, but those of bodies under a constraint `without` to zero."""
        array = self._vectors(field, value)
        for constraint in self.scene.constraints:
            if constraint.kind in without:
                array[np.isin(self.ids, constraint.bodies)] = 0
        self.state.write(name, first, array, scale)
        self._changed = True
        self._balance.begin = math.nan

    def _vectors(self, field: str, value: Any) -> np.ndarray:
        """A copy of an array with a finite vector for each body; SolverError names the field and the body."""
        array = np.array(value, dtype=np.float64)
        if array.shape != (self.state.total, 3):
            raise SolverError(f"{field}: shape {array.shape} is given, accepted is ({self.state.total}, 3)")
        bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
        if len(bad):
            raise SolverError(
                f"{field}: particle {self.ids[bad[0]]} has the value {array[bad[0]]}; accepted are finite numbers"
            )
        return array

    def _refresh(self) -> None:
        """Lists and forces of a state that was changed from outside; the contact memory of lasting contacts stays."""
        if self._changed:
            self._changed = False
            self._stepper.prepare(self.steps)

    def _relist(self, forces: bool) -> None:
        """Lists of a state whose bodies have changed, and where asked for the forces anew."""
        if forces or isinstance(self.state, FullState):
            self._stepper.prepare(self.steps)
        else:
            self._stepper.relist(self.steps)
