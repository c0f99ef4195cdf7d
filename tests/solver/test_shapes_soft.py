"""The soft-sphere law at the contact points of bodies that are no spheres."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shaped import DENSITY, GRAVITY, energy, run, shaped

from dembench.scene import Clump, Grain, LinearSpring
from dembench.solver import Simulation, SolverError

SIZE, ROUNDING = (1.2e-2, 1e-2, 6e-3), 6e-4
BOX = Grain.box(SIZE, ROUNDING, 6e-4)
DT = 4e-6


def resting(down=(0.0, 0.0, -1.0), friction=0.3, **changes):
    """A box on the floor with the overlap d that carries its weight: 4/3 E* sqrt(R) d^(3/2) = m g, n points of 1/n."""
    scene = shaped([BOX], [(0, 0, SIZE[2] / 2)], friction=friction, gravity=tuple(GRAVITY * np.array(down)), **changes)
    modulus = 1e7 / (2 * (1 - 0.2**2))
    stiffness = 4 / 3 * modulus * np.sqrt(BOX.contact_radius)
    depth = (-scene.masses()[0] * scene.gravity[2] / stiffness) ** (2 / 3)
    lowered = scene.bodies.model_copy(update={"position": np.array([[0, 0, SIZE[2] / 2 - depth]])})
    return scene.model_copy(update={"bodies": lowered}), depth


def test_box_rests_on_its_face():
    """The 25 points of a face are together as stiff as one contact; they carry the weight without tilt."""
    scene, depth = resting()
    sim = run(scene, 0.02, "soft-sphere", DT)
    load = sim.state.read("load", 2, sim.units.force)[0, 0]
    assert load == pytest.approx(scene.masses()[0] * GRAVITY, rel=1e-4)
    assert sim.position[0] == pytest.approx([0, 0, SIZE[2] / 2 - depth], abs=1e-4 * depth)
    assert Rotation.from_quat(sim.orientation).magnitude()[0] < 1e-9
    assert sim.counters()["contact points"] == 25


@pytest.mark.parametrize("part, slides", [(0.99, False), (1.01, True)])
def test_box_on_an_incline(part, slides):
    """Holds at 0.99 mu, slides with g (sin - mu cos) at 1.01 mu (verification SR3).

    Until its springs are taut the box accelerates; below mu it then comes to a stop.
    """
    angle = np.arctan(0.5 * part)
    down = np.array([np.sin(angle), 0, -np.cos(angle)])
    scene, depth = resting(down, 0.5)
    sim = Simulation(scene, DT, method="soft-sphere")
    sim.step(round(0.15 / DT))
    before, place = sim.velocity[0, 0], sim.position[0, 0]
    sim.step(round(0.1 / DT))
    if slides:
        assert sim.velocity[0, 0] - before == pytest.approx(GRAVITY * (down[0] + 0.5 * down[2]) * 0.1, rel=0.01)
    else:
        assert abs(sim.velocity[0, 0]) < 1e-6
        assert abs(sim.position[0, 0] - place) < 1e-3 * depth


def test_elastic_tumbling_keeps_energy():
    """e = 1, no friction: a clump bounces on the floor, and the springs give back what they take.

    Velocity Verlet drifts by less than 1e-3 at 60 steps per contact.
    """
    clump = Clump(spheres=((0, 0, 0, 4e-3), (5e-3, 0, 0, 3e-3), (0, 4e-3, 2e-3, 3e-3)))
    scene = shaped(
        [clump], [(0, 0, 0.02)], spin=[(40, 20, 0)], restitution=1.0, friction=0.3, floor_friction=0.0, young=1e7
    )
    sim = Simulation(scene, 2e-6, method="soft-sphere")
    start, seen = energy(sim), []
    for _ in range(300):
        sim.step(500)
        if sim.counters()["contact points"] == 0:
            seen.append(energy(sim))
    assert len(seen) > 150
    assert np.array(seen) == pytest.approx(start, rel=1e-3)
    assert np.abs(sim.velocity).max() > 0.1


@pytest.mark.parametrize("restitution", [0.5, 0.9])
def test_flat_box_rebounds_with_the_restitution_of_the_pair(restitution):
    """Without gravity n equal points have the damping ratio of one contact, so the law's e holds (Hertz: exactly)."""
    speed = 0.3
    scene = shaped([BOX], [(0, 0, SIZE[2] / 2 + 1e-5)], [(0, 0, -speed)], restitution=restitution, gravity=(0, 0, 0))
    sim = run(scene, 0.004, "soft-sphere", 1e-6)
    assert sim.velocity[0, 2] == pytest.approx(restitution * speed, rel=2e-3)
    assert np.abs(sim.angular_velocity).max() < 1e-9


def test_a_linear_law_acts_at_the_points():
    """The face of n points of 1/n has the stiffness of the law: depth m g / kn."""
    law = LinearSpring(normal_stiffness=500, tangential_stiffness=200)
    scene = shaped([BOX], [(0, 0, SIZE[2] / 2)], law=law)
    sim = run(scene, 0.08, "soft-sphere", 2e-5)
    assert SIZE[2] / 2 - sim.position[0, 2] == pytest.approx(scene.masses()[0] * GRAVITY / 500, rel=1e-3)


def test_what_scenes_with_shapes_lack_is_named():
    scene = shaped([BOX, 5e-3], [(0, 0, 0.1), (0.1, 0, 0.1)])
    with pytest.raises(SolverError, match=r"its field reaches 0.0018 m .* species s1 has spheres of 0.005 m"):
        Simulation(scene, DT)
    scene = resting()[0]
    with pytest.raises(SolverError, match="threads 2: scenes with shapes run on one thread"):
        Simulation(scene, DT, threads=2)
    with pytest.raises(SolverError, match="lists 'full': scenes with shapes"):
        Simulation(scene, DT, lists="full")
    with pytest.raises(SolverError, match="compliant rows of bodies that are no spheres"):
        Simulation(scene, DT, method="impulse", rows="compliant")
    with pytest.raises(SolverError, match="take no new bodies"):
        Simulation(scene, DT).insert([(0, 0, 1)])
    spheres = shaped([5e-3], [(0, 0, 0.1)])
    with pytest.raises(SolverError, match="this one has spheres"):
        _ = Simulation(spheres, DT).orientation
    assert scene.masses()[0] == pytest.approx(DENSITY * BOX.solid.volume)
