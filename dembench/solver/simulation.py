"""Simulation: a scene that is stepped with the soft-sphere law, state in and out as numpy arrays in SI units."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import warp as wp

from dembench.scene import HertzMindlin, Scene, features
from dembench.solver.guard import SolverError, check_step
from dembench.solver.hertz import BIG_OVERFLOW, DONE, NOT_FINITE, REBUILD, StepOptions, advance_kernel
from dembench.solver.laws import LawOptions
from dembench.solver.pairs import kinds, lookup_mode, pair_table, wall_table
from dembench.solver.state import State
from dembench.solver.units import scene_units
from dembench.solver.walls import unsupported_walls, wall_materials

SKIN = 0.2
"""Gap up to which pairs are listed, in smallest diameters."""
NEAR_SKIN = 0.01
"""Gap up to which listed pairs are tested in every step, in smallest diameters."""
BIG_SKIN = 0.5
"""Gap up to which bodies are candidates of a large body, in smallest diameters."""


class Simulation:
    """Soft spheres with the Hertz-Mindlin law of the scene.

    Args:
        scene: What is simulated; see `unsupported(scene)` for what cannot be.
        dt: Time step [s]; None takes the step of the closed division.
        threads: Threads that share a step.
        precision: "float32" (positions and velocities are float64 all the same) or "float64" throughout.
        midpoint: Dashpots use the mean velocity of the step, which allows a larger step.
        allow_unstable: Accept a step beyond the stability guard; `warnings` then says so.

    Raises:
        SolverError: The scene has a feature that the solver lacks, or dt is beyond the guard.
    """

    def __init__(
        self,
        scene: Scene,
        dt: float | None = None,
        threads: int = 1,
        precision: str = "float32",
        midpoint: bool = False,
        allow_unstable: bool = False,
    ):
        faults = unsupported(scene)
        if faults:
            raise SolverError("the soft-sphere solver cannot do: " + "; ".join(faults))
        self.scene, self.dt = scene, dt or scene.closed_step()
        self.warnings = check_step(scene, self.dt, midpoint, allow_unstable)
        self.steps = 0
        self.units = u = scene_units(scene)
        diameter = 2 * float(scene.radii().min(initial=np.inf if len(scene.bodies) else 0.5)) / u.length
        self.state = State(scene, u, precision, threads, SKIN * diameter)
        self._near_skin, self._big_skin = NEAR_SKIN * diameter, BIG_SKIN * diameter
        self._options = step_options(scene, self.state, precision, midpoint)
        begin = time.perf_counter()
        self._kernel = advance_kernel(self._options)
        load(self._kernel, *vars(self.state.kernels).values())
        self.compile_seconds = time.perf_counter() - begin
        n_kinds = int(kinds(scene).max(initial=0)) + 1 if lookup_mode(scene) == "one" else len(scene.species)
        self._pairs, self._pair_columns = pair_table(scene, u, precision), n_kinds
        self._walls, self._wall_columns = wall_table(scene, u, precision), max(1, len(wall_materials(scene)))
        self._gravity = wp.vec3d(*(g / u.acceleration for g in scene.gravity))
        self._flags = wp.zeros(5, dtype=wp.int32, device="cpu")
        self._travel = wp.zeros(4 + 4 * self.state.parts, dtype=wp.float64, device="cpu")
        self._overlap = 0.0
        self._prepare()

    # ---- stepping

    def step(self, n: int = 1) -> None:
        """Advances by n steps.

        Raises:
            SolverError: A position, velocity or force is no longer finite; the message names the step.
        """
        left = n
        while left > 0:
            self._launch(left, self.dt / self.units.time)
            flags = self._flags.numpy()
            done, reason = int(flags[2]), int(flags[3])
            left -= done
            self.steps += done
            if reason == NOT_FINITE:
                raise SolverError(
                    f"a velocity is not finite at step {self.steps} (t = {self.time:g} s); "
                    f"the time step {self.dt:g} s may be too large",
                    reason="nan",
                )
            if reason == REBUILD:
                self._rebuild()
            elif reason == BIG_OVERFLOW:
                self.state.grow_big()
                self._travel.numpy()[2] = -1.0
            elif reason == DONE and left > 0 and done == 0:
                raise SolverError(f"no progress at step {self.steps}")

    def _prepare(self) -> None:
        """Builds the lists and evaluates the forces of the initial state, without growth of the contact springs."""
        self._rebuild()
        self._flags.numpy()[4] = 1
        self._launch(0, 0.0)

    def _rebuild(self) -> None:
        self.state.rebuild()
        self._travel.numpy()[:3] = 0.0, -1.0, -1.0

    def _launch(self, steps: int, memory_dt: float) -> None:
        s = self.state

        def one(part: int) -> None:
            wp.launch(
                self._kernel,
                dim=1,
                device="cpu",
                inputs=[
                    part,
                    s.parts,
                    steps,
                    memory_dt,
                    self.dt / self.units.time,
                    self._gravity,
                    s.ranges,
                    s.n,
                    s.total,
                    s.features,
                    self._pairs,
                    self._pair_columns,
                    self._walls,
                    self._wall_columns,
                    s.skin,
                    self._near_skin,
                    self._big_skin,
                    s.capacity,
                    s.wall_capacity,
                    s.big_capacity,
                    s.pair_count,
                    s.wall_count,
                    s.bodies,
                    s.lists,
                    s.near_count,
                    self._flags,
                    self._travel,
                ],
            )

        s.each_part(one)
        self._overlap = max(self._overlap, float(self._travel.numpy()[7::4].max()))

    # ---- state

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.steps * self.dt

    @property
    def position(self) -> np.ndarray:
        """Centres [m], shape (n, 3)."""
        return self.state.read("kin", 0, self.units.length)

    @property
    def velocity(self) -> np.ndarray:
        """Velocities [m/s], shape (n, 3)."""
        return self.state.read("kin", 3, self.units.velocity)

    @property
    def angular_velocity(self) -> np.ndarray:
        """Angular velocities [rad/s], shape (n, 3)."""
        return self.state.read("spin", 0, 1 / self.units.time)

    @property
    def force(self) -> np.ndarray:
        """Contact forces of the last evaluation [N], shape (n, 3)."""
        return self.state.read("load", 0, self.units.force)

    def largest_overlap(self) -> float:
        """Largest overlap of two bodies met in any step since the start [m]."""
        return self._overlap * self.units.length

    def counters(self) -> dict[str, float]:
        """Figures about the run: list rebuilds, bytes held, largest overlap of two bodies in any step [m]."""
        return {
            "list rebuilds": self.state.rebuilds,
            "bytes per particle": self.state.memory_bytes() / max(1, self.state.total),
            "largest overlap in any step [m]": self.largest_overlap(),
        }

    def kinetic_energy(self) -> float:
        """Translational and rotational kinetic energy [J]."""
        mass = self.scene.masses()
        inertia = 0.4 * mass * self.scene.radii() ** 2
        energy = mass @ (self.velocity**2).sum(axis=1) + inertia @ (self.angular_velocity**2).sum(axis=1)
        return 0.5 * float(energy)


def load(*kernels: Any) -> None:
    """Compiles kernels, or loads them from the cache."""
    for kernel in kernels:
        kernel.module.load(wp.get_device("cpu"))


def unsupported(scene: Scene) -> list[str]:
    """What of a scene the soft-sphere solver cannot do, one line each."""
    found = unsupported_walls(scene)
    if not isinstance(scene.law, HertzMindlin):
        found.append(f"contact law {scene.law.kind}")
    has = features(scene)
    for name, text in (
        ("rolling_friction", "rolling friction"),
        ("sinks", "sinks"),
        ("periodic", "periodic domains"),
    ):
        if getattr(has, name):
            found.append(text)
    return found


def step_options(scene: Scene, state: State, precision: str, midpoint: bool) -> StepOptions:
    """What of the soft-sphere step a scene needs."""
    has = features(scene)
    law = LawOptions(precision, has.friction, getattr(scene.law, "variant", "") == "rescaled", midpoint)
    return StepOptions(
        law=law,
        pairs=lookup_mode(scene),
        walls=has.walls,
        curved=has.curved_walls,
        moving=has.moving_walls,
        bigs=state.big_rows > 0,
        rotation=has.rotation,
        threads=state.parts > 1,
    )
