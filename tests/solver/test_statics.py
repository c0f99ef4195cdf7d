"""Rigid rows at rest: columns, contrasts of mass, wedges, overlaps, inclines; where the stabilization stays off."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, gas, grains
from scipy.spatial import cKDTree

from dembench.scene import Bodies, Box, Constraint, Plane, Scene, Species
from dembench.solver import Simulation

G, DT = 9.8, 0.002
"""The sanity page's gravity and step; its spheres have radius 1 and mass 1."""


def unit_spheres(position: Any, velocity: Any = None, **changes: Any) -> Scene:
    fields: dict[str, Any] = {
        "radius": 1.0,
        "density": 3 / (4 * np.pi),
        "restitution": 0.0,
        "gravity": (0, 0, -G),
        "walls": (FLOOR,),
    }
    return grains(position, velocity, **{**fields, **changes})


def rigid(scene: Scene, dt: float = DT, **options: Any) -> Simulation:
    return Simulation(scene, dt, method="impulse", rows="rigid", **options)


def tower(n: int, width: int, gap: float = 0.0) -> Scene:
    """n layers of width x width spheres on a simple cubic lattice, in a snug box where wider than one sphere."""
    d = 2 * (1 + gap)
    across = [1 + d * np.arange(width)] * 2
    z = 1 + d * np.arange(n)
    position = np.stack(np.meshgrid(*across, z, indexing="ij"), axis=-1).reshape(-1, 3)
    if width == 1:
        return unit_spheres(position)
    edge = 2 + d * (width - 1)
    box = Box(name="box", material="grain", lower=(0, 0, 0), upper=(edge, edge, 3 * n), open_faces=("z+",))
    return unit_spheres(position, walls=(box,))


def foot_force(simulation: Simulation) -> float:
    """Sum of the vertical forces of the walls [N]."""
    contacts = simulation.contacts()
    return float(contacts.force()[contacts.wall >= 0, 2].sum())


@pytest.mark.parametrize(
    ("n", "width", "options"),
    [
        (10, 1, {}),
        (40, 1, {}),
        (113, 1, {}),
        (300, 1, {}),
        (40, 5, {"velocity_sweeps": 30, "position_sweeps": 10}),
        pytest.param(113, 5, {}, marks=pytest.mark.slow),
        pytest.param(300, 5, {}, marks=pytest.mark.slow),
    ],
)
def test_w3_d7_a_touching_tower_stands(n: int, width: int, options: dict[str, Any]) -> None:
    """Started without any impulse: speed below g dt always, weight on the foot, spacing and height as at first."""
    simulation = rigid(tower(n, width), **options)
    z = simulation.position[:, 2]
    for _ in range(30):
        simulation.step(10)
        assert np.abs(simulation.velocity).max() <= G * DT
    assert foot_force(simulation) == pytest.approx(n * width**2 * G, rel=0.01)
    now = simulation.position.reshape(width**2, n, 3)
    assert np.diff(now[:, :, 2], axis=1) == pytest.approx(2.0, abs=1e-3)
    assert (z - simulation.position[:, 2]).max() < 2e-3


@pytest.mark.slow
def test_w3_d7_a_tower_of_a_thousand_layers_stands() -> None:
    """Speed and spacing as of the lower towers; the weight on the foot is within 10 % in every step, not within 1 %."""
    simulation = rigid(tower(1000, 1), precision="float64")
    for _ in range(30):
        simulation.step(10)
        assert np.abs(simulation.velocity).max() <= G * DT
    assert foot_force(simulation) == pytest.approx(1000 * G, rel=0.1)
    assert np.diff(simulation.position[:, 2]) == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("stabilization", [True, False])
def test_the_stabilization_is_what_holds_a_tower(stabilization: bool) -> None:
    """Eight symmetric sweeps alone leave a tower of 40 layers with many g dt; the weight is never carried."""
    simulation = rigid(tower(40, 1), stabilization=stabilization)
    simulation.step(500)
    assert (np.abs(simulation.velocity).max() < 0.1 * G * DT) == stabilization


