"""Simulation: a scene that is stepped, state in and out as numpy arrays in SI units and in the scene's order."""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Literal

import numpy as np

from dembench.scene import Scene, scene_from_arrays
from dembench.solver import soft
from dembench.solver.drive import Drive
from dembench.solver.energy import Balance
from dembench.solver.guard import SolverError, check_step
from dembench.solver.impulse.compliant_stepper import CompliantImpulses
from dembench.solver.impulse.stepper import Impulses
from dembench.solver.methods import carriers, method_of
from dembench.solver.operations import Operations
from dembench.solver.population import drain
from dembench.solver.saving import read_state, restore, write_state
from dembench.solver.softening import softening_of
from dembench.solver.state import State
from dembench.solver.timestep import choose_step
from dembench.solver.units import scene_units

FIRST_BLOCK, PROGRESS = 16, 0.125
"""Steps before the first call of `progress`; wall time between two calls below which there are fewer of them [s]."""


class Simulation(Operations):
    """A scene on the way through time.

    Args:
        scene: What is simulated.
        dt: Time step [s]; None takes the step of the closed division, "auto" what `timestep.choose_step` chooses for
            the soft-sphere solver.
        threads: Threads that share a step.
        precision: "float32" (positions and velocities are float64 all the same) or "float64" throughout.
        midpoint: Dashpots use the mean velocity of the step, which allows a larger step.
        allow_unstable: Accept a step beyond the stability guard; `warnings` then says so.
        method: "soft-sphere" (the scene's Hertz-Mindlin law, explicit) or "impulse"; None takes "impulse" where the
            scene's law is rigid, else "soft-sphere".
        rows: Contacts of the impulse solver: "compliant" (the scene's soft-sphere law, implicit) or "rigid" (the
            restitution and friction of the pair laws); None takes "rigid" for a rigid law and for bodies that are no
            spheres, else "compliant".
        substeps: Substeps of a step with compliant rows; None takes as many as the contacts of the step need.
        velocity_sweeps: Sweeps over compliant rows in a substep, 1 where None, or, with full lists, the largest number
            of them, 64 where None; largest number of sweeps over rigid rows in a step, 8 where None.
        position_sweeps: Largest number of position sweeps in a step with rigid rows.
        stabilization: Rigid rows carry on after the sweeps where matter is at rest, until its weight is carried.
        device: "cpu", or a CUDA device such as "cuda:0" for the soft-sphere solver and compliant rows.
        lists: Neighbour lists of both: "half" (threads of the CPU) or "full" (CUDA devices; also runs on the CPU, with
            one thread). None takes what the device needs.
        softening: Softer materials for the soft-sphere solver, within the overlap budget of `softening.softening_of`;
            `warnings` then says how soft.
        force: Names of features (`needs.FORCEABLE`) that are computed though the scene does not need them, to measure
            what leaving them out saves.
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
        force: Iterable[str] = (),
    ):
        force = list(force)
        settings = {name: value for name, value in locals().items() if name not in ("self", "scene")}
        chosen = method_of(scene, settings)
        if chosen.impulses and (softening or dt == "auto"):
            raise SolverError(f"softening and dt 'auto' are for the soft-sphere solver, not for {chosen.name}")
        softer = softening_of(scene) if softening else None
        self.scene, solved = scene, softer.apply(scene) if softer else scene
        if dt is not None and dt != "auto" and not 0 < dt < math.inf:
            raise SolverError(f"dt = {dt}: accepted is a finite number above 0 [s]")
        self.dt = choose_step(solved, midpoint).step if dt == "auto" else dt or scene.closed_step()
        self.settings = {**settings, "dt": self.dt}
        self.steps = 0
        self._species, self._later_radii, self._later_masses = scene.bodies.species, np.zeros(0), np.zeros(0)
        self.drive = Drive(len(scene.bodies), halves=not chosen.impulses, steady=chosen.compliant)
        self._balance = Balance()
        self.units = scene_units(scene)
        self.warnings = [] if chosen.impulses else check_step(solved, self.dt, allow_unstable)
        self.warnings += [softer.text()] if softer else []
        self.state, self._stepper = carriers(scene, solved, self.units, self.dt, chosen)
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
            progress: Called with the number of steps made so far of the n, about every quarter of a second.

        Raises:
            SolverError: A velocity is no longer finite; the message names the step.
        """
        self._refresh()
        made, block = 0, n if progress is None else FIRST_BLOCK
        while made < n:
            begin = time.perf_counter()
            try:
                done = self._advance(min(block, n - made))
            except SolverError as error:
                text = f"step {self.steps} (t = {self.time:g} s, dt = {self.dt:g} s): {error}"
                raise SolverError(text, error.reason) from None
            made += done
            self.steps += done
            if progress is not None:
                progress(made)
                block = 2 * block if time.perf_counter() - begin < PROGRESS else max(1, block // 2)
        if isinstance(self.state, State):
            left, touched = drain(self.state)
            if left:
                self._relist(touched)

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

    def _advance(self, n: int) -> int:
        """Up to n steps, one where forces from outside act; returns how many."""
        if isinstance(self._stepper, CompliantImpulses):
            self._stepper.driven = self.drive.active
        if not self.drive.active:
            return self._stepper.advance(n, self.steps)
        if isinstance(self._stepper, Impulses):
            gain = self.drive.acceleration(self.state, self.time) * self.dt
            self._stepper.expect(gain / self.units.velocity)
        self.drive.before(self.state, self.time, self.dt)
        while not self._stepper.advance(1, self.steps):
            pass
        self.drive.after(self.state, self.time + self.dt, self.dt)
        return 1
