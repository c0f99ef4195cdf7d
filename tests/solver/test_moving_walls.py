"""Walls that move: by velocity, turning and oscillating; D26 and D39 of the verification catalogue."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import RADIUS, grains, resting_overlap
from scipy.optimize import brentq

from dembench.scene import Box, Cylinder, Mesh, Motion, Plane, Sdf
from dembench.solver import Simulation

DRIVERS: dict[str, dict[str, Any]] = {
    "half": {},
    "full": {"lists": "full"},
    "rigid": {"method": "impulse", "rows": "rigid"},
    "compliant": {"method": "impulse", "rows": "compliant"},
}
G = 9.81


def plate(kind: str, motion: Motion, centre: Any = (0, 0, 0)) -> Any:
    """A horizontal plate of a kind, with the void above."""
    x, y, z = centre
    common = {"name": "plate", "material": "grain", "motion": motion}
    if kind == "plane":
        return Plane(point=centre, normal=(0, 0, 1), **common)
    half = 40 * RADIUS
    if kind == "grid":
        return Sdf.from_function(
            function=lambda p: p[:, 2] - z,
            lower=(x - half, y - half, z - 2 * RADIUS),
            upper=(x + half, y + half, z + 3 * RADIUS),
            spacing=RADIUS,
            **common,
        )
    a, b, c, d = ([x + u * half, y + v * half, z] for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return Mesh(triangles=[[a, b, c], [a, c, d]], **common)


@pytest.mark.parametrize("far", [0.0, 1e6], ids=["at the origin", "far away"])
@pytest.mark.parametrize(
    ("kind", "driver"), [("plane", "half"), ("grid", "half"), ("mesh", "half"), ("grid", "rigid"), ("plane", "full")]
)
def test_d26_d39_a_grain_leaves_a_moving_plate_with_the_restitution_of_their_approach(
    driver: str, kind: str, far: float
) -> None:
    """A plate comes with V from beyond the lists at a grain at rest: it leaves with (1 + e) V, also 1e6 d away.

    The velocity Verlet step resolves the contact of 220 steps to 1e-3 of V; an impulse has no contact time.
    """
    centre = far * 2 * RADIUS * np.array([1.0, -0.7, 0.4])
    moving = plate(kind, Motion(velocity=(0.3, 0, 1)), tuple(centre))
    scene = grains([centre + np.array([0, 0, 5.3 * RADIUS])], walls=(moving,), young=1e8, restitution=0.6, friction=0.0)
    simulation = Simulation(scene, 4e-7, **DRIVERS[driver])
    simulation.step(15000)
    assert simulation.velocity[0] == pytest.approx([0, 0, 1.6], abs=2e-3)


@pytest.mark.parametrize(("driver", "kind"), [*[(d, "box") for d in DRIVERS], ("half", "mesh"), ("rigid", "mesh")])
def test_d39_a_box_that_turns_and_travels_takes_its_ball_along(driver: str, kind: str) -> None:
    """A closed box with a tight ball: after a quarter of a turn and 60 ball radii the ball is where it should be.

    The ball has a play of 1 % of its radius in the box; the centre of the box follows the closed form of the motion.
    """
    half = 1.01 * RADIUS
    arm, speed, rate = 20 * RADIUS, 2.0, 50.0
    box = Box(
        name="box",
        material="grain",
        lower=(arm - half, -half, -half),
        upper=(arm + half, half, half),
        motion=Motion(velocity=(0, 0, speed), angular_velocity=(0, 0, rate), centre=(0, 0, 0)),
    )
    if kind == "mesh":
        box = Mesh(name="box", material="grain", triangles=box.triangulate(), motion=box.motion)
    start = [[0, rate * arm, speed]]
    scene = grains([[arm, 0, 0]], start, walls=(box,), young=1e8, restitution=0.2, friction=0.0)
    simulation = Simulation(scene, 2e-6, **DRIVERS[driver])
    simulation.step(round(np.pi / 2 / rate / 2e-6))
    t = simulation.time
    centre = np.array([arm * np.cos(rate * t), arm * np.sin(rate * t), speed * t])
    assert t == pytest.approx(np.pi / 2 / rate, rel=1e-4)
    assert np.abs(simulation.position[0] - centre).max() < 0.03 * RADIUS


@pytest.mark.parametrize("driver", DRIVERS)
def test_a_grain_that_turns_with_its_drum_does_not_slip(driver: str) -> None:
    """A grain at the wall of a drum moves with it as one rigid body: nothing slips, and it keeps the drum's spin.

    The surface of the wall is faster than the grain's centre by spin times radius. Taken at the centre, its velocity
    would stop the spin: 20 radii away a contact time is enough.
    """
    rate, drum = 50.0, 20 * RADIUS
    motion = Motion(angular_velocity=(0, rate, 0))
    wall = Cylinder(name="drum", material="grain", start=(0, -1, 0), end=(0, 1, 0), radius=drum, motion=motion)
    far = drum - RADIUS
    law = {"young": 1e7, "restitution": 0.2, "friction": 0.5}
    scene = grains([[far, 0, 0]], [[0, 0, -rate * far]], [[0, rate, 0]], walls=(wall,), **law)
    simulation = Simulation(scene, 2e-6, **DRIVERS[driver])
    simulation.step(round(np.pi / 2 / rate / 2e-6))
    assert simulation.angular_velocity[0] == pytest.approx([0, rate, 0], abs=0.02 * rate)
    assert np.abs(simulation.position[0] - [0, 0, -far]).max() < 0.02 * RADIUS


def test_a_turning_drum_gives_two_sevenths_of_its_speed() -> None:
    """A rigid grain that hits it and sticks: v = 2/7 and w r = 5/7 of the surface's speed, Walton's b0 = 0."""
    rate, drum = 5.0, 20 * RADIUS
    motion = Motion(angular_velocity=(0, rate, 0))
    wall = Cylinder(name="drum", material="grain", start=(0, -1, 0), end=(0, 1, 0), radius=drum, motion=motion)
    scene = grains([[drum - 1.5 * RADIUS, 0, 0]], [[1.0, 0, 0]], walls=(wall,), restitution=0.5, friction=5.0)
    simulation = Simulation(scene, 1e-5, **DRIVERS["rigid"])
    simulation.step(200)
    speed = rate * drum
    assert simulation.velocity[0] == pytest.approx([-0.5, 0, -2 / 7 * speed], abs=1e-4)
    assert simulation.angular_velocity[0, 1] == pytest.approx(5 / 7 * speed / RADIUS, rel=1e-4)


def shaken(gamma: float, height: float, velocity: float, restitution: float, kind: str = "plane") -> tuple[Any, float]:
    """A ball above a plate that oscillates at 25 Hz with gamma g, and the amplitude [m]."""
    rate = 2 * np.pi * 25
    amplitude = gamma * G / rate**2
    wall = plate(kind, Motion(amplitude=(0, 0, amplitude), frequency=25.0))
    fields = {"walls": (wall,), "gravity": (0, 0, -G), "restitution": restitution, "friction": 0.0, "young": 1e9}
    return grains([[0, 0, RADIUS + height]], [[0, 0, velocity]], **fields), amplitude


@pytest.mark.parametrize(("driver", "kind"), [("half", "plane"), ("rigid", "plane"), ("rigid", "grid")])
def test_d39_a_bouncing_ball_settles_on_the_orbit_of_the_plate(driver: str, kind: str) -> None:
    """Period-1 orbit: flight of one period T, impact at the phase with cos phi = pi (1 - e)/((1 + e) Gamma).

    It attracts for e = 0.5 between Gamma 1.05 and 1.53 (Luck and Mehta, Phys. Rev. E 48 (1993) 3988). A ball that
    starts 5 % off is after 25 periods where that orbit has it at the end of a period, within 1 % of height and speed.
    """
    gamma, e, period = 1.3, 0.5, 0.04
    phi = np.arccos(np.pi * (1 - e) / ((1 + e) * gamma))
    since = period - phi / (2 * np.pi * 25)
    height = gamma * G / (2 * np.pi * 25) ** 2 * np.sin(phi) + G * period / 2 * since - G * since**2 / 2
    speed = G * period / 2 - G * since
    scene, _amplitude = shaken(gamma, 0.95 * height, 0.95 * speed, e, kind)
    simulation = Simulation(scene, 2.5e-7 if driver != "rigid" else 2e-5, precision="float64", **DRIVERS[driver])
    simulation.step(round(25 * period / simulation.dt))
    assert simulation.position[0, 2] - RADIUS == pytest.approx(height, abs=0.01 * G * period**2 / 8)
    assert simulation.velocity[0, 2] == pytest.approx(speed, abs=0.01 * G * period / 2)


@pytest.mark.parametrize(("driver", "impacts"), [("half", 2), ("rigid", 3)])
def test_d39_impacts_at_four_g_follow_the_exact_map(driver: str, impacts: int) -> None:
    """Gamma = 4, e = 0.5: flights and impacts from root finding, velocity and position within 1 % of the last flight.

    Impacts amplify deviations about fourfold; those of soft spheres last a while, in which the plate moves on.
    """
    scene, amplitude = shaken(4.0, 2e-3, 0.0, 0.5)
    rate, z, v, t = 2 * np.pi * 25, 2e-3, 0.0, 0.0
    for _ in range(impacts):

        def gap(s: float, z: float = z, v: float = v, t: float = t) -> float:
            return z + v * s - G * s * s / 2 - amplitude * np.sin(rate * (t + s))

        times = np.linspace(1e-6, 0.3, 30000)
        first = times[np.argmax(np.array([gap(s) for s in times]) < 0)]
        flight = brentq(gap, first - 1e-5, first)
        t, z, v = t + flight, amplitude * np.sin(rate * (t + flight)), v - G * flight
        plate_speed = amplitude * rate * np.cos(rate * t)
        v = plate_speed - 0.5 * (v - plate_speed)
    simulation = Simulation(scene, 1e-6 if driver == "half" else 4e-6, precision="float64", **DRIVERS[driver])
    simulation.step(round((t + 0.004) / simulation.dt))
    s = simulation.time - t
    assert simulation.velocity[0, 2] == pytest.approx(v - G * s, abs=0.01 * v)
    assert simulation.position[0, 2] - RADIUS == pytest.approx(z + v * s - G * s * s / 2, abs=0.01 * v * v / (2 * G))


@pytest.mark.parametrize(
    ("kind", "driver"), [*[("plane", d) for d in DRIVERS], ("grid", "half"), ("mesh", "compliant")]
)
def test_a_conveyor_belt_takes_a_grain_along(kind: str, driver: str) -> None:
    """Its surface moves with V and it stays where it is: mu g until the grain rolls with 2/7 V, at 2 V/(7 mu g)."""
    belt = plate(kind, Motion(velocity=(0.1, 0, 0), surface=True))
    rest = RADIUS - resting_overlap(grains([[0, 0, 0]], gravity=(0, 0, -G)))
    scene = grains([[0, 0, rest]], walls=(belt,), gravity=(0, 0, -G), friction=0.2, restitution=0.5)
    simulation = Simulation(scene, 4e-6, **DRIVERS[driver])
    simulation.step(500)
    early = simulation.velocity[0, 0]
    simulation.step(1000)
    assert simulation.velocity[0, 0] - early == pytest.approx(0.2 * G * 1000 * 4e-6, rel=0.01)
    simulation.step(6000)
    # the lever is r less half the overlap, 5e-4 of r
    assert simulation.velocity[0] == pytest.approx([2 / 7 * 0.1, 0, 0], abs=1e-4)
    assert simulation.angular_velocity[0] == pytest.approx([0, -5 / 7 * 0.1 / RADIUS, 0], rel=2e-3, abs=1e-3)


@pytest.mark.parametrize(("kind", "driver"), [("grid", "half"), ("grid", "rigid"), ("mesh", "half")])
def test_a_grain_bounces_on_every_kind_of_floor_as_on_the_plane(kind: str, driver: str) -> None:
    """Three bounces with spin and friction: position and velocity agree to 1e-3 of the drop height and speed."""
    found = []
    for wall in (plate(kind, Motion()), plate("plane", Motion())):
        scene = grains(
            [[0, 0, RADIUS + 5e-3]], [[0.1, 0.05, 0]], [[0, 50, 0]], walls=(wall,), gravity=(0, 0, -G), young=1e8
        )
        simulation = Simulation(scene, 2e-6, precision="float64", **DRIVERS[driver])
        simulation.step(40000)
        found.append((simulation.position[0], simulation.velocity[0]))
    assert found[0][0] == pytest.approx(found[1][0], abs=1e-3 * 5e-3)
    assert found[0][1] == pytest.approx(found[1][1], abs=1e-3 * 0.3)
