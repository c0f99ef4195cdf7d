"""Figures of a packing, on beds whose figures are known."""

from pathlib import Path

import numpy as np
import pytest

from dembench.initial.published import find_file, read_coordinates
from dembench.initial.quality import packing

PUBLISHED = Path(__file__).parents[3] / "shared" / "data" / "dosta2024"


def cubic_bed(counts, radius, overlap=0.0):
    """A simple cubic packing with its floor at z = 0.5 m, and its box."""
    pitch = 2 * radius * (1 - overlap)
    index = np.stack(np.meshgrid(*[np.arange(n) for n in counts], indexing="ij"), axis=-1).reshape(-1, 3)
    lower = np.array([-1.0, 2.0, 0.5])
    position = lower + radius + index * pitch
    return position, lower, lower + np.array(counts) * pitch


def test_simple_cubic_packing():
    position, lower, upper = cubic_bed((12, 12, 12), 0.002)
    found = packing(position, 0.002 * (1 + 1e-9), lower, upper)
    assert found.count == 12**3
    assert found.height == pytest.approx(12 * 0.004)
    assert found.fraction == pytest.approx(np.pi / 6)
    assert found.bulk_fraction == pytest.approx(np.pi / 6)
    assert found.coordination == pytest.approx(2 * 3 * 12 * 12 * 11 / 12**3)
    assert found.largest_overlap == pytest.approx(0, abs=1e-8)


def test_overlap_is_in_diameters():
    position, lower, upper = cubic_bed((12, 12, 12), 0.002, overlap=0.01)
    assert packing(position, 0.002, lower, upper).largest_overlap == pytest.approx(0.01)


def test_a_flat_bed_has_no_bulk():
    position, lower, upper = cubic_bed((12, 12, 2), 0.002)
    assert np.isnan(packing(position, 0.002, lower, upper).bulk_fraction)


@pytest.mark.skipif(not PUBLISHED.is_dir(), reason="the published coordinate files are not beside the checkout")
def test_the_published_bed():
    """Independent figures: height 0.0320 m, whole bed 0.556, bulk 0.579, coordination 4.31, overlap 0.045 %."""
    bed = read_coordinates(find_file(PUBLISHED, "impact 25k"), [0.001], ball=0.01)
    found = packing(bed.position, 0.001, np.array([-0.049, -0.03, -0.0902431]), np.array([0.049, 0.03, 0.107757]))
    assert found.height == pytest.approx(0.0320, abs=5e-5)
    assert found.fraction == pytest.approx(0.556, abs=5e-4)
    assert found.bulk_fraction == pytest.approx(0.579, abs=3e-3)
    assert found.coordination == pytest.approx(4.31, abs=5e-3)
    assert found.largest_overlap == pytest.approx(0.00045, abs=5e-6)
