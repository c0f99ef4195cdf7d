"""Compliant rows: the soft-sphere law in the limit, energy, rest, and the substeps that a step needs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, gas, grains, resting_overlap
from impacts import Impact

from dembench.scene import Box, Constraint, LinearSpring, Rigid, Scene
from dembench.solver import Simulation, SolverError
from dembench.solver.impulse.compliant_substeps import STIFFEST, USUAL

GRAVITY = (0, 0, -9.81)
N = 24


def compliant(scene: Scene, dt: float, **options: Any) -> Simulation:
    return Simulation(scene, dt, method="impulse", rows="compliant", **options)


def pairs(speed: float, travel: float, sliding: float = 0.0, **changes: Any) -> Scene:
    """N pairs far apart, the second grain at rest; they meet one after the other while the first travel by `travel`."""
    random = np.random.default_rng(5)
    first, second = np.zeros((N, 3)), np.zeros((N, 3))
    first[:, 1] = second[:, 1] = 0.01 * np.arange(N)
    second[:, 0] = 2 * RADIUS + travel * np.linspace(0.01, 1, N)
    second[:, 2] = random.uniform(-0.5, 0.5, N) * RADIUS * bool(sliding)
    velocity = np.zeros((2 * N, 3))
    velocity[:N, 0] = speed
    velocity[:N, 1] = sliding * random.uniform(-1, 1, N)
    spin = sliding / RADIUS * random.uniform(-1, 1, (2 * N, 3))
    return grains(np.concatenate([first, second]), velocity, spin, **changes)


@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.9, 1.0])
def test_restitution_is_the_same_at_any_speed(restitution: float) -> None:
    """As the law has it, from 0.01 to 5 m/s, for any phase of the substeps, of which there are about three a contact.

    The dashpot makes up for what the mean speed of a substep leaves out: 0.005 above at e = 0.2, less the more elastic;
    elastic grains lose what the Newton iterations leave.
    """
    found = []
    for speed in (0.01, 0.3, 5.0):
        dt = 5e-5 * speed**-0.2
        scene = pairs(speed, speed * dt, young=1e9, restitution=restitution)
        simulation = compliant(scene, dt, precision="float64")
        simulation.step(12)
        v = simulation.velocity[:, 0]
        found.append(float(np.mean(v[N:] - v[:N])) / speed)
    assert np.ptp(found) < 1e-3
    assert found[0] == pytest.approx(restitution, abs=0.01 if restitution < 1 else 2e-5)


LAWS: dict[str, dict[str, Any]] = {
    "reference": {},
    "rescaled": {"variant": "rescaled"},
    "no-tension": {"variant": "no-tension"},
    "linear": {"law": LinearSpring(normal_stiffness=2e4, tangential_stiffness=1.5e4)},
}


@pytest.mark.parametrize("law", list(LAWS))
def test_oblique_impacts_converge_to_those_of_the_soft_sphere_law(law: str) -> None:
    """First order: a sixteenth of the substep leaves a sixteenth of the error of velocities and surface speeds.

    Which substep a grain begins to slide in makes the error of one substep scatter by a factor of two.
    """
    scene = pairs(1.0, 4e-6, 1.5, young=1e8, **LAWS[law])
    duration = 2e-4
    exact = Simulation(scene, duration / 16000, precision="float64")
    exact.step(16000)
    errors = []
    for n in (100, 1600):
        simulation = compliant(scene, duration / n, substeps=1, precision="float64")
        simulation.step(n)
        dv = simulation.velocity - exact.velocity
        dw = RADIUS * (simulation.angular_velocity - exact.angular_velocity)
        errors.append(float(np.sqrt(np.mean(dv**2) + np.mean(dw**2))))
    assert errors[0] > 8 * errors[-1], errors
    assert errors[-1] < 3e-3, errors
    assert np.abs(exact.velocity[:N, 1] - scene.bodies.velocity[:N, 1]).max() > 0.1, "nothing slid"


def test_tangential_compliance_turns_the_slip_back() -> None:
    """A sticking impact on a floor, against its equations: the spring gives back what a rigid contact stops."""
    scene = grains(
        [[0, 0, 1.0001 * RADIUS]], [[0.3, 0, -1.0]], walls=(FLOOR,), young=1e8, restitution=0.9, friction=10.0
    )
    exact = Impact(scene, 0)
    simulation = compliant(scene, 1e-7, substeps=1, precision="float64")
    simulation.step(2000)
    v, w = simulation.velocity[0], simulation.angular_velocity[0]
    assert v[[0, 2]] == pytest.approx(exact.velocity, abs=5e-3)
    assert RADIUS * w[1] == pytest.approx(RADIUS * exact.spins[0], abs=5e-3)
    assert v[0] - RADIUS * w[1] > 0.1


def total_energy(simulation: Simulation) -> float:
    """Kinetic, potential and elastic energy [J]."""
    height = 9.81 * float(simulation.masses @ simulation.position[:, 2])
    return simulation.kinetic_energy() + height + float(simulation.contacts().energy.sum())


def heap(n: int = 125, **changes: Any) -> Scene:
    """A lattice that falls apart in a box."""
    position, velocity, spin = gas(n, speed=0.3, spacing=2.5)
    position += 2 * RADIUS
    box = Box(name="box", material="grain", lower=(0, 0, 0), upper=(0.02, 0.02, 0.1), open_faces=("z+",))
    return grains(position, velocity, spin, **{"walls": (box,), "gravity": GRAVITY, "restitution": 0.5, **changes})


def many_sizes(n: int, **changes: Any) -> Scene:
    """The same with radii of their own."""
    scene = heap(n, **changes)
    sizes = RADIUS * np.random.default_rng(2).uniform(0.5, 1.0, n)
    return scene.model_copy(update={"bodies": scene.bodies.model_copy(update={"radius": sizes})})


@pytest.mark.parametrize(("restitution", "friction"), [(0.9, 0.0), (0.5, 0.3), (0.9, 1.0)])
def test_energy_of_a_collapsing_pile_only_falls(restitution: float, friction: float) -> None:
    """In every step, sticking grains included: the springs gain no more than what bends them."""
    simulation = compliant(heap(restitution=restitution, friction=friction), 2e-4)
    found = []
    for _ in range(400):
        found.append(total_energy(simulation))
        simulation.step()
    assert found[-1] < 0.7 * found[0]
    assert np.diff(found).max() < 0


def test_energy_of_elastic_grains_is_kept() -> None:
    """One sweep leaves rows that do not know of each other's last change; what they gain or lose has no trend."""
    simulation = compliant(heap(restitution=1.0, friction=0.0), 2e-4)
    found = []
    for _ in range(400):
        found.append(total_energy(simulation))
        simulation.step()
    assert np.array(found) == pytest.approx(np.full(400, found[0]), rel=3e-4)


