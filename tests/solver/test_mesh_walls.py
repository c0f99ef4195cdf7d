"""Walls of triangles: one contact per face, edge or vertex that is the nearest; W9 and D22 of the catalogue."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from grains import FLOOR, RADIUS, grains
from numpy.typing import ArrayLike
from walling import distances

from dembench.scene import Cylinder, Mesh, Motion
from dembench.scene.mesh import closest_points
from dembench.solver import Simulation

RANDOM = np.random.default_rng(11)


def mesh(triangles: ArrayLike, **fields: Any) -> Mesh:
    return Mesh(name="mesh", material="grain", triangles=triangles, **fields)


def patch(x: ArrayLike, y: ArrayLike, height: Any = lambda x, y: 0 * x) -> np.ndarray:
    """Triangles over the rectangles between the values of x and y, whose corners lie at height(x, y)."""
    found = []
    for x0, x1 in pairwise(np.asarray(x, float)):
        for y0, y1 in pairwise(np.asarray(y, float)):
            a, b, c, d = ([u, v, height(u, v)] for u, v in ((x0, y0), (x1, y0), (x1, y1), (x0, y1)))
            found += [[a, b, c], [a, c, d]]
    return np.array(found)


def nearest(triangles: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the nearest point of the triangles and the direction away from it."""
    offsets = np.array([points - closest_points(points, t) for t in triangles])
    distance = np.linalg.norm(offsets, axis=2)
    best = distance.argmin(axis=0), np.arange(len(points))
    return distance[best], offsets[best] / distance[best][:, None]


def tetrahedron() -> np.ndarray:
    corners = np.array([[0, 0, 0], [1, 0, 0.1], [0.2, 0.9, 0], [0.3, 0.2, 1.1]]) * 3 * RADIUS
    return corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]]


SURFACES = {
    "flat": patch(np.linspace(-3, 3, 7) * RADIUS, np.linspace(-3, 3, 5) * RADIUS),
    "tetrahedron": tetrahedron(),
    "saddle": patch(*[np.linspace(-2, 2, 6) * RADIUS] * 2, lambda x, y: (x * x - y * y) / (3 * RADIUS)),
    "waves": patch(
        np.linspace(-3, 3, 13) * RADIUS, np.linspace(-1, 1, 3) * RADIUS, lambda x, y: RADIUS * np.sin(3 * x / RADIUS)
    ),
    "one triangle": np.array([[[0, 0, 0], [1, 0, 0], [0.2, 0.7, 0.1]]]) * RADIUS,
}


@pytest.mark.parametrize("name", list(SURFACES))
def test_the_nearest_of_all_parts_is_the_nearest_point_of_the_mesh(name: str) -> None:
    """Everywhere, from both sides, far away and in the regular places where regions meet."""
    triangles = SURFACES[name]
    low, high = triangles.min(axis=(0, 1)) - 2 * RADIUS, triangles.max(axis=(0, 1)) + 2 * RADIUS
    points = RANDOM.uniform(low, high, (3000, 3))
    corners, up = triangles.reshape(-1, 3), np.array([0, 0, 0.7 * RADIUS])
    points = np.vstack([points, corners + up, triangles.mean(axis=1) - up])
    d, n = distances([mesh(triangles)], points)
    best = d.argmin(axis=1)
    expected, direction = nearest(triangles, points)
    rows = np.arange(len(points))
    assert d[rows, best] == pytest.approx(expected, abs=1e-9 * RADIUS)
    clear = np.sort(d, axis=1)
    alone = (clear[:, 1] - clear[:, 0] > 1e-6 * RADIUS) & (expected > 1e-3 * RADIUS)
    assert alone.mean() > 0.9 or name == "tetrahedron"
    assert n[rows, best][alone] == pytest.approx(direction[alone], abs=1e-6)


def test_w9_every_contact_is_a_local_minimum_of_the_distance() -> None:
    """One contact above a flat mesh, wherever the point is; one around a convex edge, two in a concave fold."""
    flat = patch(np.linspace(-4, 4, 9) * RADIUS, np.linspace(-4, 4, 9) * RADIUS)
    above = RANDOM.uniform(-4, 4, (3000, 3)) * RADIUS
    above[:, 2] = 0.9 * RADIUS
    regular = np.stack(np.meshgrid(*[np.linspace(-3.5, 3.5, 15) * RADIUS] * 2, [0.9 * RADIUS]), axis=-1).reshape(-1, 3)
    for turn in (np.eye(3), rotation([1, 2, 3], 0.7)):
        d, _n = distances([mesh(flat @ turn.T)], np.vstack([above, regular]) @ turn.T)
        assert ((d < RADIUS).sum(axis=1) == 1).all()
    ridge = patch(np.linspace(-4, 4, 9) * RADIUS, np.linspace(-4, 4, 9) * RADIUS, lambda x, y: -np.abs(x))
    along = np.stack([0.1 * RANDOM.uniform(-1, 1, 500), RANDOM.uniform(-3.9, 3.9, 500), np.full(500, 0.9)], axis=1)
    d, n = distances([mesh(ridge)], along * RADIUS)
    assert ((d < RADIUS).sum(axis=1) == 1).all()
    d, n = distances([mesh(ridge)], along * RADIUS * [1, 1, -1.3])
    touching = d < RADIUS
    assert (touching.sum(axis=1) == 2).all()
    assert np.abs(n[touching][:, 0]) == pytest.approx(np.full(1000, np.sqrt(0.5)))