def test_the_residual_tells_how_well_a_tower_is_solved() -> None:
    solved, unsolved = rigid(tower(40, 1)), rigid(tower(40, 1), stabilization=False)
    found = []
    for simulation in (solved, unsolved):
        simulation.step(100)
        counters = simulation.counters()
        assert counters["rows"] == 40
        found.append(counters["residual of the contact problem"])
    assert found[0] < 1e-4 < found[1]


def test_d8_a_loose_column_comes_to_rest() -> None:
    """Released 1.05 d apart, e = 0: nearest distance above 0.98 d at all times, and rest in the end."""
    simulation = rigid(tower(30, 1, gap=0.05))
    for _ in range(250):
        simulation.step(10)
        assert np.diff(simulation.position[:, 2]).min() > 0.98 * 2
    assert np.abs(simulation.velocity).max() <= G * DT
    assert simulation.position[:, 2] == pytest.approx(1 + 2 * np.arange(30), abs=5e-3)
    assert foot_force(simulation) == pytest.approx(30 * G, rel=0.01)


def test_a_column_that_falls_on_a_floor_piles_up_without_overlap() -> None:
    """60 spheres, 1.05 d apart, land at 22 d/s: a fifth of a diameter per step, four gaps that close in one step.

    With sweeps to convergence 2 % of a diameter are left; pairs chosen by their own approach alone would leave 35 %.
    """
    simulation = rigid(pour(1, 60), 0.01, velocity_sweeps=200)
    simulation.step(200)
    assert simulation.largest_overlap() < 0.03


@pytest.mark.slow
def test_d8_a_pour_of_96_thousand_grains() -> None:
    """40 x 40 x 60 spheres, 1.05 d apart, fall 20 d onto the floor from 10 d/s, with g = 10 d/s^2 and dt = 0.01 s.

    No overlap above 0.15 d while the front of the pour runs up the block, with 16 velocity sweeps (0.20 d with 8); in
    the end all are at rest, nobody nearer to the next than 0.98 d.
    """
    simulation = rigid(pour(40, 60), 0.01, velocity_sweeps=16)
    simulation.step(4000)
    assert simulation.largest_overlap() < 0.15
    x = simulation.position
    assert cKDTree(x).query(x, k=2)[0][:, 1].min() >= 0.98
    assert np.abs(simulation.velocity).max() < 10 * 0.01
    assert x[:, 2].max() == pytest.approx(59.5, abs=0.01)
    assert foot_force(simulation) == pytest.approx(len(x) * 10, rel=0.01)


def pour(width: int, height: int) -> Scene:
    """A block of spheres of diameter 1, 1.05 apart, 20 above the floor of a snug box, moving down at 10 per second."""
    d = 1.05
    across = [0.5 + d * np.arange(width)] * 2
    z = 20.5 + d * np.arange(height)
    position = np.stack(np.meshgrid(*across, z, indexing="ij"), axis=-1).reshape(-1, 3)
    edge = 1 + d * (width - 1)
    box = Box(name="box", material="grain", lower=(0, 0, 0), upper=(edge, edge, 200), open_faces=("z+",))
    velocity = np.broadcast_to([0, 0, -10.0], position.shape)
    return grains(position, velocity, radius=0.5, density=6 / np.pi, restitution=0.1, gravity=(0, 0, -10), walls=(box,))


@pytest.mark.parametrize("power", [0, 2, 4, 6])
def test_w14_d4_a_heavy_sphere_rests_on_a_light_one(power: int) -> None:
    """Mass ratio up to 1e6: penetration at most 1 % of the radius, speed at most 2 g dt, after 2 s."""
    scene = contrast([[0, 0, 1], [0, 0, 3]], [0, 1], 10.0**power)
    simulation = rigid(scene)
    simulation.step(1000)
    assert simulation.position[:, 2] == pytest.approx([1, 3], abs=0.01)
    assert np.abs(simulation.velocity).max() <= 2 * G * DT
    assert foot_force(simulation) == pytest.approx((1 + 10.0**power) * G, rel=0.01)


