"""Walls given by a signed distance on a grid, against the analytic walls; D40 of the verification catalogue."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grains import RADIUS, grains
from numpy.typing import ArrayLike
from walling import distances

from dembench.scene import Cylinder, Scene, Sdf
from dembench.solver import Simulation

GRAVITY = (0, 0, -9.81)
BOWL = 16 * RADIUS


def plane(point: ArrayLike, normal: ArrayLike) -> Any:
    """Signed-distance function of a plane."""
    direction = np.array(normal) / np.linalg.norm(normal)
    return lambda x: (x - np.array(point)) @ direction


def sdf(function: Any, lower: ArrayLike, upper: ArrayLike, spacing: float, **fields: Any) -> Sdf:
    return Sdf.from_function(
        name="grid",
        material="grain",
        function=function,
        lower=tuple(np.array(lower, float)),
        upper=tuple(np.array(upper, float)),
        spacing=spacing,
        **fields,
    )


def tube(cells: int) -> Sdf:
    """A horizontal cylinder along y as a grid, with a number of cells per radius."""
    edge = BOWL / cells
    return sdf(
        lambda x: BOWL - np.hypot(x[:, 0], x[:, 2]),
        (-BOWL - edge, -2 * edge, -BOWL - edge),
        (BOWL, 2 * edge, BOWL),
        edge,
    )


def descent(wall: Any, dt: float = 2e-5, angle: float = 0.5, **settings: Any) -> tuple[float, float]:
    """Time to the lowest point [s] of a grain that rolls down from an angle, and its speed there [m/s]."""
    swing = BOWL - RADIUS
    start = [[swing * np.sin(angle), 0, -swing * np.cos(angle)]]
    simulation = Simulation(rolling(start, wall), dt, **settings)
    for _ in range(4000):
        x = simulation.position[0, 0]
        simulation.step(5)
        if simulation.position[0, 0] <= 0:
            now = simulation.position[0, 0]
            return simulation.time - 5 * dt * now / (now - x), float(np.linalg.norm(simulation.velocity[0]))
    raise AssertionError("the grain does not arrive")


def rolling(position: Any, wall: Any) -> Scene:
    return grains(position, walls=(wall,), gravity=GRAVITY, friction=0.8, restitution=0.5, young=2e6)


TUBE = Cylinder(name="tube", material="grain", start=(0, -1, 0), end=(0, 1, 0), radius=BOWL)


@pytest.mark.parametrize("settings", [{}, {"method": "impulse"}], ids=["soft-sphere", "impulse"])
def test_d40_a_grain_rolls_down_a_grid_as_down_the_cylinder(settings: dict[str, Any]) -> None:
    """64 cells per radius: time and speed at the bottom within 1 % of those on the mantle of revolution."""
    time, speed = descent(TUBE, **settings)
    # rolling without slip: the speed of a fall over the height, times sqrt(5/7)
    fall = (BOWL - RADIUS) * (1 - np.cos(0.5))
    assert speed == pytest.approx(np.sqrt(10 / 7 * 9.81 * fall), rel=5e-3)
    assert descent(tube(64), **settings) == pytest.approx((time, speed), rel=0.01)


def test_d40_distance_and_normal_of_a_grid_are_of_second_order() -> None:
    """Half the distance of the nodes, a quarter of the errors; the normal is within 0.5 degrees at 16 cells already."""
    random = np.random.default_rng(3)
    angle, reach = random.uniform(0, 2 * np.pi, 2000), BOWL - random.uniform(0.5, 1, 2000) * RADIUS
    inwards = -np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    errors = []
    for cells in (16, 32, 64):
        d, n = distances([tube(cells)], -reach[:, None] * inwards)
        errors.append((np.abs(d[:, 0] - (BOWL - reach)).max(), np.linalg.norm(n[:, 0] - inwards, axis=1).max()))
    errors = np.array(errors)
    assert errors[:-1] / errors[1:] == pytest.approx(np.full((2, 2), 4.0), rel=0.2)
    assert errors[0, 1] < np.radians(0.5)


def test_where_the_distances_from_all_sides_are_equal_there_is_no_normal() -> None:
    d, n = distances([tube(16)], [[0, 0, 0]])
    assert d[0, 0] == pytest.approx(BOWL) and not n.any()