def crowd(n: int = 343, **changes: Any) -> Scene:
    """Grains of two sizes and a ball, packed at random in a box, that fly apart."""
    position, velocity, spin = gas(n, speed=1.0, spacing=2.3)
    low, high = position.min(axis=0) - 2 * RADIUS, position.max(axis=0) + 2 * RADIUS
    ball = [*((low + high) / 2)[:2], high[2] + 6 * RADIUS]
    box = Box(name="box", material="grain", lower=tuple(low), upper=(*high[:2], high[2] + 14 * RADIUS))
    return grains(
        [*position, ball],
        [*velocity, [0, 0, -1.0]],
        [*spin, [0, 0, 0]],
        radius=(RADIUS, 1.1 * RADIUS, 6 * RADIUS),
        species=[*(np.arange(n) % 2), 2],
        walls=(box,),
        young=1e7,
        **changes,
    )


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_solve_the_same_rows(threads: int) -> None:
    """Sweeps in another order have the same solution, and with many sweeps all get there.

    So it is without dashpots: of those the law takes that of the shear away where a contact slides, and near that jump
    it has no solution, between whose two sides a row goes to and fro.
    """
    ends = []
    for parts in (1, threads):
        options: dict[str, Any] = {"substeps": 1, "velocity_sweeps": 60, "precision": "float64"}
        simulation = compliant(crowd(restitution=1.0), 2e-5, threads=parts, **options)
        simulation.step(100)
        ends.append(simulation)
    one, several = ends
    assert several.counters()["rows"] == one.counters()["rows"] > 60
    assert np.abs(one.velocity - crowd().bodies.velocity).max() > 0.5
    assert several.velocity == pytest.approx(one.velocity, abs=1e-9)
    assert RADIUS * several.angular_velocity == pytest.approx(RADIUS * one.angular_velocity, abs=1e-9)
    found = [(len(c.i), float(c.energy.sum()), np.sort(c.normal_force)) for c in (one.contacts(), several.contacts())]
    assert found[0][0] == found[1][0] and found[0][1] == pytest.approx(found[1][1], rel=1e-4)
    assert found[0][2] == pytest.approx(found[1][2], abs=1e-4 * found[0][2].max())


