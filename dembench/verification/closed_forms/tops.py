"""Torque-free tops (SR9): clumps that turn in empty space, against Euler's equations."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from dembench.results import Result
from dembench.scene import Clump, Scene
from dembench.verification.checks import Experiment, deviation, on_one_scene
from dembench.verification.scenes import MOTION, Body, Kind, every, scene_of

RADIUS = 1e-3
ROD = Clump.dumbbell(RADIUS, 2 * RADIUS)
ELBOW = Clump(
    spheres=((0, 0, 0, RADIUS), (2 * RADIUS, 0, 0, RADIUS), (-2 * RADIUS, 0, 0, RADIUS), (0, 2 * RADIUS, 0, RADIUS))
)
"""Three moments of inertia, all different."""
SPINS = {"rod": (30.0, 0.0, 40.0), "elbow": (0.5, 40.0, 0.2)}
"""Angular velocities at the start [rad/s]; that of the elbow in its principal axes, near that of the middle moment."""
STEP, END, EVERY = 1e-4, 1.0, 5e-3


def _kinds() -> dict[str, Kind]:
    shapes = {"rod": ROD, "elbow": ELBOW}
    return {
        name: Kind(1e6, 2500, float(shape.bounding_radius), friction=0.3, shape=shape) for name, shape in shapes.items()
    }


def _start(name: str) -> np.ndarray:
    """Angular velocity at the start [rad/s], shape (3,)."""
    return np.asarray(ELBOW.solid.axes @ SPINS[name] if name == "elbow" else SPINS[name])


def scene() -> Scene:
    """Both tops, far apart."""
    kinds = _kinds()
    bodies = [Body(name, (20 * RADIUS * k, 0, 0), spin=tuple(_start(name))) for k, name in enumerate(kinds)]
    return scene_of("tops", kinds, bodies, time_step=STEP, times=every(EVERY, END))


def precession(shape: Clump, start: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Angular velocity of a symmetric top [rad/s], shape (t, 3): it turns about the angular momentum with L/I1.

    Args:
        shape: With its axis of symmetry along z at the start.
        start: Angular velocity at the start [rad/s].
        times: [s].
    """
    axes, moments = shape.solid.axes, shape.solid.moments
    tensor = axes @ np.diag(moments) @ axes.T
    momentum = tensor @ start
    about = momentum / tensor[0, 0]
    return np.asarray(Rotation.from_rotvec(np.outer(times, about)).apply(start))


def tumbling(shape: Clump, start: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Angular velocity of a body [rad/s], shape (t, 3): Euler's equations and the quaternion, integrated to 1e-11."""
    axes, moments = shape.solid.axes, shape.solid.moments

    def motion(_: float, state: np.ndarray) -> np.ndarray:
        q, w = state[:4], state[4:]
        spun = 0.5 * np.array(
            [
                q[3] * w[0] + q[1] * w[2] - q[2] * w[1],
                q[3] * w[1] + q[2] * w[0] - q[0] * w[2],
                q[3] * w[2] + q[0] * w[1] - q[1] * w[0],
                -q[:3] @ w,
            ]
        )
        return np.concatenate([spun, np.cross(moments * w, w) / moments])

    initial = np.concatenate([Rotation.from_matrix(axes).as_quat(), axes.T @ start])
    found = solve_ivp(motion, (0, times[-1]), initial, method="DOP853", t_eval=times, rtol=1e-11, atol=1e-11)
    return np.asarray(Rotation.from_quat(found.y[:4].T).apply(found.y[4:].T))


def _measure(result: Result) -> Mapping[str, float]:
    seen = result.snapshots[MOTION]
    exact = (precession(ROD, _start("rod"), seen.time), tumbling(ELBOW, _start("elbow"), seen.time))
    found = [
        float(np.linalg.norm(seen.angular_velocity[:, k] - known, axis=1).max() / np.linalg.norm(known[0]))
        for k, known in enumerate(exact)
    ]
    return {"SR9a": found[0], "SR9b": found[1]}


def experiment() -> Experiment:
    """The experiment."""
    checks = (
        deviation("SR9a", "symmetric top: largest deviation of the spin in 1 s", 1e-3, "precession about L with L/I1"),
        deviation("SR9b", "tumbling top: largest deviation of the spin in 1 s", 0.02, "Euler's equations, integrated"),
    )
    return on_one_scene("tops", "Torque-free tops", scene, _measure, checks, settings={"dt": f"{STEP:g}"})
