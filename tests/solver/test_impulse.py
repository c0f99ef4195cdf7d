"""The impulse solver: restitution, friction, rest, speed without tunnelling, and what no step may create."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, gas, grains

from dembench.scene import Box, Constraint, Scene
from dembench.solver import Simulation, SolverError

DT = 5e-5
GRAVITY = (0, 0, -9.81)


def rigid(scene: Scene, dt: float = DT, **options: Any) -> Simulation:
    return Simulation(scene, dt, method="impulse", rows="rigid", **options)


@pytest.mark.parametrize("gravity", [(0, 0, 0), GRAVITY])
@pytest.mark.parametrize("restitution", [0.1, 0.5, 0.8, 1.0])
def test_two_spheres_part_with_the_restitution(restitution: float, gravity: tuple[float, float, float]) -> None:
    """Exact, in free fall as without gravity: the impulse is one number and the contact has no duration."""
    scene = grains(
        [[-1.5e-3, 0, 0], [1.5e-3, 0, 0]],
        [[0.5, 0, 0], [-0.5, 0, 0]],
        [[30, 0, 0], [-30, 0, 0]],
        restitution=restitution,
        gravity=gravity,
    )
    simulation = rigid(scene)
    simulation.step(60)
    v = simulation.velocity - np.array(gravity) * simulation.time
    assert v[1] - v[0] == pytest.approx([restitution, 0, 0], abs=1e-6)
    assert v.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-6)


@pytest.mark.parametrize("restitution", [0.2, 0.9])
def test_a_sphere_rebounds_from_a_floor(restitution: float) -> None:
    scene = grains([[0, 0, 1.5e-3]], [[0, 0, -1.0]], walls=(FLOOR,), restitution=restitution)
    simulation = rigid(scene)
    simulation.step(30)
    assert simulation.velocity[0] == pytest.approx([0, 0, restitution], abs=1e-6)


@pytest.mark.parametrize("fall", [0.0, 1e-6, 9.81])
@pytest.mark.parametrize("speed", [2.0, 0.3])
def test_d18_friction_of_an_oblique_impact_is_the_same_law_at_any_gravity(speed: float, fall: float) -> None:
    """Tangential impulse min(mu (1 + e) m vn, 2/7 m vt), whether the grain then slides or sticks."""
    e, mu = 0.6, 0.2
    scene = grains(
        [[0, 0, 1.3 * RADIUS]],
        [[speed, 0, -1.0]],
        walls=(FLOOR,),
        restitution=e,
        friction=mu,
        gravity=(0, 0, -fall),
    )
    simulation = rigid(scene)
    before = simulation.velocity[0]
    while before[2] < 0:
        simulation.step()
        arriving = before - [0, 0, fall * DT]
        before = simulation.velocity[0]
    impulse = min(mu * (1 + e) * -arriving[2], 2 / 7 * speed)
    assert before == pytest.approx([speed - impulse, 0, -e * arriving[2]], abs=1e-6)
    assert simulation.angular_velocity[0] == pytest.approx([0, 2.5 * impulse / RADIUS, 0], rel=1e-5, abs=1e-3)


@pytest.mark.parametrize("fall", [0.0, 9.8])
def test_d38_spinning_spheres_are_deflected_by_the_bound_of_coulomb(fall: float) -> None:
    """+-2 m/s, both spins 10 rad/s, unit spheres, e = 0.2, mu = 0.6: mu (1 + e) v_rel m* = 1.44, less than sticking."""
    scene = grains(
        [[-1.5, 0, 0], [1.5, 0, 0]],
        [[2, 0, 0], [-2, 0, 0]],
        [[0, 0, 10], [0, 0, 10]],
        radius=1.0,
        density=3 / (4 * np.pi),
        restitution=0.2,
        friction=0.6,
        gravity=(0, 0, -fall),
    )
    simulation = rigid(scene, 0.002)
    simulation.step(400)
    v = simulation.velocity
    assert np.abs(v[:, 1]) == pytest.approx([1.44, 1.44], rel=1e-4)
    assert v[:, 1].sum() == pytest.approx(0, abs=1e-6)
    assert v[1, 0] - v[0, 0] == pytest.approx(0.2 * 4, rel=1e-5)


def test_opposite_spins_do_not_deflect() -> None:
    scene = grains([[-1.5e-3, 0, 0], [1.5e-3, 0, 0]], [[0.5, 0, 0], [-0.5, 0, 0]], [[0, 0, 100], [0, 0, -100]])
    simulation = rigid(scene)
    simulation.step(60)
    assert simulation.velocity[:, 1] == pytest.approx([0, 0], abs=1e-6)
    assert simulation.angular_velocity[:, 2] == pytest.approx([100, -100], rel=1e-6)


def test_a_sphere_on_a_plane_rests() -> None:
    scene = grains([[0, 0, RADIUS]], walls=(FLOOR,), gravity=GRAVITY)
    simulation = rigid(scene)
    simulation.step(4000)
    assert np.abs(simulation.velocity).max() < 1e-6
    assert simulation.position[0] == pytest.approx([0, 0, RADIUS], abs=1e-4 * RADIUS)


def test_a_column_stands() -> None:
    """20 touching spheres for 0.5 s: no speed, no sinking."""
    z = RADIUS * (1 + 2 * np.arange(20))
    scene = grains(np.stack([0 * z, 0 * z, z], axis=1), walls=(FLOOR,), gravity=GRAVITY)
    simulation = rigid(scene)
    simulation.step(10000)
    assert np.abs(simulation.velocity).max() < 9.81 * DT
    assert np.abs(simulation.position[:, :2]).max() < 1e-3 * RADIUS
    assert simulation.position[:, 2] == pytest.approx(z, abs=0.01 * RADIUS)


def incline(angle: float, friction: float, locked: bool = False) -> Scene:
    constraints = (Constraint(kind="rotation-locked", bodies=(0,)),) if locked else ()
    return grains(
        [[0, 0, RADIUS]],
        walls=(FLOOR,),
        gravity=(9.81 * np.sin(angle), 0, -9.81 * np.cos(angle)),
        friction=friction,
        constraints=constraints,
    )


@pytest.mark.parametrize("ratio", [0.9, 0.99])
def test_w10_d34_a_block_sticks_below_the_friction_angle(ratio: float) -> None:
    simulation = rigid(incline(np.arctan(ratio * 0.5), 0.5, locked=True))
    simulation.step(20000)
    assert simulation.position[0, 0] == pytest.approx(0, abs=1e-4 * RADIUS)


@pytest.mark.parametrize("ratio", [1.01, 1.05, 1.15])
def test_w10_d34_a_block_slides_above_the_friction_angle_from_rest(ratio: float) -> None:
    """1/2 (g sin - mu g cos) t^2, however slow: nothing falls asleep. A symplectic step is (1 + dt/t) too far."""
    theta = np.arctan(ratio * 0.5)
    simulation = rigid(incline(theta, 0.5, locked=True))
    simulation.step(8000)
    t = simulation.time
    exact = 0.5 * 9.81 * (np.sin(theta) - 0.5 * np.cos(theta)) * t**2
    assert simulation.position[0, 0] == pytest.approx(exact * (1 + DT / t), rel=1e-4)
    assert (simulation.angular_velocity == 0).all()


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_d35_a_sphere_on_an_incline_rolls_or_slides(factor: float) -> None:
    """a = 5/7 g sin for mu above 2/7 tan(theta), else g (sin - mu cos)."""
    theta = 0.6
    friction = factor * 2 / 7 * np.tan(theta)
    simulation = rigid(incline(theta, friction))
    simulation.step(4000)
    a = 5 / 7 * 9.81 * np.sin(theta) if factor > 1 else 9.81 * (np.sin(theta) - friction * np.cos(theta))
    assert simulation.velocity[0, 0] == pytest.approx(a * simulation.time, rel=1e-4)
    slip = simulation.velocity[0, 0] - RADIUS * simulation.angular_velocity[0, 1]
    assert (abs(slip) < 1e-5) == (factor > 1)


def test_a_sliding_sphere_ends_rolling_with_five_sevenths_of_its_speed() -> None:
    scene = grains([[0, 0, RADIUS]], [[0.3, 0, 0]], walls=(FLOOR,), gravity=GRAVITY, friction=0.5)
    simulation = rigid(scene)
    simulation.step(2000)
    assert simulation.velocity[0, 0] == pytest.approx(5 / 7 * 0.3, rel=1e-5)
    assert simulation.angular_velocity[0, 1] * RADIUS == pytest.approx(5 / 7 * 0.3, rel=1e-5)


def heap(n: int = 343, **changes: Any) -> Scene:
    """A lattice that falls apart in a box."""
    position, velocity, spin = gas(n, speed=0.3, spacing=2.5)
    position += 2 * RADIUS
    box = Box(name="box", material="grain", lower=(0, 0, 0), upper=(0.025, 0.025, 0.1), open_faces=("z+",))
    fields = {"walls": (box,), "gravity": GRAVITY, "restitution": 0.5}
    return grains(position, velocity, spin, **{**fields, **changes})


@pytest.mark.parametrize(("sweeps", "window"), [(100, 1), (8, 20)])
def test_energy_of_a_collapsing_pile_only_falls(sweeps: int, window: int) -> None:
    """Kinetic and potential: in every step where the sweeps converge, in every millisecond with eight of them."""
    scene = heap(216)
    simulation = rigid(scene, velocity_sweeps=sweeps)
    mass = scene.masses()
    found = []
    for _ in range(2500 // window):
        found.append(simulation.kinetic_energy() + 9.81 * float(mass @ simulation.position[:, 2]))
        simulation.step(window)
    assert np.diff(found).max() < 0
    simulation.step(2500)
    assert simulation.kinetic_energy() < 1e-3 * found[0]
    assert np.abs(simulation.position[:, :2] - 0.0125).max() < 0.0125 - 0.999 * RADIUS


def test_the_position_pass_leaves_at_most_the_slop() -> None:
    """With as many sweeps as it takes, no overlap above 5e-5 diameters is left after a step, of pairs or with walls."""
    scene = heap(125)
    simulation = rigid(scene, position_sweeps=1000)
    i, j = np.triu_indices(125, 1)
    worst = 0.0
    for _ in range(200):
        simulation.step(5)
        x = simulation.position
        worst = max(worst, float((2 * RADIUS - np.linalg.norm(x[i] - x[j], axis=1)).max()))
        worst = max(worst, float((RADIUS - x).max()))
    assert worst <= 1.0001 * 5e-5 * 2 * RADIUS
    assert simulation.largest_overlap() <= 1.0001 * 5e-5 * 2 * RADIUS


def test_momentum_of_free_grains_is_kept() -> None:
    position, velocity, spin = gas(64)
    scene = grains(position, velocity + 100 * (position.mean(axis=0) - position), spin)
    simulation = rigid(scene)
    v0 = simulation.velocity
    simulation.step(100)
    v, x = simulation.velocity, simulation.position
    assert np.abs(v - v0).max() > 1
    total = np.abs(v0).sum()
    assert v.sum(axis=0) == pytest.approx(v0.sum(axis=0), abs=1e-6 * total)
    inertia = 0.4 * RADIUS**2
    angular = (np.cross(x, v) + inertia * simulation.angular_velocity).sum(axis=0)
    start = (np.cross(position, v0) + inertia * scene.bodies.angular_velocity).sum(axis=0)
    # impulses act at the touching point of the start of the step; what is missing is the gap closed within it
    assert angular == pytest.approx(start, abs=5e-4 * total * np.abs(position).max())


def test_a_repeated_run_gives_the_same_bits() -> None:
    ends = []
    for block in (1000, 1000, 13):
        simulation = rigid(heap(125))
        made = 0
        while made < 1000:
            simulation.step(min(block, 1000 - made))
            made += min(block, 1000 - made)
        ends.append([a.tobytes() for a in (simulation.position, simulation.velocity, simulation.angular_velocity)])
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.parametrize("dt", [0.0, -1e-5, float("nan"), float("inf")])
def test_what_is_no_step_is_refused(dt: float) -> None:
    with pytest.raises(SolverError, match=f"dt = {dt}"):
        rigid(grains([[0, 0, 0]]), dt)


@pytest.mark.parametrize(("name", "value"), [("velocity_sweeps", 0), ("position_sweeps", -1)])
def test_numbers_of_sweeps_that_make_no_sense_are_refused(name: str, value: int) -> None:
    with pytest.raises(SolverError, match=f"{name} = {value}"):
        rigid(grains([[0, 0, 0]]), **{name: value})
