"""Periodic domains: contacts across a face, momentum and energy of a gas, and the frame of reference."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, gas, grains, hertz

from dembench.scene import Cylinder, Domain, HertzMindlin, Plane, Rigid, Scene
from dembench.solver import Simulation, SolverError
from dembench.solver.soft import unsupported

DRIVERS: dict[str, dict[str, Any]] = {
    "half lists": {"precision": "float64"},
    "full lists": {"precision": "float64", "lists": "full"},
    "rigid rows": {"precision": "float64", "method": "impulse", "rows": "rigid"},
    "compliant rows": {"precision": "float64", "method": "impulse", "rows": "compliant"},
}


def box(size: Any, periodic: tuple[bool, bool, bool] = (True, True, True), low: float = 0.0) -> Domain:
    """A domain of these lengths [m]."""
    lower = (low, low, low)
    return Domain(lower=lower, upper=tuple(low + s for s in np.broadcast_to(size, 3)), periodic=periodic)


@pytest.mark.parametrize("driver", list(DRIVERS))
def test_a_collision_across_a_face_is_that_inside(driver: str) -> None:
    """Oblique impacts of spinning grains across a face, an edge and a corner, in a box of three cells and of one.

    Only the rounding of the positions differs, 1e-16 of the box, which a contact of overlap 1e-2 r amplifies by 1e3.
    """
    meet = np.array([[-1.05, 0.2, -0.1], [1.05, -0.2, 0.1]]) * RADIUS
    velocity, spin = [[0.4, 0.1, 0], [-0.4, 0, 0.1]], [[0, 100, 200], [50, 0, -300]]
    size = np.array([2.5, 9, 30]) * 2 * RADIUS
    ends = []
    for turn in range(3):
        roll = [np.roll(a, turn, axis=1) for a in (meet, np.array(velocity), np.array(spin))]
        for middle in ([0.5, 0.5, 0.5], [0, 0.5, 0.5], [0.5, 0, 0], [0, 0, 0]):
            place = np.array(middle) * size
            scene = grains(np.mod(roll[0] + place, size), roll[1], roll[2], domain=box(size), restitution=0.8)
            simulation = Simulation(scene, 1e-6, **DRIVERS[driver])
            simulation.step(400)
            offset = simulation.position - place
            ends.append(np.hstack([offset - size * np.round(offset / size), simulation.velocity]).reshape(2, 2, 3))
            ends[-1] = np.roll(ends[-1], -turn, axis=2)
    assert np.abs(ends[0][:, 1] - velocity).max() > 0.3, "nothing collided"
    for end in ends[1:]:
        assert end[:, 0] == pytest.approx(ends[0][:, 0], abs=1e-10 * RADIUS)
        assert end[:, 1] == pytest.approx(ends[0][:, 1], abs=1e-10)


def crowd(n: int = 200, **changes: Any) -> Scene:
    """A gas that fills a periodic box."""
    position, velocity, spin = gas(n, seed=5, speed=0.5)
    edge = int(np.ceil(n ** (1 / 3)))
    low = -1.25 * RADIUS
    size = 2.5 * RADIUS * edge
    domain = box(size, low=low)
    return grains(low + np.mod(position - low, size), velocity, spin, **{"young": 1e8, "domain": domain, **changes})


OPTIONS: dict[str, dict[str, Any]] = {"one thread": {}, "two threads": {"threads": 2}, "full lists": {"lists": "full"}}


@pytest.mark.parametrize("name", list(OPTIONS))
def test_a_periodic_gas_keeps_its_momentum(name: str) -> None:
    """Friction and dissipation, through many faces; and every driver finds the same contacts."""
    scene = crowd()
    simulation = Simulation(scene, 1e-6, precision="float64", **OPTIONS[name])
    reference = Simulation(scene, 1e-6, precision="float64")
    start = scene.bodies.velocity
    total = np.abs(start).sum()
    for part in range(10):
        simulation.step(400)
        reference.step(400)
        if part < 3:
            # later a collision or more per grain has amplified the order of the sums
            assert simulation.velocity == pytest.approx(reference.velocity, abs=1e-9)
    assert simulation.velocity.sum(axis=0) == pytest.approx(start.sum(axis=0), abs=1e-12 * total)
    assert simulation.kinetic_energy() < 0.9 * Simulation(scene, 1e-6, precision="float64").kinetic_energy()
    low, high = np.array(scene.domain.lower), np.array(scene.domain.upper)
    assert (simulation.position >= low).all() and (simulation.position <= high).all()


def spring_energy(scene: Scene, position: np.ndarray) -> float:
    """Energy in the normal springs of equal grains in a periodic cube [J]: 2/5 of force times overlap."""
    i, j = np.triu_indices(len(position), 1)
    size = np.subtract(scene.domain.upper, scene.domain.lower)
    d = position[i] - position[j]
    overlap = np.maximum(0, 2 * RADIUS - np.linalg.norm(d - size * np.round(d / size), axis=1))
    return float(0.4 * (hertz(scene, overlap, RADIUS / 2) * overlap).sum())


def test_d13_an_elastic_periodic_gas_keeps_its_energy() -> None:
    """D13 on a small scale: e = 1, no friction, more than ten collisions of every grain; 1/100 of a contact a step."""
    position, velocity, _spin = gas(64, seed=2, speed=0.5, spacing=2.3)
    low, size = -1.15 * RADIUS, 4 * 2.3 * RADIUS
    scene = grains(
        low + np.mod(position - low, size), velocity, domain=box(size, low=low), friction=0.0, restitution=1.0
    )
    simulation = Simulation(scene, 1e-6, precision="float64")
    start = simulation.kinetic_energy() + spring_energy(scene, simulation.position)
    for _ in range(20):
        simulation.step(1000)
        now = simulation.kinetic_energy() + spring_energy(scene, simulation.position)
        assert now == pytest.approx(start, rel=1e-4)
    assert simulation.velocity.sum(axis=0) == pytest.approx(velocity.sum(axis=0), abs=1e-12 * np.abs(velocity).sum())


def test_sr13_a_moving_frame_sees_the_same_gas() -> None:
    """SR13: a common velocity takes the gas through the box several times and changes nothing else."""
    wind = np.array([3.0, -2.0, 1.0])
    still = crowd()
    bodies = still.bodies.model_copy(update={"velocity": still.bodies.velocity + wind})
    moving = still.model_copy(update={"bodies": bodies})
    ends = []
    for scene in (still, moving):
        simulation = Simulation(scene, 1e-6, precision="float64")
        simulation.step(1200)
        ends.append((simulation.position, simulation.velocity, simulation.time))
    size = np.subtract(still.domain.upper, still.domain.lower)
    offset = ends[1][0] - ends[0][0] - wind * ends[0][2]
    assert offset - size * np.round(offset / size) == pytest.approx(np.zeros_like(offset), abs=1e-7 * RADIUS)
    assert ends[1][1] - wind == pytest.approx(ends[0][1], abs=1e-7)


@pytest.mark.parametrize("lists", ["half", "full"])
def test_a_large_body_meets_grains_across_a_face(lists: str) -> None:
    """A ball of four radii and a cloud, in the middle of the box and across its corner."""
    random = np.random.default_rng(3)
    size = 40 * RADIUS
    shell = random.normal(size=(80, 3))
    shell *= (5.2 + 3 * random.uniform(size=80)[:, None]) * RADIUS / np.linalg.norm(shell, axis=1)[:, None]
    apart = [0]
    for k in range(1, 80):
        if np.linalg.norm(shell[apart] - shell[k], axis=1).min() > 2.05 * RADIUS:
            apart.append(k)
    cloud = shell[apart]
    position = np.vstack([cloud, np.zeros(3)])
    velocity = np.vstack([-60 * cloud, np.zeros(3)])
    ends = []
    for place in (0.5 * size, 0.0):
        scene = grains(
            np.mod(position + place, size),
            velocity,
            radius=(RADIUS, 4 * RADIUS),
            species=[0] * len(cloud) + [1],
            domain=box(size),
        )
        simulation = Simulation(scene, 1e-6, precision="float64", lists=lists)
        simulation.step(3000)
        ends.append(simulation.velocity)
    assert np.abs(ends[0] - velocity).max() > 0.1
    assert ends[1] == pytest.approx(ends[0], abs=1e-8)


def test_a_layer_with_one_periodic_axis_rests_on_its_floor() -> None:
    """Periodic in x alone: gravity, a floor, and neighbours across the face that the layer's ends lean on."""
    n = 8
    size = n * 2 * RADIUS * (1 - 1e-4)
    x = (np.arange(n) + 0.5) * size / n
    position = np.stack([x, 0 * x, np.full(n, RADIUS)], axis=1)
    domain = Domain(lower=(0, -1, -1), upper=(size, 1, 1), periodic=(True, False, False))
    scene = grains(position, gravity=(0, 0, -9.81), walls=(FLOOR,), domain=domain, law=HertzMindlin(), friction=0.3)
    simulation = Simulation(scene, 2e-6)
    simulation.step(5000)
    assert np.abs(simulation.velocity).max() < 1e-3
    assert np.sort(simulation.position[:, 0]) == pytest.approx(x, abs=1e-6 * RADIUS)


