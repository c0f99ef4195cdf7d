"""A scene from arrays: what a script gives arrives in the scene, and what cannot be is refused by name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dembench.scene import HertzMindlin, Plane, Rigid, scene_from_arrays

THREE = [[0, 0, 1.0], [0, 0, 4.0], [0, 0, 9.0]]


def test_numbers_serve_all_bodies() -> None:
    scene = scene_from_arrays(THREE, 0.5, density=2000, restitution=0.4, friction=0.2)
    assert scene.law == Rigid() and scene.bodies.radius is None
    assert np.array_equal(scene.radii(), [0.5] * 3)
    assert scene.masses() == pytest.approx([2000 * np.pi / 6] * 3)
    law = scene.pair_law("grain", "grain")
    assert (law.restitution, law.friction) == (0.4, 0.2)
    assert not scene.bodies.velocity.any() and scene.gravity == (0, 0, -9.81)


def test_radii_and_masses_of_each_body() -> None:
    scene = scene_from_arrays(THREE, [0.5, 1.0, 1.0], mass=[1.0, 2.0, 7.0], restitution=0.5)
    assert np.array_equal(scene.radii(), [0.5, 1.0, 1.0])
    assert scene.masses() == pytest.approx([1.0, 2.0, 7.0], rel=1e-14)
    # one material of three densities: every pair keeps the law of the one
    assert {law.restitution for law in scene.pair_laws} == {0.5} and len(scene.pair_laws) == 6


def test_materials_by_index_with_a_table_of_pairs() -> None:
    scene = scene_from_arrays(
        THREE,
        0.5,
        material=[0, 1, 0],
        materials=("glass", "steel", "wood"),
        density=(2500, 7800, 700),
        mass=None,
        law=HertzMindlin(),
        young=(7e10, 2e11, 1e10),
        restitution=0.9,
        pairs={("steel", "glass"): {"restitution": 0.7}, ("glass", "wood"): {"friction": 0.6}},
        walls=[Plane(name="floor", material="wood", point=(0, 0, 0), normal=(0, 0, 1)), ((0, 0, 10), (0, 0, -1))],
    )
    assert scene.densities().tolist() == [2500, 7800, 2500]
    assert scene.pair_law("glass", "steel").restitution == 0.7
    assert scene.pair_law("glass", "wood").friction == 0.6 and scene.pair_law("glass", "wood").restitution == 0.9
    assert [w.material for w in scene.walls] == ["wood", "glass"]
    assert scene.material("steel").young == 2e11


def test_bodies_that_are_held() -> None:
    scene = scene_from_arrays(THREE, 0.5, fixed=[0], rotation_locked=np.array([1, 2]))
    assert [(c.kind, c.bodies) for c in scene.constraints] == [("fixed", (0,)), ("rotation-locked", (1, 2))]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": [1.0, 2.0]}, r"radius: expected a number or shape \(3,\), got \(2,\)"),
        ({"mass": [1, float("nan"), 1]}, "mass: particle 1 has the value nan"),
        ({"material": 3}, "material: 3 to 3 are given; accepted are 0 to 0"),
        ({"young": (1e7, 2e7)}, r"young: expected a number or one per material \(1\)"),
        ({"pairs": {("grain", "floor"): {"friction": 0.1}}}, "floor-grain is no pair of the materials grain"),
        ({"velocity": [[0, 0, 1.0]]}, "velocity has 1 rows, position has 3"),
        ({"restitution": 1.5}, "restitution"),
    ],
)
def test_what_cannot_be_is_refused_by_name(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        scene_from_arrays(THREE, **{"radius": 0.5, **change})


def test_too_many_densities_are_refused() -> None:
    with pytest.raises(ValueError, match="65 densities of material grain; accepted are up to 64"):
        scene_from_arrays(np.arange(195.0).reshape(65, 3), 0.1, mass=np.arange(1, 66))
