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
from dembench.scene import Bodies, Box, Domain, Material, PairLaw, Scene, Species
from dembench.scene.base import Model, Positive


class Protocol(Model):
    """How a bed is settled; part of the key of the cache.

    Attributes:
        version: Raised when the procedure changes.
        lattice_fraction: Solid fraction of the lattice that the grains start on [-].
        softening: Young's modulus while settling, as a share of the real one [-].
        friction: Friction between grains while settling; None is that of the pair law.
        step: Time step in Rayleigh times [-].
        check: Interval between checks for rest [s].
        rest: Mean kinetic energy of a grain below which the bed rests, in units of m g r [-].
        longest: Time after which a bed that does not come to rest is given up [s].
    """

    version: int = 1
    lattice_fraction: Annotated[float, Field(gt=0, lt=0.5)] = 0.35
    softening: Annotated[float, Field(gt=0, le=1)] = 0.1
    friction: float | None = None
    step: Annotated[float, Field(gt=0, le=0.3)] = 0.2
    check: Positive = 2e-3
    rest: Positive = 1e-4
    longest: Positive = 1.0


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
    position, velocity = lattice(plan, seed), np.zeros((plan.count, 3))
    stages = [(plan.protocol.softening, plan.protocol.friction), (1.0, None)]
    for k, (softening, friction) in enumerate(stages):
        scene = _scene(plan, position, velocity, softening, friction)
        start, end = k / len(stages), (k + 1) / len(stages)
        position, velocity = _rest(scene, plan, lambda f, m, a=start, b=end: progress(a + f * (b - a), m))
    found = measure(plan, position)
    check_packing(plan, found)
    progress(1.0, found.line())
    return position


def _scene(
    plan: BedPlan, position: np.ndarray, velocity: np.ndarray, softening: float, friction: float | None
) -> Scene:
    material = plan.material.model_copy(update={"young": softening * plan.material.young})
    wall = plan.wall_material.model_copy(update={"young": softening * plan.wall_material.young})
    laws = tuple(p if friction is None else p.model_copy(update={"friction": friction}) for p in plan.pair_laws)
    lower, upper = np.array(plan.box.lower) - 5 * plan.radius, np.array(plan.box.upper) + 5 * plan.radius
    upper[2] = max(upper[2], position[:, 2].max() + 5 * plan.radius)
    return Scene(
        name="bed",
        materials=(material, wall),
        pair_laws=laws,
        species=(Species(name="grain", material=material.name, radius=plan.radius),),
        walls=(plan.box,),
        bodies=Bodies(position=position, velocity=velocity),
        domain=Domain(lower=tuple(lower), upper=tuple(upper)),
        duration=plan.protocol.longest,
        rayleigh_fraction=plan.protocol.step,
    )


def _rest(scene: Scene, plan: BedPlan, progress: Progress) -> tuple[np.ndarray, np.ndarray]:
    """Steps a scene until its grains rest; their centres and velocities, shape (n, 3)."""
    from dembench.solver import Simulation

    protocol = plan.protocol
    dt = protocol.step * scene.rayleigh_time()
    unit = plan.count * scene.masses()[0] * -scene.gravity[2] * plan.radius
    simulation = Simulation(scene, dt=dt)
    falling = True
    while simulation.time < protocol.longest:
        simulation.step(max(1, round(protocol.check / dt)))
        energy = simulation.kinetic_energy() / unit
        falling = falling and energy < 10 * protocol.rest and simulation.time < 10 * protocol.check
        progress(min(1.0, simulation.time / 0.2), f"settling {plan.count} grains, t = {simulation.time:.3f} s")
        if energy < protocol.rest and not falling:
            return simulation.position, simulation.velocity
    raise PackingError(
        f"{plan.count} grains do not rest after {protocol.longest:g} s: kinetic energy {energy:.2g} m g r per grain, "
        f"wanted below {protocol.rest:g}"
    )
