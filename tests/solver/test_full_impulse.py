"""Compliant rows on full lists against those on half lists, their stop test, conservation laws, and their CUDA build.

Sweeps that are continued until nothing changes end at the same forces in both drivers, whatever their order: without
dashpots. With them the law has a jump where a contact begins to slide, see
`test_impulse_compliant.test_threads_solve_the_same_rows`, near which no sweep ends.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp
from grains import FLOOR, RADIUS, gas, grains, resting_overlap
from test_full import WALLS, compiles, impact, same_bits
from test_impulse_compliant import GRAVITY, N, crowd, heap, many_sizes, pairs
from test_mesh_walls import mesh, patch

from dembench.scene import Box, Domain, LinearSpring, Rigid, Scene
from dembench.solver import Simulation, SolverError, full_impulse, full_state
from dembench.solver.full_impulse_loops import loop_kernels
from dembench.solver.full_impulse_step import substep_kernels
from dembench.solver.impulse.compliant_rows import CompliantOptions
from dembench.solver.laws import LawOptions


def full(scene: Scene, dt: float, steps: int = 0, **options: Any) -> Simulation:
    """The scene after some steps with compliant rows on full lists, in float64."""
    settings = {"method": "impulse", "lists": "full", "precision": "float64", **options}
    simulation = Simulation(scene, dt, **settings)
    simulation.step(steps)
    return simulation


def converged(scene: Scene, dt: float, steps: int, **options: Any) -> tuple[Simulation, Simulation]:
    """With rows on full and on half lists, after steps of one substep and as many sweeps as change anything."""
    ours = full(scene, dt, steps, substeps=1, velocity_sweeps=400, **options)
    theirs = full(scene, dt, steps, substeps=1, velocity_sweeps=80, lists="half", **options)
    assert ours.counters()["substeps at the largest number of sweeps"] == 0
    assert ours.counters()["mean sweeps of a substep"] > 4
    return ours, theirs


def agree(ours: Simulation, theirs: Simulation) -> None:
    """What is left between the two are the residuals, 1e-12 of the impulses, that the collisions amplify."""
    assert ours.velocity == pytest.approx(theirs.velocity, rel=0, abs=1e-9)
    assert RADIUS * ours.angular_velocity == pytest.approx(RADIUS * theirs.angular_velocity, rel=0, abs=1e-9)


@pytest.fixture
def tight(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(full_impulse, "RESIDUAL", 1e-12)


@pytest.mark.usefixtures("tight")
def test_both_drivers_find_the_same_forces() -> None:
    """Grains of two sizes between walls, packed so that they all meet, and a large ball that falls on them."""
    scene = crowd(restitution=1.0)
    ours, theirs = converged(scene, 2e-5, 100)
    agree(ours, theirs)
    changed = np.abs(ours.velocity - scene.bodies.velocity).max(axis=1)
    assert changed[-1] > 0.01 and (changed > 0.1).mean() > 0.9
    assert ours.largest_overlap() == pytest.approx(theirs.largest_overlap(), rel=1e-3)


@pytest.mark.usefixtures("tight")
def test_both_drivers_meet_the_same_moving_walls() -> None:
    """A turning drum and a sliding floor, whose loads are those of the same contacts."""
    ours, theirs = converged(impact(4, restitution=1.0), 1e-5, 120, wall_loads=True)
    agree(ours, theirs)
    for wall in ("drum", "floor"):
        assert np.linalg.norm(theirs.wall_force(wall)) > 0
        assert ours.wall_force(wall) == pytest.approx(theirs.wall_force(wall), rel=1e-6)
        assert ours.wall_torque(wall) == pytest.approx(theirs.wall_torque(wall), rel=1e-6)
        assert ours.wall_work(wall) == pytest.approx(theirs.wall_work(wall), rel=1e-6)


OTHERS: dict[str, dict[str, Any]] = {
    "linear": {"law": LinearSpring(normal_stiffness=2e3, tangential_stiffness=1.5e3)},
    "rescaled": {"variant": "rescaled"},
    "no-tension": {"variant": "no-tension"},
    "frictionless": {"friction": 0.0},
    "periodic": {"domain": Domain(lower=(0, 0, 0), upper=(0.0132, 0.0132, 0.0132), periodic=(True, True, True))},
    "mesh": {"walls": (mesh(patch(np.linspace(-5, 20, 31) * RADIUS, np.linspace(-5, 20, 31) * RADIUS)),)},
}


def gas_of(kind: str) -> Scene:
    """Grains of one of the other laws that fly into each other."""
    position, velocity, spin = gas(125, spacing=2.55, speed=2.0)
    return grains(position + RADIUS, velocity, spin, restitution=1.0, young=1e6, **OTHERS[kind])


@pytest.mark.slow
@pytest.mark.usefixtures("tight")
@pytest.mark.parametrize("kind", list(OTHERS))
def test_both_drivers_agree_about_every_law(kind: str) -> None:
    scene = gas_of(kind)
    ours, theirs = converged(scene, 2e-5, 150)
    agree(ours, theirs)
    assert (np.abs(ours.velocity - scene.bodies.velocity).max(axis=1) > 0.1).mean() > 0.8, "few have met"


def test_the_stop_test_bounds_the_residual(monkeypatch: pytest.MonkeyPatch) -> None:
    """The velocities of a step are off by about the residual times its changes of them."""
    scene = crowd(restitution=1.0)
    ends, sweeps = [], []
    for residual in (1e-12, 1e-6, 1e-3, 1e-1):
        monkeypatch.setattr(full_impulse, "RESIDUAL", residual)
        simulation = full(scene, 2e-5, 2, substeps=1)
        ends.append(simulation.velocity)
        sweeps.append(simulation.counters()["mean sweeps of a substep"])
    change = np.abs(ends[0] - scene.bodies.velocity).max()
    off = [np.abs(end - ends[0]).max() / change for end in ends[1:]]
    assert off[0] < 3e-6 and off[1] < 3e-3 and off[2] < 0.3
    assert sweeps == sorted(sweeps, reverse=True) and sweeps[3] >= 2


def test_split_masses_solve_a_dense_bed_in_large_substeps() -> None:
    """It settles in five times the substep that its contacts ask for, where sweeps with whole masses diverge."""
    edge, high = 4, 8
    place = np.stack(np.meshgrid(np.arange(edge), np.arange(edge), np.arange(high)), axis=-1).reshape(-1, 3)
    position = (2.02 * place + np.random.default_rng(0).uniform(-0.01, 0.01, place.shape) + 1.05) * RADIUS
    width = (2.02 * edge + 0.05) * RADIUS
    box = Box(name="box", material="grain", lower=(0, 0, 0), upper=(width, width, 0.1), open_faces=("z+",))
    scene = grains(position, walls=(box,), gravity=GRAVITY)
    asked = full(scene, 4e-4, 100, precision="float32")
    simulation = full(scene, 4e-4, 100, substeps=1, precision="float32")
    assert asked.counters()["most substeps of a step"] == 5
    assert simulation.kinetic_energy() == pytest.approx(asked.kinetic_energy(), rel=0.2)
    settled, expected = simulation.position[:, 2].mean(), asked.position[:, 2].mean()
    assert settled == pytest.approx(expected, abs=0.01 * (position[:, 2].mean() - expected))


HEAPS = {
    "one kind": lambda: heap(64, restitution=1.0),
    "two kinds and a ball": lambda: crowd(64, restitution=1.0),
    "many sizes": lambda: many_sizes(64, restitution=1.0),
    "linear": lambda: heap(64, restitution=1.0, **OTHERS["linear"]),
    "periodic": lambda: gas_of("periodic"),
}


@pytest.mark.usefixtures("tight")
@pytest.mark.parametrize(("kind", "looks"), [(kind, 3 if kind == "linear" else 4) for kind in HEAPS])
def test_substeps_are_those_of_half_lists(kind: str, looks: int) -> None:
    """Counted from the same contacts, each pair once; full lists, where both list it, one by one, half lists in lanes.

    Over 20 steps, or 15 with the linear law: later on collisions have amplified the rounding to where it decides about
    a substep.
    """
    found = []
    for lists, sweeps in (("full", 400), ("half", 80)):
        simulation = full(HEAPS[kind](), 2e-4, lists=lists, velocity_sweeps=sweeps)
        counts = []
        for _ in range(looks):
            simulation.step(5)
            counters = simulation.counters()
            counts.append([counters[f"{which} substeps of a step"] for which in ("fewest", "mean", "most")])
        found.append(counts)
    assert found[0] == found[1]
    assert found[0][-1][2] > 2


@pytest.mark.parametrize("restitution", [0.2, 0.9])
def test_restitution_is_that_of_the_law(restitution: float) -> None:
    """At 1 m/s, in about three substeps a contact, for any phase of them: as on half lists."""
    dt = 5e-5
    simulation = full(pairs(1.0, dt, young=1e9, restitution=restitution), dt, 12)
    v = simulation.velocity[:, 0]
    assert float(np.mean(v[N:] - v[:N])) == pytest.approx(restitution, abs=0.01)


def test_energy_of_elastic_grains_is_kept() -> None:
    """As on half lists; what the springs hold is that of the soft-sphere law at the same overlaps."""
    scene = heap(restitution=1.0, friction=0.0)
    simulation, look = full(scene, 2e-4), Simulation(scene, 1e-6, precision="float64")

    def total() -> float:
        look.position = simulation.position
        springs = float(look.contacts().energy.sum())
        height = 9.81 * float(simulation.masses @ simulation.position[:, 2])
        return simulation.kinetic_energy() + height + springs

    found = [total()]
    for _ in range(8):
        simulation.step(50)
        found.append(total())
    assert np.array(found) == pytest.approx(np.full(9, found[0]), rel=3e-4)


def test_momentum_and_angular_momentum_of_free_grains_are_kept() -> None:
    """Both bodies of a pair find the same impulse to the bit, though the sweeps end before it is solved."""
    position, velocity, spin = gas(64)
    scene = grains(position, velocity + 100 * (position.mean(axis=0) - position), spin)
    simulation = full(scene, 1e-4)
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
    assert after[0] == pytest.approx(before[0], abs=1e-14 * total)
    assert after[1] == pytest.approx(before[1], abs=1e-14 * total * np.abs(position).max())


def test_a_column_rests_and_carries_its_weight() -> None:
    """Ten grains: the contact below the k-th from the top carries k weights, and overlaps as Hertz says."""
    count = 10
    z = RADIUS * (1 + 2 * np.arange(count))
    scene = grains(np.stack([0 * z, 0 * z, z], axis=1), walls=(FLOOR,), gravity=GRAVITY)
    simulation = full(scene, 2e-4, 4000, precision="float32")
    assert np.abs(simulation.velocity).max() < 1e-6
    height = simulation.position[:, 2]
    overlap = np.r_[RADIUS - height[0], 2 * RADIUS - np.diff(height)]
    # the reduced radius of two grains is half of that at the floor
    softer = np.r_[1, np.full(count - 1, 2 ** (1 / 3))]
    expected = resting_overlap(scene) * softer * np.arange(count, 0, -1.0) ** (2 / 3)
    assert overlap == pytest.approx(expected, rel=1e-3)


def test_steps_repeat_their_bits_however_they_are_asked_for() -> None:
    """Also where lists have to grow, which moves every array, and a recorded graph is recorded anew."""
    scene = impact(4, restitution=0.6)
    ends = []
    for block in (90, 7):
        simulation = full(scene, 1e-5, wall_loads=True)
        for made in range(0, 90, block):
            simulation.step(min(block, 90 - made))
        ends.append(simulation)
    assert same_bits(*ends)
    assert ends[0].counters()["list rebuilds"] > 2


def test_a_resumed_run_gives_the_same_bits(tmp_path: Path) -> None:
    scene = impact(4, restitution=0.6)
    simulation = full(scene, 1e-5, 50, wall_loads=True)
    simulation.save(tmp_path / "state.npz")
    resumed = Simulation.load(tmp_path / "state.npz")
    for one in (simulation, resumed):
        one.step(50)
    straight = full(scene, 1e-5, 100, wall_loads=True)
    assert same_bits(resumed, simulation) and same_bits(straight, simulation)
    assert resumed.counters() == simulation.counters()


def test_lists_grow_and_lose_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = impact(4, restitution=0.6)
    ample = full(scene, 1e-5, 90, wall_loads=True)
    for room in ("SLOTS", "WALL_SLOTS", "BIG_ROOM"):
        monkeypatch.setattr(full_state, room, 1)
    tight = full(scene, 1e-5, 90, wall_loads=True)
    assert tight.state.generation > 0
    assert same_bits(ample, tight)


def test_a_blown_up_state_is_refused() -> None:
    simulation = full(impact(4, restitution=0.6), 1e-5, wall_loads=True)
    velocity = simulation.velocity
    velocity[5] = np.nan
    simulation.state.write("kin", 3, velocity, simulation.units.velocity)
    with pytest.raises(SolverError, match=r"step 0 .*not finite"):
        simulation.step(1)


def test_what_it_cannot_do_is_refused() -> None:
    simulation = full(impact(4, restitution=0.6), 1e-5, wall_loads=True)
    with pytest.raises(SolverError, match="contacts can be inspected with half lists only"):
        simulation.contacts()
    with pytest.raises(SolverError, match="forces from outside act on spheres with half lists only"):
        simulation.set_force(np.zeros((len(simulation.masses), 3)))
    with pytest.raises(SolverError, match="rigid rows need device cpu and half lists"):
        full(grains([[0, 0, 0]], law=Rigid()), 1e-4)
    with pytest.raises(SolverError, match="substeps = 0: accepted is 1 or more"):
        full(grains([[0, 0, 0]]), 1e-4, substeps=0)


@pytest.mark.slow
def test_every_kernel_compiles_for_cuda(tmp_path: Path) -> None:
    """All that a scene with every feature launches beside what the soft-sphere driver has."""
    options = CompliantOptions(LawOptions(), pairs="radii", alike=False, walls=WALLS, bigs=True, periodic=True)
    for kernel in [*vars(loop_kernels(options)).values(), *vars(substep_kernels(options)).values()]:
        compiles(kernel, tmp_path)


@pytest.mark.skipif(not wp.is_cuda_available(), reason="needs a CUDA device")
@pytest.mark.usefixtures("tight")
def test_the_gpu_agrees_with_the_cpu() -> None:
    """The graph with its loops is the same; fused multiply-add and the order of the sums on the ball are not."""
    scene = impact(restitution=1.0)
    cpu, gpu, again = (full(scene, 1e-5, 120, substeps=1, device=d) for d in ("cpu", "cuda:0", "cuda:0"))
    agree(gpu, cpu)
    assert gpu.counters()["list rebuilds"] > 2
    assert same_bits(gpu, again)
