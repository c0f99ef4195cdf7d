"""Fills a container: a loose jittered lattice of particles that settles under gravity inside the real walls.

The lattice is looser than any packing, so that its order is lost while the particles fall. They settle with a reduced
Young's modulus, which allows longer steps, then relax at their own: overlaps and stresses are those of the real ones.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from dembench.initial.cache import cached, entry
from dembench.initial.container import enclosure
from dembench.initial.lattice import RoomError, lattice
from dembench.initial.packings import Packing, packing
from dembench.initial.progress import Progress, silent
from dembench.scene import Bodies, Constraint, Domain, Material, PairLaw, Scene, Species
from dembench.scene.base import Finite, Model, Name, NotNegative, Positive
from dembench.scene.walls import WallShape

if TYPE_CHECKING:
    from dembench.solver import Simulation

CHECKPOINT = 60.0
"""Wall time between two checkpoints [s]."""


class Stage(Model):
    """One stage of settling, from rest and without the shear springs of the stage before.

    Attributes:
        softening: Young's modulus as a share of the real one [-].
        friction: Friction of all pairs [-]; None is that of the pair laws.
        locked: The particles do not rotate: they arch at once, and the next stage starts from a very loose heap.
        step: Time step in Rayleigh times [-]. A hundred times softer particles overlap by 3 % under the weight of a
            silo, and 0.3 is beyond stability: they rattle for ever and creep.
        rest: Mean kinetic energy of a particle below which the packing rests, in units of its m g r [-].
    """

    softening: Positive = 1.0
    friction: NotNegative | None = None
    locked: bool = False
    step: Annotated[float, Field(gt=0, le=0.3)] = 0.2
    rest: Positive = 1e-3


class Protocol(Model):
    """How particles are settled; part of the key of the cache.

    The defaults were chosen so that height, bulk solid fraction and coordination of the published 25k impact bed come
    out: particles that hardly bounce and rub harder settle more loosely, and every further stage takes part of that
    back.

    Attributes:
        version: Raised when the procedure changes.
        lattice_fraction: Solid fraction of the lattice that the particles start on [-].
        stages: What is settled in turn.
        restitution: Restitution of all pairs in all stages [-]; so strong a dashpot needs its midpoint form.
        check: Interval between checks for rest, in units of sqrt(r/g) [-].
        longest: Time after which a stage that does not come to rest is given up [s].
    """

    version: int = 2
    lattice_fraction: Annotated[float, Field(gt=0, lt=0.5)] = 0.4
    stages: Annotated[tuple[Stage, ...], Field(min_length=1)] = (Stage(softening=0.1, friction=0.6), Stage())
    restitution: Annotated[float, Field(gt=0, le=1)] = 0.1
    check: Positive = 0.2
    longest: Positive = 1.0


LOOSE = Protocol(stages=(Stage(softening=0.1, friction=0.5, locked=True), Stage(friction=1.0)), lattice_fraction=0.42)
"""For beds looser than the default makes, as the published impact beds of 50k and 100k grains are."""

STACKED = Protocol(stages=(Stage(friction=1.0, step=0.3),))
"""For a start that is a settled packing nearly everywhere."""

TALL = Protocol(
    stages=(
        Stage(softening=0.02, friction=0.5, step=0.25, rest=1e-2),
        Stage(softening=0.2, friction=0.5, step=0.3, rest=1e-2),
        Stage(step=0.3),
    ),
    lattice_fraction=0.42,
)
"""For containers many diameters high, where falling takes long: most of it with fifty times softer particles. A stage
is at most ten times stiffer than the one before, whose overlaps would throw the particles up otherwise."""


SOFT = Protocol(stages=(Stage(friction=0.5, rest=1e-2), Stage()), lattice_fraction=0.42)
"""For particles that are a hundred times softer than real ones themselves."""


class Layer(Model):
    """Particles of one species that are filled in at once."""

    species: Name
    count: Annotated[int, Field(gt=0)]


class Filling(Model):
    """What is filled into which container, and what it should come out as.

    Attributes:
        materials, pair_laws, species: As in a scene.
        walls: The container as it is closed for the filling; it bounds the space below and at the sides.
        layers: What is filled in, the lowest layer first.
        top: Height above which no particle starts [m]; None is the highest point of the walls.
        height: Mean height of the top above the lowest point of the walls that the packing should have [m]; None
            where none is known.
        bulk_fraction: Solid fraction of the bulk that it should have [-]; None where none is known.
        height_tolerance, fraction_tolerance: Accepted distances [m], [-].
        protocol: How it settles.
    """

    materials: tuple[Material, ...]
    pair_laws: tuple[PairLaw, ...]
    species: Annotated[tuple[Species, ...], Field(min_length=1)]
    walls: Annotated[tuple[WallShape, ...], Field(min_length=1)]
    layers: Annotated[tuple[Layer, ...], Field(min_length=1)]
    top: Finite | None = None
    height: Positive | None = None
    bulk_fraction: Positive | None = None
    height_tolerance: Positive = 1e-3
    fraction_tolerance: Positive = 0.01
    protocol: Protocol = Protocol()

    @model_validator(mode="after")
    def _fillable(self) -> Filling:
        enclosure(self.walls)
        moving = [wall.name for wall in self.walls if wall.motion is not None]
        if moving:
            raise ValueError(f"walls: {', '.join(moving)} moves; particles settle between walls at rest")
        known = [s.name for s in self.species]
        for k, layer in enumerate(self.layers):
            if layer.species not in known:
                raise ValueError(
                    f"layers[{k}].species: '{layer.species}' is not known; accepted are {', '.join(known)}"
                )
        for s in self.species:
            if s.shape is not None:
                raise ValueError(f"species {s.name} has a shape; only spheres can be filled in")
        return self

    @property
    def count(self) -> int:
        """Number of particles."""
        return sum(layer.count for layer in self.layers)

    def body_species(self) -> np.ndarray:
        """Index into `species` of every particle, layer upon layer, shape (n,)."""
        names = [s.name for s in self.species]
        index = [names.index(layer.species) for layer in self.layers]
        return np.repeat(np.array(index, np.int32), [layer.count for layer in self.layers])

    def radii(self) -> np.ndarray:
        """Radius of every particle [m], shape (n,)."""
        return np.array([s.radius for s in self.species])[self.body_species()]


class PackingError(RuntimeError):
    """Particles that have no room, do not come to rest, or not to the packing that they should have."""


_unsettled: ContextVar[list[Filling] | None] = ContextVar("unsettled", default=None)


@contextmanager
def unsettled() -> Iterator[list[Filling]]:
    """Within it nothing settles: a filling that the cache does not have stays where it starts, and is listed."""
    lattices: list[Filling] = []
    token = _unsettled.set(lattices)
    try:
        yield lattices
    finally:
        _unsettled.reset(token)


def filled(plan: Filling, seed: int, progress: Progress | None = None, start: np.ndarray | None = None) -> np.ndarray:
    """Centres of a settled packing [m], shape (n, 3), layer upon layer, from the cache where it is there.

    An interrupted filling goes on from its last checkpoint in the cache when it is asked for again, and ends with the
    same bits. See `unsettled` for plans of runs, which do without.

    Args:
        plan: What is filled in.
        seed: Seed of the lattice's jitter.
        progress: Called while it settles.
        start: Centres to start from instead of the lattice [m], shape (n, 3).

    Raises:
        PackingError: The particles have no room or do not rest in time, or the height or solid fraction is outside
            the tolerance.
    """
    path, lattices = cache_path(plan, seed, start), _unsettled.get()

    def begin() -> np.ndarray:
        return _lattice(plan, seed) if start is None else start

    def make() -> np.ndarray:
        return _settle(plan, begin(), progress or silent, Checkpoints(path))

    if lattices is not None and not path.exists():
        lattices.append(plan)
        return begin()
    return cached(_kind(plan), inputs(plan, seed, start), make)


def inputs(plan: Filling, seed: int, start: np.ndarray | None = None) -> dict[str, Any]:
    """Everything that a filling depends on, as plain JSON data; a given start by its digest."""
    found = {"plan": plan.model_dump(mode="json"), "seed": seed}
    if start is not None:
        found["start"] = hashlib.sha256(np.ascontiguousarray(start, dtype="<f8").tobytes()).hexdigest()
    return found


def cache_path(plan: Filling, seed: int, start: np.ndarray | None = None) -> Path:
    """Where the cache keeps a filling."""
    return entry(_kind(plan), inputs(plan, seed, start))


def _kind(plan: Filling) -> str:
    return f"filling{plan.count}"


def measure(plan: Filling, position: np.ndarray) -> Packing:
    """The packing of a filling."""
    return packing(position, plan.radii(), plan.walls)


def check_packing(plan: Filling, found: Packing) -> None:
    """Raises PackingError where the height or the bulk's solid fraction is outside the plan's tolerance."""
    faults = []
    if plan.height is not None and not abs(found.height - plan.height) <= plan.height_tolerance:
        faults.append(f"height {plan.height * 1e3:.2f} +- {plan.height_tolerance * 1e3:.2f} mm")
    if plan.bulk_fraction is not None and not abs(found.bulk_fraction - plan.bulk_fraction) <= plan.fraction_tolerance:
        faults.append(f"bulk solid fraction {plan.bulk_fraction:.3f} +- {plan.fraction_tolerance:.3f}")
    if faults:
        raise PackingError(f"the settled packing is not as it should be ({'; '.join(faults)}): {found.line()}")


def resting(plan: Filling, position: np.ndarray, tolerance: float, progress: Progress | None = None) -> Simulation:
    """A simulation of a settled packing whose contacts have their shear springs again, so that the walls carry it.

    Args:
        plan: The filling.
        position: Centres [m], shape (n, 3).
        tolerance: Share of the weight that the walls may fail to carry [-].
        progress: Called while it settles.

    Raises:
        PackingError: The packing does not come to rest.
    """
    simulation = _simulation(plan, position, plan.protocol.stages[-1])
    weight = float(simulation.scene.masses().sum()) * -simulation.scene.gravity[2]
    carried = 0.0
    while abs(carried / weight - 1) > tolerance:
        _rest(simulation, plan, len(plan.protocol.stages) - 1, progress or silent, None)
        contacts = simulation.contacts()
        carried = float(contacts.force()[contacts.j < 0, 2].sum())
    return simulation


class Checkpoints:
    """States of an unfinished filling, beside the file that it will become: one at a time, named by its stage."""

    def __init__(self, target: Path):
        self.target = target
        self._last = time.monotonic()

    def load(self, stages: int) -> tuple[int, Simulation] | None:
        """Stage and simulation of the furthest state that can be read."""
        from dembench.solver import Simulation, SolverError

        for stage in reversed(range(stages)):
            try:
                return stage, Simulation.load(self._path(stage))
            except SolverError:
                continue
        return None

    def save(self, stage: int, simulation: Simulation) -> None:
        """Writes a state where the last one is old enough."""
        if time.monotonic() - self._last < CHECKPOINT:
            return
        self.target.parent.mkdir(parents=True, exist_ok=True)
        simulation.save(self._path(stage))
        self._last = time.monotonic()
        for earlier in range(stage):
            self._path(earlier).unlink(missing_ok=True)

    def clear(self, stages: int) -> None:
        """Removes all states."""
        for stage in range(stages):
            self._path(stage).unlink(missing_ok=True)

    def _path(self, stage: int) -> Path:
        return self.target.with_name(f"{self.target.stem}-stage{stage}.npz")


def _settle(plan: Filling, start: np.ndarray, progress: Progress, checkpoints: Checkpoints) -> np.ndarray:
    stages = plan.protocol.stages
    resumed = checkpoints.load(len(stages))
    if resumed:
        first, simulation = resumed
    else:
        first, simulation = 0, _simulation(plan, start, stages[0])
    for k in itertools.count(first):
        _rest(simulation, plan, k, progress, checkpoints)
        if k + 1 == len(stages):
            break
        simulation = _simulation(plan, simulation.position, stages[k + 1])
    found = measure(plan, simulation.position)
    # the last state of one that is refused stays: the next attempt need not begin anew to say so again
    check_packing(plan, found)
    checkpoints.clear(len(stages))
    progress(1.0, found.line())
    return simulation.position


def _lattice(plan: Filling, seed: int) -> np.ndarray:
    radius = {s.name: s.radius for s in plan.species}
    layers = [(layer.count, radius[layer.species]) for layer in plan.layers]
    try:
        return lattice(layers, plan.walls, plan.protocol.lattice_fraction, np.random.default_rng(seed), plan.top)
    except RoomError as error:
        raise PackingError(str(error)) from None


def _simulation(plan: Filling, position: np.ndarray, stage: Stage) -> Simulation:
    """The particles alone in the container, at rest, with the Young's modulus and the pair laws of a stage."""
    from dembench.solver import Simulation

    change = {"restitution": plan.protocol.restitution}
    if stage.friction is not None:
        change["friction"] = stage.friction
    margin = 5 * plan.radii().max()
    lower, upper = enclosure(plan.walls)
    scene = Scene(
        name="filling",
        materials=tuple(m.model_copy(update={"young": stage.softening * m.young}) for m in plan.materials),
        pair_laws=tuple(p.model_copy(update=change) for p in plan.pair_laws),
        species=plan.species,
        walls=plan.walls,
        bodies=Bodies(position=position, species=plan.body_species()),
        domain=Domain(lower=tuple(lower - margin), upper=tuple(upper + margin)),
        constraints=(Constraint(kind="rotation-locked", bodies=tuple(range(plan.count))),) if stage.locked else (),
        duration=plan.protocol.longest,
        rayleigh_fraction=stage.step,
    )
    return Simulation(scene, dt=stage.step * scene.rayleigh_time(), midpoint=True)