def rotation(axis: ArrayLike, angle: float) -> np.ndarray:
    """Matrix of a rotation (Rodrigues)."""
    u = np.array(axis, float) / np.linalg.norm(axis)
    cross = np.cross(np.eye(3), u)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def test_a_mesh_is_looked_up_where_its_motion_has_taken_it() -> None:
    """Turned about a centre and shifted: distances to the moved mesh are those to the mesh before, moved back."""
    motion = Motion(velocity=(0.1, -0.2, 0.05), angular_velocity=(3.0, 1.0, 2.0), centre=(0.002, 0.001, 0))
    triangles, t = tetrahedron(), 0.3
    points = RANDOM.uniform(-5, 5, (500, 3)) * RADIUS
    turn, centre = (
        rotation(motion.angular_velocity, t * np.linalg.norm(motion.angular_velocity)),
        np.array(motion.centre),
    )
    moved = centre + np.array(motion.velocity) * t + (points - centre) @ turn.T
    before, normal = distances([mesh(triangles)], points)
    after, turned = distances([mesh(triangles, motion=motion)], moved, time=t)
    assert after == pytest.approx(before, abs=1e-9 * RADIUS)
    assert turned == pytest.approx(normal @ turn.T, abs=1e-9)


def test_a_mesh_of_a_cylinder_converges_to_it() -> None:
    """The polygon lies within R (1 - cos(pi/n)) of the circle: distances differ by at most that."""
    tube = Cylinder(name="tube", material="grain", start=(0, 0, -0.01), end=(0, 0, 0.01), radius=0.02)
    angle = RANDOM.uniform(0, 2 * np.pi, 400)
    points = 0.0193 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    for segments in (50, 100, 200):
        d, _n = distances([mesh(tube.triangulate(segments))], points)
        sag = 0.02 * (1 - np.cos(np.pi / segments))
        error = np.abs(d.min(axis=1) - 0.0007)
        assert 0.5 * sag < error.max() < 1.001 * sag


DRIVERS: dict[str, dict[str, Any]] = {
    "half": {},
    "full": {"lists": "full"},
    "rigid": {"method": "impulse", "rows": "rigid"},
    "compliant": {"method": "impulse", "rows": "compliant"},
}


@pytest.mark.parametrize("driver", list(DRIVERS))
def test_a_grain_that_rolls_over_a_mesh_moves_as_on_the_plane(driver: str) -> None:
    """From face to face over edges and vertices: the contact and its shear go on, so only rounding differs."""
    floor = patch(np.linspace(-10, 10, 21) * 0.7 * RADIUS, np.linspace(-6, 6, 13) * 0.7 * RADIUS)
    found = []
    for wall in (mesh(floor), FLOOR):
        scene = grains(
            [[0, 0, 0.999 * RADIUS], [-4.2 * RADIUS, 0.7 * RADIUS, 1.2 * RADIUS]],
            [[0.2, 0.05, 0], [0.3, 0, 0]],
            [[0, 0, 0], [100, -50, 20]],
            walls=(wall,),
            gravity=(0, 0, -9.81),
            friction=0.5,
        )
        simulation = Simulation(scene, 4e-6, precision="float64", **DRIVERS[driver])
        simulation.step(5000)
        found.append(np.hstack([simulation.position / RADIUS, simulation.velocity]))
    assert found[0] == pytest.approx(found[1], abs=1e-6)
    assert np.abs(found[0][:, 0] - [0, -4.2]).min() > 2


@pytest.mark.parametrize("driver", ["half", "rigid", "compliant"])
def test_a_large_ball_and_small_grains_on_a_mesh_are_where_they_are_on_the_plane(driver: str) -> None:
    """The ball outruns the skin of the grains, over a mesh finer than itself."""
    floor = patch(np.linspace(-30, 60, 31) * RADIUS, np.linspace(-30, 30, 21) * RADIUS)
    found = []
    for wall in (mesh(floor), FLOOR):
        small = [[k * 3 * RADIUS - 20 * RADIUS, -20 * RADIUS, 1.1 * RADIUS] for k in range(5)]
        scene = grains(
            [*small, [0, 0, 10.5 * RADIUS]],
            [*[[0, 0, 0]] * 5, [2.0, 0.3, -1.0]],
            walls=(wall,),
            gravity=(0, 0, -9.81),
            radius=(RADIUS, 10 * RADIUS),
            species=[0] * 5 + [1],
        )
        simulation = Simulation(scene, 4e-6, precision="float64", **DRIVERS[driver])
        simulation.step(2500)
        found.append(np.hstack([simulation.position / RADIUS, simulation.velocity]))
    assert found[0] == pytest.approx(found[1], abs=1e-6)
    assert found[0][5, 0] > 10
