"""Neighbour lists: no pair is missed, memory survives, threads and repeats agree, room is made, faults are named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, gas, grains, hertz
from reference import AllPairs

from dembench.scene import Bodies, Box, Scene
from dembench.solver import Simulation, SolverError, soft


def pit(n: int = 200, **changes: Any) -> Scene:
    """Fast grains in a closed box, in which they keep on meeting each other and the walls."""
    position, velocity, spin = gas(n, speed=2.0, spacing=2.45)
    low, high = position.min(axis=0) - 1.05 * RADIUS, position.max(axis=0) + 1.05 * RADIUS
    box = Box(name="box", material="grain", lower=tuple(low), upper=tuple(high))
    return grains(position, velocity, spin, **{"young": 1e8, "walls": (box,), "gravity": (0, 0, -9.81), **changes})


def with_ball() -> Scene:
    """Fast grains of two sizes around a ball of ten radii, which all fly together; the ball has a fast spin."""
    random = np.random.default_rng(5)
    direction = random.normal(size=(900, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    position = direction * random.uniform(11.6, 22, (900, 1)) * RADIUS
    kept: list[int] = []
    for k in range(900):
        if all(np.linalg.norm(position[k] - position[j]) > 3.05 * RADIUS for j in kept):
            kept.append(k)
    kept = kept[:150]
    velocity = -3 * direction[kept] + 2 * random.normal(size=(len(kept), 3))
    species = np.arange(len(kept)) % 2
    return grains(
        np.vstack([position[kept], [[0, 0, 0]]]),
        np.vstack([velocity, [[5.0, 0, 0]]]),
        np.vstack([random.normal(size=(len(kept), 3)) * 500, [[100, 0, 200]]]),
        radius=(RADIUS, 1.5 * RADIUS, 10 * RADIUS),
        species=[*species, 2],
        young=1e8,
    )


@pytest.mark.parametrize("threads", [1, 2])
def test_no_pair_is_missed_among_fast_grains_and_a_ball(threads: int) -> None:
    """Every grain follows the all-pairs solution: one contact missed, or found late, in one step would show."""
    scene = with_ball()
    simulation, reference = Simulation(scene, threads=threads, precision="float64"), AllPairs(scene, 1e-6)
    contacts, met = 0, set()
    for _ in range(100):
        simulation.step(20)
        reference.step(20)
        contacts += len(reference.touching)
        met |= {tuple(p) for p in reference.touching}
        # rounding grows with every collision; a missed contact of one step changes a velocity by 1e-3 and more
        assert np.abs(simulation.velocity - reference.v).max() < 1e-9
        assert np.abs(simulation.angular_velocity - reference.w).max() < 1e-6
    assert len(met) > 100 and sum(len(scene.bodies) - 1 in p for p in met) > 20
    assert simulation.counters()["list rebuilds"] > 10


def test_two_that_are_the_fastest_may_meet_head_on_from_any_distance() -> None:
    """Gaps that close as fast as gaps can: a contact just before the lists are due must be seen."""
    gap = np.linspace(0.00517, 1.19731, 60) * 2 * RADIUS
    y = 5 * RADIUS * np.arange(60)
    left = np.stack([0 * y, y, 0 * y], axis=1)
    right = left + np.stack([2 * RADIUS + gap, 0 * y, 0 * y], axis=1)
    assert_follows_all_pairs(grains([*left, *right], [[2.0, 0, 0]] * 60 + [[-2.0, 0, 0]] * 60, young=1e8), 1000)


@pytest.mark.parametrize("gap", [0.40007, 0.50007, 0.60007, 1.00007])
def test_a_ball_that_is_the_fastest_meets_what_lies_just_beyond_its_candidates(gap: float) -> None:
    """A grain at rest ahead; the candidates of the ball are renewed when it has moved half a diameter of a grain.

    No gap is a whole number of steps: where a touch falls on a step, rounding decides whether there is a force.
    """
    far = [[1.0, 5 * RADIUS * k, 0] for k in range(60)]
    scene = grains(
        [[11 * RADIUS + gap * 2 * RADIUS, 0, 0], *far, [0, 0, 0]],
        [[0, 0, 0]] * 61 + [[4.0, 0, 0]],
        radius=(RADIUS, 10 * RADIUS),
        species=[0] * 61 + [1],
        young=1e8,
    )
    assert_follows_all_pairs(scene, 600)


def assert_follows_all_pairs(scene: Scene, steps: int) -> None:
    simulation, reference = Simulation(scene, 1e-6, precision="float64"), AllPairs(scene, 1e-6)
    for _ in range(steps // 20):
        simulation.step(20)
        reference.step(20)
        assert np.abs(simulation.velocity - reference.v).max() < 1e-9
    assert np.abs(reference.v - scene.bodies.velocity).max() > 0.5


def test_grains_scattered_over_a_wide_space_still_meet() -> None:
    """Two far outliers must not make the grid coarse or empty: the pairs near the origin still collide."""
    position, velocity, spin = gas(60, speed=2.0)
    position[0] = [50, -30, 20]
    position[1] = [-70, 10, 90]
    scene = grains(position, velocity, spin, young=1e8)
    simulation, reference = Simulation(scene, precision="float64"), AllPairs(scene, 1e-6)
    simulation.step(600)
    reference.step(600)
    assert np.abs(reference.v - velocity).max() > 0.5
    assert np.abs(simulation.velocity - reference.v).max() < 1e-9


def test_contact_memory_survives_rebuilds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lists that are built anew every few steps give what lists that last give: springs move along with their pairs."""
    ends = {}
    for skin, near in ((0.02, 0.002), (0.8, 0.1)):
        monkeypatch.setattr(soft, "SKIN", skin)
        monkeypatch.setattr(soft, "NEAR_SKIN", near)
        simulation = Simulation(pit(), precision="float64")
        simulation.step(1500)
        ends[skin] = simulation.velocity, simulation.angular_velocity, simulation.counters()["list rebuilds"]
    assert ends[0.02][2] > 5 * ends[0.8][2] > 5
    assert ends[0.02][0] == pytest.approx(ends[0.8][0], abs=1e-9)
    assert ends[0.02][1] == pytest.approx(ends[0.8][1], abs=1e-6)


