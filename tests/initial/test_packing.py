"""Figures of a packing, on beds whose figures are known."""

from pathlib import Path

import numpy as np
import pytest

from dembench.initial.packings import packing, tops
from dembench.initial.published import find_file, read_coordinates
from dembench.scene import Box, Cylinder, Frustum, Plane

PUBLISHED = Path(__file__).parents[3] / "shared" / "data" / "dosta2024"


SAMPLED = 2e-3
"""Accuracy of solid fractions [-]: 400 000 points, of which about a third lie in cells that a surface cuts."""


def box(lower, upper):
    return (Box(name="box", material="steel", lower=tuple(lower), upper=tuple(upper), open_faces=("z+",)),)


def cubic_bed(counts, radius, overlap=0.0):
    """A simple cubic packing with its floor at z = 0.5 m, and its box."""
    pitch = 2 * radius * (1 - overlap)
    index = np.stack(np.meshgrid(*[np.arange(n) for n in counts], indexing="ij"), axis=-1).reshape(-1, 3)
    lower = np.array([-1.0, 2.0, 0.5])
    position = lower + radius + index * pitch
    return position, box(lower, lower + np.array(counts) * pitch)


def test_simple_cubic_packing():
    position, walls = cubic_bed((12, 12, 12), 0.002)
    found = packing(position, 0.002 * (1 + 1e-9), walls)
    assert found.count == 12**3
    assert found.height == pytest.approx(12 * 0.004)
    assert found.fraction == pytest.approx(np.pi / 6, abs=SAMPLED)
    assert found.bulk_fraction == pytest.approx(np.pi / 6, abs=2 * SAMPLED)
    assert found.coordination == pytest.approx(2 * 3 * 12 * 12 * 11 / 12**3)
    assert found.largest_overlap == pytest.approx(0, abs=1e-8)


def test_spheres_of_two_sizes():
    """A small sphere in every hole of a cubic packing of large ones: radius (sqrt(3) - 1) R, touching eight."""
    position, walls = cubic_bed((12, 12, 12), 0.002)
    small = (np.sqrt(3) - 1) * 0.002
    holes = position.reshape(12, 12, 12, 3)[:-1, :-1, :-1].reshape(-1, 3) + 0.002
    radius = np.append(np.full(len(position), 0.002), np.full(len(holes), small)) * (1 + 1e-9)
    found = packing(np.vstack([position, holes]), radius, walls)
    assert found.coordination == pytest.approx(2 * (3 * 12 * 12 * 11 + 8 * 11**3) / (12**3 + 11**3))
    solid = 4 / 3 * np.pi * (12**3 * 0.002**3 + 11**3 * small**3) / (12 * 0.004) ** 3
    assert found.fraction == pytest.approx(solid, abs=SAMPLED)


def test_the_volume_inside_a_silo():
    """One sphere in a cone below a cylinder: the fraction is its volume over that of the walls below its top."""
    walls = (
        Cylinder(name="barrel", material="steel", start=(0, 0, 0.07), end=(0, 0, 0.3), radius=0.1),
        Frustum(name="cone", material="steel", start=(0, 0, 0), end=(0, 0, 0.07), radius_start=0.03, radius_end=0.1),
        Plane(name="plug", material="steel", point=(0, 0, 0), normal=(0, 0, 1)),
    )
    found = packing(np.array([[0.0, 0.0, 0.11]]), 0.09, walls)
    assert found.height == pytest.approx(0.2)
    inside = np.pi * (0.07 / 3 * (0.03**2 + 0.03 * 0.1 + 0.1**2) + 0.13 * 0.1**2)
    assert found.fraction == pytest.approx(4 / 3 * np.pi * 0.09**3 / inside, abs=SAMPLED)


def test_overlaps_are_in_diameters():
    position, walls = cubic_bed((12, 12, 12), 0.002, overlap=0.01)
    found = packing(position, 0.002, walls)
    assert found.largest_overlap == pytest.approx(0.01)
    assert found.mean_overlap == pytest.approx(0.01)


def test_the_surface_in_a_round_container_is_that_of_its_middle():
    """A cubic packing cut to a cylinder: columns at the rim that hold low grains only do not lower its surface."""
    position, _ = cubic_bed((12, 12, 12), 0.002)
    position = position - position.mean(axis=0) + [0, 0, 0.024]
    away = np.linalg.norm(position[:, :2], axis=1)
    inside = (away < 0.0226) | ((away < 0.024) & (position[:, 2] < 0.01))
    walls = (Cylinder(name="tube", material="steel", start=(0, 0, 0), end=(0, 0, 0.1), radius=0.026),)
    top = tops(position[inside], np.full(inside.sum(), 0.002), walls)
    assert len(top) > 40
    np.testing.assert_allclose(top, 0.048)


def test_a_flat_bed_has_no_bulk():
    position, walls = cubic_bed((12, 12, 2), 0.002)
    assert np.isnan(packing(position, 0.002, walls).bulk_fraction)


def test_walls_without_end_are_refused():
    position, _ = cubic_bed((2, 2, 2), 0.002)
    with pytest.raises(ValueError, match="open without end along x"):
        packing(position, 0.002, (Plane(name="floor", material="steel", point=(0, 0, 0), normal=(0, 0, 1)),))


@pytest.mark.skipif(not PUBLISHED.is_dir(), reason="the published coordinate files are not beside the checkout")
def test_the_published_bed():
    """Independent figures: height 0.0320 m, whole bed 0.556, bulk 0.579, coordination 4.31, overlap 0.045 %."""
    bed = read_coordinates(find_file(PUBLISHED, "impact 25k"), [0.001], ball=0.01)
    found = packing(bed.position, 0.001, box((-0.049, -0.03, -0.0902431), (0.049, 0.03, 0.107757)))
    assert found.height == pytest.approx(0.0320, abs=5e-5)
    assert found.fraction == pytest.approx(0.556, abs=SAMPLED)
    assert found.bulk_fraction == pytest.approx(0.579, abs=3e-3)
    assert found.coordination == pytest.approx(4.31, abs=5e-3)
    assert found.largest_overlap == pytest.approx(0.00045, abs=5e-6)