def test_threads_keep_momentum_and_repeat_their_bits() -> None:
    """With one sweep, where every row is solved once and half of the impulses go from range to range."""
    ends = []
    for block in (300, 7):
        position, velocity, spin = gas(512, spacing=2.2)
        scene = grains(position, velocity, spin, restitution=0.6)
        simulation = compliant(scene, 1e-5, threads=2)
        made = 0
        while made < 300:
            simulation.step(min(block, 300 - made))
            made += min(block, 300 - made)
        before, after = (scene.masses() @ v for v in (scene.bodies.velocity, simulation.velocity))
        scale = scene.masses() @ np.linalg.norm(velocity, axis=1)
        assert np.abs(after - before).max() < 1e-6 * scale
        assert simulation.kinetic_energy() < 0.9 * 0.5 * float(scene.masses() @ (velocity**2).sum(axis=1))
        ends.append([a.tobytes() for a in (simulation.position, simulation.velocity, simulation.angular_velocity)])
    assert ends[0] == ends[1]


def test_threads_share_the_pairs_of_an_uneven_bed() -> None:
    """A dense block and a loose cloud: as many bodies for each thread would leave one without pairs."""
    dense = np.stack(np.meshgrid(*3 * [np.arange(8)]), axis=-1).reshape(-1, 3) * 2.05
    loose = np.stack(np.meshgrid(*3 * [np.arange(8)]), axis=-1).reshape(-1, 3) * 2.6 + [20, 0, 0]
    position = RADIUS * np.concatenate([dense, loose])
    simulation = compliant(grains(position, np.random.default_rng(1).normal(0, 0.1, position.shape)), 1e-5, threads=2)
    simulation.step(20)
    for _ in range(4):
        simulation.state.rebuild()
    ranges = simulation.state.ranges.numpy()
    work = simulation.state.pair_count.numpy().reshape(2, 2).sum(axis=1) + np.diff(ranges)
    assert work.max() < 1.1 * work.min()
    assert ranges[1] < 0.4 * len(position)


def test_energy_of_a_gas_that_falls_together_only_falls() -> None:
    position, velocity, spin = gas(64)
    scene = grains(position, velocity + 100 * (position.mean(axis=0) - position), spin, friction=0.0, restitution=0.6)
    simulation = compliant(scene, 1e-4)
    found = []
    for _ in range(80):
        found.append(simulation.kinetic_energy() + float(simulation.contacts().energy.sum()))
        simulation.step()
    assert np.diff(found).max() < 1e-7 * found[0]
    assert found[-1] < 0.9 * found[0]


@pytest.mark.parametrize("lists", ["half", "full"])
def test_a_crowd_on_one_point_bursts_as_in_many_substeps(lists: str) -> None:
    """A hundred grains, each against all others: the stiffness that moves one is that of all its contacts.

    Within a third of the energy of a hundred substeps a step; substeps that are one contact's made it 24 times as much.
    """
    scene, kinetic = grains(np.zeros((100, 3)), young=1e7), []
    for substeps in (None, 100):
        simulation = compliant(scene, 2e-4, substeps=substeps, lists=lists)
        simulation.step(12)
        kinetic.append(simulation.kinetic_energy())
    assert kinetic[0] == pytest.approx(kinetic[1], rel=0.33)