def test_d5_a_light_sphere_between_heavy_ones_is_not_pressed_out() -> None:
    scene = contrast([[0, 0, 1], [0, 0, 3], [0, 0, 5]], [1, 0, 1], 1e6)
    simulation = rigid(scene)
    simulation.step(2000)
    assert np.abs(simulation.position[:, :2]).max() < 1e-3
    assert simulation.position[:, 2] == pytest.approx([1, 3, 5], abs=0.01)


def contrast(position: Any, species: list[int], ratio: float) -> Scene:
    """Unit spheres of mass 1 (species 0) and `ratio` (species 1) on a floor."""
    light = unit_spheres(position)
    stone = light.materials[0]
    heavy = stone.model_copy(update={"name": "lead", "density": ratio * stone.density})
    laws = [
        light.pair_laws[0].model_copy(update={"a": a, "b": b})
        for a, b in (("grain", "grain"), ("grain", "lead"), ("lead", "lead"))
    ]
    return light.model_copy(
        update={
            "materials": (stone, heavy),
            "pair_laws": tuple(laws),
            "species": (*light.species, Species(name="heavy", material="lead", radius=1.0)),
            "bodies": Bodies(position=position, species=species),
        }
    )


def test_w14_d11_half_overlapped_spheres_part_without_speed() -> None:
    scene = grains([[0, 0, 0], [1.0, 0, 0]], radius=1.0, density=3 / (4 * np.pi), gravity=(0, 0, -G))
    simulation = rigid(scene)
    simulation.step(50)
    v = simulation.velocity + np.array([0, 0, G * simulation.time])
    assert np.abs(v).max() < 1e-6
    assert np.linalg.norm(np.diff(simulation.position, axis=0)) == pytest.approx(2, abs=2e-3)


def test_w14_d11_a_block_of_half_overlapped_spheres_parts_in_its_box() -> None:
    """216 spheres at half their distance: speeds stay those of falling back, and nobody leaves."""
    n = 6
    lattice = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    position = lattice + np.array([7.0, 7.0, 1.0])
    box = Box(name="box", material="grain", lower=(0, 0, 0), upper=(20, 20, 40), open_faces=("z+",))
    simulation = rigid(unit_spheres(position, walls=(box,)), position_sweeps=30)
    simulation.step(2)
    assert np.abs(simulation.velocity).max() <= 3 * G * DT
    simulation.step(1500)
    x = simulation.position
    assert (x[:, :2] > 0.999).all() and (x[:, :2] < 19.001).all() and (x[:, 2] > 0.999).all()
    i, j = np.triu_indices(len(x), 1)
    assert np.linalg.norm(x[i] - x[j], axis=1).min() > 2 * (1 - 1e-3)


@pytest.mark.parametrize("half_angle", [45, 10, 2, 0.5])
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_w14_d30_a_sphere_rests_in_a_wedge(half_angle: float, friction: float) -> None:
    """Between two planes: height r / sin a, each plane with m g / (2 sin a) where there is no friction."""
    a = np.radians(half_angle)
    planes = tuple(
        Plane(name=f"p{k}", material="grain", point=(0, 0, 0), normal=(s * np.cos(a), 0, np.sin(a)))
        for k, s in enumerate((1, -1))
    )
    height = 1 / np.sin(a)
    simulation = rigid(unit_spheres([[0, 0, height]], walls=planes, friction=friction))
    simulation.step(1500)
    x = simulation.position[0]
    assert x[2] == pytest.approx(height, rel=0.01)
    assert abs(x[0]) < 1e-3 and abs(x[1]) < 1e-3
    contacts = simulation.contacts()
    if friction == 0:
        assert contacts.normal_force == pytest.approx([G / (2 * np.sin(a))] * 2, rel=0.01)
    assert contacts.force().sum(axis=0) == pytest.approx([0, 0, G], abs=0.01 * G)


