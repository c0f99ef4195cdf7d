"""Triangle meshes as features: faces, edges and vertices, each with the part of space in which it is the nearest.

A point has a contact with a feature where that is a local minimum of its distance to the mesh: with a face where its
projection lies inside, with an edge where it lies between the planes at its ends and outside all faces that meet there,
with a vertex where it lies behind the planes of all edges that meet there. Each of these regions is an intersection of
half-spaces, and the planes between two regions are shared, so that a flat mesh has one contact, a concave fold two and
a convex edge one, wherever the point is (Voronoi regions; Ericson, Real-Time Collision Detection (2005), sections 5.1.5
and 9.5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dembench.solver.walls.records import EDGE, FACE, VERTEX

WELD = 1e-9
"""Vertices closer than this are one vertex, in extents of the mesh; directions that differ by less are the same."""
TIE = 1e-13
"""Planes between regions are shifted by this, in extents of the mesh, so that no point of a regular mesh lies on one.

All are shifted as if the points were moved, by far less than matters, in one direction that is parallel to no plane of
interest: every point then lies in the regions that it would lie in at that place.
"""
_DIRECTION = np.array([0.5377, 0.6180, 0.5735])


@dataclass(frozen=True)
class MeshFeatures:
    """Features of a mesh; all positions are relative to `reference`.

    Attributes:
        reference: Where positions are counted from, shape (3,).
        shape: FACE, EDGE or VERTEX, shape (k,).
        base, axis: A point of each feature and the normal of a face or the direction of an edge, shape (k, 3).
        first, count: Where the half-spaces of each feature begin, and how many they are, shape (k,).
        spaces: Half-spaces: a point of the plane and the unit normal into the half-space, shape (h, 2, 3).
        low, high: Corners of the box around each feature, shape (k, 3).
    """

    reference: np.ndarray
    shape: np.ndarray
    base: np.ndarray
    axis: np.ndarray
    first: np.ndarray
    count: np.ndarray
    spaces: np.ndarray
    low: np.ndarray
    high: np.ndarray


def mesh_features(triangles: np.ndarray) -> MeshFeatures:
    """The features of triangles, shape (n, 3, 3); triangles without area are left out.

    Edges between coplanar faces and vertices inside flat parts or straight edges are nowhere the nearest: they are left
    out, too.
    """
    reference = triangles.mean(axis=(0, 1))
    vertices, faces = _welded(triangles - reference)
    extent = float(np.ptp(vertices, axis=0).max())
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = _unit(np.cross(b - a, c - a))
    side_vertices = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, edge = np.unique(np.sort(side_vertices, axis=1), axis=0, return_inverse=True)
    edge = edge.reshape(-1)
    along = _unit(vertices[edges[:, 1]] - vertices[edges[:, 0]])
    forward = np.where(side_vertices[:, 0] == edges[edge, 0], 1.0, -1.0)
    inward = np.cross(np.repeat(normal, 3, axis=0), forward[:, None] * along[edge])

    # the two sides of a flat edge share their plane to the last bit
    sides = np.argsort(edge, kind="stable")
    of_edge = np.split(sides, np.cumsum(np.bincount(edge))[:-1])
    flat = np.zeros(len(edges), dtype=bool)
    for e, two in enumerate(of_edge):
        if len(two) == 2 and np.linalg.norm(inward[two[0]] + inward[two[1]]) < WELD:
            flat[e] = True
            inward[two[1]] = -inward[two[0]]
    owner = np.array([of_edge[e][0] if flat[e] else s for s, e in enumerate(edge)])
    side_plane = _shifted(vertices[edges[edge, 0]], inward[owner], extent)
    ends = [_shifted(vertices[edges[:, k]], along, extent) for k in (0, 1)]

    spaces: list[list[tuple[np.ndarray, np.ndarray]]] = []
    for f in range(len(faces)):
        spaces.append([(side_plane[s], inward[s]) for s in (3 * f, 3 * f + 1, 3 * f + 2)])
    kept = np.flatnonzero(~flat)
    for e in kept:
        between = [(ends[0][e], along[e]), (ends[1][e], -along[e])]
        spaces.append(between + [(side_plane[s], -inward[s]) for s in of_edge[e]])
    corners = []
    for v, meeting in enumerate(_edges_of_vertices(edges, len(vertices))):
        outward = [along[e] * (1 if edges[e, 0] == v else -1) for e in meeting]
        if not flat[meeting].all() and not _straight(np.array(outward)):
            corners.append(v)
            planes = [ends[0 if edges[e, 0] == v else 1][e] for e in meeting]
            spaces.append([(p, -u) for p, u in zip(planes, outward, strict=True)])

    shapes = [FACE] * len(faces) + [EDGE] * len(kept) + [VERTEX] * len(corners)
    parts = [vertices[faces], vertices[edges[kept]], vertices[corners][:, None]]
    count = np.array([len(s) for s in spaces])
    return MeshFeatures(
        reference=reference,
        shape=np.array(shapes),
        base=np.concatenate([part[:, 0] for part in parts]),
        axis=np.concatenate([normal, along[kept], np.zeros((len(corners), 3))]),
        first=np.cumsum(count) - count,
        count=count,
        spaces=np.array([plane for each in spaces for plane in each]),
        low=np.concatenate([part.min(axis=1) for part in parts]),
        high=np.concatenate([part.max(axis=1) for part in parts]),
    )


def _welded(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices, shape (v, 3), and their indices in the triangles that have an area, shape (n, 3)."""
    corners = triangles.reshape(-1, 3)
    pairs = cKDTree(corners).query_pairs(WELD * float(np.ptp(corners, axis=0).max()), output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(corners),) * 2)
    _count, label = connected_components(links, directed=False)
    _labels, first, index = np.unique(label, return_index=True, return_inverse=True)
    vertices, faces = corners[first], index.reshape(-1, 3)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    sides = [np.linalg.norm(q - p, axis=1) for p, q in ((a, b), (b, c), (c, a))]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return vertices, faces[area > WELD * np.max(sides, axis=0) ** 2]