def test_momentum_and_angular_momentum_of_free_grains_are_kept() -> None:
    """To rounding of single-precision impulses: they act at one point, on both grains."""
    position, velocity, spin = gas(64)
    scene = grains(position, velocity + 100 * (position.mean(axis=0) - position), spin)
    simulation = compliant(scene, 1e-4)
    inertia = 0.4 * RADIUS**2

    def momenta() -> tuple[np.ndarray, np.ndarray]:
        v = simulation.velocity
        angular = np.cross(simulation.position, v) + inertia * simulation.angular_velocity
        return v.sum(axis=0), angular.sum(axis=0)

    before, v0 = momenta(), simulation.velocity
    simulation.step(60)
    after = momenta()
    assert np.abs(simulation.velocity - v0).max() > 1, "nothing collided"
    total = np.abs(v0).sum()
    assert after[0] == pytest.approx(before[0], abs=1e-7 * total)
    assert after[1] == pytest.approx(before[1], abs=1e-7 * total * np.abs(position).max())


def test_a_column_rests_and_carries_its_weight() -> None:
    """Ten grains: the contact below the k-th from the top carries k weights, and overlaps as Hertz says."""
    count = 10
    z = RADIUS * (1 + 2 * np.arange(count))
    scene = grains(np.stack([0 * z, 0 * z, z], axis=1), walls=(FLOOR,), gravity=GRAVITY)
    simulation = compliant(scene, 2e-4)
    simulation.step(5000)
    assert np.abs(simulation.velocity).max() < 1e-6
    found = simulation.contacts()
    weight = float(scene.masses()[0]) * 9.81
    carried = count - np.where(found.j < 0, 0, np.maximum(found.i, found.j))
    assert len(found) == count
    assert found.normal_force == pytest.approx(carried * weight, rel=1e-3)
    floor = found.j < 0
    assert found.overlap[floor] == pytest.approx(resting_overlap(scene) * count ** (2 / 3), rel=1e-3)


def test_the_floor_carries_a_pile_at_rest() -> None:
    scene = heap(young=1e6, restitution=0.3)
    simulation = compliant(scene, 4e-4)
    simulation.step(2000)
    found = simulation.contacts()
    up = found.force()[found.j < 0, 2].sum()
    assert up == pytest.approx(9.81 * float(scene.masses().sum()), rel=2e-3)
    assert np.abs(simulation.velocity).max() < 1e-3