def test_two_threads_give_the_result_of_one() -> None:
    """The sums are taken in another order, so that rounding differs."""
    ends = []
    for threads in (1, 2):
        simulation = Simulation(pit(), threads=threads, precision="float64")
        simulation.step(1500)
        ends.append((simulation.position, simulation.velocity))
    assert ends[0][0] == pytest.approx(ends[1][0], abs=1e-9 * RADIUS)
    assert ends[0][1] == pytest.approx(ends[1][1], abs=1e-9)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_repeated_run_gives_the_same_bits_however_it_is_cut(threads: int) -> None:
    ends = []
    for block in (3000, 3000, 7):
        simulation = Simulation(pit(), threads=threads)
        made = 0
        while made < 3000:
            simulation.step(min(block, 3000 - made))
            made += min(block, 3000 - made)
        ends.append([a.tobytes() for a in (simulation.position, simulation.velocity, simulation.angular_velocity)])
    assert ends[0] == ends[1]
    assert ends[0] == ends[2]


def test_a_start_that_is_not_a_number_is_refused_with_the_particle() -> None:
    with pytest.raises(ValueError, match="particle 1 has the value nan"):
        Bodies(position=[[0, 0, 0], [0, float("nan"), 0]])


@pytest.mark.parametrize("method", ["soft-sphere", "impulse"])
def test_a_velocity_that_is_not_a_number_ends_the_run_with_its_step(method: str) -> None:
    simulation = Simulation(pit(8), 1e-6, method=method)
    simulation.step(40)
    velocity = simulation.velocity
    velocity[3, 1] = np.nan
    simulation.state.write("kin", 3, velocity, simulation.units.velocity)
    with pytest.raises(SolverError, match=r"step 4[01] .*a velocity is not finite") as raised:
        simulation.step(100)
    assert raised.value.reason == "nan"


def test_a_step_beyond_the_guard_is_refused() -> None:
    scene = grains([[0, 0, 0], [0, 0, 3e-3]], [[0, 0, 100.0], [0, 0, 0]])
    limit = 0.6 * scene.rayleigh_time()
    Simulation(grains([[0, 0, 0]]), 0.99 * limit)
    with pytest.raises(SolverError, match=r"dt .* s is above 0.6 Rayleigh time steps .*choose a smaller dt"):
        Simulation(scene, 1.01 * limit)
    # at 100 m/s a Hertz contact is shorter than the Rayleigh bound allows for
    with pytest.raises(SolverError, match="contact times of the fastest body"):
        Simulation(scene, 0.99 * limit)
    insisted = Simulation(scene, 1.01 * limit, allow_unstable=True)
    assert len(insisted.warnings) == 2 and "Rayleigh" in insisted.warnings[0]


def test_lists_grow_with_what_they_must_hold() -> None:
    """A heap in which every grain overlaps dozens of others: far more pairs than there is room for at first."""
    position = np.random.default_rng(2).uniform(0, 4 * RADIUS, (300, 3))
    position[:, 2] += 0.9 * RADIUS
    scene = grains(position, walls=(FLOOR,), young=1e6)
    simulation, reference = Simulation(scene, 1e-6, precision="float64"), AllPairs(scene, 1e-6)
    simulation.step(20)
    reference.step(20)
    assert len(reference.touching) > 30 * 300
    assert np.abs(reference.v).max() > 0.1
    assert simulation.velocity == pytest.approx(reference.v, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("method", ["soft-sphere", "impulse"])
def test_a_ball_may_touch_thousands_of_grains(method: str) -> None:
    """5000 grains on a sphere, all of them moving onto the ball: none may be left out and sink into it."""
    n, ball = 5000, 60 * RADIUS
    k = np.arange(n) + 0.5
    polar, turn = np.arccos(1 - 2 * k / n), np.pi * (1 + 5**0.5) * k
    direction = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=1)
    position = np.vstack([direction * (ball + RADIUS * (1 + 1e-4)), [[0, 0, 0]]])
    velocity = np.vstack([-0.1 * direction, [[0, 0, 0]]])
    scene = grains(position, velocity, radius=(RADIUS, ball), species=[0] * n + [1], young=1e8, restitution=0.5)
    dt = 1e-6 if method == "soft-sphere" else 1e-5
    simulation = Simulation(scene, dt, method=method)
    simulation.step(round(2e-4 / dt))
    away = (simulation.velocity[:n] * direction).sum(axis=1)
    # every grain rebounds; the soft contact of 70 steps has a first-order error of the step
    assert away == pytest.approx(np.full(n, 0.05), abs=2e-3)


def test_contacts_of_the_initial_state_push_from_the_first_half_step_on() -> None:
    scene = grains([[0, 0, 0], [0, 0, 1.99 * RADIUS]], restitution=1.0)
    simulation = Simulation(scene, 1e-9, precision="float64")
    simulation.step()
    force = simulation.velocity[1, 2] * scene.masses()[0] / 1e-9
    assert force == pytest.approx(hertz(scene, 0.01 * RADIUS, RADIUS / 2), rel=1e-6)
