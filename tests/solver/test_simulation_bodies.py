"""Bodies that leave and come during a run: ids, counts, and what the others notice of it."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from grains import RADIUS, gas, grains
from test_simulation_saving import bits, shaken

from dembench.scene import Region, Scene, Sink
from dembench.solver import Simulation, SolverError

METHODS: dict[str, dict[str, Any]] = {
    "soft-sphere": {"dt": 1e-6},
    "compliant": {"dt": 1e-5, "method": "impulse"},
    "rigid": {"dt": 1e-5, "method": "impulse", "rows": "rigid"},
}
each_method = pytest.mark.parametrize("method", list(METHODS))
BOTTOM = Sink(name="bottom", region=Region(upper=(None, None, -0.5)))
G = 9.81


def cloud(**changes: Any) -> Scene:
    """60 fast grains that meet, and one far away at rest."""
    position, velocity, spin = gas(60, speed=1.0, spacing=2.3)
    return grains([*position, [1, 1, 1]], [*velocity, [0, 0, 0]], [*spin, [0, 0, 0]], young=1e8, **changes)


@each_method
def test_the_others_do_not_notice_that_a_far_body_leaves(method: str) -> None:
    """Contacts keep their memory and forces; only rounding differs, for new lists sum in another order."""
    ends = []
    for leaves in (False, True):
        simulation = Simulation(cloud(), **METHODS[method], precision="float64")
        simulation.step(300)
        if leaves:
            simulation.remove(60)
        simulation.step(700)
        ends.append((simulation.position[:60], simulation.velocity[:60], simulation.angular_velocity[:60]))
    assert simulation.ids.tolist() == list(range(60))
    for there, gone in zip(*ends, strict=True):
        assert gone == pytest.approx(there, rel=1e-7, abs=1e-9)
    assert np.abs(ends[0][1] - cloud().bodies.velocity[:60]).max() > 0.5


@pytest.mark.parametrize("settings", [*METHODS.values(), {"dt": 1e-6, "threads": 2}])
def test_ids_stay_with_their_bodies_when_others_leave(settings: dict[str, Any], tmp_path: Path) -> None:
    """Ids stay with their bodies, and a saved run goes on with the same bits."""
    simulation = Simulation(shaken(), **settings)
    simulation.step(200)
    gone = np.array([0, 3, 77, 150, 200])
    before = simulation.velocity
    simulation.remove(gone)
    assert simulation.ids.tolist() == [k for k in range(201) if k not in gone]
    assert np.array_equal(simulation.velocity, before[simulation.ids])
    assert len(simulation.radii) == len(simulation.masses) == len(simulation.species) == 196
    simulation.save(tmp_path / "state.npz")
    resumed = Simulation.load(tmp_path / "state.npz")
    for other in (simulation, resumed):
        other.step(300)
    assert bits(resumed) == bits(simulation)
    assert np.isfinite(simulation.position).all() and simulation.overlap() < 0.2 * RADIUS


@each_method
def test_a_support_that_leaves_lets_its_load_fall(method: str) -> None:
    """A grain at rest on a fixed one falls freely from the moment the other is gone: no force is left over."""
    resting = 2 * RADIUS * (1 - 1e-5)
    scene = grains(
        [[0, 0, 0], [0, 0, resting]],
        gravity=(0, 0, -G),
        young=1e8,
        constraints=({"kind": "fixed", "bodies": (0,)},),
    )
    simulation = Simulation(scene, **METHODS[method])
    simulation.step(5000)
    start, speed = simulation.position[1, 2], simulation.velocity[1, 2]
    simulation.remove([0])
    simulation.step(100)
    dt = METHODS[method]["dt"]
    t = 100 * dt
    assert simulation.ids.tolist() == [1]
    assert simulation.velocity[0, 2] - speed == pytest.approx(-G * t, rel=1e-6)
    assert simulation.position[0, 2] - start == pytest.approx(speed * t - G * t * t / 2, abs=G * t * dt)


@each_method
def test_new_bodies_join_in(method: str) -> None:
    """A grain that comes in later hits one at rest head on: at e = 1 they exchange velocities.

    Compliant rows at their usual substep lose a seventh of the speed, but no momentum.
    """
    scene = grains([[0, 0, 0], [1, 0, 0]], restitution=1.0, friction=0.0, young=1e8)
    simulation = Simulation(scene, **METHODS[method])
    simulation.step(10)
    ids = simulation.insert([[0, 0, 2.1 * RADIUS], [2, 2, 2]], [[0, 0, -1.0], [0, 0.5, 0]])
    assert ids.tolist() == [2, 3] and simulation.ids.tolist() == [0, 1, 2, 3]
    simulation.step(round(1e-3 / METHODS[method]["dt"]))
    loss = 0.15 if method == "compliant" else 2e-3
    assert simulation.velocity == pytest.approx(np.array([[0, 0, -1.0], [0, 0, 0], [0, 0, 0], [0, 0.5, 0]]), abs=loss)
    assert simulation.velocity.sum(axis=0) == pytest.approx([0, 0.5, -1.0], abs=1e-6)
    simulation.remove([3])
    assert simulation.insert([[3, 3, 3.0]]).tolist() == [4], "an id is never given twice"
    assert simulation.ids.tolist() == [0, 1, 2, 4]


def test_many_bodies_come_until_the_arrays_are_full() -> None:
    """Layer after layer above a ball: what follows is what follows from all of them at the start, but for rounding."""
    random = np.random.default_rng(4)
    layers = [
        np.stack([*np.meshgrid(*[np.arange(5) * 2.2 * RADIUS] * 2)], axis=-1).reshape(-1, 2)
        + random.uniform(-0.05, 0.05, (25, 2)) * RADIUS
        for _ in range(6)
    ]
    heights = [(2.2 * k + 1.1) * RADIUS for k in range(6)]
    rows = [np.column_stack([layer, np.full(25, z)]) for layer, z in zip(layers, heights, strict=True)]
    ball = [5 * RADIUS, 5 * RADIUS, -6 * RADIUS]
    given: dict[str, Any] = {"radius": (RADIUS, 5 * RADIUS), "young": 1e8}
    simulation = Simulation(grains([*rows[0], ball], species=[0] * 25 + [1], **given), precision="float64")
    for row in rows[1:]:
        simulation.insert(row)
    all_rows = np.vstack([rows[0], [ball], *rows[1:]])
    whole = Simulation(grains(all_rows, species=[0] * 25 + [1] + [0] * 125, **given), precision="float64")
    for each in (simulation, whole):
        each.velocity = np.outer(each.radii == RADIUS, [0, 0, -1.0])
    assert np.array_equal(simulation.position, whole.position) and np.array_equal(simulation.masses, whole.masses)
    for each in (simulation, whole):
        each.step(2500)
    assert simulation.velocity[25, 2] < -1e-3
    assert simulation.velocity == pytest.approx(whole.velocity, abs=1e-9)


@each_method
def test_a_stream_through_a_sink(method: str) -> None:
    """Drops in free fall from the heights z leave when they pass -0.5 m: after sqrt(2 (z + 0.5) / g)."""
    heights = np.linspace(0, 2, 41)
    position = np.column_stack([0.1 * np.arange(41), np.zeros(41), heights])
    scene = grains(position, radius=0.04, gravity=(0, 0, -G), sinks=(BOTTOM,), young=1e6)
    simulation = Simulation(scene, **{**METHODS[method], "dt": 1e-4})
    passes = np.sqrt(2 * (heights + 0.5) / G)
    for _ in range(17):
        simulation.step(437)
        # the symplectic step of the impulse solver is ahead by up to a step
        early, late = (
            np.count_nonzero(passes < simulation.time - 1.1e-4),
            np.count_nonzero(passes < simulation.time + 1.1e-4),
        )
        gone = 41 - len(simulation.ids)
        assert early <= gone <= late
        assert simulation.ids.tolist() == list(range(gone, 41))
        assert simulation.counters()["left through bottom"] == gone
    assert gone == 41


def test_what_cannot_leave_or_come_is_refused() -> None:
    simulation = Simulation(cloud(), 1e-6)
    with pytest.raises(SolverError, match="there is no body 61; there are 61 bodies"):
        simulation.remove([3, 61])
    simulation.remove([3])
    with pytest.raises(SolverError, match="there is no body 3"):
        simulation.remove(3)
    at = simulation.position[-1] + [0, 0, 1.9 * RADIUS]
    with pytest.raises(SolverError, match=r"particles 61 and 60 would overlap by 10.00% of the smaller radius"):
        simulation.insert([at])
    with pytest.raises(SolverError, match=r"particles 61 and 62 would overlap by 100.00%"):
        simulation.insert([[5, 5, 5], [5, 5, 5 + RADIUS]])
    with pytest.raises(SolverError, match="species: 1 is given; accepted are those of the bodies at the start: 0"):
        simulation.insert([[5, 5, 5]], species=1)
    with pytest.raises(SolverError, match=r"particle 0 has the value nan"):
        simulation.insert([[float("nan"), 5, 5]])
    with pytest.raises(SolverError, match="velocity has 2 rows, position has 1"):
        simulation.insert([[5, 5, 5]], [[0, 0, 0]] * 2)
    with pytest.raises(SolverError, match="radius: accepted are those of the species"):
        simulation.insert([[5, 5, 5]], radius=2 * RADIUS)
    assert len(simulation.ids) == 60


def test_a_body_in_a_wall_is_refused() -> None:
    simulation = Simulation.from_arrays([[0, 0, 1.0]], 0.1, walls=[((0, 0, 0), (0, 0, 1))], dt=1e-4)
    with pytest.raises(SolverError, match=r"particle 1 would overlap wall plane0 by 50.00% of its radius"):
        simulation.insert([[1, 0, 0.05]])


def test_full_lists_refuse_by_name() -> None:
    simulation = Simulation(cloud(), 1e-6, lists="full")
    with pytest.raises(SolverError, match="half lists only"):
        simulation.remove(0)
    with pytest.raises(SolverError, match="full lists cannot do: sinks"):
        Simulation(cloud(sinks=(BOTTOM,)), 1e-6, lists="full")


@each_method
def test_the_motion_of_single_bodies_is_that_in_the_arrays(method: str) -> None:
    """Whatever the order of the bodies in memory; one that is not there is named."""
    simulation = Simulation(cloud(), **METHODS[method], precision="float64")
    simulation.step(300)
    simulation.remove(7)
    position, velocity = simulation.motion([60, 9, 3])
    rows = [59, 8, 3]
    assert (position == simulation.position[rows]).all() and (velocity == simulation.velocity[rows]).all()
    with pytest.raises(SolverError, match="body 7 is gone"):
        simulation.motion([3, 7])


@each_method
def test_a_state_that_was_emptied_can_be_filled_again(method: str) -> None:
    simulation = Simulation(cloud(), **METHODS[method])
    simulation.step(3)
    simulation.remove(simulation.ids)
    assert len(simulation.ids) == 0
    simulation.step(3)
    simulation.insert([[0, 0, 0], [5 * RADIUS, 0, 0]], velocity=[[0, 0, 1], [0, 1, 0]])
    simulation.step(3)
    assert simulation.ids.tolist() == [61, 62]
    assert simulation.velocity == pytest.approx(np.array([[0, 0, 1], [0, 1, 0]]), abs=1e-12)


def test_the_table_is_that_of_the_arrays_in_blocks_and_no_copy_of_all() -> None:
    """Also where bodies have left, and with the order of the sorted arrays another one than that of the ids."""
    n = 20_000
    lattice = np.stack((*np.divmod(np.arange(n), 200), np.zeros(n)), axis=1)
    place = 3 * RADIUS * np.random.default_rng(2).permutation(lattice)
    simulation = Simulation(grains(place, 0.1 * place, 100 * place), 1e-6)
    simulation.step(2)
    simulation.remove(np.arange(0, n, 7))
    tables = list(simulation.table(block=1000))
    assert {len(table) for table in tables[:-1]} == {1000} and 0 < len(tables[-1]) <= 1000
    whole = np.concatenate(tables)
    assert np.array_equal(whole[:, 0], simulation.ids)
    for first, name in ((1, "position"), (4, "velocity"), (7, "angular_velocity")):
        assert np.array_equal(whole[:, first : first + 3], getattr(simulation, name)), name
    tracemalloc.start()
    for _table in simulation.table(block=1000):
        pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 30 * n < whole.nbytes / 2