def test_a_box_that_is_too_small_is_named() -> None:
    scene = grains([[RADIUS] * 3, [3.1 * RADIUS] * 3], domain=box((4 * RADIUS, 5 * RADIUS, 1), (True, True, False)))
    text = f"a periodic x of {4 * RADIUS:g} m: at least {4.8 * RADIUS:g} m for these radii"
    with pytest.raises(SolverError, match=text):
        Simulation(scene)
    with pytest.raises(SolverError, match=text):
        Simulation(scene.model_copy(update={"law": Rigid()}))


def test_a_wall_must_be_the_same_at_both_faces() -> None:
    """A floor and a drum along the axis are; a wall across it, or a drum that ends inside, is not."""
    size = 20 * RADIUS
    position = [[8 * RADIUS, 10 * RADIUS, 1.2 * RADIUS], [12 * RADIUS, 10 * RADIUS, 1.2 * RADIUS]]
    domain = box(size, (True, False, False))
    middle = {"material": "grain", "radius": 10 * RADIUS}
    through = Cylinder(name="through", start=(-size, size / 2, size / 2), end=(2 * size, size / 2, size / 2), **middle)
    short = Cylinder(name="short", start=(0, size / 2, size / 2), end=(size / 2, size / 2, size / 2), **middle)
    across = Plane(name="across", material="grain", point=(0, 0, 0), normal=(1, 0, 0))
    assert unsupported(grains(position, domain=domain, walls=(FLOOR, through))) == []
    for wall in (short, across):
        with pytest.raises(SolverError, match=f"wall {wall.name} in a periodic x: it is not the same at both faces"):
            Simulation(grains(position, domain=domain, walls=(wall,)))
