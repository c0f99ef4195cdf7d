"""Free flight: precession, the flip about the middle axis, and what collisions keep."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from shaped import momenta, shaped

from dembench.scene import Clump, Grain
from dembench.solver import Simulation

METHODS = ["soft-sphere", "impulse"]


@pytest.mark.parametrize("method", METHODS)
def test_dumbbell_precesses(method):
    """In its own frame the spin of a symmetric body turns about the axis at (I3 - I1) w3 / I1 (verification SR9).

    The splitting is of second order: at |w| dt = 0.01 its error of the rate is 1e-5.
    """
    shape = Clump.dumbbell(1e-3, 2.5e-3)
    spin = np.array([20.0, 0, 30.0])
    scene = shaped([shape], [(0, 0, 0)], spin=[spin], floor=None)
    moments = scene.moments()[0]
    rate = (moments[0] - moments[2]) * spin[2] / moments[2]
    sim = Simulation(scene, 2.5e-4, method=method, allow_unstable=True)
    before = momenta(sim)[1], sim.kinetic_energy()
    turned = 0.0
    last = spin
    for _ in range(400):
        sim.step(10)
        own = Rotation.from_quat(sim.orientation[0]).apply(sim.angular_velocity[0], inverse=True)
        turned += np.arctan2(last[0] * own[1] - last[1] * own[0], last[0] * own[0] + last[1] * own[1])
        last = own
    assert turned / sim.time == pytest.approx(rate, rel=1e-3)
    assert momenta(sim)[1] == pytest.approx(before[0], rel=1e-9)
    assert sim.kinetic_energy() == pytest.approx(before[1], rel=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_box_flips_about_its_middle_axis(method):
    """Dzhanibekov: spin about the middle axis turns over, as Euler's equations say; |L| and E stay.

    The splitting has second order: |w| dt = 0.01 gives 1e-4 |w|, times the growth of a deviation before a flip.
    """
    start = np.array([0.5, 40, 0.5])
    scene = shaped([Grain.box((3e-3, 2e-3, 1e-3), 1e-4, 1e-4)], [(0, 0, 0)], spin=[start], floor=None)
    moments = scene.moments()[0]

    def euler(_t, w):
        return -np.cross(w, moments * w) / moments

    times = np.linspace(0, 1, 101)
    exact = solve_ivp(euler, (0, 1), start, t_eval=times, rtol=1e-10, atol=1e-9).y.T
    sim = Simulation(scene, 2.5e-4, method=method, allow_unstable=True)
    before = momenta(sim)[1], sim.kinetic_energy()
    found = [start]
    for _ in times[1:]:
        sim.step(40)
        found.append(Rotation.from_quat(sim.orientation[0]).apply(sim.angular_velocity[0], inverse=True))
        assert sim.kinetic_energy() == pytest.approx(before[1], rel=1e-4)
    assert np.count_nonzero(np.diff(np.sign(exact[:, 1]))) == 2
    assert np.array(found) == pytest.approx(exact, abs=0.01 * 40)
    assert momenta(sim)[1] == pytest.approx(before[0], rel=1e-9, abs=1e-9 * np.linalg.norm(before[0]))
    assert np.linalg.norm(sim.orientation[0]) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", ["clumps", "grains", "mixed"])
def test_collision_keeps_momentum_and_never_gives_energy(method, kind):
    """Two spinning bodies that collide off centre, with friction: momentum and angular momentum to rounding.

    The soft-sphere springs store energy during the contact and give it back.
    """
    clump = Clump(spheres=((0, 0, 0, 1e-3), (1e-3, 0, 0, 8e-4), (0, 1.2e-3, 0.2e-3, 6e-4)))
    grain = Grain.box((3e-3, 2e-3, 1.5e-3), 2e-4, 1e-4, probes=7, reach=1.1e-3)
    shapes = {"clumps": [clump, clump], "grains": [grain, grain], "mixed": [clump, grain]}[kind]
    scene = shaped(
        shapes,
        [(0, 0, 0), (5e-3, 1e-3, 4e-4)],
        velocity=[(0.5, 0, 0), (-0.5, 0, 0.1)],
        spin=[(30, 0, 50), (0, -80, 0)],
        floor=None,
    )
    sim = Simulation(scene, {"soft-sphere": 1e-6, "impulse": 2e-5}[method], method=method)
    before = momenta(sim), sim.kinetic_energy()
    step = round(2e-5 / sim.dt)
    met = 0
    last = before[1]
    for _ in range(400):
        sim.step(step)
        points = sim.counters()["contact points"]
        met += points > 0
        if method == "impulse" or points == 0:
            assert sim.kinetic_energy() <= last * (1 + 1e-6)
            last = sim.kinetic_energy()
    assert met > 0
    assert sim.kinetic_energy() < 0.95 * before[1]
    after = momenta(sim)
    assert after[0] == pytest.approx(before[0][0], abs=1e-10 * 0.5 * sim.masses.sum())
    assert after[1] == pytest.approx(before[0][1], abs=1e-9 * np.linalg.norm(before[0][1]))
