"""What the states of all solvers have: the bodies in scene units, in arrays that are sorted by cell."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Scene
from dembench.solver.guard import SolverError
from dembench.solver.needs import Needs
from dembench.solver.pairs import kinds, lookup_mode
from dembench.solver.periodic import box_lengths, wrap_kernel
from dembench.solver.types import types, vec8d
from dembench.solver.units import Units
from dembench.solver.walls.features import WallSet
from dembench.solver.workspace import unwritten

BIG_RATIO = 3.0
"""A body is kept apart as large where its radius exceeds this many median radii."""
BIG_LIMIT = 16
"""At most this many bodies are kept apart; a scene with more, or with shapes, is sorted as a whole."""


class BodyArrays(ABC):
    """Particle arrays in scene units, sorted by cell; the lists belong to those that inherit.

    What the scene does not need has no elements: spins, torques and moments of inertia where nothing turns, contact
    memory where contacts remember nothing.

    Attributes:
        device: Where the arrays are.
        needs: What is there.
        lookup: How pair constants are looked up.
        cuts: Shares of the sorted bodies at which the ranges of the threads begin and end, shape (parts + 1,).
        n, total: Number of small particles, which are sorted, and of all; the large bodies stand behind them.
        small_species: Species of the small bodies of the scene, ascending.
        limit: Above all ids of bodies that there are or were.
        identity: Id of each body.
        sinks: Regions where bodies leave [m].
        drained: Number of bodies that each sink has taken.
        bodies: The Warp record that kernels take.
        kernels: The kernels of a rebuild, by name.
        rebuilds: How many there were.
        diameter: Smallest diameter [scene units].
        skin: Gap up to which pairs are listed [scene units]; set by the stepper before a rebuild.
        walls: The walls of the scene.
        low, box: Lower corner of the domain and lengths of its periodic axes, 0 on the others [scene units].
        wall_speed: Bound of the speed at which walls come towards bodies until the next rebuild [scene units].
    """

    device: Any = "cpu"

    def __init__(
        self,
        scene: Scene,
        units: Units,
        precision: str,
        threads: int,
        wall_loads: bool = False,
        needs: Needs | None = None,
    ):
        self.units = units
        self.needs = needs or Needs.of(scene)
        self.lookup = lookup_mode(scene, self.needs)
        self.types = types(precision)
        radii = scene.radii() / units.length
        self.diameter = 2 * float(radii.min()) if len(radii) else 1.0
        self.skin = 0.1 * self.diameter
        big = np.flatnonzero(radii > BIG_RATIO * np.median(radii)) if len(radii) else np.empty(0, int)
        if len(big) > BIG_LIMIT or self.needs.present.shapes:
            big = np.empty(0, int)
        self.total = self.limit = len(radii)
        self.n = self.total - len(big)
        ids = np.concatenate([np.setdiff1d(np.arange(self.total), big), big])
        self.small_species = np.unique(scene.bodies.species[ids[: self.n]])
        self.parts = max(1, min(threads, self.n // 64))
        self.cuts = np.linspace(0, 1, self.parts + 1)
        self.walls = WallSet(scene, units, self.parts, self.device, wall_loads, self.needs)
        self.wall_speed = 0.0
        self.low, self.box = np.array(scene.domain.lower) / units.length, box_lengths(scene) / units.length
        self.periodic = bool(self.box.any()) or self.needs.forces("periodic")
        self.radius = 0.0 if self.needs.radii else float(radii.max(initial=0.0))
        self.kernels = self._kernels()
        self.reach = 2 * float(radii[ids[: self.n]].max(initial=0.5))
        self.sinks = [sink.region for sink in scene.sinks]
        self.drained = np.zeros(len(self.sinks), dtype=np.int64)
        self.rebuilds = 0
        self._loaded = self.needs.loads
        self._pool = ThreadPoolExecutor(self.parts) if self.parts > 1 else None
        self.allocate(max(1, self.total))
        self.divide()
        self._fill(scene, radii, ids)
        self._lists()

    # ---- what depends on the lists

    @abstractmethod
    def _kernels(self) -> Any:
        """The kernels of a rebuild, by name."""

    @abstractmethod
    def allocate(self, n: int) -> None:
        """Empty arrays for n bodies."""

    @abstractmethod
    def _lists(self) -> None:
        """Makes the lists, with the room that they have at first."""

    @abstractmethod
    def rebuild(self) -> None:
        """Sorts the small particles by cell and builds all lists anew; contact memory is carried over."""

    @abstractmethod
    def _box(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the box around the centres of the small bodies [scene units]."""

    @abstractmethod
    def counts(self) -> dict[str, float]:
        """How much the lists hold, by name."""

    # ---- allocation

    def _wrapping(self) -> dict[str, Any]:
        return {"wrap": wrap_kernel(self.types.precision)} if self.periodic else {}

    def _record(self) -> Any:
        """A record Bodies without arrays."""
        b = self.types.Bodies()
        b.radius = self.radius
        b.box = wp.vec3d(*self.box)
        b.inverse_box = wp.vec3d(*np.divide(1, self.box, out=np.zeros(3), where=self.box > 0))
        return b

    def _bodies(self, n: int) -> Any:
        t, turns = self.types, self.needs.rotation
        b = self._record()
        b.kin = wp.zeros(n, dtype=vec8d, device="cpu")
        b.spin = wp.zeros(n * turns, dtype=t.vec4, device="cpu")
        b.load = wp.zeros(n * (self._loaded and turns), dtype=t.vec8, device="cpu")
        b.force = wp.zeros(n * (self._loaded and not turns), dtype=t.vec4, device="cpu")
        b.inv_m = wp.zeros(n, dtype=t.real, device="cpu")
        b.inv_i = wp.zeros(n * turns, dtype=t.real, device="cpu")
        b.kind = wp.zeros(n, dtype=wp.int32, device="cpu")
        return b

    def loads(self) -> wp.array:
        """What acts on the bodies, in rows that begin with the force: `load`, or `force` where nothing turns.

        There are none where no step needs them and `keep_loads` was not called.
        """
        return self.bodies.load if self.needs.rotation else self.bodies.force

    def keep_loads(self) -> None:
        """Makes `loads`, zeros, where there are none."""
        if not self._loaded:
            self._loaded = True
            made = self._bodies(len(self.bodies.kin))
            self.bodies.load, self.bodies.force = made.load, made.force

    def _ints(self, n: int) -> wp.array:
        return unwritten(max(1, n), wp.int32)

    def contact_memory(self, n: int) -> wp.array:
        """Empty memory of n contacts; none where contacts remember nothing."""
        return unwritten(max(1, n) * self.needs.history, self.types.vec4)

    def divide(self) -> None:
        """Numbers that follow from those of the bodies: large ones, and the ranges of the threads."""
        self.big_rows = self.total - self.n
        ranges = (self.n * self.cuts).round().astype(np.int32)
        self.ranges_host = ranges
        self.ranges = wp.array(ranges, dtype=wp.int32, device="cpu")

    def _fill(self, scene: Scene, radii: np.ndarray, ids: np.ndarray) -> None:
        """Puts the scene's initial state into the arrays, sorted as the ids."""
        u = self.units
        if not len(ids):
            return
        mass = scene.masses() / u.mass
        inverse_mass, inverse_inertia = 1 / mass, 1 / (0.4 * mass * radii**2)
        for constraint in scene.constraints:
            held = list(constraint.bodies)
            inverse_inertia[held] = 0
            if constraint.kind != "rotation-locked":
                inverse_mass[held] = 0
        self.identity.assign(ids)
        b = self.bodies
        b.kin.numpy()[:, 6] = radii[ids]
        b.inv_m.assign(inverse_mass[ids])
        if self.needs.rotation:
            b.inv_i.assign(inverse_inertia[ids])
        b.kind.assign(kinds(scene, self.lookup)[ids])
        velocity, spin = scene.bodies.velocity.copy(), scene.bodies.angular_velocity.copy()
        for constraint in scene.constraints:
            held = list(constraint.bodies)
            if constraint.kind == "fixed":
                velocity[held] = 0
            if constraint.kind != "kinematic":
                spin[held] = 0
        self.write("kin", 0, scene.bodies.position, u.length)
        self.write("kin", 3, velocity, u.velocity)
        self.write("spin", 0, spin, 1 / u.time)

    # ---- state in and out, bodies by ascending id

    def ids(self) -> np.ndarray:
        """Ids of the bodies, ascending, shape (total,)."""
        if self.total == self.limit:
            return np.arange(self.total)
        return np.sort(self.identity.numpy()[: self.total])

    def write(self, name: str, first: int, values: np.ndarray, scale: float) -> None:
        """Sets three columns of kin or spin from values by ascending id and a unit, shape (total, 3).

        Raises:
            SolverError: Spins are given where nothing turns.
        """
        array = getattr(self.bodies, name)
        if not len(array):
            self.refuse_rotation("angular_velocity", values)
            return
        columns = array.numpy()
        columns[: self.total, first : first + 3] = values[self.rank()] / scale
        array.assign(columns)

    def read(self, name: str, first: int, scale: float) -> np.ndarray:
        """Three columns of kin, spin or load by ascending id, times a unit, shape (total, 3), float64."""
        out = np.zeros((self.total, 3))
        array = getattr(self.bodies, name)
        if len(array):
            out[self.rank()] = array.numpy()[: self.total, first : first + 3]
        out *= scale
        return out

    def places(self) -> np.ndarray:
        """Where the bodies stand in the arrays, by ascending id, shape (total,)."""
        out = np.empty(self.total, dtype=np.int32)
        out[self.rank()] = np.arange(self.total, dtype=np.int32)
        return out

    def slots(self, ids: Sequence[int]) -> np.ndarray:
        """Where bodies stand in the arrays, shape (m,); cheap for a few.

        Raises:
            SolverError: One of them is not there, by the reason "lost particles".
        """
        order = self.identity.numpy()[: self.total]
        found = [np.flatnonzero(order == i) for i in ids]
        gone = [i for i, slot in zip(ids, found, strict=True) if not len(slot)]
        if gone:
            raise SolverError(f"body {gone[0]} is gone", reason="lost particles")
        return np.array([slot[0] for slot in found], dtype=np.int64)

    def refuse_rotation(self, field: str, values: np.ndarray) -> None:
        """Raises SolverError where bodies are to turn, by a field with values other than 0, and the state has no spins.

        Without friction no contact sees a spin: it is left out.
        """
        if not self.needs.rotation and np.any(values):
            raise SolverError(
                f"{field}: the scene has no rotation, accepted are zeros; Simulation(..., force=('rotation',)) has it"
            )

    def rank(self) -> np.ndarray:
        """For each sorted body how many have a lower id, shape (total,)."""
        ids = self.identity.numpy()[: self.total]
        if self.total == self.limit:
            return ids
        there = np.zeros(self.limit, dtype=bool)
        there[ids] = True
        return (np.cumsum(there, dtype=np.int32) - 1)[ids]

    def alike(self) -> bool:
        """Whether all small bodies are of one kind, and may be taken so."""
        return not self.needs.forces("pair_table") and len(np.unique(self.bodies.kind.numpy()[: self.n])) <= 1

    # ---- for a rebuild

    def _wrap(self) -> None:
        """Takes all bodies back into the domain along its periodic axes."""
        if self.periodic:
            wp.launch(self.kernels.wrap, self.total, inputs=[wp.vec3d(*self.low), self.bodies], device=self.device)

    def grid(self, low: np.ndarray, high: np.ndarray) -> tuple[Any, ...]:
        """Cells of the small bodies in a box: origin, 1/edges, axes from the longest to the shortest, cells per axis.

        Cells fill a periodic axis; it is one cell where it has no room for three, so that no two meet on both sides.
        """
        if not (np.isfinite(low).all() and np.isfinite(high).all()):
            low, high = np.zeros(3), np.ones(3)
        joined = self.box > 0
        low = np.where(joined, self.low, low)
        length = np.where(joined, self.box, high - low)
        edge = (self.reach + self.skin) * (1 + 1e-9)
        # a few particles far away must not make a grid of mostly empty cells
        while np.prod(np.floor(length / edge) + 1) > 8 * self.n + 64:
            edge *= 1.26
        whole = np.floor(length / edge)
        cells = np.where(joined, np.where(whole < 3, 1, whole), whole + 1)
        inverse = np.where(joined, cells / np.where(joined, self.box, 1), 1 / edge)
        axis = np.argsort(-length, kind="stable").astype(int)
        order = wp.vec3i(*axis.tolist())
        return (wp.vec3d(*low), wp.vec3d(*inverse), order, wp.vec3i(*cells[axis].astype(int).tolist()))

    def place_walls(self, time: float) -> None:
        """Takes the walls to where they are at a time [scene units] and bounds their speed; due before a rebuild."""
        self.walls.place(time)
        if self.walls.moves and self.n:
            low, high = self._box()
            room = self.skin + self.diameter
            self.wall_speed = self.walls.largest_speed(time, low - room, high + room)
