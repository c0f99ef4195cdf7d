"""A loose, jittered cubic lattice inside walls: where particles start that are to settle."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from dembench.initial.container import clearance, enclosure
from dembench.scene.walls import WallShape


class RoomError(ValueError):
    """More particles than the lattice has sites."""


def lattice(
    layers: Sequence[tuple[int, float]],
    walls: Sequence[WallShape],
    fraction: float,
    rng: np.random.Generator,
    top: float | None = None,
) -> np.ndarray:
    """Centres [m], shape (n, 3), layer upon layer from the lowest point of the walls up.

    Each particle is moved at random by less than half the gap to its neighbours, or not at all where that would bring
    it into a wall. The highest plane of a layer is a random part of a full one.

    Args:
        layers: Number and radius [m] of the particles of each layer, the lowest first.
        walls: What the particles must clear.
        fraction: Solid fraction of the lattice where no wall is near [-].
        rng: Where the random numbers are from.
        top: Height above which there are no sites [m]; None is the highest point of the walls.

    Raises:
        RoomError: The layers need more sites than there are.
    """
    lower, upper = enclosure(walls)
    if top is not None:
        upper[2] = min(upper[2], top)
    floor, found = lower[2], []
    for k, (count, radius) in enumerate(layers):
        spacing = radius * (4 * math.pi / 3 / fraction) ** (1 / 3)
        cells = np.maximum(1, np.floor((upper - lower)[:2] / spacing).astype(int))
        pitch = np.append((upper - lower)[:2] / cells, spacing)
        # the walls bound the sites from above, a plane of them may reach beyond the top by half a pitch
        planes: list[np.ndarray] = []
        room = 0
        while room < count:
            height = floor + (len(planes) + 0.5) * spacing
            if height + radius > upper[2]:
                raise RoomError(
                    f"layer {k + 1} has {count} particles of radius {radius:g} m, and there are sites for {room} of "
                    f"them up to z = {upper[2]:g} m; raise the walls or lower the count"
                )
            sites = _plane(lower, pitch, cells, height)
            planes.append(sites[clearance(walls, sites) >= radius])
            room += len(planes[-1])
        last = planes.pop()
        needed = count - (room - len(last))
        planes.append(last[np.sort(rng.choice(len(last), needed, replace=False))])
        site = np.concatenate(planes)
        reach = 0.99 * (pitch / 2 - radius)
        moved = site + rng.uniform(-reach, reach, (count, 3))
        found.append(np.where((clearance(walls, moved) >= radius)[:, None], moved, site))
        floor += len(planes) * spacing
    return np.concatenate(found)


def _plane(lower: np.ndarray, pitch: np.ndarray, cells: np.ndarray, height: float) -> np.ndarray:
    """All sites of a horizontal plane [m], shape (cells, 3), the first axis fastest."""
    site = np.arange(int(cells.prod()))
    index = np.stack([site % cells[0], site // cells[0]], axis=1)
    return np.column_stack([lower[:2] + (index + 0.5) * pitch[:2], np.full(len(site), height)])
