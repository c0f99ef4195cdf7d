"""Simulation: a scene that is stepped, state in and out as numpy arrays in SI units and in the scene's order."""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from dembench.scene import Rigid, Scene, WallForce, features, scene_from_arrays
from dembench.scene.overlap import largest_overlap
from dembench.scene.shape_overlap import Shaped
from dembench.solver import soft
from dembench.solver.diagnostics import WallLayer, wall_layer
from dembench.solver.drive import Drive
from dembench.solver.energy import Balance, Energy, kinetic
from dembench.solver.export import write_csv, write_vtkhdf
from dembench.solver.full import FullSpheres, check_device
from dembench.solver.full_state import FullState
from dembench.solver.guard import SolverError, check_step
from dembench.solver.impulse import compliant_stepper as compliant
from dembench.solver.impulse import stepper as rigid
from dembench.solver.insertion import Newcomers
from dembench.solver.inspection import Contacts, contacts_of
from dembench.solver.laws import LawOptions
from dembench.solver.periodic import wrapped
from dembench.solver.population import drain, insert, remove
from dembench.solver.relaxing import relax
from dembench.solver.saving import read_state, restore, write_state
from dembench.solver.shapes.stepper import ImpulseShapes, SoftShapes, refuse_for_shapes
from dembench.solver.softening import softening_of
from dembench.solver.state import State
from dembench.solver.timestep import choose_step
from dembench.solver.units import scene_units
from dembench.solver.walls.loads import FORCE, TORQUE, WORK

Stepper = soft.SoftSpheres | FullSpheres | rigid.Impulses | compliant.CompliantImpulses | SoftShapes | ImpulseShapes


