"""How spheres are packed inside walls: solid fraction, height, coordination, overlaps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from dembench.initial.container import clearance, enclosure
from dembench.scene.base import Model
from dembench.scene.walls import WallShape

CORE_MARGIN = 0.008
"""Distance of the bulk from side walls, measured horizontally [m]."""
COLUMN = 1.5
SAMPLES = 400_000
"""Points on which volumes are measured: solid fractions are good to about 1e-3."""
DIRECTIONS = 8


class Packing(Model):
    """Figures of a packing.

    Attributes:
        count: Number of particles [-].
        height: Mean height of the top above the lowest point of the walls [m]: the mean, over columns 1.5 mean
            diameters wide, of the top of the highest particle.
        fraction: Volume of all particles, as a share of the space inside the walls below that height [-].
        bulk_fraction: Solid fraction [-] of the bulk: at least 8 mm from side walls (horizontally), from two mean
            diameters above the lowest point to three below the height.
        coordination: Mean number of particles that a particle overlaps [-].
        mean_overlap, largest_overlap: Overlaps of two particles, as a share of the sum of their radii [-].
    """

    count: int
    height: float
    fraction: float
    bulk_fraction: float
    coordination: float
    mean_overlap: float
    largest_overlap: float

    def line(self) -> str:
        """The main figures in one line."""
        return (
            f"{self.count} particles, height {self.height * 1e3:.2f} mm, solid fraction {self.fraction:.3f} "
            f"(bulk {self.bulk_fraction:.3f}), coordination {self.coordination:.2f}, "
            f"largest overlap {self.largest_overlap:.2%} of the diameter"
        )


def packing(position: np.ndarray, radius: np.ndarray | float, walls: Sequence[WallShape]) -> Packing:
    """The packing of spheres.

    Args:
        position: Centres [m], shape (n, 3); the third axis is vertical.
        radius: Radii [m], a number or shape (n,).
        walls: What holds them.

    Raises:
        ValueError: The walls do not bound a space.
    """
    radius = np.broadcast_to(np.asarray(radius, dtype=float), len(position))
    lower, _ = enclosure(walls)
    diameter = 2 * float(radius.mean())
    top = float(tops(position, radius, walls).mean())
    samples = Samples(position, radius, walls, top)
    bulk = samples.core & (samples.height > lower[2] + 2 * diameter) & (samples.height < top - 3 * diameter)
    depth = overlaps(position, radius)
    return Packing(
        count=len(position),
        height=top - lower[2],
        fraction=float(4 / 3 * np.pi * (radius**3).sum()) / samples.volume,
        bulk_fraction=float(samples.solid[bulk].mean()) if bulk.any() else float("nan"),
        coordination=2 * len(depth) / len(position),
        mean_overlap=float(depth.mean()) if len(depth) else 0.0,
        largest_overlap=float(depth.max()) if len(depth) else 0.0,
    )


def tops(position: np.ndarray, radius: np.ndarray, walls: Sequence[WallShape]) -> np.ndarray:
    """Tops of the highest particle of every column [m]; columns are 1.5 mean diameters wide.

    Columns without a particle are left out, and those that a wall cuts, unless it cuts all.
    """
    lower, upper = enclosure(walls)
    width = (upper - lower)[:2]
    columns = np.maximum(1, np.round(width / (COLUMN * 2 * radius.mean()))).astype(int)
    index = np.clip(((position - lower)[:, :2] / width * columns).astype(int), 0, columns - 1)
    top = np.full(columns, -np.inf)
    np.maximum.at(top, (index[:, 0], index[:, 1]), position[:, 2] + radius)
    filled = np.argwhere(np.isfinite(top))
    found, whole = top[np.isfinite(top)], np.ones(len(filled), bool)
    for corner in ((0.01, 0.01), (0.01, 0.99), (0.99, 0.01), (0.99, 0.99)):
        place = lower[:2] + (filled + corner) * width / columns
        whole &= clearance(walls, np.column_stack([place, found])) > 0
    return found[whole] if whole.any() else found


def overlaps(position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Overlaps of all pairs that touch, as a share of the sum of their radii, shape (pairs,)."""
    pairs = cKDTree(position).query_pairs(2 * radius.max(), output_type="ndarray")
    reach = radius[pairs].sum(axis=1)
    depth = 1 - np.linalg.norm(position[pairs[:, 0]] - position[pairs[:, 1]], axis=1) / reach
    return depth[depth > 0]


class Samples:
    """Random points inside walls and below a level, one in every cell of a grid.

    Attributes:
        volume: Volume of the space that the points fill [m^3].
        height: Height of each point [m], shape (m,).
        solid: Whether it is inside a sphere.
        core: Whether it is at least `CORE_MARGIN` from side walls.
    """

    def __init__(self, position: np.ndarray, radius: np.ndarray, walls: Sequence[WallShape], top: float):
        lower, upper = enclosure(walls)
        size = np.append((upper - lower)[:2], top - lower[2])
        cells = np.maximum(1, np.round(size / (size.prod() / SAMPLES) ** (1 / 3))).astype(int)
        index = np.stack(np.unravel_index(np.arange(cells.prod()), cells), axis=1)
        point = lower + (index + np.random.default_rng(0).random(index.shape)) * size / cells
        point = point[clearance(walls, point) > 0]
        self.volume = float(size.prod()) * len(point) / int(cells.prod())
        self.height = point[:, 2]
        self.solid = np.zeros(len(point), bool)
        for own in np.unique(radius):
            near, _ = cKDTree(position[radius == own]).query(point, distance_upper_bound=own)
            self.solid |= near < own
        self.core = np.ones(len(point), bool)
        for angle in 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
            aside = CORE_MARGIN * np.array([np.cos(angle), np.sin(angle), 0.0])
            inside = np.flatnonzero(self.core)
            self.core[inside] = clearance(walls, point[inside] + aside) > 0
