"""What a scene does not need has no buffer and no code, and forcing it on changes nothing that can be seen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, grains

from dembench.scene import FORCEABLE, HertzMindlin, Scene, features
from dembench.solver import Simulation, SolverError

GRAVITY = (0.0, 0.0, -9.81)
SOLVERS = {
    "soft": {},
    "full lists": {"lists": "full"},
    "compliant": {"method": "impulse", "rows": "compliant"},
    "rigid": {"method": "impulse", "rows": "rigid"},
}
MEMORIES = ("memory", "wall_memory", "big_memory")
DT = 2e-6


def heap(friction: float = 0.0, **fields: Any) -> Scene:
    """Nine grains that have fallen on each other and the floor within 1000 steps."""
    place = [[0.3 * RADIUS * (k % 2), 0.2 * RADIUS * (k % 3), (1.0 + 2.005 * k) * RADIUS] for k in range(9)]
    speed = [[0.1, 0.0, -0.5]] * 9
    return grains(place, speed, friction=friction, walls=(FLOOR,), gravity=GRAVITY, **fields)


def simulated(scene: Scene, solver: str, steps: int = 1000, **settings: Any) -> Simulation:
    simulation = Simulation(scene, DT, **SOLVERS[solver], **settings)
    simulation.step(steps)
    return simulation


def elements(simulation: Simulation, record: str, names: tuple[str, ...]) -> dict[str, int]:
    """Elements of the arrays of a record; the blank element of device arrays is none."""
    arrays = {name: getattr(getattr(simulation.state, record), name) for name in names}
    return {name: 0 if array.size == 1 else array.size for name, array in arrays.items()}


@pytest.mark.parametrize("solver", ["soft", "full lists", "compliant"])
def test_no_tangential_history_without_friction(solver: str) -> None:
    """Neither beside the listed pairs nor beside the candidates of walls; with friction both are there."""
    smooth, rough = simulated(heap(), solver, 10), simulated(heap(0.3), solver, 10)
    assert set(elements(smooth, "lists", MEMORIES).values()) == {0}
    if solver == "full lists":
        assert set(elements(smooth, "_old", MEMORIES).values()) == {0}
    assert elements(rough, "lists", MEMORIES[:2])["memory"] > 0
    assert elements(rough, "lists", MEMORIES[:2])["wall_memory"] > 0


@pytest.mark.parametrize("solver", list(SOLVERS))
def test_nothing_that_turns_without_rotation(solver: str) -> None:
    """No spins, torques and moments of inertia in the state; forces without torques take half the room."""
    smooth, rough = simulated(heap(), solver, 10), simulated(heap(0.3), solver, 10)
    names = ("spin", "inv_i", "load")
    assert elements(smooth, "bodies", names) == {"spin": 0, "inv_i": 0, "load": 0}
    assert elements(rough, "bodies", ("spin", "inv_i")) == {"spin": 9, "inv_i": 9}
    forces = 9 if solver in ("soft", "full lists") else 0
    assert elements(smooth, "bodies", ("force",))["force"] == forces
    assert elements(rough, "bodies", ("load", "force")) == {"load": forces, "force": 0}
    assert not smooth.angular_velocity.any()


@pytest.mark.parametrize("solver", list(SOLVERS))
def test_radii_are_not_read_per_contact_where_all_are_equal(solver: str) -> None:
    """A run with wrong radii beside the bodies is the same to the bit, but not where radii are forced to be read."""
    scene = heap(0.3)

    def final(wrong: bool, force: tuple[str, ...] = ()) -> np.ndarray:
        simulation = Simulation(scene, DT, **SOLVERS[solver], force=force)
        if wrong:
            bodies = simulation.state.bodies
            rows = bodies.kin.numpy()
            rows[:, 6] *= 1.2
            bodies.kin.assign(rows)
        simulation.step(300)
        return simulation.position

    assert features(scene).polydisperse is False
    assert np.array_equal(final(wrong=True), final(wrong=False))
    assert not np.array_equal(final(wrong=True, force=("polydisperse",)), final(wrong=False))


@pytest.mark.parametrize("solver", ["soft", "compliant", "rigid"])
@pytest.mark.parametrize(
    "feature",
    [
        "friction",
        "rotation",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("periodic", "curved_walls", "moving_geometry")),
    ],
)
def test_a_forced_feature_changes_no_bit(solver: str, feature: str) -> None:
    """It acts on nothing: friction is 0, the box is open, no wall is round or moves.

    But for friction in compliant rows: the torque of an impulse along the normal is 0 to rounding only.
    """
    scene = heap()
    bare, forced = simulated(scene, solver, 400), simulated(scene, solver, 400, force=(feature,))
    if (solver, feature) == ("compliant", "friction"):
        assert forced.position == pytest.approx(bare.position, abs=1e-9 * RADIUS)
    else:
        assert np.array_equal(bare.position, forced.position)
        assert np.array_equal(bare.velocity, forced.velocity)
        assert not forced.angular_velocity.any()
    if feature in ("friction", "rotation"):
        assert forced.counters()["bytes of all arrays"] > bare.counters()["bytes of all arrays"]


def test_pairs_that_are_scaled_body_by_body_differ_in_the_last_digits() -> None:
    """Their constants are scaled in single precision: equal to a millionth of a radius after a fall."""
    bare, forced = simulated(heap(), "soft", 200), simulated(heap(), "soft", 200, force=("polydisperse",))
    assert forced.position == pytest.approx(bare.position, abs=1e-6 * RADIUS)


def test_forcing_can_only_add() -> None:
    scene = heap(0.3)
    present = features(scene)
    assert set(present.forced(FORCEABLE).names()) >= set(present.names()) | set(FORCEABLE)
    assert present.forced(()) == present
    with pytest.raises(SolverError, match="force: 'gravity' cannot be forced; accepted are friction, "):
        Simulation(scene, DT, force=("gravity",))


def test_what_needs_rotation_is_refused_without_it() -> None:
    """A spin that no contact would see is named, and taken where rotation is forced."""
    simulation = Simulation(heap(), DT)
    for name, change in (
        ("angular_velocity", lambda s: setattr(s, "angular_velocity", np.ones((9, 3)))),
        ("torque", lambda s: s.set_torque(np.ones((9, 3)))),
        ("angular_velocity", lambda s: s.insert([[1.0, 0, 1.0]], angular_velocity=[[0, 0, 1.0]])),
    ):
        with pytest.raises(SolverError, match=f"{name}: the scene has no rotation"):
            change(simulation)
        change(Simulation(heap(), DT, force=("rotation",)))
    own = heap()
    by_body = own.model_copy(update={"bodies": own.bodies.model_copy(update={"radius": own.radii()})})
    with pytest.raises(SolverError, match=r"radius: .* is given; accepted is .*, which all bodies have"):
        Simulation(by_body, DT).insert([[1.0, 0, 1.0]], radius=2 * RADIUS)
    assert Simulation(by_body, DT, force=("polydisperse",)).insert([[1.0, 0, 1.0]], radius=2 * RADIUS) == [9]


@pytest.mark.parametrize("restitution", [0.3, 0.9])
def test_a_smooth_contact_knows_no_tangential_dashpot_where_friction_is_compiled_in(restitution: float) -> None:
    """Oblique impact with compliant rows: without friction the tangential velocity stays to the last bit."""
    simulation = Simulation.from_arrays(
        [[0.0, 0.0, 1.1 * RADIUS]],
        RADIUS,
        velocity=[[1.0, 0.0, -1.0]],
        walls=[((0, 0, 0), (0, 0, 1))],
        gravity=(0, 0, 0),
        restitution=restitution,
        law=HertzMindlin(),
        method="impulse",
        rows="compliant",
        force=("friction",),
        dt=1e-5,
    )
    simulation.step(300)
    assert simulation.velocity[0, 2] == pytest.approx(restitution, abs=0.01)
    assert simulation.velocity[0, 0] == 1.0 and not simulation.angular_velocity.any()
