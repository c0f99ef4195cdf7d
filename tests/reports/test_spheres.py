"""Pictures of spheres: what is seen is what is nearest, where it is and as large as it is."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from dembench.reports.spheres import Camera, png, render

RED, BLUE = np.array([[1.0, 0, 0]]), np.array([[0, 0, 1.0]])
CAMERA = Camera((-1.0, 1.0), (-0.5, 0.5), 100.0)


def picture(spheres: list[tuple[float, float, float, float]], colour: np.ndarray, smooth: int = 2) -> np.ndarray:
    """A picture of (right, up, near, radius)."""
    rows = np.array(spheres)
    return render(CAMERA, rows[:, :3], rows[:, 3], np.broadcast_to(colour, (len(rows), 3)), smooth)


def test_a_sphere_covers_its_disc_where_it_is() -> None:
    """Covered area pi r^2 within 1 %: the samples are a fiftieth of the radius, the edge is smoothed."""
    drawn = picture([(0.3, -0.1, 0.0, 0.25)], RED)
    assert drawn.shape == (100, 200, 4)
    opacity = drawn[..., 3] / 255
    assert opacity.sum() == pytest.approx(np.pi * 25**2, rel=0.01)
    rows, columns = np.indices(opacity.shape)
    assert (opacity * (columns + 0.5)).sum() / opacity.sum() == pytest.approx(130, abs=0.2)
    assert (opacity * (rows + 0.5)).sum() / opacity.sum() == pytest.approx(60, abs=0.2)


def test_light_comes_from_the_upper_left() -> None:
    drawn = picture([(0.0, 0.0, 0.0, 0.4)], RED)[..., 0].astype(int)
    assert drawn[30, 80] > drawn[50, 100] > drawn[70, 120]


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_sphere_hides_the_other_whatever_their_order(order: tuple[int, int]) -> None:
    rows = np.array([(0.0, 0.0, 1.0, 0.1), (0.0, 0.0, 0.0, 0.3)])[list(order)]
    colours = np.vstack([RED, BLUE])[list(order)]
    drawn = render(CAMERA, rows[:, :3], rows[:, 3], colours)
    assert drawn[50, 100, 0] > drawn[50, 100, 2]
    assert drawn[50, 120, 2] > drawn[50, 120, 0]


def test_a_heap_is_what_ray_by_ray_search_finds() -> None:
    """Owners of all samples against a search over all spheres: two sizes, apart in space, many behind each other."""
    random = np.random.default_rng(3)
    seen = np.stack(np.meshgrid(*(np.linspace(-a, a, n) for a, n in ((0.9, 10), (0.4, 5), (0.5, 6)))), -1).reshape(
        -1, 3
    )
    seen += random.uniform(-0.03, 0.03, seen.shape)
    radius = np.where(random.random(300) < 0.3, 0.069, 0.04)
    colour = np.column_stack([np.arange(300) / 300, np.ones(300), np.ones(300)])
    drawn = render(CAMERA, seen, radius, colour, smooth=1)
    x = -1 + (np.arange(200) + 0.5) / 100
    z = 0.5 - (np.arange(100) + 0.5) / 100
    square = radius**2 - (x[None, :, None] - seen[:, 0]) ** 2 - (z[:, None, None] - seen[:, 1]) ** 2
    surface = np.where(square > 0, seen[:, 2] + np.sqrt(np.maximum(square, 0)), -np.inf)
    covered = np.isfinite(surface.max(axis=2))
    assert np.array_equal(drawn[..., 3] == 255, covered)
    nearest = surface.argmax(axis=2)
    lit = drawn[..., 2].astype(float)  # a sphere's red over its blue is the colour it was given, where nothing shines
    plain = covered & (lit < 200)
    assert plain.sum() > 1000
    red = drawn[..., 0][plain] / lit[plain]
    off = np.abs(red - nearest[plain] / 300)
    assert np.median(off) < 0.002 and np.quantile(off, 0.97) < 0.02


def test_nothing_is_drawn_of_what_lies_outside() -> None:
    assert not picture([(3.0, 0.0, 0.0, 0.2), (0.0, 5.0, 0.0, 0.2)], RED).any()


def test_a_png_file_keeps_size_and_transparency() -> None:
    image = Image.open(io.BytesIO(png(picture([(0.0, 0.0, 0.0, 0.3)], BLUE)))).convert("RGBA")
    assert image.size == (200, 100)
    assert image.getpixel((1, 1))[3] == 0 and image.getpixel((100, 50))[3] == 255  # type: ignore[index]
