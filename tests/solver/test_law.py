"""The Hertz-Mindlin law of one contact, against closed forms and against the law written out in plain numpy."""

from __future__ import annotations

import numpy as np
import pytest
from grains import FLOOR, RADIUS, gas, grains
from impacts import Impact
from reference import AllPairs

from dembench.scene import HertzMindlin, LinearSpring, Material, PairLaw, Plane, Species
from dembench.solver import Simulation


@pytest.mark.parametrize(("precision", "tolerance"), [("float64", 1e-7), ("float32", 1e-6)])
@pytest.mark.parametrize(("young", "restitution"), [(1e7, 0.49986195), (1e9, 0.50256667)])
def test_two_spheres_rebound_as_in_other_codes_of_the_law(
    young: float, restitution: float, precision: str, tolerance: float
) -> None:
    """LIGGGHTS and MUSEN give these numbers; the first touch falls on a step: rounding shows in the eighth digit."""
    scene = grains([[-1.5e-3, 0, 0], [1.5e-3, 0, 0]], [[0.5, 0, 0], [-0.5, 0, 0]], young=young)
    simulation = Simulation(scene, precision=precision)
    simulation.step(5000)
    v = simulation.velocity
    assert v[1, 0] - v[0, 0] == pytest.approx(restitution, abs=tolerance)
    assert v.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-7)
    assert np.abs(v[:, 1:]).max() == 0


OBLIQUE = {
    "sticking": {"friction": 5.0, "velocity": (0.4, 0.15, 0.1)},
    "slipping at first": {"friction": 0.3, "velocity": (0.5, 0.3, -0.2)},
    "slipping": {"friction": 0.1, "velocity": (0.5, 1.0, 0.4)},
}


LAWS = {
    "reference": HertzMindlin(),
    "rescaled": HertzMindlin(variant="rescaled"),
    "no-tension": HertzMindlin(variant="no-tension"),
    "linear": LinearSpring(normal_stiffness=2000.0, tangential_stiffness=1700.0),
}


@pytest.mark.parametrize("name", list(LAWS))
@pytest.mark.parametrize("case", list(OBLIQUE))
def test_oblique_impact_of_spinning_spheres_follows_the_law(case: str, name: str) -> None:
    """Different radii, spins about all axes, until the spheres part: every step is that of the law in plain numpy."""
    law = OBLIQUE[case]
    scene = grains(
        [[-1.0e-3, 0, 0], [1.5003e-3, 3e-4, -2e-4]],
        [law["velocity"], (0, 0, 0)],
        [[120, -300, 250], [-80, 200, 400]],
        radius=(RADIUS, 1.5 * RADIUS),
        species=[0, 1],
        friction=law["friction"],
        law=LAWS[name],
    )
    simulation, reference = Simulation(scene, precision="float64"), AllPairs(scene, 1e-6)
    steps_in_contact = 0
    for _ in range(30):
        simulation.step(25)
        reference.step(25)
        steps_in_contact += len(reference.touching)
        assert simulation.velocity == pytest.approx(reference.v, rel=1e-9, abs=1e-12)
        assert simulation.angular_velocity == pytest.approx(reference.w, rel=1e-9, abs=1e-9)
    assert 5 < steps_in_contact < 25


def test_the_variants_differ_by_lever_and_history() -> None:
    """Otherwise the comparison above would not tell them apart."""
    ends = []
    for variant in ("reference", "rescaled"):
        scene = grains([[-1e-3, 0, 0], [1e-3, 3e-4, 0]], [[0.5, 0.5, 0], [0, 0, 0]], variant=variant)
        simulation = Simulation(scene, precision="float64")
        simulation.step(1000)
        ends.append(simulation.angular_velocity[0, 2])
    assert 1e-4 < abs(ends[1] / ends[0] - 1) < 0.1


def test_restitution_tends_to_that_of_the_pair_law() -> None:
    """The dashpot of the law gives e for every stiffness and speed as the step goes to zero; tension is not clipped."""
    for restitution in (0.1, 0.5, 0.9):
        scene = grains([[0, 0, 1.01e-3]], [[0, 0, -0.3]], walls=(FLOOR,), restitution=restitution, dt=1e-7)
        simulation = Simulation(scene, precision="float64")
        simulation.step(16000)
        # first order in dt: 3000 steps per contact leave a few 1e-4 (clipped tension would give .253, .550 and .902)
        assert simulation.velocity[0, 2] / 0.3 == pytest.approx(restitution, abs=5e-4)


