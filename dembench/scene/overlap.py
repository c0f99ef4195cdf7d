"""Overlaps of spheres, found fast also for a few large bodies among many small ones."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from dembench.scene.scene import Domain

Touching = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Pairs that overlap: indices of both, shape (k,), and overlaps [m], shape (k,)."""


def largest_overlap(position: np.ndarray, radius: np.ndarray, domain: Domain | None = None) -> float:
    """Largest overlap of two spheres [m], 0 where none touch; for the arguments see `touching`."""
    return float(touching(position, radius, domain)[2].max(initial=0.0))


def touching(position: np.ndarray, radius: np.ndarray, domain: Domain | None = None) -> Touching:
    """All pairs of spheres that overlap.

    The spheres are sorted into classes of size, each within a factor of two, so that the search radius of the small
    ones does not grow with the largest body.

    Args:
        position: Centres [m], shape (n, 3), finite.
        radius: Radii [m], shape (n,).
        domain: Its periodic directions join opposite faces.
    """
    period = np.zeros(3)
    if domain is not None and any(domain.periodic):
        lower, upper = np.array(domain.lower), np.array(domain.upper)
        period = np.where(domain.periodic, upper - lower, 0.0)
        inside = np.mod(position - lower, np.where(period > 0, period, 1.0))
        position = np.where(period > 0, inside, position)
    found = [(i, j, _overlap(position, radius, i, j, period)) for i, j in _near(position, radius, period)]
    i, j, overlap = (np.concatenate(parts) for parts in zip(*found, strict=True)) if found else (np.empty(0, int),) * 3
    touch = overlap > 0
    return i[touch], j[touch], overlap[touch]


def _near(position: np.ndarray, radius: np.ndarray, period: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pairs that may touch, class by class."""
    if len(position) < 2:
        return
    octave = np.floor(np.log2(radius / radius.min())).astype(int)
    classes = [np.flatnonzero(octave == k) for k in np.unique(octave)]
    trees = [cKDTree(position[members], boxsize=period if period.any() else None) for members in classes]
    for a, small in enumerate(classes):
        pairs = trees[a].query_pairs(2 * radius[small].max(), output_type="ndarray")
        yield small[pairs[:, 0]], small[pairs[:, 1]]
        for b in range(a + 1, len(classes)):
            reach = radius[small].max() + radius[classes[b]].max()
            near = trees[b].sparse_distance_matrix(trees[a], reach, output_type="ndarray")
            yield classes[b][near["i"]], small[near["j"]]


def _overlap(position: np.ndarray, radius: np.ndarray, i: np.ndarray, j: np.ndarray, period: np.ndarray) -> np.ndarray:
    offset = position[i] - position[j]
    if period.any():
        offset -= period * np.round(offset / np.where(period > 0, period, 1.0))
    return radius[i] + radius[j] - np.linalg.norm(offset, axis=1)