class Simulation:
    """A scene on the way through time.

    Args:
        scene: What is simulated.
        dt: Time step [s]; None takes the step of the closed division, "auto" what `timestep.choose_step` chooses for
            the soft-sphere solver.
        threads: Threads that share a step of the soft-sphere solver.
        precision: "float32" (positions and velocities are float64 all the same) or "float64" throughout.
        midpoint: Dashpots use the mean velocity of the step, which allows a larger step.
        allow_unstable: Accept a step beyond the stability guard; `warnings` then says so.
        method: "soft-sphere" (the scene's Hertz-Mindlin law, explicit) or "impulse"; None takes "impulse" where the
            scene's law is rigid, else "soft-sphere".
        rows: Contacts of the impulse solver: "compliant" (the scene's soft-sphere law, implicit) or "rigid" (the
            restitution and friction of the pair laws); None takes "rigid" for a rigid law and for bodies that are no
            spheres, else "compliant".
        substeps: Substeps of a step with compliant rows; None takes as many as the stiffest contact of the step needs.
        velocity_sweeps: Sweeps over compliant rows in a substep, 1 where None; largest number of sweeps over rigid rows
            in a step, 8 where None.
        position_sweeps: Largest number of position sweeps in a step with rigid rows.
        stabilization: Rigid rows carry on after the sweeps where matter is at rest, until its weight is carried.
        device: "cpu", or a CUDA device such as "cuda:0" for the soft-sphere solver.
        lists: Neighbour lists of the soft-sphere solver: "half" (threads of the CPU) or "full" (CUDA devices; also runs
            on the CPU, with one thread). None takes what the device needs.
        softening: Softer materials for the soft-sphere solver, within the overlap budget of `softening.softening_of`;
            `warnings` then says how soft.
        wall_loads: Sum up what bodies do to walls, for `wall_force`, `wall_torque` and `wall_work`; None does so where
            the scene observes a wall force.

    Attributes:
        scene, dt: See above.
        settings: The arguments beside the scene, by name.
        steps: Steps made.
        drive: Forces from outside; set by `set_force`, `set_torque` and `add_spring`.
        warnings: What the user should know about the settings.
        compile_seconds: Time spent on compiling or loading kernels [s].

    Raises:
        SolverError: The scene has a feature that the solver lacks, or dt is beyond the guard.
    """

    def __init__(
        self,
        scene: Scene,
        dt: float | Literal["auto"] | None = None,
        threads: int = 1,
        precision: str = "float32",
        midpoint: bool = False,
        allow_unstable: bool = False,
        method: str | None = None,
        rows: Literal["compliant", "rigid"] | None = None,
        substeps: int | None = None,
        velocity_sweeps: int | None = None,
        position_sweeps: int = 12,
        stabilization: bool = True,
        device: str = "cpu",
        lists: Literal["half", "full"] | None = None,
        softening: bool = False,
        wall_loads: bool | None = None,
    ):
        settings = {name: value for name, value in locals().items() if name not in ("self", "scene")}
        method = method or ("impulse" if isinstance(scene.law, Rigid) else "soft-sphere")
        rows = rows or ("rigid" if isinstance(scene.law, Rigid) or features(scene).shapes else "compliant")
        _known("method", method, ("soft-sphere", "impulse"))
        _known("rows", rows, ("compliant", "rigid"))
        if method == "impulse":
            faults = (rigid if rows == "rigid" else compliant).unsupported(scene)
        else:
            faults = soft.unsupported(scene)
        if faults:
            raise SolverError(f"the {method} solver cannot do: " + "; ".join(faults))
        if method != "soft-sphere" and (softening or dt == "auto"):
            raise SolverError(f"softening and dt 'auto' are for the soft-sphere solver, not for {method}")
        softer = softening_of(scene) if softening else None
        self.scene, solved = scene, softer.apply(scene) if softer else scene
        if dt is not None and dt != "auto" and not 0 < dt < math.inf:
            raise SolverError(f"dt = {dt}: accepted is a finite number above 0 [s]")
        for name, sweeps, least in (("velocity", velocity_sweeps, 1), ("position", position_sweeps, 0)):
            if sweeps is not None and sweeps < least:
                raise SolverError(f"{name}_sweeps = {sweeps}: accepted is {least} or more")
        self.dt = choose_step(solved, midpoint).step if dt == "auto" else dt or scene.closed_step()
        self.settings = {**settings, "dt": self.dt}
        self.steps = 0
        # by id, of all bodies that are or were there
        self._species, self._radii, self._masses = scene.bodies.species, scene.radii(), scene.masses()
        steady = method == "impulse" and rows == "compliant"
        self.drive = Drive(len(scene.bodies), halves=method == "soft-sphere", steady=steady)
        self._balance = Balance()
        self.units = scene_units(scene)
        self.warnings = [] if method == "impulse" else check_step(solved, self.dt, allow_unstable)
        self.warnings += [softer.text()] if softer else []
        lists = lists or ("half" if device == "cpu" else "full")
        check_device(device, lists, method)
        if lists == "full" and scene.sinks:
            raise SolverError("full lists cannot do: sinks")
        self.state: State
        self._stepper: Stepper
        if wall_loads is None:
            wall_loads = any(isinstance(seen, WallForce) for seen in scene.observables)
        if features(scene).shapes:
            if wall_loads:
                raise SolverError("wall_loads: loads of walls are not summed for bodies that are no spheres")
            refuse_for_shapes(lists, threads)
            self.state = State(scene, self.units, "float64", 1)
            if method == "impulse":
                sweeps = (velocity_sweeps or 8, position_sweeps)
                self._stepper = ImpulseShapes(scene, self.state, self.dt, *sweeps)
            else:
                self._stepper = SoftShapes(solved, self.state, self.dt, LawOptions.of(scene, "float64", midpoint))
        elif lists == "full":
            self.state = state = FullState(scene, self.units, precision, device, wall_loads)
            self._stepper = FullSpheres(solved, state, self.dt, precision, midpoint)
        elif method == "impulse":
            self.state = State(scene, self.units, precision, 1, wall_loads)
            if rows == "rigid":
                sweeps = (velocity_sweeps or 8, position_sweeps, stabilization)
                self._stepper = rigid.Impulses(scene, self.state, self.dt, precision, *sweeps)
            else:
                sweep = velocity_sweeps or 1
                self._stepper = compliant.CompliantImpulses(scene, self.state, self.dt, precision, substeps, sweep)
        else:
            self.state = State(scene, self.units, precision, threads, wall_loads)
            self._stepper = soft.SoftSpheres(solved, self.state, self.dt, precision, midpoint)
        begin = time.perf_counter()
        soft.load(device, *self._stepper.kernels, *vars(self.state.kernels).values())
        self.compile_seconds = time.perf_counter() - begin
        self._changed = True
        self._refresh()

    @classmethod
    def from_arrays(cls, position: Any, radius: Any, **arguments: Any) -> Simulation:
        """A simulation of spheres from arrays and numbers.

        Args:
            position: Centres [m], shape (n, 3).
            radius: Radii [m], a number or shape (n,).
            arguments: Other arguments of `dembench.scene.scene_from_arrays` and of `Simulation`.

        Raises:
            ValueError: An array or a number is not accepted; the message names the field.
            SolverError: As for `Simulation`.
        """
        known = inspect.signature(cls).parameters
        own = {name: arguments.pop(name) for name in list(arguments) if name in known}
        return cls(scene_from_arrays(position, radius, **arguments), **own)

    def step(self, n: int = 1, progress: Callable[[int], None] | None = None) -> None:
        """Advances by n steps.

        Bodies in a sink of the scene leave at the end, and on the way whenever the lists are rebuilt.

        Args:
            n: Number of steps.
            progress: Called with the number of steps made so far of the n, at least whenever the lists are rebuilt.

        Raises:
            SolverError: A velocity is no longer finite; the message names the step.
        """
        self._refresh()
        made = 0
        while made < n:
            try:
                done = self._advance(n - made)
            except SolverError as error:
                text = f"step {self.steps} (t = {self.time:g} s, dt = {self.dt:g} s): {error}"
                raise SolverError(text, error.reason) from None
            made += done
            self.steps += done
            if progress is not None:
                progress(made)
        left, touched = drain(self.state)
        if left:
            self._relist(touched)

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

    @property
    def species(self) -> np.ndarray:
        """Indices into the scene's species, shape (n,)."""
        return self._species[self.ids]

    @property
    def radii(self) -> np.ndarray:
        """Radii [m], shape (n,)."""
        return self._radii[self.ids]

    @property
    def masses(self) -> np.ndarray:
        """Masses [kg], shape (n,)."""
        return self._masses[self.ids]

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
        if isinstance(self._stepper, FullSpheres):
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
            "bytes per particle": self.state.memory_bytes() / max(1, self.state.total),
            "largest overlap in any step [m]": self.largest_overlap(),
            **{
                f"left through {sink.name}": int(gone)
                for sink, gone in zip(self.scene.sinks, self.state.drained, strict=True)
            },
            **self.state.counts(),
            **self._stepper.counters(),
        }

    # ---- files

    def save(self, path: str | Path) -> None:
        """Writes the complete state to a file, from which `load` goes on with the same bits."""
        self._refresh()
        write_state(Path(path), self, self.scene, self.settings)

    @classmethod
    def load(cls, path: str | Path) -> Simulation:
        """The simulation that `save` has written.

        Raises:
            SolverError: The file is not there, is damaged or was written by another version.
        """
        scene, settings, arrays = read_state(Path(path))
        made = cls(scene, **settings)
        restore(made, arrays, Path(path))
        return made

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
        self._can_change()
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
        self.drive.set_torque(self.ids, self._vectors("torque", torque))

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
        if isinstance(self._stepper, FullSpheres | SoftShapes | ImpulseShapes):
            raise SolverError("forces from outside act on spheres with half lists only")

    def _advance(self, n: int) -> int:
        """Up to n steps, one where forces from outside act; returns how many."""
        if isinstance(self._stepper, compliant.CompliantImpulses):
            self._stepper.driven = self.drive.active
        if not self.drive.active:
            return self._stepper.advance(n, self.steps)
        if isinstance(self._stepper, rigid.Impulses):
            gain = self.drive.acceleration(self.state, self.time) * self.dt
            self._stepper.expect(gain / self.units.velocity)
        self.drive.before(self.state, self.time, self.dt)
        while not self._stepper.advance(1, self.steps):
            pass
        self.drive.after(self.state, self.time + self.dt, self.dt)
        return 1

    # ---- bodies that leave and come

    def remove(self, ids: Any) -> None:
        """Takes bodies out; the others go on with their ids and contacts.

        Args:
            ids: Ids of the bodies, shape (k,).

        Raises:
            SolverError: One of them is not there, or the lists are full.
        """
        self._can_change()
        ids = np.atleast_1d(np.asarray(ids, dtype=np.int64))
        missing = np.setdiff1d(ids, self.ids)
        if len(missing):
            raise SolverError(f"ids: there is no body {missing[0]}; there are {self.state.total} bodies, see `ids`")
        if len(ids):
            self._balance.begin = math.nan
            self._relist(remove(self.state, np.isin(self.state.identity.numpy()[: self.state.total], ids)))

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
        self._can_change()
        if features(self.scene).shapes:
            raise SolverError("insert: scenes with bodies that are no spheres take no new bodies")
        new = Newcomers(self, position, velocity, angular_velocity, species, radius)
        ids = self.state.limit + np.arange(len(new.radii))
        if len(ids):
            self._species = np.concatenate([self._species, new.species])
            self._radii, self._masses = np.append(self._radii, new.radii), np.append(self._masses, new.masses)
            insert(self.state, new.columns(), ids)
            self.drive.grow(self.state.limit)
            self._changed = True
            self._balance.begin = math.nan
        return ids

    def _can_change(self) -> None:
        if self.state.device != "cpu" or isinstance(self.state, FullState):
            raise SolverError("bodies can leave and come with half lists only (lists='half')")
        self._refresh()

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
        if forces:
            self._stepper.prepare(self.steps)
        else:
            self._stepper.relist(self.steps)


def _known(field: str, value: str, accepted: tuple[str, ...]) -> None:
    """SolverError where a value is none of the accepted ones."""
    if value not in accepted:
        raise SolverError(f"{field} '{value}' is not known; accepted are {', '.join(accepted)}")
