"""How a settled bed of equal spheres in a box is packed: solid fraction, height, coordination, overlaps."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from dembench.scene.base import Model

CORE_MARGIN = 0.008
COLUMN = 1.5


class Packing(Model):
    """Figures of a bed.

    Attributes:
        count: Number of grains [-].
        height: Mean height of the bed's top above the floor [m]: the mean, over columns 1.5 diameters wide, of the top
            of the highest grain.
        fraction: Solid fraction [-] of the volume below that height.
        bulk_fraction: Solid fraction [-] at least 8 mm from the side walls, from two diameters above the floor to three
            below the height, spheres cut exactly at both levels.
        coordination: Mean number of grains that a grain overlaps [-].
        largest_overlap: Largest overlap of two grains in diameters [-].
    """

    count: int
    height: float
    fraction: float
    bulk_fraction: float
    coordination: float
    largest_overlap: float

    def line(self) -> str:
        """All figures in one line."""
        return (
            f"{self.count} grains, height {self.height * 1e3:.2f} mm, solid fraction {self.fraction:.3f} "
            f"(bulk {self.bulk_fraction:.3f}), coordination {self.coordination:.2f}, "
            f"largest overlap {self.largest_overlap:.2%} of the diameter"
        )


def packing(position: np.ndarray, radius: float, lower: np.ndarray, upper: np.ndarray) -> Packing:
    """The packing of a bed.

    Args:
        position: Centres [m], shape (n, 3); the third axis is vertical.
        radius: Radius of all grains [m].
        lower, upper: Inner corners of the box [m], shape (3,).
    """
    width = upper[:2] - lower[:2]
    relative = position - lower
    volume = 4 / 3 * np.pi * radius**3
    height = _height(relative, radius, width)
    core = ((relative[:, :2] > CORE_MARGIN) & (relative[:, :2] < width - CORE_MARGIN)).all(axis=1)
    low, high = 4 * radius, height - 6 * radius
    inside = (_below(high, relative[core, 2], radius) - _below(low, relative[core, 2], radius)).sum()
    pairs = cKDTree(position).query_pairs(2 * radius, output_type="ndarray")
    distance = np.linalg.norm(position[pairs[:, 0]] - position[pairs[:, 1]], axis=1)
    return Packing(
        count=len(position),
        height=height,
        fraction=len(position) * volume / (width.prod() * height),
        bulk_fraction=inside / ((width - 2 * CORE_MARGIN).prod() * (high - low)) if high > low else float("nan"),
        coordination=2 * len(pairs) / len(position),
        largest_overlap=float(1 - distance.min() / (2 * radius)) if len(pairs) else 0.0,
    )


def _height(relative: np.ndarray, radius: float, width: np.ndarray) -> float:
    columns = np.maximum(1, np.round(width / (COLUMN * 2 * radius))).astype(int)
    index = np.clip((relative[:, :2] / width * columns).astype(int), 0, columns - 1)
    top = np.full(columns, -np.inf)
    np.maximum.at(top, (index[:, 0], index[:, 1]), relative[:, 2] + radius)
    return float(top[np.isfinite(top)].mean())


def _below(level: float, height: np.ndarray, radius: float) -> np.ndarray:
    """Volume of each sphere below a level [m^3], shape (n,): the integral of its cross-section."""
    x = np.clip(level - height, -radius, radius)
    return np.pi * (radius**2 * x - x**3 / 3 + 2 * radius**3 / 3)
