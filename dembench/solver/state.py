"""The state of a simulation in scene units: sorted particle arrays, their lists, and the rebuild of both."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Scene
from dembench.solver.guard import SolverError
from dembench.solver.needs import Needs
from dembench.solver.neighbours import list_kernels
from dembench.solver.pairs import kinds, lookup_mode
from dembench.solver.periodic import box_lengths, wrap_kernel
from dembench.solver.population import drain, large_pairs, listed_at_walls, listed_pairs
from dembench.solver.types import types, vec8d
from dembench.solver.units import Units
from dembench.solver.walls.features import WallSet

BIG_RATIO = 3.0
"""A body is kept apart as large where its radius exceeds this many median radii."""
BIG_LIMIT = 16
"""At most this many bodies are kept apart; a scene with more, or with shapes, is sorted as a whole."""


class State:
    """Particle arrays in scene units, sorted by cell, with half lists for one or more threads.

    What the scene does not need has no elements: spins, torques and moments of inertia where nothing turns, contact
    memory where contacts remember nothing.

    Attributes:
        needs: What is there.
        lookup: How pair constants are looked up.
        n, total: Number of small particles, which are sorted, and of all; the large bodies stand behind them.
        small_at_start: Ids of the small bodies of the scene.
        limit: Above all ids of bodies that there are or were.
        identity: Id of each body.
        sinks: Regions where bodies leave [m].
        drained: Number of bodies that each sink has taken.
        bodies, lists: The Warp records that kernels take.
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
        self.identity_start = np.concatenate([np.setdiff1d(np.arange(self.total), big), big]).astype(np.int32)
        self.small_at_start = self.identity_start[: self.n]
        self.parts = max(1, min(threads, self.n // 64))
        self.walls = WallSet(scene, units, self.parts, self.device, wall_loads, self.needs)
        self.wall_speed = 0.0
        self.low, self.box = np.array(scene.domain.lower) / units.length, box_lengths(scene) / units.length
        self.periodic = bool(self.box.any()) or self.needs.forces("periodic")
        self.radius = 0.0 if self.needs.radii else float(radii.max(initial=0.0))
        self.kernels = self._kernels(scene)
        self.reach = 2 * float(radii[self.identity_start[: self.n]].max(initial=0.5))
        self.sinks = [sink.region for sink in scene.sinks]
        self.drained = np.zeros(len(self.sinks), dtype=np.int64)
        self.rebuilds = 0
        self._pool = ThreadPoolExecutor(self.parts) if self.parts > 1 else None
        self.allocate(max(1, self.total))
        self.divide()
        self._fill(scene, radii)
        self._lists(5)

    def _kernels(self, scene: Scene) -> Any:
        """The kernels of a rebuild, by name."""
        del scene
        kernels = vars(list_kernels(self.types.precision, self.walls.options, self.periodic))
        return SimpleNamespace(**kernels, **self._wrapping())

    def _wrapping(self) -> dict[str, Any]:
        return {"wrap": wrap_kernel(self.types.precision)} if self.periodic else {}

    # ---- allocation

    def _record(self) -> Any:
        """A record Bodies without arrays."""
        b = self.types.Bodies()
        b.radius = self.radius
        b.box = wp.vec3d(*self.box)
        b.inverse_box = wp.vec3d(*np.divide(1, self.box, out=np.zeros(3), where=self.box > 0))
        return b

    def _bodies(self, n: int) -> Any:
        t, needs = self.types, self.needs
        turns = needs.rotation
        b = self._record()
        b.kin = wp.zeros(n, dtype=vec8d, device="cpu")
        b.spin = wp.zeros(n * turns, dtype=t.vec4, device="cpu")
        b.load = wp.zeros(n * (needs.loads and turns), dtype=t.vec8, device="cpu")
        b.force = wp.zeros(n * (needs.loads and not turns), dtype=t.vec4, device="cpu")
        b.inv_m = wp.zeros(n, dtype=t.real, device="cpu")
        b.inv_i = wp.zeros(n * turns, dtype=t.real, device="cpu")
        b.kind = wp.zeros(n, dtype=wp.int32, device="cpu")
        return b

    def loads(self) -> wp.array:
        """What acts on the bodies, in rows that begin with the force: `load`, or `force` where nothing turns."""
        return self.bodies.load if self.needs.rotation else self.bodies.force

    def _ints(self, n: int) -> wp.array:
        return wp.zeros(max(1, n), dtype=wp.int32, device="cpu")

    def contact_memory(self, n: int) -> wp.array:
        """Empty memory of n contacts; none where contacts remember nothing."""
        return wp.zeros(max(1, n) * self.needs.history, dtype=self.types.vec4, device="cpu")

    def allocate(self, n: int) -> None:
        """Empty arrays for n bodies."""
        self.bodies, self._spare = self._bodies(n), self._bodies(n)
        self.identity, self._identity_spare = self._ints(n), self._ints(n)
        self._big_spare = self.contact_memory((self.total - self.n) * n)
        self.cell, self.order, self.place, self.head = (self._ints(n) for _ in range(4))

    def divide(self) -> None:
        """Numbers that follow from those of the bodies: large ones, and the ranges of the threads."""
        self.big_rows = self.total - self.n
        ranges = np.linspace(0, self.n, self.parts + 1).round().astype(np.int32)
        self.ranges_host = ranges
        self.ranges = wp.array(ranges, dtype=wp.int32, device="cpu")

    def _lists(self, per_particle: int) -> None:
        """Lists with room for `per_particle` pairs of every particle; a build that needs more makes them grow."""
        self._set_room(max(64, per_particle * self.n // self.parts), 64)
        self.wall_capacity = max(64, self.n // 4)
        self.big_capacity = 1024
        self.lists = self.types.Lists()
        lists = self.lists
        self._new_pairs(lists)
        self._new_walls(lists)
        lists.big_i, lists.big_j = self._ints(self.big_capacity), self._ints(self.big_capacity)
        lists.big_memory = self.contact_memory(self.big_rows * self.total)
        self._old = self.types.Lists()
        self._new_pairs(self._old)
        self._new_walls(self._old)
        for name in ("near", "big_i", "big_j"):
            setattr(self._old, name, self._ints(1))
        self._old.big_memory = self.contact_memory(1)
        self._follow = self._ints(0)
        self._room_to_follow(len(lists.i))
        self.pair_count = self._ints(2 * self.parts)
        self.wall_count = self._ints(self.parts)
        self.near_count = self._ints(2 * self.parts + 1)

    def _set_room(self, inside: int, across: int) -> None:
        """Where the regions of the pair lists begin: 2p with room for `inside`, 2p + 1 for `across` pairs."""
        rooms = [inside, across if self.parts > 1 else 0] * self.parts
        self.base = wp.array(np.concatenate([[0], np.cumsum(rooms)]), dtype=wp.int32, device="cpu")

    def _new_pairs(self, lists: Any) -> None:
        pairs = int(self.base.numpy()[-1])
        lists.i, lists.j, lists.near = self._ints(pairs), self._ints(pairs), self._ints(pairs)
        lists.memory = self.contact_memory(pairs)

    def _room_to_follow(self, entries: int) -> None:
        """Room for the chains of entries that have a memory."""
        if self.needs.history and len(self._follow) < entries:
            self._follow = self._ints(entries)

    def _new_walls(self, lists: Any) -> None:
        candidates = self.parts * self.wall_capacity
        lists.wall_i, lists.wall_f = self._ints(candidates), self._ints(candidates)
        lists.wall_memory = self.contact_memory(candidates)

    def _fill(self, scene: Scene, radii: np.ndarray) -> None:
        """Puts the scene's initial state into the arrays."""
        u, ids = self.units, self.identity_start
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
        return out * scale

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
        return (np.cumsum(there) - 1)[ids]

    def alike(self) -> bool:
        """Whether all small bodies are of one kind, and may be taken so."""
        return not self.needs.forces("pair_table") and len(np.unique(self.bodies.kind.numpy()[: self.n])) <= 1

    # ---- rebuild

    def rebuild(self) -> None:
        """Sorts the small particles by cell and builds all lists anew; contact memory is carried over.

        Bodies in a sink leave before.
        """
        self.rebuilds += 1
        self._wrap()
        drain(self)
        grid = self._sort()
        while True:
            self._build(grid)
            needed, room = self.pair_count.numpy(), np.diff(self.base.numpy())
            if (needed <= room).all():
                break
            # the old pairs stay where they are until a build has carried their memory over
            self._set_room(int(1.1 * needed[0::2].max()) + 64, int(1.5 * needed[1::2].max()) + 64)
            self._new_pairs(self.lists)
        self._build_walls()
        self.near_count.zero_()

    def _wrap(self) -> None:
        """Takes all bodies back into the domain along its periodic axes."""
        if self.periodic:
            wp.launch(self.kernels.wrap, self.total, inputs=[wp.vec3d(*self.low), self.bodies], device=self.device)

    def _sort(self) -> tuple[Any, ...]:
        launch, n, b = self._launch, self.n, self.bodies
        if n == 0:
            empty = (wp.vec3d(), wp.vec3d(), wp.vec3i(0, 1, 2), wp.vec3i(1, 1, 1))
            self.start = self._ints(2)
            launch(self.kernels.permute, 0, self.total, *self._permuted())
            self._swap()
            return empty
        grid = self.grid(*self._box())
        self.start = self._ints(int(np.prod(list(grid[3]))) + 1)
        launch(self.kernels.sort, b, n, *grid, self.cell, self.start, self.order)
        launch(self.kernels.permute, n, self.total, *self._permuted())
        self._swap()
        return grid

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

    def _permuted(self) -> list[Any]:
        out = [self.big_rows, self.order, self.bodies, self.identity, self.lists.big_memory]
        return [*out, self._spare, self._identity_spare, self._big_spare, self.place]

    def _swap(self) -> None:
        self.bodies, self._spare = self._spare, self.bodies
        self.identity, self._identity_spare = self._identity_spare, self.identity
        self.lists.big_memory, self._big_spare = self._big_spare, self.lists.big_memory
        # the pair arrays become the old ones; the new ones are written by the build
        for name in ("i", "j", "memory"):
            ours, theirs = getattr(self.lists, name), getattr(self._old, name)
            setattr(self.lists, name, theirs)
            setattr(self._old, name, ours)
        if len(self.lists.i) < int(self.base.numpy()[-1]):
            self._new_pairs(self.lists)
        self._room_to_follow(len(self._old.i))
        # where the regions of the old pairs begin does not change when the new ones grow
        self._old_base = wp.clone(self.base)
        if not self.needs.history:
            return
        self._launch(
            self.kernels.collect,
            self._old,
            2 * self.parts,
            self._old_base,
            self.pair_count,
            self.place,
            self.n,
            self.head,
            self._follow,
        )

    def _build(self, grid: tuple[Any, ...]) -> None:
        def one(part: int) -> None:
            self._launch(
                self.kernels.build,
                part,
                self.parts,
                self.ranges,
                self.bodies,
                self.skin,
                *grid,
                self.start,
                self._old,
                self.place,
                self.head,
                self._follow,
                self.base,
                self.lists,
                self.pair_count,
            )

        self.each_part(one)

    def place_walls(self, time: float) -> None:
        """Takes the walls to where they are at a time [scene units] and bounds their speed; due before a rebuild."""
        self.walls.place(time)
        if self.walls.moves and self.n:
            low, high = self._box()
            room = self.skin + self.diameter
            self.wall_speed = self.walls.largest_speed(time, low - room, high + room)

    def _box(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the box around the centres of the small bodies [scene units]."""
        box = wp.zeros(2, dtype=wp.vec3d, device="cpu")
        self._launch(self.kernels.bounds, self.bodies, self.n, box)
        low, high = box.numpy()
        return low, high

    def _build_walls(self) -> None:
        if not self.walls.count:
            return
        for name in ("wall_i", "wall_f", "wall_memory"):
            ours, theirs = getattr(self.lists, name), getattr(self._old, name)
            setattr(self.lists, name, theirs)
            setattr(self._old, name, ours)
        self._room_to_follow(len(self._old.wall_i))
        chains = [self.head, self._follow]
        if self.needs.history:
            inputs = [self._old, self.parts, self.wall_capacity, self.wall_count, self.place, self.total]
            self._launch(self.kernels.collect_walls, *inputs, *chains)

        def one(part: int) -> None:
            spans = [(int(self.ranges_host[part]), int(self.ranges_host[part + 1]), self.skin)]
            if part == 0:
                # large bodies outrun the skin of the small ones: they are tested against all walls in every step, but
                # where there are meshes, whose many parts cost more than a rebuild
                spans.append((self.n, self.total, self.skin if self.walls.options.meshes else 1e30))
            for first, last, skin in spans:
                inputs = [part, first, last, self.bodies, self.walls.record, skin, self._old, *chains]
                inputs += [part * self.wall_capacity, self.wall_capacity]
                self._launch(self.kernels.build_walls, *inputs, self.lists, self.wall_count)

        while True:
            self.wall_count.zero_()
            if len(self.lists.wall_i) < self.parts * self.wall_capacity:
                self._new_walls(self.lists)
            self.each_part(one)
            needed = int(self.wall_count.numpy().max())
            if needed <= self.wall_capacity:
                return
            # the old candidates stay where they are until a build has carried their memory over
            self.wall_capacity = int(1.2 * needed) + 64

    def grow_big(self) -> None:
        """Makes room for more candidates of the large bodies."""
        self.big_capacity = int(1.2 * int(self.near_count.numpy()[-1])) + 64
        self.lists.big_i, self.lists.big_j = self._ints(self.big_capacity), self._ints(self.big_capacity)

    # ---- launching

    def _launch(self, kernel: Any, *arguments: Any) -> None:
        wp.launch(kernel, dim=1, inputs=list(arguments), device="cpu")

    def each_part(self, work: Any) -> None:
        """Calls work(part) for every part, each in its own thread where there are several."""
        if self._pool is None:
            work(0)
        else:
            list(self._pool.map(work, range(self.parts)))

    def counts(self) -> dict[str, float]:
        """Listed pairs and wall candidates, and, where there is a contact memory, how many have one, by name."""
        listed = {
            "listed pairs": sum(len(row[0]) for row in listed_pairs(self)),
            "listed at walls": sum(len(row[0]) for row in listed_at_walls(self)),
        }
        if not self.needs.history:
            return listed
        pairs, walls, large = (
            int(sum(np.count_nonzero(row[-1][:, 3]) for row in rows(self)))
            for rows in (listed_pairs, listed_at_walls, large_pairs)
        )
        return {**listed, "pairs in contact": pairs + large, "contacts with walls": walls}
