"""The full-list driver against the half-list driver, its conservation laws, and its CUDA build.

Two drivers of one law differ in nothing but the order of sums. In float64 that is a few 1e-16 of a force per step, and
the few collisions of these runs amplify it by less than 1e3: 1e-10 diameters leaves room for both and none for a missed
contact or a lost spring, which move a grain by 1e-4 diameters and more within the run.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp
from grains import RADIUS, grains

from dembench.scene import Cylinder, Motion, Plane, Scene
from dembench.solver import Simulation, full_state
from dembench.solver.contacts import StepOptions
from dembench.solver.full import BLOCK
from dembench.solver.full_lists import MARK, full_list_kernels
from dembench.solver.full_sort import sort_kernels
from dembench.solver.full_step import full_kernels
from dembench.solver.guard import SolverError
from dembench.solver.laws import LawOptions
from dembench.solver.walls.records import WallOptions

ROUNDING = 1e-10 * 2 * RADIUS
"""Largest difference of positions [m] between two orders of the same sums."""
STEPS = 10 * BLOCK + 7
ARCHITECTURES = (80, 90, 120)
"""Compute capabilities of CUDA devices for which kernels must compile."""
WALLS = WallOptions(present=True, curved=True, grids=True, meshes=True, moving=True, timed=True, loads=True)


def lattice(edge: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions [m], velocities [m/s] and spins [rad/s] of edge^3 spinning grains that rush into one corner."""
    random = np.random.default_rng(seed)
    cell = np.stack(np.meshgrid(*[np.arange(edge)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    position = (2.06 * cell + random.uniform(-0.03, 0.03, cell.shape)) * RADIUS
    corner = [*position[:, :2].max(axis=0), position[:, 2].min()]
    velocity = -250 * (position - corner) + 0.2 * random.normal(size=cell.shape)
    return position, velocity, 200 * random.normal(size=cell.shape)


def drum(middle: Any, radius: float) -> tuple[Cylinder, Plane]:
    """A turning drum about a vertical axis through (x, y) and a sliding floor at z = 0."""
    turning = Motion(angular_velocity=(0, 0, 30.0), centre=(*middle, 0))
    sliding = Motion(velocity=(0.5, 0, 0))
    start, end = (*middle, -RADIUS), (*middle, 0.1)
    return (
        Cylinder(name="drum", material="grain", start=start, end=end, radius=radius, motion=turning),
        Plane(name="floor", material="grain", point=(0, 0, 0), normal=(0, 0, 1), motion=sliding),
    )


def impact(edge: int = 6, **changes: Any) -> Scene:
    """Grains of two radii in a turning drum with a sliding floor, and a heavy ball that comes after them at 6 m/s."""
    position, velocity, spin = lattice(edge)
    position += 1.04 * RADIUS
    n, top, middle = len(position), position[:, 2].max(), position[:, :2].mean(axis=0)
    radius = np.array([RADIUS, 0.8 * RADIUS])
    species = np.random.default_rng(1).integers(0, 2, n)
    reach = np.linalg.norm(position[:, :2] - middle, axis=1) + radius[species]
    fields: dict[str, Any] = {
        "radius": [*radius, 4 * RADIUS],
        "species": np.r_[species, 2],
        "gravity": (0, 0, -9.81),
        "walls": drum(middle, reach.max() + 0.01 * RADIUS),
    }
    return grains(
        np.vstack([position, [*middle, top + 5.02 * RADIUS]]),
        np.vstack([velocity, [0, 0, -6]]),
        np.vstack([spin, [0, 50, 0]]),
        **{**fields, **changes},
    )


def full(scene: Scene, steps: int = STEPS, **settings: Any) -> Simulation:
    """The scene after some steps of the full-list driver in float64."""
    simulation = Simulation(scene, **{"precision": "float64", "lists": "full", **settings})
    simulation.step(steps)
    return simulation


def compiles(kernel: Any, folder: Path) -> None:
    """A kernel compiles ahead of time for all ARCHITECTURES."""
    paths = wp.compile_aot_module(
        kernel.module, device=None, arch=ARCHITECTURES, module_dir=folder / kernel.key, use_ptx=True
    )
    assert [path.suffixes[-2:] for path in paths] == [[f".sm{arch}", ".ptx"] for arch in ARCHITECTURES]
    for path, arch in zip(paths, ARCHITECTURES, strict=True):
        text = path.read_text(errors="replace")
        assert f".target sm_{arch}" in text
        assert f".entry {kernel.key}" in text


def same_bits(a: Simulation, b: Simulation) -> bool:
    return all(
        np.array_equal(getattr(a, name), getattr(b, name)) for name in ("position", "velocity", "angular_velocity")
    )


def test_both_drivers_agree() -> None:
    """Two radii, friction, moving walls of both shapes, a large body: every path of the step."""
    scene = impact()
    ours, theirs = full(scene), full(scene, lists="half")
    assert ours.position == pytest.approx(theirs.position, rel=0, abs=ROUNDING)
    assert ours.velocity == pytest.approx(theirs.velocity, rel=0, abs=1e-8)
    assert ours.angular_velocity == pytest.approx(theirs.angular_velocity, rel=0, abs=1e-5)
    assert ours.largest_overlap() == pytest.approx(theirs.largest_overlap(), rel=1e-9)
    # what is compared is a lively scene: the ball is slowed, nearly every grain has been hit, lists were rebuilt
    assert ours.velocity[-1, 2] > -5.99
    turned = np.abs(ours.angular_velocity - scene.bodies.angular_velocity).max(axis=1)
    assert (turned > 1).mean() > 0.9
    walls = ours.state.lists.wall.numpy()
    assert set(walls[walls >= MARK] - MARK) == {0, 1}
    assert ours.state.rebuilds >= 3


def test_large_bodies_are_not_outrun_by_their_lists() -> None:
    """Two large bodies collide, and one then meets grains at rest, which alone would never ask for new lists."""
    small = [[x, y, 20] for x in (8, 12) for y in (-4, 0, 4)]
    large = [[-10.7, 0, 20], [0, 0.3, 20]]
    scene = grains(
        RADIUS * np.array(small + large),
        [[0, 0, 0]] * 6 + [[8, 0, 0], [-8, 0, 0]],
        radius=[RADIUS, 0.8 * RADIUS, 4 * RADIUS],
        species=[0, 0, 1, 0, 0, 1, 2, 2],
        walls=drum((0, 0), 40 * RADIUS),
    )
    ours, theirs = full(scene, 2000), full(scene, 2000, lists="half")
    assert ours.state.big_rows == 2
    assert np.linalg.norm(ours.velocity[[1, -2, -1]] - scene.bodies.velocity[[1, -2, -1]], axis=1).min() > 0.1
    assert ours.position == pytest.approx(theirs.position, rel=0, abs=ROUNDING)


def test_single_steps_give_the_bits_of_one_call() -> None:
    scene = impact(4)
    ours, theirs = full(scene, 75), full(scene, 0)
    for _ in range(25):
        theirs.step(3)
    assert same_bits(ours, theirs)


def test_two_runs_give_the_same_bits() -> None:
    scene = impact(5)
    assert same_bits(full(scene, precision="float32"), full(scene, precision="float32"))


def test_momentum_is_conserved_without_walls() -> None:
    """Both bodies of a pair find the same force to the bit, so nothing but the rounding of sums is left."""
    scene = grains(*lattice(6))
    m, inertia = scene.masses(), 0.4 * scene.masses() * scene.radii() ** 2
    simulation = full(scene, 0)

    def momenta() -> tuple[np.ndarray, np.ndarray]:
        x, v, w = simulation.position, simulation.velocity, simulation.angular_velocity
        return m @ v, m @ np.cross(x, v) + inertia @ w

    linear, angular = momenta()
    simulation.step(STEPS)
    scale = m @ np.linalg.norm(simulation.velocity, axis=1)
    assert simulation.state.rebuilds >= 3
    assert momenta()[0] == pytest.approx(linear, rel=0, abs=1e-13 * scale)
    assert momenta()[1] == pytest.approx(angular, rel=0, abs=1e-13 * scale * np.ptp(simulation.position))


def test_memory_survives_rebuilds() -> None:
    """A bed in free flight is the bed at rest, though it leaves its lists every few steps with its springs wound up."""
    position, velocity, spin = lattice(5)
    flight = np.array([30.0, 20.0, 10.0])
    rest = full(grains(position, velocity, spin))
    moving = full(grains(position, velocity + flight, spin), allow_unstable=True)
    assert moving.state.rebuilds > 20 * rest.state.rebuilds / 2
    # positions grow to 0.01 m, speeds to 40 m/s: their rounding is some 1e2 times that of the bed at rest
    assert moving.position - flight * moving.time == pytest.approx(rest.position, rel=0, abs=10 * ROUNDING)
    assert moving.angular_velocity == pytest.approx(rest.angular_velocity, rel=0, abs=1e-4)


def test_lists_grow_and_lose_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = impact(5)
    ample = full(scene)
    monkeypatch.setattr(full_state, "SLOTS", 1)
    monkeypatch.setattr(full_state, "WALL_SLOTS", 1)
    monkeypatch.setattr(full_state, "BIG_ROOM", 1)
    tight = full(scene)
    assert tight.state.generation > 0
    assert tight.state.big_capacity > 1
    assert same_bits(ample, tight)


def test_a_blown_up_state_is_refused() -> None:
    simulation = full(impact(3), 0)
    velocity = simulation.velocity
    velocity[5] = np.nan
    simulation.state.write("kin", 3, velocity, simulation.units.velocity)
    with pytest.raises(SolverError, match=r"step 0 .*not finite"):
        simulation.step(1)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"device": "cuda:99", "lists": None}, "device 'cuda:99' is not there; accepted are cpu"),
        ({"lists": "quarter"}, "lists 'quarter' are not known; accepted are half, full"),
        ({"method": "impulse", "rows": "rigid"}, "rigid rows need device cpu and half lists"),
    ],
)
def test_impossible_settings_are_named(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(SolverError, match=message):
        full(grains([[0, 0, 0]]), 0, **settings)


@pytest.mark.slow
def test_every_kernel_compiles_for_cuda(tmp_path: Path) -> None:
    """All that a scene with every feature launches, ahead of time, on a machine without a GPU."""
    options = StepOptions(LawOptions(), pairs="radii", walls=WALLS, bigs=True, periodic=True)
    groups = (full_kernels(options), full_list_kernels("float32", WALLS, True, True), sort_kernels("float32"))
    for kernel in [kernel for group in groups for kernel in vars(group).values()]:
        compiles(kernel, tmp_path)


@pytest.mark.skipif(not wp.is_cuda_available(), reason="needs a CUDA device")
@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_the_gpu_agrees_with_the_cpu(precision: str) -> None:
    """Fused multiply-add and the order of the sums on the ball differ between the devices: rounding of `real`."""
    scene = impact()
    cpu, gpu, again = (full(scene, precision=precision, device=d) for d in ("cpu", "cuda:0", "cuda:0"))
    limit = {"float32": 1e-4 * 2 * RADIUS, "float64": ROUNDING}[precision]
    assert gpu.position == pytest.approx(cpu.position, rel=0, abs=limit)
    assert gpu.largest_overlap() == pytest.approx(cpu.largest_overlap(), rel=1e-3)
    assert gpu.state.rebuilds >= 3
    assert same_bits(gpu, again)
