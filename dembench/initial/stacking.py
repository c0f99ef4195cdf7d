"""A bed upon itself: the start of one that is twice as high."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree


def stacked(position: np.ndarray, radius: float) -> np.ndarray:
    """Centres of a bed [m], shape (n, 3), and of its copy on top of it, shape (2 n, 3).

    The copy is turned by half a turn about the vertical line through the middle of the bed, so that it has the same
    box, and stands as low as it can without overlapping.

    Args:
        position: Centres of the bed [m], shape (n, 3).
        radius: Radius of all particles [m].
    """
    middle = 0.5 * (position.min(axis=0) + position.max(axis=0))
    copy = np.column_stack([2 * middle[:2] - position[:, :2], position[:, 2]])
    under = cKDTree(position[:, :2]).query_ball_point(copy[:, :2], 2 * radius)
    k = np.repeat(np.arange(len(copy)), [len(near) for near in under])
    below = np.concatenate([np.asarray(near, int) for near in under])
    across = np.linalg.norm(copy[k, :2] - position[below, :2], axis=1)
    lift = position[below, 2] + np.sqrt(np.maximum(0, (2 * radius) ** 2 - across**2)) - copy[k, 2]
    return np.vstack([position, copy + np.array([0, 0, lift.max()])])