def _rest(
    simulation: Simulation, plan: Filling, stage: int, progress: Progress, checkpoints: Checkpoints | None
) -> None:
    """Steps a simulation until its particles rest."""
    protocol, scene = plan.protocol, simulation.scene
    gravity, radius = -scene.gravity[2], scene.radii()
    interval = max(1, round(protocol.check * math.sqrt(radius.min() / gravity) / simulation.dt))
    unit = float((scene.masses() * radius).sum()) * gravity
    expected = 2 * math.sqrt(2 * float(np.ptp(scene.bodies.position[:, 2])) / gravity)
    where = f"settling {plan.count} particles, stage {stage + 1} of {len(protocol.stages)}"

    def tell(_: int = 0) -> None:
        done = min(1.0, simulation.time / expected)
        progress((stage + done) / len(protocol.stages), f"{where}, t = {simulation.time:.3f} s")

    tell()
    energy = math.inf
    while energy > protocol.stages[stage].rest:
        if simulation.time > protocol.longest:
            raise PackingError(
                f"{plan.count} particles do not rest after {protocol.longest:g} s: "
                f"the mean kinetic energy is {energy:.2g} m g r, accepted is {protocol.stages[stage].rest:g}"
            )
        simulation.step(interval, tell)
        energy = simulation.kinetic_energy() / unit
        if checkpoints:
            checkpoints.save(stage, simulation)
