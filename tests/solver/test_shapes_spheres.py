"""Spheres told as shapes: a clump of one sphere, and a ball given by its signed distance."""

import numpy as np
import pytest
from shaped import run, shaped

from dembench.scene import Clump, Grain

RADIUS = 5e-3
STEP = {"soft-sphere": 4e-6, "impulse": 1e-4}
FINE = {"soft-sphere": 4e-6, "impulse": 5e-6}
ONE = Clump(spheres=((0.0, 0.0, 0.0, RADIUS),))
BALL = Grain.from_function(
    lambda x: np.linalg.norm(x, axis=-1) - RADIUS, (-2.2 * RADIUS,) * 3, (2.2 * RADIUS,) * 3, RADIUS / 16
)
MOTIONS = {
    "drop": ({"position": [(0, 0, RADIUS + 5e-3)]}, 0.06),
    "oblique": ({"position": [(0, 0, RADIUS + 1e-3)], "velocity": [(0.5, 0, -0.5)], "spin": [(0, -20, 9)]}, 0.02),
    "rolling": ({"position": [(0, 0, RADIUS)], "velocity": [(0.3, 0.1, 0)]}, 0.12),
}


def state(sim):
    """Place, velocity and surface speed [m, m/s, m/s], shape (n, 9)."""
    return np.hstack([sim.position, sim.velocity, RADIUS * sim.angular_velocity])


@pytest.mark.parametrize("method", list(STEP))
@pytest.mark.parametrize("motion", list(MOTIONS))
def test_one_sphere_in_a_clump_is_a_sphere(motion, method):
    """The sphere solvers and the shape solvers make the same motion, to 1e-4 of its speed.

    Levers of impulses end in the middle of the gap, v dt/2 beyond the sphere at most, so that angular momentum is kept.
    """
    fields, time = MOTIONS[motion]
    found = [
        state(run(shaped([s], **fields, restitution=0.8), time, method, FINE[method], precision="float64", **rows))
        for s, rows in ((RADIUS, {"rows": "rigid"}), (ONE, {}))
    ]
    assert found[1] == pytest.approx(found[0], abs=1e-4 * 0.5)


def test_tangential_restitution_turns_the_slip_around():
    """Walton: in the sticking regime the surface leaves with -beta of its slip, as that of a sphere does."""
    fields, time = MOTIONS["oblique"]
    scene = shaped([ONE], **{**fields, "velocity": [(0.1, 0, -0.5)]}, restitution=0.8)
    laws = tuple(law.model_copy(update={"tangential_restitution": 0.5}) for law in scene.pair_laws)
    sim = run(scene.model_copy(update={"pair_laws": laws}), time, "impulse", FINE["impulse"])
    slip = sim.velocity[0, 0] - RADIUS * sim.angular_velocity[0, 1]
    assert slip == pytest.approx(-0.5 * (0.1 + 20 * RADIUS), rel=0.01)


@pytest.mark.parametrize("method", list(STEP))
def test_two_spheres_in_clumps_collide_as_spheres(method):
    """Off centre, with friction and spins."""
    fields = {
        "position": [(0, 0, 0), (2.2 * RADIUS, 0.6 * RADIUS, 0)],
        "velocity": [(0.5, 0, 0), (-0.5, 0, 0.1)],
        "spin": [(0, 0, 30), (10, 0, 0)],
        "species": [0, 0],
        "floor": None,
        "restitution": 0.8,
    }
    found = [
        state(run(shaped([s], **fields), 0.01, method, FINE[method], precision="float64", **rows))
        for s, rows in ((RADIUS, {"rows": "rigid"}), (ONE, {}))
    ]
    assert found[1] == pytest.approx(found[0], abs=1e-4 * 0.5)


@pytest.mark.parametrize("method", list(STEP))
@pytest.mark.parametrize("motion", list(MOTIONS))
def test_ball_on_a_grid_is_a_sphere(motion, method):
    """Within 1 % of its speed, also 5/7 of it when it rolls; the grid gives the moment of inertia to 0.2 %."""
    fields, time = MOTIONS[motion]
    sphere, ball = (
        state(run(shaped([s], **fields, restitution=0.8), time, method, STEP[method]))[0] for s in (ONE, BALL)
    )
    scale = np.linalg.norm(fields.get("velocity", [(0, 0, 0.3)])[0])
    assert ball[3:] == pytest.approx(sphere[3:], abs=0.01 * scale)
    assert ball[:3] == pytest.approx(sphere[:3], abs=0.01 * scale * time)
    if motion == "rolling":
        assert ball[3:5] == pytest.approx([5 / 7 * 0.3, 5 / 7 * 0.1], rel=0.01)


@pytest.mark.parametrize("method", list(STEP))
def test_two_balls_on_grids_collide_as_spheres(method):
    """Each probe is a sphere as large as the ball, looked up in the field of the other a radius off its surface."""
    fields = {
        "position": [(0, 0, 0), (2.2 * RADIUS, 0.6 * RADIUS, 0)],
        "velocity": [(0.5, 0, 0), (-0.5, 0, 0)],
        "species": [0, 0],
        "floor": None,
        "restitution": 0.8,
    }
    sphere, ball = (state(run(shaped([s], **fields), 0.02, method, STEP[method] / 4)) for s in (ONE, BALL))
    assert ball[:, 3:] == pytest.approx(sphere[:, 3:], abs=0.01)
