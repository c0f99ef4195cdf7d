"""What one snapshot of a drum tells: mixture, free surface, and how the wall takes the grains along."""

from __future__ import annotations

import numpy as np

from dembench.cases.publication import published
from dembench.scene import Scene

CELL = 8.0
"""Edge of a sample cell of the Lacey index in radii of the largest grains [-]."""
LEAST_GRAINS = 10
"""Smallest number of grains in a sample [-]."""
LAYER = 1.2
"""Distance from the wall, in radii, up to which a grain's centre makes it one of the wall layer [-]."""
COLUMNS = 20
STRETCH = 0.5
"""Middle part of the drum's radius over which the free surface is fitted [-]."""


def lacey_index(scene: Scene, position: np.ndarray) -> float:
    """Lacey's index of mixing of the first two species, by volume: 0 apart, 1 mixed at random [-].

    M = (s0^2 - s^2) / (s0^2 - sr^2), with s^2 the variance of the volume fraction over cubic samples, weighted by
    their volume, s0^2 = p (1 - p) that of separate grains, and sr^2 that of grains mixed at random: p (1 - p) / n for
    equal grains, n in a sample (Lacey 1954, J. Appl. Chem. 4, 257, doi 10.1002/jctb.5010040504). For grains of
    volumes v that are drawn one by one into m samples it is m sum(v^2 (c - p)^2) / sum(v)^2 in first order, with c = 1
    for the first species and 0 for the other.

    Args:
        scene: The scene.
        position: Centres [m], shape (n, 3).
    """
    here = np.isfinite(position).all(axis=1)
    volume = scene.radii()[here] ** 3
    first = (scene.bodies.species[here] == 0) * volume
    cell = CELL * float(scene.radii().max())
    index = np.floor(position[here] / cell).astype(int)
    _, sample = np.unique(index, axis=0, return_inverse=True)
    sample = sample.ravel()
    total, part = np.bincount(sample, volume), np.bincount(sample, first)
    used = np.bincount(sample) >= LEAST_GRAINS
    total, part = total[used], part[used]
    p = part.sum() / total.sum()
    s2 = float((total * (part / total - p) ** 2).sum() / total.sum())
    kept = used[sample]
    spread = float((volume[kept] ** 2 * ((scene.bodies.species[here][kept] == 0) - p) ** 2).sum())
    separate, mixed = p * (1 - p), len(total) * spread / total.sum() ** 2
    return float((separate - s2) / (separate - mixed))


def surface_angle(scene: Scene, position: np.ndarray) -> float:
    """Angle of the free surface to the horizontal about the drum's axis [deg], positive where it rises with x.

    A line through the highest grains of columns over the middle of the drum; the wall that moves up at +x lifts the
    surface there.

    Args:
        scene: The scene.
        position: Centres [m], shape (n, 3).
    """
    radius = published("drum")["drum"]["radius"]
    here = np.isfinite(position).all(axis=1)
    x, top = position[here, 0], position[here, 2] + scene.radii()[here]
    edges = np.linspace(-STRETCH * radius, STRETCH * radius, COLUMNS + 1)
    column = np.digitize(x, edges) - 1
    heights = np.array([np.quantile(top[column == k], 0.99) if (column == k).any() else np.nan for k in range(COLUMNS)])
    seen = np.isfinite(heights)
    centres = 0.5 * (edges[1:] + edges[:-1])
    return float(np.degrees(np.arctan(np.polyfit(centres[seen], heights[seen], 1)[0])))


def wall_layer(
    scene: Scene, position: np.ndarray, velocity: np.ndarray, angular_velocity: np.ndarray
) -> tuple[float, float] | None:
    """How the mantle takes the grains at it along: co-rotation and slip, both over the speed of the wall [-].

    None where no grain is at the mantle.

    Co-rotation is the mean tangential velocity of the centres over that of a body that turns with the drum; slip is
    the mean length of the difference of wall and grain surface at the contact, spins included.

    Args:
        scene: The scene.
        position, velocity, angular_velocity: [m], [m/s], [rad/s], shape (n, 3).
    """
    drum = published("drum")["drum"]
    radius, spin = drum["radius"], np.array(drum["angular_velocity"])
    radii = scene.radii()
    radial = position * np.array([1.0, 0.0, 1.0])
    away = np.linalg.norm(radial, axis=1)
    near = np.isfinite(away) & (radius - away < LAYER * radii)
    if not near.any():
        return None
    outward = radial[near] / away[near, None]
    turning = np.cross(spin, radial[near])
    share = (velocity[near] * turning).sum(axis=1) / (turning**2).sum(axis=1)
    surface = velocity[near] + np.cross(angular_velocity[near], radii[near, None] * outward)
    wall = np.cross(spin, radius * outward)
    slip = surface - wall
    slip -= (slip * outward).sum(axis=1)[:, None] * outward
    speed = float(np.linalg.norm(spin)) * radius
    return float(share.mean()), float(np.linalg.norm(slip, axis=1).mean() / speed)
