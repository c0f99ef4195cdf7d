"""Rigid contacts of bodies that are no spheres: drops, stacks, inclines, a rod on its end."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from shaped import GRAVITY, energy, inertia, run, shaped

from dembench.scene import Clump, Grain, Mesh, Motion
from dembench.solver import Simulation, SolverError

BOX = Grain.box((2e-2, 2e-2, 1e-2), 1e-3, 1e-3)


@pytest.mark.parametrize("restitution", [0.3, 0.8])
def test_flat_box_bounces_with_its_restitution(restitution):
    """The height falls to e^2 of the drop, and a flat impact gives no spin.

    A step decides at which of its ends the box rebounds: v dt / h = 0.4 % of the height at most.
    """
    drop = 0.02
    sim = Simulation(shaped([BOX], [(0, 0, drop + 5e-3)], restitution=restitution), 1e-4, method="impulse")
    heights, spins = [], []
    for _ in range(round(0.12 / 1e-4)):
        sim.step()
        heights.append(sim.position[0, 2] - 5e-3)
        spins.append(np.abs(sim.angular_velocity[0]).max())
    hit = int(np.argmin(heights[: round(0.07 / 1e-4)]))
    flight = slice(hit, hit + round(0.09 * restitution / 1e-4))
    bounce = max(heights[flight])
    assert bounce == pytest.approx(restitution**2 * drop, rel=0.01)
    assert max(spins[flight]) * 1e-2 < 1e-4 * np.sqrt(2 * GRAVITY * drop)


def test_five_boxes_stand():
    """A stack with small offsets stands: it drifts by less than 1e-3 of an edge in 1 s and tilts by less than 1e-4."""
    start = np.array([(2e-4 * (k % 2), 0, 5e-3 + 1e-2 * k) for k in range(5)])
    sim = run(shaped([BOX], start, species=[0] * 5, friction=0.5), 1.0, "impulse", 2e-4)
    tilt = Rotation.from_quat(sim.orientation).magnitude()
    assert sim.position == pytest.approx(start, abs=1e-5)
    assert tilt.max() < 1e-4
    assert np.abs(sim.velocity).max() < 1e-6
    assert sim.largest_overlap() < 1e-6


@pytest.mark.parametrize("part, slides", [(0.99, False), (1.01, True), (1.2, True)])
def test_box_on_an_incline(part, slides):
    """Holds below tan = mu; slides with g (sin - mu cos) above (verification SR3), which 1 % above mu is 0.9 % of g."""
    angle = np.arctan(0.5 * part)
    down = np.array([np.sin(angle), 0, -np.cos(angle)])
    scene = shaped([BOX], [(0, 0, 5e-3)], friction=0.5, gravity=tuple(GRAVITY * down))
    sim = run(scene, 0.4, "impulse", 1e-4)
    expected = GRAVITY * (down[0] + 0.5 * down[2]) * 0.4 if slides else 0.0
    assert sim.velocity[0, 0] == pytest.approx(expected, rel=0.01, abs=1e-6)
    assert np.abs(sim.velocity[0, 1:]).max() < 1e-4
    if not slides:
        assert sim.position[0] == pytest.approx([0, 0, 5e-3], abs=2e-6)


@pytest.mark.parametrize("floor_friction", [0.0, 0.1, 100.0])
def test_rod_lands_on_its_end(floor_friction):
    """Impulse P at the end of a rod: v' = v + P/m, w' = w + I^-1 r x P, v'.n = -e v.n at the end (Routh).

    Without friction P is vertical; with much of it the end does not slide; between them the end slides all the time
    towards -x and P leans by mu.
    """
    rod = Clump.rod(2e-3, 2e-2, 9)
    tilt, speed, restitution = np.radians(40), 1.0, 0.6
    turn = Rotation.from_rotvec([0, tilt, 0])
    lowest = 8e-3 * np.cos(tilt) + 2e-3
    scene = shaped(
        [rod],
        [(0, 0, lowest + 5e-4)],
        velocity=[(0, 0, -speed)],
        orientation=[turn.as_quat()],
        floor_friction=floor_friction,
        restitution=restitution,
        gravity=(0, 0, 0),
    )
    sim = run(scene, 1e-3, "impulse", 1e-5)
    lever = turn.apply([0, 0, -8e-3]) - [0, 0, 2e-3]
    mass, tensor = scene.masses()[0], np.linalg.inv(inertia(Simulation(scene, 1e-5, method="impulse"))[0])
    skew = np.array([[0, -lever[2], lever[1]], [lever[2], 0, -lever[0]], [-lever[1], lever[0], 0]])
    response = np.eye(3) / mass - skew @ tensor @ skew
    change = np.array([0, 0, (1 + restitution) * speed])
    if floor_friction == 0.1:
        slide = -np.sign((response @ [0, 0, 1])[0])
        direction = np.array([slide * floor_friction, 0, 1])
        impulse = direction * change[2] / (response @ direction)[2]
    elif floor_friction:
        impulse = np.linalg.solve(response, change)
    else:
        impulse = np.array([0, 0, change[2] / response[2, 2]])
    spin = tensor @ np.cross(lever, impulse)
    assert sim.angular_velocity[0] == pytest.approx(spin, abs=1e-3 * np.abs(spin).max())
    assert sim.velocity[0] == pytest.approx([0, 0, -speed] + impulse / mass, abs=1e-3)


def test_tumbling_bodies_come_to_rest_and_never_gain_energy():
    """A clump, a box and a sphere dropped together with spins: energy falls to that of rest; no jitter is left."""
    clump = Clump(spheres=((0, 0, 0, 4e-3), (5e-3, 0, 0, 3e-3), (0, 4e-3, 2e-3, 3e-3)))
    box = Grain.box((1.2e-2, 1e-2, 8e-3), 1e-3, 5e-4, reach=5e-3)
    scene = shaped(
        [clump, box, 4e-3],
        [(0, 0, 0.01), (4e-3, 2e-3, 0.025), (-2e-3, 1e-3, 0.037)],
        spin=[(50, 0, 20), (-30, 40, 0), (0, 60, 0)],
        friction=0.6,
        restitution=0.4,
    )
    sim = Simulation(scene, 1e-4, method="impulse")
    last = energy(sim)
    for _ in range(150):
        sim.step(100)
        now = energy(sim)
        assert now <= last * (1 + 1e-9)
        last = now
    assert np.abs(sim.velocity[:2]).max() < 1e-3
    assert sim.largest_overlap() < 4e-4


def test_cube_from_stl_lands_as_the_box_does(tmp_path):
    """A cube from twelve triangles against a box with edges rounded by 1/40, both dropped on an edge.

    The rounding shifts the lever of the edge by 1 % of the cube.
    """
    trimesh.creation.box((1e-2, 1e-2, 1e-2)).export(tmp_path / "cube.stl")
    cube = Grain.from_stl(tmp_path / "cube.stl", 4e-4, probe=5e-4, distance=2.5e-3, reach=5e-4)
    box = Grain.box((1e-2, 1e-2, 1e-2), 2.5e-4, 4e-4)
    turn = Rotation.from_rotvec([0, 0.6, 0]).as_quat()
    found = []
    for shape in (cube, box):
        scene = shaped([shape], [(0, 0, 8e-3)], [(0, 0, -0.5)], orientation=[turn], gravity=(0, 0, 0))
        sim = run(scene, 5e-3, "impulse", 1e-5)
        found.append(np.hstack([sim.velocity[0], 5e-3 * sim.angular_velocity[0]]))
    assert found[0] == pytest.approx(found[1], abs=0.02 * 0.5)
    assert abs(found[0][4]) > 0.05


@pytest.mark.parametrize("method", ["soft-sphere", "impulse"])
def test_a_resumed_run_gives_the_same_bits(method, tmp_path):
    """Orientation, spins and contact memory are in the file.

    A body that leaves does not disturb the others, but the order of their rows: they agree within the tolerance of the
    sweeps.
    """
    scene = shaped(
        [Clump.dumbbell(2e-3, 3e-3), BOX],
        [(0, 0, 2.5e-2), (0, 0, 5e-3), (0.5, 0, 0.1)],
        spin=[(5, 3, 0), (0, 0, 0), (1, 2, 3)],
        species=[0, 1, 0],
    )
    sim = Simulation(scene, {"soft-sphere": 4e-6, "impulse": 1e-4}[method], method=method)
    sim.step(round(0.06 / sim.dt))
    sim.save(tmp_path / "state.npz")
    again = Simulation.load(tmp_path / "state.npz")
    for one in (sim, again):
        one.step(500)
    assert (again.position == sim.position).all()
    assert (again.orientation == sim.orientation).all()
    assert (again.angular_velocity == sim.angular_velocity).all()
    again.remove([2])
    for one in (sim, again):
        one.step(500)
    assert again.orientation == pytest.approx(sim.orientation[:2], abs=1e-5)
    assert again.kinetic_energy() < sim.kinetic_energy()


def test_a_dumbbell_rides_on_a_moving_floor():
    """A floor that lifts at 0.1 m/s and slides at 0.2 m/s takes a lying dumbbell along, without turning it."""
    lying = Rotation.from_rotvec([np.pi / 2, 0, 0]).as_quat()
    scene = shaped([Clump.dumbbell(2e-3, 6e-3)], [(0, 0, 2e-3)], orientation=[lying], restitution=0.3)
    floor = scene.walls[0].model_copy(update={"motion": Motion(velocity=(0, 0.2, 0.1))})
    scene = scene.model_copy(update={"walls": (floor,)})
    sim = run(scene, 0.2, "impulse", 1e-4)
    assert sim.velocity[0] == pytest.approx([0, 0.2, 0.1], abs=1e-4)
    assert sim.position[0, 2] == pytest.approx(0.02 + 2e-3, abs=2e-5)
    assert np.abs(sim.angular_velocity).max() < 0.05


def test_a_floor_of_triangles_is_a_plane():
    """A dumbbell that falls on its end near the edge between two triangles; points would need an inside."""
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * 0.05
    floor = Mesh(name="floor", material="plate", triangles=corners[[[0, 1, 2], [0, 2, 3]]])
    found = []
    for walls in ({}, {"walls": (floor,)}):
        scene = shaped([Clump.dumbbell(2e-3, 4e-3)], [(1e-3, 2e-3, 8e-3)], spin=[(1, 0, 3)], **walls)
        sim = run(scene, 0.08, "impulse", 1e-4)
        found.append(np.hstack([sim.position[0], sim.velocity[0], sim.orientation[0]]))
    assert found[1] == pytest.approx(found[0], abs=1e-9)
    sharp = Grain.box((4e-3,) * 3, 4e-4, 4e-4).model_copy(update={"points": np.zeros((1, 4))})
    with pytest.raises(SolverError, match="probes without a radius cannot meet walls of triangles"):
        Simulation(shaped([sharp], [(0, 0, 8e-3)], walls=(floor,)), 1e-4, method="impulse")
