"""What impulse and soft-sphere solvers are known to do wrong, each as a short test of physics that ours passes.

Every docstring says by which mechanism another solver fails. The statics of rigid rows are in `test_statics.py`: deep
columns (W3), a heavy sphere on a light one, wedges and half overlapped spheres (W14), and there, too, the tests are
named by their number. Other gaps in the numbers are weaknesses of bulk results and of speed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import DENSITY, FLOOR, RADIUS, gas, grains
from scipy.integrate import solve_ivp

from dembench.scene import Bodies, Constraint, Material, PairLaw, Plane, Scene, Species
from dembench.solver import Simulation, SolverError

UNIT_DENSITY = 3 / (4 * np.pi)
GRAVITY = (0, 0, -9.81)
DT = 5e-5
RIGID: dict[str, Any] = {"method": "impulse", "rows": "rigid"}
METHODS: dict[str, dict[str, Any]] = {"soft-sphere": {"method": "soft-sphere"}, "impulse": RIGID}


def unit_spheres(position: Any, velocity: Any = None, **changes: Any) -> Scene:
    """Spheres with r = 1 m and m = 1 kg."""
    return grains(position, velocity, **{"radius": 1.0, "density": UNIT_DENSITY, **changes})


def test_w1_a_heavy_ball_rebounds_from_wedged_grains() -> None:
    """A ball of 2900 grains' mass hits five grains in a tube, e = 0.4: explicit and implicit springs rebound alike.

    The dashpot is sized by the mass of a grain and the mass that bounces is the ball's: the wedge stores most of the
    energy for many steps and gives it back. Mechanism: Newton's law in every substep of the impact loses it, and so
    does a pass that removes momentum.
    """
    n = 5
    z = RADIUS * (1 + 2 * np.arange(n + 1))
    walls = [FLOOR]
    for k, normal in enumerate(((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))):
        point = tuple(-RADIUS * np.array(normal))
        walls.append(Plane(name=f"side{k}", material="grain", point=point, normal=normal))
    scene = grains(
        np.stack([0 * z, 0 * z, z], axis=1),
        [[0, 0, 0]] * n + [[0, 0, -0.1]],
        walls=tuple(walls),
        kinds=tuple(Species(name=name, material=name, radius=RADIUS) for name in ("grain", "heavy")),
        species=[0] * n + [1],
        materials=tuple(
            Material(name=name, density=density, young=1e8, poisson=0.2)
            for name, density in (("grain", DENSITY), ("heavy", 2900 * DENSITY))
        ),
        pair_laws=tuple(
            PairLaw(a=a, b=b, restitution=0.4, friction=0.0)
            for a, b in (("grain", "grain"), ("grain", "heavy"), ("heavy", "heavy"))
        ),
    )
    rebound = {}
    for name, dt, options in (
        ("explicit", 1e-6, METHODS["soft-sphere"]),
        ("compliant", 2e-5, {"method": "impulse", "rows": "compliant"}),
    ):
        simulation = Simulation(scene, dt, **options)
        simulation.step(round(0.02 / dt))
        rebound[name] = simulation.velocity[n, 2] / 0.1
    assert rebound["explicit"] > 0.8
    assert rebound["compliant"] == pytest.approx(rebound["explicit"], abs=0.05)


@pytest.mark.parametrize("method", METHODS)
def test_w8_the_overlap_is_that_of_the_positions(method: str) -> None:
    """The present overlap follows from the positions, for pairs that touch and for pairs that have parted.

    Mechanism: a residual of the last sweep, ten times smaller than the overlap, is reported in its place.
    """
    simulation = Simulation(grains([[0, 0, 0], [0, 0, 1.9 * RADIUS]], young=1e8), 1e-6, **METHODS[method])
    assert simulation.overlap() == pytest.approx(0.1 * RADIUS, rel=1e-9)
    simulation.velocity = [[0, 0, -1.0], [0, 0, 1.0]]
    simulation.step(1000)
    assert simulation.overlap() == 0
    assert simulation.velocity[1, 2] >= 1.0


@pytest.mark.parametrize("method", METHODS)
def test_w9_a_grain_that_slides_into_a_corner_stays_down(method: str) -> None:
    """At 2 m/s on a floor without friction into a wall, e = 0.01: it stops and does not rise.

    Mechanism: one contact for all boundaries, with the sum of their normals, throws it up at half its speed.
    """
    wall = Plane(name="wall", material="grain", point=(0.01, 0, 0), normal=(-1, 0, 0))
    law = {"walls": (FLOOR, wall), "gravity": GRAVITY, "friction": 0.0, "restitution": 0.01, "young": 1e8}
    simulation = Simulation(grains([[0, 0, RADIUS]], [[2.0, 0, 0]], **law), 1e-6, **METHODS[method])
    for _ in range(60):
        simulation.step(200)
        assert abs(simulation.position[0, 2] - RADIUS) < 1e-3 * RADIUS
        assert abs(simulation.velocity[0, 2]) < 2e-3
    assert -0.05 < simulation.velocity[0, 0] <= 0


@pytest.mark.parametrize("ratio", [0.99, 1.01])
def test_w10_a_block_at_the_friction_angle_does_as_coulomb_says(ratio: float) -> None:
    """A rotation-locked unit sphere, mu = 0.5, from rest for 4 s: it holds at 0.99 mu and slides 0.357 m at 1.01 mu.

    Mechanism: what is slower than some g dt for a while is put to sleep, and never wakes. A symplectic step is
    (1 + dt/t) too far.
    """
    theta, dt = np.arctan(ratio * 0.5), 2e-3
    scene = unit_spheres(
        [[0, 0, 1]],
        walls=(FLOOR,),
        gravity=(10 * np.sin(theta), 0, -10 * np.cos(theta)),
        friction=0.5,
        constraints=(Constraint(kind="rotation-locked", bodies=(0,)),),
    )
    simulation = Simulation(scene, dt, **RIGID)
    simulation.step(2000)
    exact = 0.5 * 10 * (np.sin(theta) - 0.5 * np.cos(theta)) * simulation.time**2
    if ratio < 1:
        assert abs(simulation.position[0, 0]) < 1e-4
    else:
        assert exact == pytest.approx(0.357, abs=1e-3)
        assert simulation.position[0, 0] == pytest.approx(exact * (1 + dt / simulation.time), rel=1e-4)


@pytest.mark.parametrize("fall", [0.0, 1e-3])
@pytest.mark.parametrize("gap", [0.0, 1e-3])
@pytest.mark.parametrize("moving", [1, 2, 3, 4])
def test_w11_as_many_rigid_balls_leave_a_cradle_as_come_in(moving: int, gap: float, fall: float) -> None:
    """Five balls in a row, e = 1, touching or 1e-3 d apart: n out for n in, at once, with and without gravity.

    Mechanism: Newton's law for all contacts of a step at once lets the first ball rebound and the others leave
    together; a path of its own for g = 0 hides it.
    """
    x = 2 * RADIUS * (1 + gap) * np.arange(5)
    x[:moving] -= 0.1 * RADIUS
    v = np.zeros((5, 3))
    v[:moving, 0] = 1.0
    scene = grains(np.stack([x, 0 * x, 0 * x], axis=1), v, restitution=1.0, gravity=(0, 0, -fall))
    simulation = Simulation(scene, DT, **RIGID)
    simulation.step(10)
    expected = np.zeros(5)
    expected[5 - moving :] = 1.0
    assert simulation.velocity[:, 0] == pytest.approx(expected, abs=1e-6)
    assert simulation.velocity[:, 2] == pytest.approx(-fall * simulation.time * np.ones(5), abs=1e-6)


@pytest.mark.parametrize("moving", [1, 2])
def test_w11_an_elastic_cradle_follows_its_differential_equation(moving: int) -> None:
    """Touching Hertz balls do not leave n for n: most of the momentum goes to the last ones, as the chain's ODE says.

    Each contact pushes with 4/3 E* sqrt(R*) d^(3/2) (Herrmann & Seitz 1982, doi 10.1119/1.12936).
    """
    n, speed, dt = 5, 0.1, 2e-7
    x = 2 * RADIUS * np.arange(n)
    x[:moving] -= 1e-3 * RADIUS
    v = np.zeros((n, 3))
    v[:moving, 0] = speed
    scene = grains(np.stack([x, 0 * x, 0 * x], axis=1), v, restitution=1.0, friction=0.0)
    simulation = Simulation(scene, dt, precision="float64", **METHODS["soft-sphere"])
    steps = 15_000
    simulation.step(steps)
    m = scene.materials[0]
    mass = scene.masses()[0]
    stiffness = 4 / 3 * m.young / (2 * (1 - m.poisson**2)) * np.sqrt(RADIUS / 2)

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        push = stiffness * np.maximum(2 * RADIUS - np.diff(y[:n]), 0) ** 1.5 / mass
        return np.concatenate([y[n:], np.append(-push, 0) + np.insert(push, 0, 0)])

    scale = np.repeat([RADIUS, speed], n)
    exact = solve_ivp(
        slope, (0, steps * dt), np.concatenate([x, v[:, 0]]), rtol=1e-9, atol=1e-9 * scale, max_step=1e-5
    ).y[n:, -1]
    assert (exact[1:-1] > 1e-3 * speed).any()
    assert simulation.velocity[:, 0] == pytest.approx(exact, abs=1e-3 * speed)
    assert simulation.velocity[:, 0].sum() == pytest.approx(moving * speed, rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("offset", [0.0, 1e5, 1e6])
def test_w12_a_pair_far_from_the_origin_meets_as_a_pair_at_the_origin(method: str, offset: float) -> None:
    """Unit spheres at 1 m/s, up to a million radii away: they part with e.

    Mechanism: absolute positions in single precision; at 1e5 r a step of v dt is lost in the last place.
    """
    centre = offset * np.array([1.0, -1.0, 1.0])
    scene = unit_spheres(
        centre + np.array([[-1.01, 0, 0], [1.01, 0, 0]]),
        [[1.0, 0, 0], [-1.0, 0, 0]],
        restitution=0.8,
        friction=0.0,
        young=1e5,
    )
    simulation = Simulation(scene, 5e-5 if method == "soft-sphere" else 2e-3, **METHODS[method])
    simulation.step(round(0.1 / simulation.dt))
    parted = (simulation.velocity[1, 0] - simulation.velocity[0, 0]) / 2
    assert parted == pytest.approx(0.8, abs=1e-6 if method == "impulse" else 0.01)
    assert np.abs(simulation.velocity[:, 1:]).max() < 1e-6


@pytest.mark.parametrize("dt", [1e-5, 1e-4, 1e-3])
def test_w13_a_bullet_does_not_go_through_a_wall(dt: float) -> None:
    """100 m/s between a floor and a roof: up to fifty diameters per step.

    Mechanism: contacts are looked for where the body is predicted to be, beyond the wall.
    """
    roof = Plane(name="roof", material="grain", point=(0, 0, 0.3), normal=(0, 0, -1))
    scene = grains([[0, 0, 0.15]], [[0, 0, -100.0]], walls=(FLOOR, roof), restitution=0.9)
    simulation = Simulation(scene, dt, **RIGID)
    bounced = 0
    for _ in range(round(0.02 / dt)):
        simulation.step()
        assert -1e-6 < simulation.position[0, 2] - RADIUS < 0.298 + 1e-6
        bounced += simulation.velocity[0, 2] > 0
    assert bounced > 0


@pytest.mark.parametrize("dt", [1e-5, 1e-4, 5e-4])
def test_w13_a_bullet_does_not_go_through_a_layer_of_spheres(dt: float) -> None:
    """A layer of fixed grains, hit in its middle and off it; at 5e-4 s the bullet moves 25 diameters per step."""
    x = 2 * RADIUS * np.arange(-4, 5)
    height = 5 * RADIUS
    layer = np.array([[a, b, height] for a in x for b in x])
    for shift in (0.0, 0.45):
        bullet = [2 * RADIUS * shift, 2 * RADIUS * shift, height + 0.0437]
        scene = grains(
            [*layer, bullet],
            [*np.zeros_like(layer), [0, 0, -100.0]],
            walls=(FLOOR,),
            constraints=(Constraint(kind="fixed", bodies=tuple(range(len(layer)))),),
        )
        simulation = Simulation(scene, dt, **RIGID)
        for _ in range(round(2e-3 / dt)):
            simulation.step()
            assert simulation.position[-1, 2] > height
        assert simulation.velocity[-1, 2] > 0
        assert (simulation.position[:-1] == layer).all()


@pytest.mark.parametrize("scale", [1e-6, 1e3])
@pytest.mark.parametrize("method", METHODS)
def test_w14_lengths_from_a_micrometre_to_a_kilometre(method: str, scale: float) -> None:
    """A gas of eight that collapses under gravity: lengths and stiffness times s, times and speeds times sqrt(s).

    Mechanism: absolute thresholds such as 1e-6 m or 1e-4 m/s.
    """
    ends = []
    for s in (1.0, scale):
        position, velocity, spin = gas(8, spacing=2.2)
        scene = grains(
            s * (position + np.array([0, 0, 2 * RADIUS])),
            s**0.5 * velocity,
            spin / s**0.5,
            radius=s * RADIUS,
            young=1e8 * s,
            walls=(FLOOR,),
            gravity=GRAVITY,
        )
        dt = (1e-6 if method == "soft-sphere" else 2e-5) * s**0.5
        simulation = Simulation(scene, dt, **METHODS[method])
        simulation.step(round(3e-3 * s**0.5 / dt))
        ends.append((simulation.position / s, simulation.velocity / s**0.5))
    assert ends[1][0] == pytest.approx(ends[0][0], abs=1e-4 * RADIUS)
    assert ends[1][1] == pytest.approx(ends[0][1], abs=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_w14_what_is_no_number_is_refused_with_its_index(method: str) -> None:
    """At the door with the particle, inside with the step: one NaN reaches every grain within a few collisions."""
    with pytest.raises(ValueError, match="particle 1 has the value nan"):
        Bodies(position=[[0, 0, 0], [0, float("nan"), 0]])
    simulation = Simulation(grains([[0, 0, 0], [0.01, 0, 0]]), 1e-6, **METHODS[method])
    with pytest.raises(SolverError, match="1"):
        simulation.velocity = [[0, 0, 0], [0, float("inf"), 0]]


@pytest.mark.parametrize("method", METHODS)
def test_w15_slow_motion_is_not_lost(method: str) -> None:
    """1 mm/s at 0.1 and 10 m in steps of 0.8 us.

    Mechanism: positions in single precision, of which a step at 0.1 m is a tenth of a unit in the last place.
    """
    scene = grains([[0.1, 0.1, -0.1], [10, 10, -10]], [[1e-3, -1e-3, 1e-3]] * 2)
    simulation = Simulation(scene, 8e-7, **METHODS[method])
    simulation.step(100_000)
    way = simulation.position - scene.bodies.position
    assert way[0] == pytest.approx([8e-5, -8e-5, 8e-5], abs=1e-12)
    assert way[1] == pytest.approx([8e-5, -8e-5, 8e-5], abs=1e-10)
