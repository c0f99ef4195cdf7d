"""Reads the published wall meshes of the three cases: one triangle per row. Source: doi 10.5281/zenodo.8252892."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dembench.initial.rows import CoordinatesError, numbers, text_lines

HEADER = [f"vertex{k}_{axis}[m]" for k in (1, 2, 3) for axis in "XYZ"]
ACCEPTED = "a row has the nine numbers of three vertices"


@dataclass(frozen=True)
class Published:
    """What a published mesh is known by.

    Attributes:
        lower, upper: Corners of the volume that it fills [m].
        triangles: Number of its triangles.
    """

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    triangles: int


MESHES = {
    "large silo walls": Published((-0.101951, -0.101988, -0.0554222), (0.102, 0.101988, 0.314578), 7632),
    "small silo walls": Published((-0.101951, -0.101988, -0.0593008), (0.102, 0.101988, 0.320699), 8636),
    "drum walls": Published((-0.101951, -0.032, -0.101988), (0.102, 0.032, 0.101988), 1200),
    "impact walls": Published((-0.051, -0.032, -0.0922431), (0.051, 0.032, 0.107757), 56),
}
"""The meshes by name. All are closed surfaces whose triangles share vertices to the last digit."""
EXTENT_TOLERANCE = 1e-3
"""Accepted distance of a corner [m]: less than between any two of the meshes, more than coarser facets make."""
FLATNESS = 1e-9
"""Smallest height of a triangle in its longest edge [-]; below it rounding decides where its normal points."""


def read_walls(path: Path, name: str | None = None) -> np.ndarray:
    """Reads a wall mesh.

    Args:
        path: The file.
        name: The published mesh that it must be, one of `MESHES`, whole and undamaged; None accepts any.

    Returns:
        Vertices of the triangles [m], shape (n, 3, 3), in the order of the file.

    Raises:
        CoordinatesError: The file cannot be read, has a bad row, a triangle without area, or is another mesh or only
            a part of it.
    """
    lines = text_lines(path)
    if not lines or lines[0].split() != HEADER:
        raise CoordinatesError(f"{path}:1: expected the header '{' '.join(HEADER)}'")
    rows = [numbers(path, number, line, ACCEPTED) for number, line in enumerate(lines[1:], 2)]
    if not rows:
        raise CoordinatesError(f"{path}: no triangles")
    for number, row in enumerate(rows, 2):
        if len(row) != len(HEADER):
            raise CoordinatesError(f"{path}:{number}: {len(row)} fields; {ACCEPTED}")
    triangles = np.array(rows).reshape(-1, 3, 3)
    edges = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    flat = np.flatnonzero(~(area > FLATNESS * edges**2))
    if len(flat):
        raise CoordinatesError(
            f"{path}:{flat[0] + 2}: the three vertices lie on a line; a triangle needs an area ({len(flat)} such rows)"
        )
    if name is not None:
        _check_extent(path, triangles, name)
        if len(triangles) != MESHES[name].triangles:
            raise CoordinatesError(f"{path}: {len(triangles)} triangles; the {name} have {MESHES[name].triangles}")
        _check_closed(path, triangles)
    return triangles


def _check_extent(path: Path, triangles: np.ndarray, name: str) -> None:
    found = np.array([triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))])
    fitting = [
        known
        for known, mesh in MESHES.items()
        if np.allclose(found, (mesh.lower, mesh.upper), rtol=0, atol=EXTENT_TOLERANCE)
    ]
    if name in fitting:
        return
    like = f", as the {fitting[0]} do" if fitting else ""
    (x0, y0, z0), (x1, y1, z1) = MESHES[name].lower, MESHES[name].upper
    raise CoordinatesError(
        f"{path}: reaches from {tuple(found[0].tolist())} to {tuple(found[1].tolist())} m{like}; "
        f"the {name} reach from ({x0:g}, {y0:g}, {z0:g}) to ({x1:g}, {y1:g}, {z1:g}) m"
    )


def _check_closed(path: Path, triangles: np.ndarray) -> None:
    """Every edge is that of one other triangle, which goes along it the other way: a wrong digit opens the surface."""
    _, vertex = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    first = vertex.reshape(-1, 3)
    edges = np.stack([first, np.roll(first, -1, axis=1)], axis=2).reshape(-1, 2)
    known, count = np.unique(edges, axis=0, return_counts=True)
    closed = {(a, b) for (a, b), n in zip(known.tolist(), count.tolist(), strict=True) if n == 1}
    open_edges = np.array([(a, b) not in closed or (b, a) not in closed for a, b in edges.tolist()])
    if open_edges.any():
        worst = int(open_edges.reshape(-1, 3).sum(axis=1).argmax())  # its neighbours have one open edge each
        raise CoordinatesError(
            f"{path}:{worst + 2}: the surface is open at edges of this triangle; accepted is a closed surface, whose "
            "triangles share their vertices to the last digit"
        )
