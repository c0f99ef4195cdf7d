"""Largest overlap of any two spheres, fast also for a few large bodies among many small ones."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from dembench.scene.scene import Domain


def largest_overlap(position: np.ndarray, radius: np.ndarray, domain: Domain | None = None) -> float:
    """Largest overlap of two spheres [m], 0 where none touch.

    The spheres are sorted into classes of size, each within a factor of two, so that the search radius of the small
    ones does not grow with the largest body.

    Args:
        position: Centres [m], shape (n, 3), finite.
        radius: Radii [m], shape (n,).
        domain: Its periodic directions join opposite faces.
    """
    if len(position) < 2:
        return 0.0
    period = np.zeros(3)
    if domain is not None and any(domain.periodic):
        lower, upper = np.array(domain.lower), np.array(domain.upper)
        period = np.where(domain.periodic, upper - lower, 0.0)
        wrapped = lower + np.mod(position - lower, np.where(period > 0, period, 1.0))
        position = np.where(period > 0, wrapped, position)
        position = np.where(period > 0, position - lower, position)
    octave = np.floor(np.log2(radius / radius.min())).astype(int)
    classes = [np.flatnonzero(octave == k) for k in np.unique(octave)]
    trees = [cKDTree(position[members], boxsize=period if period.any() else None) for members in classes]
    largest = 0.0
    for a, small in enumerate(classes):
        reach = 2 * radius[small].max()
        pairs = trees[a].query_pairs(reach, output_type="ndarray")
        largest = max(largest, _largest(position, radius, small[pairs[:, 0]], small[pairs[:, 1]], period))
        for b in range(a + 1, len(classes)):
            reach = radius[small].max() + radius[classes[b]].max()
            near = trees[b].sparse_distance_matrix(trees[a], reach, output_type="ndarray")
            largest = max(largest, _largest(position, radius, classes[b][near["i"]], small[near["j"]], period))
    return largest


def _largest(position: np.ndarray, radius: np.ndarray, i: np.ndarray, j: np.ndarray, period: np.ndarray) -> float:
    if len(i) == 0:
        return 0.0
    offset = position[i] - position[j]
    if period.any():
        offset -= period * np.round(offset / np.where(period > 0, period, 1.0))
    return float((radius[i] + radius[j] - np.linalg.norm(offset, axis=1)).max())