@pytest.mark.parametrize("friction", [2.0, 1e3, 1e9])
def test_d15_d16_a_jammed_or_very_rough_sphere_takes_no_energy(friction: float) -> None:
    """A sphere dropped with spin into a wedge of 20 degrees: impulses stay finite and energy does not rise."""
    a = np.radians(20)
    planes = tuple(
        Plane(name=f"p{k}", material="grain", point=(0, 0, 0), normal=(s * np.cos(a), 0, np.sin(a)))
        for k, s in enumerate((1, -1))
    )
    scene = unit_spheres([[0, 0, 4.0]], [[0.5, 0, -1.0]], walls=planes, friction=friction, restitution=0.5)
    scene = scene.model_copy(
        update={"bodies": Bodies(position=[[0, 0, 4.0]], velocity=[[0.5, 0, -1.0]], angular_velocity=[[0, 10, 0]])}
    )
    simulation = rigid(scene)
    energy = [simulation.kinetic_energy() + G * simulation.position[0, 2]]
    for _ in range(500):
        simulation.step()
        energy.append(simulation.kinetic_energy() + G * simulation.position[0, 2])
    assert np.diff(energy).max() < 1e-3 * energy[0]
    assert np.abs(simulation.velocity).max() <= 2 * G * DT


@pytest.mark.parametrize("friction", [1e3, 1e9])
def test_d15_a_very_rough_sphere_rolls_down_a_steep_incline(friction: float) -> None:
    """60 degrees, dropped with the wrong spin: rolls at once, a = (5/7) g sin."""
    angle = np.radians(60)
    gravity = (9.81 * np.sin(angle), 0, -9.81 * np.cos(angle))
    scene = grains(
        [[0, 0, 1.5 * RADIUS]],
        None,
        [[0, -300, 0]],
        walls=(FLOOR,),
        gravity=gravity,
        friction=friction,
        restitution=0.1,
    )
    simulation = rigid(scene, 5e-5)
    simulation.step(1000)
    v0, t0 = simulation.velocity[0, 0], simulation.time
    simulation.step(2000)
    v = simulation.velocity[0, 0]
    assert (v - v0) / (simulation.time - t0) == pytest.approx(5 / 7 * 9.81 * np.sin(angle), rel=1e-3)
    assert abs(v - RADIUS * simulation.angular_velocity[0, 1]) < 1e-3 * v


def slab(ratio: float, friction: float = 0.5) -> Scene:
    """4 x 4 touching spheres that cannot turn, on a plane with tan(angle) = ratio times the friction."""
    angle = np.arctan(ratio * friction)
    at = RADIUS * (1 + 2 * np.arange(4))
    position = np.stack(np.meshgrid(at, at, [RADIUS], indexing="ij"), axis=-1).reshape(-1, 3)
    return grains(
        position,
        walls=(FLOOR,),
        gravity=(9.81 * np.sin(angle), 0, -9.81 * np.cos(angle)),
        friction=friction,
        constraints=(Constraint(kind="rotation-locked", bodies=tuple(range(16))),),
    )


@pytest.mark.parametrize("ratio", [0.90, 0.99])
def test_w10_d34_a_slab_holds_below_the_friction_angle(ratio: float) -> None:
    scene = slab(ratio)
    simulation = rigid(scene, 5e-4)
    simulation.step(20000)
    assert np.abs(simulation.position - scene.bodies.position).max() < 1e-4 * RADIUS


@pytest.mark.parametrize("ratio", [1.01, 1.10])
def test_w10_d34_a_slab_slides_above_the_friction_angle(ratio: float) -> None:
    """x = 1/2 (g sin - mu g cos) t^2 from rest within 1 %, however slow: nothing falls asleep."""
    scene, angle = slab(ratio), np.arctan(ratio * 0.5)
    simulation = rigid(scene, 5e-5)
    simulation.step(8000)
    exact = 0.5 * 9.81 * (np.sin(angle) - 0.5 * np.cos(angle)) * simulation.time**2
    assert simulation.position[:, 0] - scene.bodies.position[:, 0] == pytest.approx(exact, rel=0.01)


def test_d29_a_pyramid_does_not_creep() -> None:
    """Three spheres and one on top, mu = 0.8: no motion of 1e-4 r in 30 s, none at all after the first 10 s."""
    ring = (
        2 / np.sqrt(3) * np.stack([np.cos(2 * np.pi * np.arange(3) / 3), np.sin(2 * np.pi * np.arange(3) / 3)], axis=1)
    )
    position = [*([x, y, 1.0] for x, y in ring), [0, 0, 1 + np.sqrt(8 / 3)]]
    simulation = rigid(unit_spheres(position, friction=0.8))
    simulation.step(5000)
    early = simulation.position
    simulation.step(10000)
    assert np.abs(simulation.position - position).max() < 1e-4
    assert np.abs(simulation.position - early).max() < 1e-6