@pytest.mark.parametrize(("ratio", "slides"), [(0.99, False), (1.01, True)])
def test_a_block_slides_beyond_the_friction_angle(ratio: float, slides: bool) -> None:
    """A grain that cannot turn on an incline: at rest below, a = g (sin - mu cos) above."""
    mu, steps, dt = 0.5, 1000, 2e-4
    angle = math.atan(ratio * mu)
    scene = grains(
        [[0, 0, RADIUS]],
        walls=(FLOOR,),
        gravity=(9.81 * math.sin(angle), 0, -9.81 * math.cos(angle)),
        friction=mu,
        constraints=(Constraint(kind="rotation-locked", bodies=(0,)),),
    )
    simulation = compliant(scene, dt)
    simulation.step(500)
    before = simulation.velocity[0, 0]
    simulation.step(steps)
    gained = simulation.velocity[0, 0] - before
    expected = 9.81 * (math.sin(angle) - mu * math.cos(angle)) * steps * dt if slides else 0.0
    assert gained == pytest.approx(expected, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize(("ratio", "slides"), [(0.99, False), (1.01, True)])
def test_a_pushed_block_slides_beyond_the_friction(ratio: float, slides: bool) -> None:
    """A grain that cannot turn on a floor under a force from outside: at rest below mu m g, a = F/m - mu g above."""
    mu, steps, dt = 0.5, 1000, 2e-4
    locked = (Constraint(kind="rotation-locked", bodies=(0,)),)
    scene = grains([[0, 0, RADIUS]], walls=(FLOOR,), gravity=GRAVITY, friction=mu, constraints=locked)
    simulation = compliant(scene, dt)
    simulation.step(500)
    push = ratio * mu * 9.81
    simulation.set_force([[push * float(scene.masses()[0]), 0, 0]])
    simulation.step(500)
    before = simulation.velocity[0, 0]
    simulation.step(steps)
    expected = (push - mu * 9.81) * steps * dt if slides else 0.0
    assert simulation.velocity[0, 0] - before == pytest.approx(expected, rel=1e-3, abs=1e-6)


def test_w1_wedged_grains_return_more_than_the_restitution() -> None:
    """A heavy ball on seven grains: their dashpots are those of one grain, so the ball rebounds as in soft spheres."""
    angle = np.arange(6) * math.pi / 3
    ring = np.stack([2.02 * RADIUS * np.cos(angle), 2.02 * RADIUS * np.sin(angle), np.full(6, RADIUS)], axis=1)
    position = [[0, 0, RADIUS], *ring, [0, 0, 12.05 * RADIUS]]
    changes: dict[str, Any] = {"radius": [RADIUS, 10 * RADIUS], "species": [0] * 7 + [1], "walls": (FLOOR,)}
    velocity = [[0, 0, 0]] * 7 + [[0, 0, -1.0]]
    scene = grains(position, velocity, young=1e8, restitution=0.4, gravity=GRAVITY, **changes)
    steps, duration = 40, 4e-3
    ends = {}
    for name, dt, options in (
        ("soft", 5e-7, {}),
        ("compliant", duration / steps, {"method": "impulse"}),
        ("rigid", duration / steps, {"method": "impulse", "rows": "rigid"}),
    ):
        simulation = Simulation(scene, dt, **options)
        simulation.step(round(duration / dt))
        ends[name] = float(simulation.velocity[-1, 2])
    assert ends["soft"] > 0.55
    assert ends["compliant"] == pytest.approx(ends["soft"], rel=0.05)
    assert ends["rigid"] < 0.45


def test_nothing_changes_without_gravity() -> None:
    """A trace of gravity and none give the same collisions."""
    ends = []
    for fall in (0.0, 1e-9):
        position, velocity, spin = gas(27)
        inwards = velocity + 100 * (position.mean(axis=0) - position)
        scene = grains(position, inwards, spin, gravity=(0, 0, -fall), restitution=1.0)
        # the order of the rows hangs on rounding: many sweeps, and no jump of the shear dashpot, leave nothing of it
        simulation = compliant(scene, 5e-5, substeps=4, velocity_sweeps=40, precision="float64")
        simulation.step(100)
        ends.append(simulation.velocity)
    assert np.abs(ends[0] - velocity).max() > 1
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_an_impact_within_a_step_finds_its_substeps(share: float) -> None:
    """sqrt(k/m*) at the largest overlap of Hertz; grains that fly apart, or meet later, need one substep."""
    speed, dt, young = 2.0, 1e-4, 1e8
    gap = share * speed * dt
    scene = grains([[0, 0, 0], [2 * RADIUS + gap, 0, 0]], [[speed, 0, 0], [0, 0, 0]], young=young, friction=0.0)
    mass = float(scene.masses()[0]) / 2
    kn = 4 / 3 * young / (2 * (1 - 0.2**2)) * math.sqrt(RADIUS / 2)
    largest = (1.25 * mass * speed**2 / kn) ** 0.4
    turns = dt * math.sqrt(1.5 * kn * math.sqrt(largest) / mass)
    simulation = compliant(scene, dt)
    simulation.step()
    assert simulation.counters()["most substeps of a step"] == math.ceil(turns / STIFFEST) > 2
    simulation.step(20)
    assert simulation.counters()["most substeps of a step"] <= math.ceil(turns / USUAL)
    assert simulation.counters()["fewest substeps of a step"] == 1
    assert simulation.velocity[1, 0] - simulation.velocity[0, 0] == pytest.approx(0.5 * speed, abs=0.1 * speed)


def test_a_heavy_ball_meets_grains_with_the_reduced_mass_of_the_pair() -> None:
    """The grain oscillates against a ball of 1000 times its mass: its own mass sets the substep."""
    speed, dt = 2.0, 1e-4
    scene = grains(
        [[0, 0, 0], [0.01 + 1.05 * RADIUS, 0, 0]],
        [[0, 0, 0], [-speed, 0, 0]],
        radius=[RADIUS, 0.01],
        species=[0, 1],
        young=1e8,
        friction=0.0,
    )
    m = scene.masses()
    mass, radius = m[0] * m[1] / m.sum(), RADIUS * 0.01 / (RADIUS + 0.01)
    kn = 4 / 3 * 1e8 / (2 * (1 - 0.2**2)) * math.sqrt(radius)
    largest = (1.25 * mass * speed**2 / kn) ** 0.4
    simulation = compliant(scene, dt)
    simulation.step()
    needed = math.ceil(dt * math.sqrt(1.5 * kn * math.sqrt(largest) / mass) / STIFFEST)
    assert simulation.counters()["most substeps of a step"] == needed


def test_contacts_at_rest_need_a_finer_substep_than_an_impact() -> None:
    """The root mean square of sqrt(k/m*) over a column's contacts, each with Hertz's overlap of the weight on it."""
    count, dt, young = 10, 2e-3, 1e6
    z = RADIUS * (1 + 2 * np.arange(count))
    scene = grains(np.stack([0 * z, 0 * z, z], axis=1), walls=(FLOOR,), gravity=GRAVITY, young=young)
    simulation = compliant(scene, dt / 20)
    simulation.step(10_000)
    found, mass = simulation.contacts(), float(scene.masses()[0])
    between = found.j >= 0
    kn = 4 / 3 * young / (1 - 0.2**2) * np.where(between, math.sqrt(RADIUS / 2) / 2, math.sqrt(RADIUS))
    squares = 1.5 * kn * np.sqrt(found.overlap) / np.where(between, mass / 2, mass)
    again = compliant(scene, dt)
    again.position, again.velocity = simulation.position, simulation.velocity
    again.step()
    needed = dt * math.sqrt(squares.mean()) / USUAL
    assert again.counters()["most substeps of a step"] == math.ceil(needed) > math.ceil(1.5 * needed * USUAL / STIFFEST)


@pytest.mark.parametrize("kind", ["fixed", "kinematic"])
def test_a_held_grain_stays_on_its_way(kind: str) -> None:
    """A grain falls on one that does not give way, and rests on it."""
    drift = np.array([0.1, 0, 0]) * (kind == "kinematic")
    scene = grains(
        [[0, 0, 0], [0, 0, 2.001 * RADIUS]],
        [drift, drift],
        gravity=GRAVITY,
        restitution=0.3,
        constraints=(Constraint(kind=kind, bodies=(0,)),),
    )
    simulation = compliant(scene, 2e-4)
    simulation.step(100)
    assert simulation.position[0] == pytest.approx(drift * simulation.time, abs=1e-12)
    assert simulation.position[1, 2] == pytest.approx(2 * RADIUS, abs=0.01 * RADIUS)
    assert simulation.velocity[1] == pytest.approx(drift, abs=1e-4)


def test_grains_of_many_sizes_settle() -> None:
    """Radii of their own, scaled constants: the pile loses its energy, and no overlap is deeper than its impact."""
    simulation = compliant(many_sizes(64), 2e-4)
    start = simulation.kinetic_energy()
    simulation.step(1500)
    assert simulation.kinetic_energy() < 0.01 * start
    assert simulation.overlap() < 0.02 * RADIUS


def test_a_repeated_run_gives_the_same_bits() -> None:
    ends = []
    for block in (300, 300, 7):
        simulation = compliant(heap(), 2e-4)
        made = 0
        while made < 300:
            simulation.step(min(block, 300 - made))
            made += min(block, 300 - made)
        ends.append([a.tobytes() for a in (simulation.position, simulation.velocity, simulation.angular_velocity)])
    assert ends[0] == ends[1] == ends[2]


def test_what_compliant_rows_cannot_do_is_refused() -> None:
    with pytest.raises(SolverError, match="contact law rigid: compliant rows need a stiffness"):
        compliant(grains([[0, 0, 0]], law=Rigid()), 1e-4)
    with pytest.raises(SolverError, match="rows 'soft' is not known; accepted are compliant, rigid"):
        Simulation(grains([[0, 0, 0]]), 1e-4, method="impulse", rows="soft")
    with pytest.raises(SolverError, match="substeps = 0: accepted is 1 or more"):
        compliant(grains([[0, 0, 0]]), 1e-4, substeps=0)