def _shifted(points: np.ndarray, normals: np.ndarray, extent: float) -> np.ndarray:
    """Points of planes, shifted as TIE says."""
    tie = np.where(normals @ _DIRECTION >= 0, TIE, -TIE) * extent
    return points - tie[:, None] * normals


def _edges_of_vertices(edges: np.ndarray, n: int) -> list[np.ndarray]:
    """Indices of the edges that meet at each of n vertices."""
    order = np.argsort(edges.reshape(-1), kind="stable")
    count = np.bincount(edges.reshape(-1), minlength=n)
    return [found // 2 for found in np.split(order, np.cumsum(count)[:-1])]


def _straight(directions: np.ndarray) -> bool:
    """Whether two of the directions are opposite."""
    return bool((directions @ directions.T).min() < -1 + WELD)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


@dataclass(frozen=True)
class BoxGrid:
    """Cells of a grid with the boxes that reach into them.

    Attributes:
        origin: Lower corner, shape (3,).
        edge: Edge of a cell.
        cells: Cells along each axis, shape (3,).
        start, boxes: Cell c, the last axis fastest, holds boxes[start[c] : start[c + 1]].
        lowest: The cell of the lower corner of each box, shape (k, 3).
    """

    origin: np.ndarray
    edge: float
    cells: np.ndarray
    start: np.ndarray
    boxes: np.ndarray
    lowest: np.ndarray


def box_grid(low: np.ndarray, high: np.ndarray) -> BoxGrid:
    """A grid of boxes, shape (k, 3), with cells about as large as a box, but not many more than there are boxes."""
    origin, extent = low.min(axis=0), (high.max(axis=0) - low.min(axis=0)).max()
    edge = max(float((high - low).max(axis=1).mean()), 1e-3 * float(extent))
    while True:
        cells = np.floor((high.max(axis=0) - origin) / edge).astype(int) + 1
        first, last = (np.clip(np.floor((x - origin) / edge).astype(int), 0, cells - 1) for x in (low, high))
        entries = np.prod(last - first + 1, axis=1)
        if np.prod(cells) <= 8 * len(low) + 64 and entries.sum() <= 16 * len(low) + 64:
            break
        edge *= 1.26
    box = np.repeat(np.arange(len(low)), entries)
    rank = np.arange(len(box)) - np.repeat(np.cumsum(entries) - entries, entries)
    span = (last - first + 1)[box]
    place = first[box] + np.stack(
        [rank // (span[:, 1] * span[:, 2]), rank // span[:, 2] % span[:, 1], rank % span[:, 2]], axis=1
    )
    cell = (place[:, 0] * cells[1] + place[:, 1]) * cells[2] + place[:, 2]
    order = np.argsort(cell, kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=int(np.prod(cells))))])
    return BoxGrid(origin, edge, cells, start, box[order], first)