def test_impact_without_slip_tends_to_the_solution_in_continuous_time() -> None:
    """Normal and tangential oscillator with their dashpots on a plane, solved by scipy; the variant with lever r."""
    law = {"walls": (FLOOR,), "friction": 1e6, "variant": "rescaled", "dt": 1e-7}
    scene = grains([[0, 0, 1.01e-3]], [[0.2, 0, -0.3]], [[0, 50, 0]], **law)
    end = Impact(scene, 0)
    rebound, surface = end.velocity[1], end.velocity[0] - RADIUS * end.spins[0]
    simulation = Simulation(scene, precision="float64")
    simulation.step(16000)
    v, w = simulation.velocity[0], simulation.angular_velocity[0]
    assert rebound == pytest.approx(0.15, abs=1e-5)
    assert v[2] == pytest.approx(rebound, rel=1e-3)
    assert v[0] - RADIUS * w[1] == pytest.approx(surface, abs=1e-3 * 0.15)
    assert abs(surface) > 0.01
    # the force acts at the surface: m v + (2/5) m r w is conserved
    assert v[0] + 0.4 * RADIUS * w[1] == pytest.approx(0.2 + 0.4 * RADIUS * 50, rel=1e-9)


def test_sliding_impact_takes_the_friction_of_the_normal_impulse() -> None:
    """Gross slip without dashpots: tangential impulse mu m (1 + e) v; the lever is r - overlap/2, up to 3 % less."""
    scene = grains([[0, 0, 1.01e-3]], [[2.0, 0, -0.3]], walls=(FLOOR,), friction=0.1, restitution=1.0, dt=1e-7)
    simulation = Simulation(scene, precision="float64")
    simulation.step(16000)
    slowed = 0.1 * 2 * 0.3
    assert 2.0 - simulation.velocity[0, 0] == pytest.approx(slowed, rel=1e-3)
    assert simulation.angular_velocity[0, 1] * 0.4 * RADIUS == pytest.approx(slowed, rel=0.03)


def test_dashpot_of_a_sticking_contact_is_not_bounded() -> None:
    """With e < 1 a glancing impact loses more than mu (1 + e) v, as in LIGGGHTS and MUSEN."""
    scene = grains([[0, 0, 1.01e-3]], [[2.0, 0, -0.3]], walls=(FLOOR,), friction=0.2)
    simulation, reference = Simulation(scene, precision="float64"), AllPairs(scene, 1e-6)
    simulation.step(1600)
    reference.step(1600)
    assert simulation.velocity == pytest.approx(reference.v, rel=1e-9, abs=1e-12)
    assert 2.0 - simulation.velocity[0, 0] > 1.1 * 0.2 * 1.5 * 0.3


def test_midpoint_dashpot_has_less_bias_at_a_large_step() -> None:
    """e = 0.2 at 1 m/s: half a Rayleigh step makes e 0.03 too low on average over the phases of the first contact."""
    phases = 20
    dt = 0.5 * grains([[0, 0, 0]], young=1e9, poisson=0.25).rayleigh_time()
    gap = (1 + np.arange(phases) / phases) * dt
    y = np.arange(phases) * 0.01
    position = np.concatenate([np.stack([0 * y, y, s * (RADIUS + gap / 2)], axis=1) for s in (-1, 1)])
    velocity = np.repeat([[0, 0, 0.5], [0, 0, -0.5]], phases, axis=0)
    bias = {}
    for midpoint in (False, True):
        made = grains(position, velocity, young=1e9, poisson=0.25, restitution=0.2)
        simulation = Simulation(made, dt, precision="float64", midpoint=midpoint)
        simulation.step(60)
        measured = simulation.velocity[phases:, 2] - simulation.velocity[:phases, 2]
        bias[midpoint] = measured.mean() - 0.2
    assert -0.04 < bias[False] < -0.02
    assert abs(bias[True]) < 0.005


def test_co1_hertz_impact_of_two_spheres() -> None:
    """Chung and Ooi 2011, test 1: peak overlap (5 m* v^2/(4 k))^(2/5), peak force and contact time 2.9432 overlap/v."""
    for young, poisson, density, overlap, force, time in (
        (4.8e10, 0.20, 2800, 274.1e-6, 10697, 40.3e-6),
        (2.0e10, 0.25, 2500, 368.3e-6, 7108, 54.2e-6),
    ):
        scene = grains(
            [[-0.01, 0, 0], [0.01, 0, 0]],
            [[10, 0, 0], [-10, 0, 0]],
            radius=0.01,
            young=young,
            poisson=poisson,
            density=density,
            restitution=1.0,
            friction=0.35,
        )
        dt = time / 400
        simulation = Simulation(scene, dt, precision="float64")
        speed = []
        for _ in range(480):
            simulation.step()
            speed.append(simulation.velocity[1, 0])
        assert simulation.largest_overlap() == pytest.approx(overlap, rel=5e-4)
        assert float(scene.masses()[1]) * np.diff(speed).max() / dt == pytest.approx(force, rel=5e-4)
        # the end of contact is known to one step of 400
        assert np.flatnonzero(np.diff(speed))[-1] * dt == pytest.approx(time, rel=6e-3)
        assert speed[-1] == pytest.approx(10, rel=1e-4)


