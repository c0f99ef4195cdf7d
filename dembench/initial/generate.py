"""Makes a bed of equal grains: a loose jittered lattice that settles under gravity in the real box.

The lattice is looser than any packing, so that its order is lost while the grains fall. Grains settle with a reduced
Young's modulus, which allows longer steps, then relax at their own: overlaps and stresses are those of the real grains.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from dembench.initial.cache import cached
from dembench.initial.progress import Progress, silent
from dembench.initial.quality import Packing, packing
from dembench.scene import Bodies, Box, Constraint, Domain, Material, PairLaw, Scene, Species
from dembench.scene.base import Model, NotNegative, Positive


class Stage(Model):
    """One stage of settling, from rest and without the shear springs of the stage before.

    Attributes:
        softening: Young's modulus as a share of the real one [-].
        friction: Friction of all pairs [-]; None is that of the pair laws.
        locked: The grains do not rotate: they arch at once, and the next stage starts from a very loose heap.
    """

    softening: Positive = 1.0
    friction: NotNegative | None = None
    locked: bool = False


class Protocol(Model):
    """How a bed is settled; part of the key of the cache.

    The defaults were chosen so that height, bulk solid fraction and coordination of the published 25k bed come out:
    grains that hardly bounce and rub harder settle more loosely, and every further stage takes part of that back.

    Attributes:
        version: Raised when the procedure changes.
        lattice_fraction: Solid fraction of the lattice that the grains start on [-].
        stages: What is settled in turn.
        restitution: Restitution of all pairs in all stages [-]; so strong a dashpot needs its midpoint form.
        step: Time step in Rayleigh times [-].
        check: Interval between checks for rest, in units of sqrt(r/g) [-].
        rest: Mean kinetic energy of a grain below which the bed rests, in units of m g r [-].
        longest: Time after which a stage that does not come to rest is given up [s].
    """

    version: int = 1
    lattice_fraction: Annotated[float, Field(gt=0, lt=0.5)] = 0.4
    stages: Annotated[tuple[Stage, ...], Field(min_length=1)] = (Stage(softening=0.1, friction=0.6), Stage())
    restitution: Annotated[float, Field(gt=0, le=1)] = 0.1
    step: Annotated[float, Field(gt=0, le=0.3)] = 0.2
    check: Positive = 0.2
    rest: Positive = 1e-3
    longest: Positive = 1.0


LOOSE = Protocol(stages=(Stage(softening=0.1, friction=0.5, locked=True), Stage(friction=1.0)), lattice_fraction=0.42)
"""For beds looser than the default makes, as the published ones of 50k and 100k grains are."""


class BedPlan(Model):
    """A bed of equal grains and what it should come out as.

    Attributes:
        count: Number of grains.
        radius: Radius of the grains [m].
        material, wall_material: Materials of grains and box.
        pair_laws: Laws of the pairs grain-grain and grain-wall at least.
        box: The box, open at the top.
        height: Mean height of the top above the floor that the bed should have [m]; None where none is known.
        bulk_fraction: Solid fraction of the bulk that it should have [-]; None where none is known.
        height_tolerance, fraction_tolerance: Accepted distances [m], [-].
    """

    count: Annotated[int, Field(gt=0)]
    radius: Positive
    material: Material
    wall_material: Material
    pair_laws: tuple[PairLaw, ...]
    box: Box
    height: Positive | None = None
    bulk_fraction: Positive | None = None
    height_tolerance: Positive = 1e-3
    fraction_tolerance: Positive = 0.01
    protocol: Protocol = Protocol()


class PackingError(RuntimeError):
    """A bed that does not come to rest, or not to the packing it should have."""


def settled_bed(plan: BedPlan, seed: int, progress: Progress | None = None) -> np.ndarray:
    """Grain centres of a settled bed [m], shape (n, 3), from the cache where it is there.

    Raises:
        PackingError: The bed does not rest in time, or its height or solid fraction is outside the tolerance.
    """
    inputs = {"plan": plan.model_dump(mode="json"), "seed": seed}
    return cached(f"bed{plan.count}", inputs, lambda: _settle(plan, seed, progress or silent))


def measure(plan: BedPlan, position: np.ndarray) -> Packing:
    """The packing of a bed made by a plan."""
    return packing(position, plan.radius, np.array(plan.box.lower), np.array(plan.box.upper))


def check_packing(plan: BedPlan, found: Packing) -> None:
    """Raises PackingError where the height or the bulk's solid fraction is outside the plan's tolerance."""
    faults = []
    if plan.height is not None and not abs(found.height - plan.height) <= plan.height_tolerance:
        faults.append(f"height {plan.height * 1e3:.2f} +- {plan.height_tolerance * 1e3:.2f} mm")
    if plan.bulk_fraction is not None and not abs(found.bulk_fraction - plan.bulk_fraction) <= plan.fraction_tolerance:
        faults.append(f"bulk solid fraction {plan.bulk_fraction:.3f} +- {plan.fraction_tolerance:.3f}")
    if faults:
        raise PackingError(f"the settled bed is not as it should be ({'; '.join(faults)}): {found.line()}")


def lattice(plan: BedPlan, seed: int) -> np.ndarray:
    """Centres [m], shape (n, 3), on a cubic lattice from the floor up, each moved at random by less than half the gap.

    The last layer is a random part of a full one.
    """
    rng = np.random.default_rng(seed)
    lower, upper = np.array(plan.box.lower), np.array(plan.box.upper)
    spacing = plan.radius * (4 * math.pi / 3 / plan.protocol.lattice_fraction) ** (1 / 3)
    cells = np.floor((upper - lower)[:2] / spacing).astype(int)
    pitch = np.append((upper - lower)[:2] / cells, spacing)
    per_layer = int(cells.prod())
    layers = -(-plan.count // per_layer)
    site = np.arange(layers * per_layer)
    last = rng.choice(site[(layers - 1) * per_layer :], plan.count - (layers - 1) * per_layer, replace=False)
    site = np.concatenate([site[: (layers - 1) * per_layer], np.sort(last)])
    index = np.stack([site % cells[0], site // cells[0] % cells[1], site // per_layer], axis=1)
    reach = 0.99 * (pitch / 2 - plan.radius)
    return lower + (index + 0.5) * pitch + rng.uniform(-reach, reach, (plan.count, 3))


def _settle(plan: BedPlan, seed: int, progress: Progress) -> np.ndarray:
    position = lattice(plan, seed)
    stages = plan.protocol.stages
    for k, stage in enumerate(stages):
        scene = _scene(plan, position, stage)
        position = _rest(scene, plan, progress, k / len(stages), (k + 1) / len(stages))
    found = measure(plan, position)
    check_packing(plan, found)
    progress(1.0, found.line())
    return position


def _scene(plan: BedPlan, position: np.ndarray, stage: Stage) -> Scene:
    """The grains alone in the box, at rest, with the Young's modulus and the pair laws of a stage."""
    material = plan.material.model_copy(update={"young": stage.softening * plan.material.young})
    wall = plan.wall_material.model_copy(update={"young": stage.softening * plan.wall_material.young})
    change = {"restitution": plan.protocol.restitution}
    if stage.friction is not None:
        change["friction"] = stage.friction
    margin = 5 * plan.radius
    lower, upper = np.array(plan.box.lower) - margin, np.array(plan.box.upper) + margin
    upper[2] = max(upper[2], position[:, 2].max() + margin)
    return Scene(
        name="bed",
        materials=(material, wall),
        pair_laws=tuple(p.model_copy(update=change) for p in plan.pair_laws),
        species=(Species(name="grain", material=material.name, radius=plan.radius),),
        walls=(plan.box,),
        bodies=Bodies(position=position),
        domain=Domain(lower=tuple(lower), upper=tuple(upper)),
        constraints=(Constraint(kind="rotation-locked", bodies=tuple(range(plan.count))),) if stage.locked else (),
        duration=plan.protocol.longest,
        rayleigh_fraction=plan.protocol.step,
    )


def _rest(scene: Scene, plan: BedPlan, progress: Progress, start: float, end: float) -> np.ndarray:
    """Steps a scene until its grains rest; their centres [m], shape (n, 3)."""
    from dembench.solver import Simulation

    protocol, gravity = plan.protocol, -scene.gravity[2]
    dt = protocol.step * scene.rayleigh_time()
    steps = max(1, round(protocol.check * math.sqrt(plan.radius / gravity) / dt))
    unit = scene.masses().sum() * gravity * plan.radius
    expected = 2 * math.sqrt(2 * float(np.ptp(scene.bodies.position[:, 2])) / gravity)
    simulation = Simulation(scene, dt=dt, midpoint=True)
    energy = math.inf
    while energy > protocol.rest:
        if simulation.time > protocol.longest:
            raise PackingError(
                f"{plan.count} grains do not rest after {protocol.longest:g} s: "
                f"the mean kinetic energy is {energy:.2g} m g r, accepted is {protocol.rest:g}"
            )
        simulation.step(steps)
        energy = simulation.kinetic_energy() / unit
        done = min(1.0, simulation.time / expected)
        progress(start + done * (end - start), f"settling {plan.count} grains, t = {simulation.time:.3f} s")
    return simulation.position