@pytest.mark.parametrize("offset", [0.0, 1e2, 1e4, 1e6])
def test_w12_a_tower_far_from_the_origin_stands_as_near(offset: float) -> None:
    """Shifted by up to a million diameters: the same heights within 1e-3 of a radius."""
    z = 1 + 2 * np.arange(20)
    shift = np.full(3, 2 * offset)
    floor = FLOOR.model_copy(update={"point": tuple(shift)})
    position = np.stack([0 * z, 0 * z, z], axis=1) + shift
    scene = unit_spheres(position, walls=(floor,))
    domain = scene.domain.model_copy(update={"lower": (-1e7,) * 3, "upper": (1e7,) * 3})
    simulation = rigid(scene.model_copy(update={"domain": domain}))
    simulation.step(200)
    assert np.abs(simulation.velocity).max() <= G * DT
    assert simulation.position - shift == pytest.approx(position - shift, abs=1e-3)


@pytest.mark.parametrize(("speed", "place"), [(1e-3, 0.1), (1e-3, 10.0), (1e-2, 10.0)])
def test_w15_a_slow_grain_moves(speed: float, place: float) -> None:
    """v t within 1e-3 at a step of 0.8 us, where single-precision positions would not move at all."""
    scene = grains([[place, 0, 0]], [[speed, 0, 0]])
    simulation = rigid(scene, 8e-7)
    simulation.step(20000)
    assert simulation.position[0, 0] - place == pytest.approx(speed * simulation.time, rel=1e-3)


def test_w1_the_stabilization_stays_off_while_material_flows() -> None:
    """A lattice that falls apart in a box: with and without it the same up to 0.04 g dt, where the sweeps end."""
    position, velocity, spin = gas(216, speed=0.3, spacing=2.5)
    box = Box(name="box", material="grain", lower=(0, 0, 0), upper=(0.025, 0.025, 0.1), open_faces=("z+",))
    scene = grains(position + 2 * RADIUS, velocity, spin, walls=(box,), gravity=(0, 0, -9.81))
    ends = []
    for stabilization in (True, False):
        simulation = rigid(scene, 5e-5, stabilization=stabilization)
        simulation.step(1000)
        ends.append(simulation)
    assert ends[0].counters()["stabilization sweeps per step"] < 1
    v = [s.velocity for s in ends]
    assert np.abs(v[0]).max() > 100 * 9.81 * 5e-5
    assert v[0] == pytest.approx(v[1], abs=0.04 * 9.81 * 5e-5)


def test_w1_the_rebound_of_an_impact_is_the_same_with_the_stabilization() -> None:
    """A heavy ball drops at 2 m/s on a bed in a cup; its speed at every moment of the impact and the rebound."""
    n = 5
    lattice = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    bed = RADIUS * (1 + 2 * lattice)
    middle, top = n * RADIUS, 2 * n * RADIUS
    edge = 2 * n * RADIUS
    box = Box(name="cup", material="grain", lower=(0, 0, 0), upper=(edge, edge, 0.1), open_faces=("z+",))
    scene = grains(
        [*bed, [middle, middle, top + 3.1 * RADIUS]],
        [*np.zeros_like(bed), [0, 0, -2.0]],
        radius=[RADIUS, 3 * RADIUS],
        species=[0] * n**3 + [1],
        walls=(box,),
        gravity=(0, 0, -9.81),
        restitution=0.8,
    )
    paths = []
    for stabilization in (True, False):
        simulation = rigid(scene, 5e-5, stabilization=stabilization)
        path = []
        for _ in range(60):
            simulation.step()
            path.append(simulation.velocity[-1, 2])
        paths.append(path)
    assert max(paths[0]) > 0.2
    assert paths[0] == pytest.approx(paths[1], abs=0.01)
