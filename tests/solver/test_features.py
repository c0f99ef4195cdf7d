"""Only what a scene needs is compiled, and what the solvers cannot do is named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, grains

from dembench.scene import (
    Cylinder,
    Motion,
    PairLaw,
    Rigid,
    Scene,
)
from dembench.solver import Simulation, SolverError
from dembench.solver.impulse import stepper as impulse
from dembench.solver.pairs import ONE, RADII, TABLE
from dembench.solver.soft import step_options, unsupported
from dembench.solver.state import State
from dembench.solver.units import scene_units


def options(scene: Scene, threads: int = 1, midpoint: bool = False) -> Any:
    return step_options(scene, State(scene, scene_units(scene), "float32", threads), "float32", midpoint)


POSITION = [[0, 0, RADIUS], [0, 0, 4 * RADIUS]]


def test_a_scene_without_friction_has_no_tangential_part() -> None:
    scene = grains(POSITION, friction=0.0)
    bare = options(scene)
    assert not bare.law.friction and not bare.rotation and not bare.walls.present and not bare.bigs and not bare.threads
    full = options(grains(POSITION, friction=0.1))
    assert full.law.friction and full.rotation


def test_a_frictionless_scene_with_a_spin_keeps_it() -> None:
    spin = [[0, 100, 0], [100, 0, 0]]
    scene = grains(POSITION, [[0, 0, 1.0], [0, 0, -1.0]], spin, friction=0.0)
    assert options(scene).rotation and not options(scene).law.friction
    simulation = Simulation(scene, 1e-6)
    simulation.step(1500)
    assert simulation.velocity[1, 2] > 0.2
    assert simulation.angular_velocity == pytest.approx(np.array(spin), abs=1e-4)


def test_the_law_and_the_step_are_those_that_were_asked_for() -> None:
    scene = grains(POSITION, variant="rescaled")
    assert options(scene, midpoint=True).law.midpoint and options(scene).law.rescaled
    assert not options(grains(POSITION)).law.rescaled and not options(grains(POSITION)).law.midpoint


def test_walls_are_compiled_by_kind() -> None:
    def kinds(*walls: Any) -> tuple[bool, bool, bool, bool]:
        found = options(grains(POSITION, walls=walls)).walls
        return found.present, found.curved, found.moving, found.timed

    tube = Cylinder(name="tube", material="grain", start=(0, 0, 0), end=(0, 0, 1), radius=0.1)
    belt = FLOOR.model_copy(update={"motion": Motion(velocity=(1.0, 0, 0))})
    lift = FLOOR.model_copy(update={"motion": Motion(velocity=(0, 0, 1.0))})
    assert kinds() == (False, False, False, False)
    assert kinds(FLOOR) == (True, False, False, False)
    assert kinds(FLOOR, tube) == (True, True, False, False)
    assert kinds(belt) == (True, False, True, False)
    assert kinds(lift) == (True, False, True, True)


def test_pair_constants_are_looked_up_the_cheapest_way_that_is_exact() -> None:
    assert options(grains(POSITION)).pairs == ONE
    two = grains(POSITION, radius=(RADIUS, 1.5 * RADIUS), species=[0, 1])
    assert options(two).pairs == TABLE
    own = grains(POSITION)
    bodies = own.bodies.model_copy(update={"radius": own.radii() * 1.01})
    assert options(own.model_copy(update={"bodies": bodies})).pairs == RADII


def test_a_large_body_and_threads_are_seen() -> None:
    many = [[3 * RADIUS * k, 0, 0] for k in range(200)]
    scene = grains([*many, [0, 0, 1]], radius=(RADIUS, 0.1), species=[0] * 200 + [1])
    found = options(scene, threads=2)
    assert found.bigs and found.threads
    assert not options(grains(many), threads=1).bigs and not options(grains(many)).threads


LAW = {"a": "grain", "b": "grain", "restitution": 0.5, "friction": 0.3}
BOTH = ["soft-sphere", "impulse"]
MISSING = {
    "rolling friction": (["impulse"], {"pair_laws": (PairLaw(**LAW, rolling_friction=0.1),)}),
    "contact law rigid": (["soft-sphere"], {"law": Rigid()}),
}


@pytest.mark.parametrize("text", list(MISSING))
def test_what_a_solver_cannot_do_is_named(text: str) -> None:
    methods, fields = MISSING[text]
    scene = grains(POSITION, **fields)
    lists = {"soft-sphere": unsupported(scene), "impulse": impulse.unsupported(scene)}
    assert {m: text in found for m, found in lists.items()} == {m: m in methods for m in lists}
    for method in methods:
        with pytest.raises(SolverError, match=f"the {method} solver cannot do: .*{text}"):
            Simulation(scene, method=method)


def test_an_unknown_method_is_refused_with_those_known() -> None:
    with pytest.raises(SolverError, match="method 'magic' is not known; accepted are soft-sphere, impulse"):
        Simulation(grains(POSITION), method="magic")


@pytest.mark.parametrize("method", BOTH)
@pytest.mark.parametrize("n", [0, 1])
def test_scenes_of_no_and_of_one_grain_run(n: int, method: str) -> None:
    scene = grains(POSITION[:n], walls=(FLOOR,), gravity=(0, 0, -9.81))
    simulation = Simulation(scene, 1e-5, method=method)
    simulation.step(10)
    assert simulation.position.shape == (n, 3)
    assert simulation.time == pytest.approx(1e-4)
