"""Restitution, contact time and accuracy of one impact over stiffness, speed and step."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import DENSITY, FLOOR, RADIUS, grains

from dembench.scene import HertzMindlin, LinearSpring, Material, PairLaw, Scene, Species
from dembench.solver import Simulation

RESTITUTIONS = (0.1, 0.5, 0.9)
PHASES = 8


def contact_time(young: float, speed: float, poisson: float = 0.25) -> float:
    """Duration of the elastic impact of two grains [s]: 2.868 (m*^2/(R* E*^2 v))^(1/5)."""
    mass = DENSITY * 4 / 3 * np.pi * RADIUS**3 / 2
    return 2.868 * (mass**2 / (RADIUS / 2 * (young / (2 * (1 - poisson**2))) ** 2 * speed)) ** 0.2


def collisions(
    young: float, speed: float, dt: float, law: Any = None, values: tuple[float, ...] = (), precision: Any = "float32"
) -> np.ndarray:
    """Measured restitution of head-on impacts, shape (restitutions, phases of the first contact within a step)."""
    values = values or RESTITUTIONS
    names = [f"m{k}" for k in range(len(values))]
    laws = [
        PairLaw(a=a, b=b, restitution=values[i], friction=0.0)
        for i, a in enumerate(names)
        for j, b in enumerate(names)
        if i <= j
    ]
    gap = (1 + np.arange(PHASES) / PHASES) * dt * speed
    species = np.repeat(np.arange(len(values)), PHASES)
    y, apart = 0.01 * np.arange(len(species)), RADIUS + np.tile(gap, len(values)) / 2
    n = len(species)
    scene = grains(
        np.concatenate([np.stack([s * apart, y, 0 * y], axis=1) for s in (-1, 1)]),
        np.repeat([[speed / 2, 0, 0], [-speed / 2, 0, 0]], n, axis=0),
        species=np.tile(species, 2),
        materials=tuple(Material(name=k, density=DENSITY, young=young, poisson=0.25) for k in names),
        kinds=tuple(Species(name=k, material=k, radius=RADIUS) for k in names),
        pair_laws=tuple(laws),
        law=law or HertzMindlin(),
    )
    simulation = Simulation(scene, dt, precision=precision)
    # damped impacts last up to half again as long
    simulation.step(int(2.0 * contact_time(young, speed) / dt) + 4)
    v = simulation.velocity[:, 0]
    return ((v[n:] - v[:n]) / speed).reshape(len(values), PHASES)


@pytest.mark.parametrize("young", [1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12])
def test_d1_restitution_does_not_depend_on_stiffness(young: float) -> None:
    """D1: 1 m/s; 1 % of e at 1/100 of the contact time, at overlaps from 0.4 um to a third of the radius."""
    measured = collisions(young, 1.0, contact_time(young, 1.0) / 100)
    assert measured.mean(axis=1) == pytest.approx(np.array(RESTITUTIONS), abs=0.01)
    assert np.ptp(measured, axis=1).max() < 0.01


@pytest.mark.parametrize("speed", [0.01, 0.1, 5.0, 100.0])
def test_d2_restitution_does_not_depend_on_speed(speed: float) -> None:
    """D2: E = 1e9, the step follows the contact time."""
    measured = collisions(1e9, speed, contact_time(1e9, speed) / 100)
    assert measured.mean(axis=1) == pytest.approx(np.array(RESTITUTIONS), abs=0.01)


def test_d1_contact_time_falls_with_the_power_two_fifths_of_stiffness() -> None:
    """D1: exponent -0.400 +- 0.005 over seven decades, and the closed form itself."""
    moduli, times = np.logspace(5, 12, 8), []
    for young in moduli:
        scene = one_bounce(young, 1.0)
        dt = contact_time(young, 1.0) / 200
        simulation = Simulation(scene, dt, precision="float64")
        speed = []
        for _ in range(300):
            simulation.step()
            speed.append(simulation.velocity[1, 0] - simulation.velocity[0, 0])
        changing = np.flatnonzero(np.diff(speed) != 0)
        times.append((changing[-1] - changing[0]) * dt)
    assert np.polyfit(np.log(moduli), np.log(times), 1)[0] == pytest.approx(-0.4, abs=0.005)
    assert times == pytest.approx([contact_time(young, 1.0) for young in moduli], rel=0.02)


def one_bounce(young: float, speed: float, gap: float = 1e-6 * RADIUS) -> Scene:
    """Two elastic grains that meet."""
    return grains(
        [[-RADIUS - gap / 2, 0, 0], [RADIUS + gap / 2, 0, 0]],
        [[speed / 2, 0, 0], [-speed / 2, 0, 0]],
        young=young,
        poisson=0.25,
        restitution=1.0,
        friction=0.0,
    )


def clipped(e: float) -> float:
    """Restitution without tension: exp(-(b/sqrt(1-b^2)) (pi - atan2(2 b sqrt(1-b^2), 1 - 2 b^2))).

    Schwager & Poeschel 2007, doi 10.1007/s10035-007-0065-z, for the linear law; the same holds for Hertz with the
    dashpot of Tsuji.
    """
    b = -np.log(e) / np.hypot(np.pi, np.log(e))
    root = np.sqrt(1 - b * b)
    return float(np.exp(-(b / root) * (np.pi - np.arctan2(2 * b * root, 1 - 2 * b * b))))


def test_no_tension_rebounds_as_its_closed_form_says() -> None:
    """The published table of effective restitutions, and the law by name at three of them."""
    table = {0.1: 0.2527, 0.3: 0.3971, 0.5: 0.5503, 0.7: 0.7182, 0.9: 0.9020, 0.98: 0.9801}
    assert [clipped(e) for e in table] == pytest.approx(list(table.values()), abs=1e-4)
    measured = collisions(1e8, 1.0, contact_time(1e8, 1.0) / 3000, HertzMindlin(variant="no-tension"))
    assert measured.mean(axis=1) == pytest.approx([clipped(e) for e in RESTITUTIONS], abs=1e-3)


def test_the_linear_law_has_the_restitution_and_the_contact_time_of_its_oscillator() -> None:
    """MF01 without gravity: e, contact time pi/sqrt(kn/m* (1 - b^2)), elastic peak overlap v sqrt(m*/kn)."""
    kn, speed = 5e3, 0.5
    law = LinearSpring(normal_stiffness=kn, tangential_stiffness=0.0)
    mass = DENSITY * 4 / 3 * np.pi * RADIUS**3
    for e in (0.3, 1.0):
        b = -np.log(e) / np.hypot(np.pi, np.log(e))
        time = np.pi / np.sqrt(kn / mass * (1 - b * b))
        scene = grains([[0, 0, 1.0005 * RADIUS]], [[0, 0, -speed]], walls=(FLOOR,), restitution=e, law=law)
        simulation = Simulation(scene, time / 4000, precision="float64")
        height = []
        for _ in range(500):
            simulation.step(10)
            height.append(simulation.position[0, 2])
        below = np.array(height) < RADIUS
        assert simulation.velocity[0, 2] == pytest.approx(e * speed, abs=1e-3 * speed)
        assert below.sum() * 10 * simulation.dt == pytest.approx(time, rel=5e-3)
        if e == 1:
            assert RADIUS - min(height) == pytest.approx(speed * np.sqrt(mass / kn), rel=1e-3)


def test_mf01_a_sphere_falls_and_bounces_on_a_linear_spring() -> None:
    """MF01: d = 0.2 m, rho = 2600, h0 = 0.5 m: times and speeds of the rebound for kn = 1e4 to 5e4 N/m."""
    expected = {
        (1e4, 1.0): (0.39684, 2.8014),
        (2.5e4, 1.0): (0.35419, 2.8014),
        (5e4, 1.0): (0.33346, 2.8014),
        (1e4, 0.8): (0.39822, 2.1495),
        (2.5e4, 0.8): (0.35477, 2.1854),
        (5e4, 0.8): (0.33378, 2.2025),
    }
    for (kn, e), (time, speed) in expected.items():
        scene = grains(
            [[0, 0, 0.5]],
            radius=0.1,
            density=2600,
            restitution=e,
            friction=0.0,
            gravity=(0, 0, -9.81),
            walls=(FLOOR,),
            law=LinearSpring(normal_stiffness=kn, tangential_stiffness=0.0),
        )
        simulation = Simulation(scene, 1e-5, precision="float64")
        simulation.step(round(time / 1e-5))
        # at the published instant the sphere leaves the plane; its digits are 1e-5 s and 1e-4 m/s
        assert simulation.position[0, 2] == pytest.approx(0.1, abs=2e-5 * speed)
        assert simulation.velocity[0, 2] == pytest.approx(speed, rel=5e-4)


ORDERS = {"hertz": (HertzMindlin(), 2.5), "linear": (LinearSpring(normal_stiffness=2e4, tangential_stiffness=0.0), 2.0)}


@pytest.mark.parametrize("name", list(ORDERS))
def test_sr14_an_elastic_bounce_is_of_the_order_that_the_edge_of_the_contact_allows(name: str) -> None:
    """SR14: |e - 1| falls as dt^2 with a linear spring and as dt^2.5 with Hertz's law.

    Verlet gives all energy back but at the edge of the contact, where a step sees the spring or not: the energy at
    stake is that at an overlap v dt, which is (2/5) k (v dt)^(5/2) or (1/2) k (v dt)^2.
    """
    law, order = ORDERS[name]
    # where in its step a contact ends depends on where it began and on the ratio: many of both
    errors, ratios = [], np.geomspace(8, 64, 25)
    for ratio in ratios:
        dt = contact_time(1e8, 1.0) / ratio
        measured = collisions(1e8, 1.0, dt, law, values=(1.0,), precision="float64")
        errors.append(np.abs(measured - 1).mean())
    assert -np.polyfit(np.log(ratios), np.log(errors), 1)[0] == pytest.approx(order, abs=0.2)
    assert errors[0] < 0.02


def test_d10_a_grazing_bullet_is_deflected_as_the_closed_form_says() -> None:
    """D10: 100 m/s, impact parameter 0.99 d, no friction: the normal part of the velocity passes to the other.

    So stiff that the bullet moves r/50 while they touch: the closed form is that of rigid spheres.
    """
    speed, b = 100.0, 0.99 * 2 * RADIUS
    along = np.sqrt(4 * RADIUS**2 - b * b)
    scene = grains(
        [[-along - 0.5 * RADIUS, b, 0], [0, 0, 0]],
        [[speed, 0, 0], [0, 0, 0]],
        young=1e14,
        friction=0.0,
        restitution=1.0,
    )
    simulation = Simulation(scene, 0.3 * scene.rayleigh_time(), precision="float64")
    simulation.step(round(2 * RADIUS / speed / simulation.dt))
    n = np.array([-along, b, 0]) / (2 * RADIUS)
    expected = np.array([speed, 0, 0]) - (n[0] * speed) * n
    angle, wanted = (np.degrees(np.arctan2(u[1], u[0])) for u in (simulation.velocity[0], expected))
    assert angle == pytest.approx(wanted, abs=1.0)
    assert wanted > 5


def test_w8_the_largest_overlap_in_any_step_is_that_of_the_positions() -> None:
    """W8: not a residual of a solver: the largest overlap of all steps, from the positions after each."""
    random = np.random.default_rng(4)
    position = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * 2.05 * RADIUS
    inwards = position.mean(axis=0) - position
    scene = grains(position, 100 * inwards + 0.05 * random.normal(size=position.shape), young=1e7)
    simulation = Simulation(scene, 1e-6, precision="float64")
    largest = 0.0
    i, j = np.triu_indices(len(position), 1)
    for _ in range(600):
        simulation.step()
        x = simulation.position
        largest = max(largest, float((2 * RADIUS - np.linalg.norm(x[i] - x[j], axis=1)).max()))
    assert largest > 1e-3 * RADIUS
    assert simulation.largest_overlap() == pytest.approx(largest, rel=1e-9)