def test_co2_hertz_impact_on_a_plane() -> None:
    """Chung and Ooi 2011, test 2; the plane is elastic, so that its modulus makes the published 1/E* of a rigid one."""
    for young, poisson, density, overlap, force, time in (
        (7e10, 0.33, 2699, 49.30e-6, 11466, 725e-6),
        (4e10, 0.35, 1800, 52.12e-6, 7233, 767e-6),
    ):
        floor = Plane(name="floor", material="grain", point=(0, 0, 0), normal=(0, 0, 1))
        scene = grains(
            [[0, 0, 0.1]],
            [[0, 0, -0.2]],
            walls=(floor,),
            radius=0.1,
            young=2 * young,
            poisson=poisson,
            density=density,
            restitution=1.0,
        )
        dt = time / 400
        simulation = Simulation(scene, dt, precision="float64")
        lowest, ended, speed = 0.0, 0.0, []
        for k in range(480):
            simulation.step()
            speed.append(simulation.velocity[0, 2])
            lowest = min(lowest, simulation.position[0, 2] - 0.1)
            ended = k * dt if simulation.position[0, 2] < 0.1 else ended
        assert -lowest == pytest.approx(overlap, rel=5e-4)
        assert float(scene.masses()[0]) * np.diff(speed).max() / dt == pytest.approx(force, rel=5e-4)
        assert ended == pytest.approx(time, rel=6e-3)
        assert simulation.velocity[0, 2] == pytest.approx(0.2, rel=1e-4)


@pytest.mark.parametrize("method", ["soft-sphere", "impulse"])
def test_every_pair_of_materials_has_its_own_law(method: str) -> None:
    """Restitution of glass-glass, glass-steel, steel-steel, and of both against a wall of rubber."""
    names = ("glass", "steel", "rubber")
    moduli = {"glass": 1e8, "steel": 1e9, "rubber": 1e7}
    materials = tuple(Material(name=k, density=2500, young=moduli[k], poisson=0.2) for k in names)
    restitution = {
        ("glass", "glass"): 0.9,
        ("steel", "glass"): 0.7,
        ("steel", "steel"): 0.5,
        ("glass", "rubber"): 0.3,
        ("rubber", "steel"): 0.4,
    }
    pairs = [[0, 0.01 * k, z] for z in (0.1, 0.1 + 2.1 * RADIUS) for k in range(3)]
    fallers = [[0, 0.04, 1.05 * RADIUS], [0, 0.05, 1.05 * RADIUS]]
    scene = grains(
        [*pairs, *fallers],
        np.array([[0, 0, s] for s in (0.25,) * 3 + (-0.25,) * 3 + (-0.5,) * 2]),
        species=[0, 0, 1, 0, 1, 1, 0, 1],
        materials=materials,
        kinds=tuple(Species(name=k, material=k, radius=RADIUS) for k in names[:2]),
        pair_laws=tuple(PairLaw(a=a, b=b, restitution=e, friction=0.2) for (a, b), e in restitution.items()),
        walls=(FLOOR.model_copy(update={"material": "rubber"}),),
    )
    simulation = Simulation(scene, 1e-7 if method == "soft-sphere" else 1e-5, method=method, rows="rigid")
    simulation.step(12000 if method == "soft-sphere" else 120)
    v = simulation.velocity[:, 2]
    measured = [*(v[3:6] - v[:3]) / 0.5, *v[6:] / 0.5]
    # first order in the step, which is 1/200 of the shortest contact
    assert measured == pytest.approx([0.9, 0.7, 0.5, 0.3, 0.4], abs=3e-3 if method == "soft-sphere" else 1e-6)


def test_radii_of_bodies_act_as_radii_of_species() -> None:
    """The same grains, given once by species and once by a radius each: constants from a table and from radii."""
    position, velocity, spin = gas(40, speed=2.0, radius=1.5 * RADIUS)
    fields = {"radius": (RADIUS, 1.5 * RADIUS), "species": np.arange(40) % 2, "young": 1e8}
    by_species = grains(position, velocity, spin, **fields)
    bodies = by_species.bodies.model_copy(update={"radius": by_species.radii()})
    ends = []
    for scene in (by_species, by_species.model_copy(update={"bodies": bodies})):
        simulation = Simulation(scene, 1e-6, precision="float64")
        simulation.step(1000)
        ends.append((simulation.velocity, simulation.angular_velocity))
    assert np.abs(ends[0][0] - velocity).max() > 0.5
    assert ends[0][0] == pytest.approx(ends[1][0], abs=1e-10)
    assert ends[0][1] == pytest.approx(ends[1][1], abs=1e-7)
