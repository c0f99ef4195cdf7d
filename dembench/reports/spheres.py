"""Pictures of many spheres: orthographic view along one axis, nearest surface per pixel, shaded, as PNG."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass

import numpy as np
from PIL import Image
from scipy.ndimage import minimum_filter

LIGHT = np.array([-0.45, 0.55, 0.70])
"""Direction to the light: from the left, above and the viewer (right, up, towards the viewer)."""
AMBIENT, DIFFUSE, GLOSS, SHINE = 0.5, 0.5, 0.14, 24
SLABS = 16
"""Parts in which spheres are drawn from the viewer backwards."""
TOGETHER = 200_000
"""Samples of spheres that are computed together."""
PALETTE = 96
"""Colours of a PNG file: shaded spheres compress badly in full colour."""


@dataclass(frozen=True)
class Camera:
    """An orthographic view.

    Attributes:
        right, up: Ranges of the two axes of the picture that are seen [m].
        scale: Pixels per metre.
    """

    right: tuple[float, float]
    up: tuple[float, float]
    scale: float

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return round((self.right[1] - self.right[0]) * self.scale), round((self.up[1] - self.up[0]) * self.scale)


def render(camera: Camera, seen: np.ndarray, radius: np.ndarray, colour: np.ndarray, smooth: int = 2) -> np.ndarray:
    """A picture of spheres that overlap by little at most, transparent where there is none.

    Args:
        camera: The view.
        seen: Centres along the picture's right, up and towards the viewer [m], shape (n, 3).
        radius: Radii [m], shape (n,).
        colour: Colours from 0 to 1, shape (n, 3).
        smooth: Samples per pixel and axis, for smooth edges.

    Returns:
        Red, green, blue and opacity from 0 to 255, shape (height, width, 4).
    """
    width, height = camera.size
    fine = (height * smooth, width * smooth)
    scale = camera.scale * smooth
    across = (seen[:, 0] - camera.right[0]) * scale - 0.5
    down = (camera.up[1] - seen[:, 1]) * scale - 0.5
    owner = _nearest(fine, across, down, seen[:, 2], radius, scale)
    picture = np.zeros((*fine, 4))
    drawn = owner >= 0
    sphere, (row, column) = owner[drawn], np.nonzero(drawn)
    offset = np.column_stack([column - across[sphere], down[sphere] - row]) / (radius[sphere] * scale)[:, None]
    picture[drawn, :3] = _shaded(colour[sphere], offset)
    picture[drawn, 3] = 1
    blocks = picture.reshape(height, smooth, width, smooth, 4)
    opacity = blocks[..., 3].mean(axis=(1, 3))
    total = (blocks[..., :3] * blocks[..., 3:]).mean(axis=(1, 3))
    mixed = total / np.where(opacity > 0, opacity, 1)[..., None]
    return np.round(255 * np.concatenate([mixed, opacity[..., None]], axis=2)).astype(np.uint8)


def _nearest(
    shape: tuple[int, int], across: np.ndarray, down: np.ndarray, near: np.ndarray, radius: np.ndarray, scale: float
) -> np.ndarray:
    """Sphere that is seen at each sample, -1 for none.

    Slabs of spheres are drawn from the viewer backwards, so that most spheres behind are found to be hidden: every
    sample of the square around such a sphere shows something nearer than its nearest point. Those of one size are
    drawn together.

    Args:
        shape: Rows and columns.
        across, down: Centres in samples, shape (n,).
        near: Centres towards the viewer [m], shape (n,).
        radius: Radii [m], shape (n,).
        scale: Samples per metre.
    """
    margin = int(np.ceil(radius.max(initial=0) * scale)) + 2
    depth = np.full((shape[0] + 2 * margin, shape[1] + 2 * margin), -np.inf)
    owner = np.full(depth.shape, -1, dtype=np.int64)
    column, row = np.round(across).astype(np.int64) + margin, np.round(down).astype(np.int64) + margin
    reach = np.ceil(radius * scale + 0.5).astype(np.int64)
    within = (np.minimum(column, row) >= reach) & (column + reach < depth.shape[1]) & (row + reach < depth.shape[0])
    front = near + radius
    order = np.flatnonzero(within)
    order = order[np.argsort(-front[order], kind="stable")]
    for slab in np.array_split(order, SLABS):
        for size in np.unique(radius[slab]):
            same = slab[radius[slab] == size][::-1]  # of two writes to one sample the nearer comes last
            samples = size * scale
            covered = minimum_filter(depth, 2 * int(np.ceil(samples + 0.5)) + 1)
            same = same[covered[row[same], column[same]] < front[same]]
            disc = _disc(samples)
            for part in np.array_split(same, len(same) * len(disc) // TOGETHER + 1):
                right = (column[part] - margin - across[part])[:, None] + disc[:, 0]
                below = (row[part] - margin - down[part])[:, None] + disc[:, 1]
                square = (right**2 + below**2) / samples**2
                sphere, sample = np.nonzero(square < 1)
                place = row[part[sphere]] + disc[sample, 1], column[part[sphere]] + disc[sample, 0]
                surface = near[part[sphere]] + size * np.sqrt(1 - square[sphere, sample])
                nearer = surface > depth[place]
                place = place[0][nearer], place[1][nearer]
                depth[place], owner[place] = surface[nearer], part[sphere[nearer]]
    return owner[margin : margin + shape[0], margin : margin + shape[1]]


def _disc(samples: float) -> np.ndarray:
    """Whole offsets (right, down) that a disc of that radius can hit, wherever in a sample its centre lies: (m, 2)."""
    reach = int(np.ceil(samples + 0.5))
    offsets = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1).T
    return offsets[np.hypot(offsets[:, 0], offsets[:, 1]) < samples + math.sqrt(0.5)]


def _shaded(colour: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Blinn-Phong shading (Blinn 1977, doi 10.1145/965141.563893) of points whose normal leans by `offset`."""
    normal = np.column_stack([offset, np.sqrt(np.maximum(0, 1 - (offset**2).sum(axis=1)))])
    light = LIGHT / np.linalg.norm(LIGHT)
    half = light + np.array([0, 0, 1])
    half /= np.linalg.norm(half)
    lit = AMBIENT + DIFFUSE * np.maximum(0, normal @ light)
    gloss = GLOSS * np.maximum(0, normal @ half) ** SHINE
    return np.clip(colour * lit[:, None] + gloss[:, None], 0, 1)


def png(picture: np.ndarray) -> bytes:
    """A picture (height, width, 4) as the bytes of a PNG file of few colours."""
    full = Image.fromarray(picture, "RGBA")
    image = full.quantize(PALETTE, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    content = io.BytesIO()
    image.save(content, format="PNG", optimize=True)
    return content.getvalue()
