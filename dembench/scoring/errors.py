"""Errors of what is deterministic: numbers with a closed form, and paths before they diverge.

Chaotic bulk has errors of its own (`ensembles.py`, `cycles.py`); the kinds are never put on one axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dembench.scene import Bodies, Scene

SHIFT = 1e-12
"""Distance between the starts of the two runs that tell the divergence horizon, in diameters [-]."""
DIVERGED = 1e-2
"""Distance, in diameters, at which two such runs have nothing to do with each other any more [-]."""


def relative(measured: float, exact: float, scale: float) -> float:
    """Error of a number with a closed form: |measured - exact| / scale [-]; not a number where nothing was measured.

    Args:
        measured, exact: The number and its closed form, in one unit.
        scale: What an error of one is, in that unit, fixed before anything is measured: never the number itself where
            it may be near zero.

    Raises:
        ValueError: The scale is not positive.
    """
    if not scale > 0:
        raise ValueError(f"scale is {scale:g}; a positive one is needed, such as the size of the exact value")
    return abs(measured - exact) / scale


def shifted(scene: Scene, diameters: float = SHIFT) -> Scene:
    """The scene with every body moved along x by so many diameters of its own, the second one of a pair of runs.

    Neighbours move to opposite sides: a shift of all together would change nothing in a scene without walls.
    """
    bodies, sides = scene.bodies, np.where(np.arange(len(scene.bodies)) % 2, -1.0, 1.0)
    position = np.array(bodies.position)
    position[:, 0] += sides * diameters * 2 * scene.radii()
    return scene.model_copy(update={"bodies": Bodies(**{**bodies.arrays(), "position": position})})


def apart(one: np.ndarray, other: np.ndarray, diameter: np.ndarray | float) -> np.ndarray:
    """Largest distance of the same body in two runs, in diameters, at every time [-], shape (t,).

    Args:
        one, other: Positions [m], shape (t, n, 3); a body that has left is not a number and is left out.
        diameter: Of each body, or of all [m].

    Raises:
        ValueError: The shapes differ.
    """
    if one.shape != other.shape:
        raise ValueError(
            f"positions have the shapes {one.shape} and {other.shape}; the same times and bodies are needed"
        )
    distance = np.linalg.norm(one - other, axis=2) / diameter
    return np.where(np.isnan(distance), 0.0, distance).max(axis=1, initial=0.0)


def horizon(
    time: np.ndarray, one: np.ndarray, other: np.ndarray, diameter: np.ndarray | float, limit: float = DIVERGED
) -> float:
    """Time from which on two runs that started `SHIFT` diameters apart are further apart than `limit` diameters [s].

    Beyond this Lyapunov horizon a path says nothing about the accuracy of a code. Infinite where it is not reached.

    Args:
        time: Times [s], shape (t,).
        one, other, diameter: See `apart`.
        limit: Distance in diameters [-].
    """
    beyond = apart(one, other, diameter) > limit
    return float(time[int(np.argmax(beyond))]) if beyond.any() else np.inf


@dataclass(frozen=True)
class PathError:
    """How far paths are from those of a converged run.

    Attributes:
        rms: Root mean square over bodies and times, in diameters [-].
        largest: Largest distance, in diameters [-].
        until: Last time that was compared [s].
    """

    rms: float
    largest: float
    until: float


def trajectory(
    time: np.ndarray,
    position: np.ndarray,
    reference: np.ndarray,
    diameter: np.ndarray | float,
    until: float = np.inf,
) -> PathError:
    """Error of paths against those of a converged run, up to the divergence horizon.

    Args:
        time: Times of both [s], shape (t,).
        position, reference: Positions [m], shape (t, n, 3); bodies that have left either run are left out.
        diameter: Of each body, shape (n,), or of all [m].
        until: The horizon [s]; see `horizon`.

    Raises:
        ValueError: The shapes differ, or the horizon lies before the first time.
    """
    if position.shape != reference.shape:
        raise ValueError(f"positions have the shapes {position.shape} and {reference.shape}; they must be the same")
    kept = time <= until
    if not kept.any():
        raise ValueError(f"the paths diverge at {until:g} s, before the first time {time[0]:g} s")
    distance = np.linalg.norm(position[kept] - reference[kept], axis=2) / diameter
    return PathError(float(np.sqrt(np.nanmean(distance**2))), float(np.nanmax(distance)), float(time[kept][-1]))
