"""The beds that ship: made by today's plans, at rest, and small."""

import math

import numpy as np
import pytest

from dembench.cases.registry import parse_case
from dembench.initial import filling
from dembench.initial.beds import Bed, BedError, read_bed, shipped, write_bed
from dembench.initial.cache import store
from dembench.initial.filling import inputs, measure
from dembench.scene import check_scene
from dembench.share import share

SHIPPED = ("case1[orifice=large]", "case1[orifice=small]", "case2", "case3")


def path_of(text):
    case, parameters = parse_case(text)
    return share("data", "beds", f"{case.bed_name(parameters)}.npz")


def by_bed(argument):
    return pytest.mark.parametrize(argument, SHIPPED, ids=[text.replace("orifice=", "") for text in SHIPPED])


@by_bed("text")
def test_a_shipped_bed_belongs_to_the_plan_of_today(text):
    """Otherwise: dembench initial make CASE --preset quick --out data/beds."""
    case, parameters = parse_case(text)
    bed = read_bed(path_of(text))
    assert bed.seed == 0
    assert inputs(bed.plan, 0) == inputs(case.filling(parameters, "quick"), 0)
    assert path_of(text).stat().st_size < 1_000_000
    np.testing.assert_array_equal(shipped(path_of(text).stem), bed.position)


@by_bed("text")
def test_the_quick_preset_starts_from_the_shipped_bed(text, monkeypatch):
    monkeypatch.setattr("dembench.cases.initial_states.filled", None)
    case, parameters = parse_case(text)
    scene = case.scene(parameters, "quick")
    bed = shipped(path_of(text).stem)
    np.testing.assert_array_equal(scene.bodies.position[: len(bed)], bed)
    check_scene(scene)


@by_bed("text")
def test_a_shipped_bed_rests(text):
    """In the time in which a free grain falls by its radius it gains m g r; those of a bed may gain a hundredth of it.

    Shear springs have to grow anew, so that grains move by a part of their overlaps.
    """
    bed = read_bed(path_of(text))
    simulation = filling._simulation(bed.plan, bed.position, bed.plan.protocol.stages[-1])
    masses, radius = simulation.scene.masses(), simulation.scene.radii()
    simulation.step(round(math.sqrt(2 * radius.min() / 9.81) / simulation.dt))
    assert simulation.kinetic_energy() < 0.01 * float((masses * radius).sum()) * 9.81
    moved = np.linalg.norm(simulation.position - bed.position, axis=1) / radius
    assert np.median(moved) < 0.05


@by_bed("text")
def test_figures_of_the_shipped_beds(text):
    found = measure(read_bed(path_of(text)).plan, shipped(path_of(text).stem))
    assert 0.56 < found.bulk_fraction < 0.60
    assert 4 < found.coordination < 5.5


def test_a_bed_is_read_as_it_was_written(tmp_path):
    bed = read_bed(path_of("case2"))
    write_bed(tmp_path / "new" / "bed.npz", bed)
    again = read_bed(tmp_path / "new" / "bed.npz")
    assert again.plan == bed.plan and again.seed == bed.seed
    np.testing.assert_array_equal(again.position, bed.position)


def test_files_that_are_no_beds(tmp_path):
    assert shipped("case9") is None
    with pytest.raises(BedError, match=r"nothing\.npz: no bed"):
        read_bed(tmp_path / "nothing.npz")
    (tmp_path / "text.npz").write_text("no bed")
    with pytest.raises(BedError, match=r"text\.npz: no bed"):
        read_bed(tmp_path / "text.npz")
    (tmp_path / "cut.npz").write_bytes(path_of("case3").read_bytes()[:5000])
    with pytest.raises(BedError, match=r"cut\.npz: no bed that .* has written: it is damaged, cut off"):
        read_bed(tmp_path / "cut.npz")
    store(tmp_path / "other.npz", {"n": 2}, np.zeros(3))
    with pytest.raises(BedError, match=r"other\.npz: no bed"):
        read_bed(tmp_path / "other.npz")
    whole = read_bed(path_of("case3"))
    write_bed(tmp_path / "short.npz", Bed(whole.plan, 0, whole.position[:9]))
    with pytest.raises(BedError, match=r"shape \(9, 3\); its plan has 3125 particles"):
        read_bed(tmp_path / "short.npz")
