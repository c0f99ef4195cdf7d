"""Quality of packings: density by height, and stresses against weights and Janssen's formula."""

import json
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

from dembench.cli import app
from dembench.initial.filling import SOFT, Filling, Layer, PackingError, filled
from dembench.initial.quality import quality
from dembench.initial.stress import janssen, shaft
from dembench.scene import Box, Cylinder, Material, PairLaw, Plane, Species
from dembench.share import share

RADIUS, TUBE = 0.0015, 0.012


@pytest.fixture(autouse=True, scope="module")
def own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DEMBENCH_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def plan(walls, count, wall_friction):
    return Filling(
        materials=(
            Material(name="grain", density=2500, young=1e6, poisson=0.2),
            Material(name="wall", density=2500, young=1e6, poisson=0.2),
        ),
        pair_laws=(
            PairLaw(a="grain", b="grain", restitution=0.5, friction=0.3),
            PairLaw(a="grain", b="wall", restitution=0.5, friction=wall_friction),
        ),
        species=(Species(name="grain", material="grain", radius=RADIUS),),
        walls=walls,
        layers=(Layer(species="grain", count=count),),
        protocol=SOFT,
    )


@pytest.fixture(scope="module")
def column():
    """A tube five diameters high and eight grains wide, with a wall that rubs."""
    tube = Cylinder(name="tube", material="wall", start=(0, 0, 0), end=(0, 0, 0.3), radius=TUBE)
    floor = Plane(name="floor", material="wall", point=(0, 0, 0), normal=(0, 0, 1))
    asked = plan((tube, floor), 2200, 0.4)
    return quality(asked, filled(asked, 0))


def values(found, name):
    rows = [(x.height, getattr(x, name)) for x in found.levels if getattr(x, name) is not None]
    return np.array(rows).T


def test_walls_carry_the_column(column):
    held = column.support
    assert held.weight == pytest.approx(2200 * 2500 * 4 / 3 * math.pi * RADIUS**3 * 9.81)
    assert abs(held.residual) < 0.01
    assert held.density == pytest.approx(2500 * column.packing.fraction, rel=0.05)
    assert 0 < held.mobilised_friction <= 0.4 * (1 + 1e-3)
    assert 0.3 < held.pressure_ratio < 1.2
    assert held.length == pytest.approx(TUBE / (2 * held.pressure_ratio * 0.4))
    _, stress = values(column, "stress")
    _, weight = values(column, "hydrostatic")
    assert stress[0] < 0.7 * weight[0]


def test_the_column_follows_janssen_with_the_friction_that_it_mobilises(column):
    """A tenth of the largest stress: ratio and friction are means over the column, and planes cut 200 grains each."""
    height, stress = values(column, "stress")
    above, formula = values(column, "janssen")
    np.testing.assert_array_equal(above, height)
    inside = (height > 0.1 * column.surface.mean) & (height < 0.95 * column.surface.mean)
    np.testing.assert_allclose(stress[inside], formula[inside], atol=0.1 * formula.max())
    held = column.support
    expected = janssen(column.surface.mean - height, held.density, held.mobilised_length, 9.81)
    np.testing.assert_allclose(formula, expected)


def test_smooth_walls_carry_nothing():
    """Every plane passes the weight above it: to 1 % of all of it at rest, and a hundredth for what a plane cuts."""
    box = Box(name="box", material="wall", lower=(0, 0, 0), upper=(0.03, 0.03, 0.2), open_faces=("z+",))
    asked = plan((box,), 900, 0.0)
    found = quality(asked, filled(asked, 0))
    _, stress = values(found, "stress")
    _, weight = values(found, "hydrostatic")
    np.testing.assert_allclose(stress, weight, atol=0.02 * weight.max())
    assert found.support.mobilised_friction == pytest.approx(0, abs=1e-6)
    assert found.support.length is None and found.support.mobilised_length is None


def test_density_and_surface(column):
    found = column
    _, fraction = values(found, "fraction")
    assert found.packing.fraction == pytest.approx(fraction.mean(), abs=0.05)
    assert found.surface.lowest < found.surface.mean < found.surface.highest
    assert found.surface.mean == found.packing.height
    assert found.surface.deviation < 4 * RADIUS


def test_janssen_solves_its_differential_equation():
    depth, density, length = np.linspace(0, 0.5, 20), 1450.0, 0.06
    solved = solve_ivp(
        lambda h, s: density * 9.81 - s / length, (0, 0.5), [0.0], t_eval=depth, rtol=1e-10, atol=1e-8, method="LSODA"
    )
    np.testing.assert_allclose(janssen(depth, density, length, 9.81), solved.y[0], rtol=1e-6, atol=1e-5)
    np.testing.assert_allclose(janssen(depth, density, None, 9.81), density * 9.81 * depth)
    np.testing.assert_allclose(janssen(depth, density, 1e6, 9.81), density * 9.81 * depth, rtol=1e-6)


def test_shafts():
    barrel = Cylinder(name="barrel", material="wall", start=(0, 0, 0.3), end=(0, 0, 0.1), radius=0.1)
    found = shaft((barrel,))
    assert (found.area, found.perimeter) == (pytest.approx(math.pi * 0.01), pytest.approx(0.2 * math.pi))
    assert (found.lower, found.upper) == (0.1, 0.3)
    drum = barrel.model_copy(update={"start": (0.0, -0.03, 0.0), "end": (0.0, 0.03, 0.0)})
    assert shaft((drum,)) is None
    found = shaft((Box(name="box", material="wall", lower=(0, 0, 0), upper=(2, 3, 4)),))
    assert (found.area, found.perimeter, found.upper) == (6, 10, 4)


def test_less_than_a_layer_is_refused():
    box = Box(name="box", material="wall", lower=(0, 0, 0), upper=(0.03, 0.03, 0.2), open_faces=("z+",))
    with pytest.raises(PackingError, match="3 particles make no layer"):
        quality(plan((box,), 3, 0.0), np.array([[x, 0.01, RADIUS] for x in (0.01, 0.014, 0.018)]))


def invoke(*arguments):
    return CliRunner().invoke(app, ["initial", "quality", *[str(a) for a in arguments]])


def test_the_verb_shows_a_file_and_a_case(tmp_path):
    bed = share("data", "beds", "case2.npz")
    shown = invoke(bed, "--no-forces", "--figure", tmp_path / "new" / "bed.svg")
    assert shown.exit_code == 0 and "coordination number" in shown.stdout
    assert "<svg" in (tmp_path / "new" / "bed.svg").read_text()
    of_file = json.loads(invoke(bed, "--no-forces", "--json").stdout)
    of_case = json.loads(invoke("case2", "--no-forces", "--json").stdout)
    assert of_file == of_case
    assert of_file["packing"]["count"] == 4750 and of_file["support"] is None
    stressed = json.loads(invoke(share("data", "beds", "case3.npz"), "--json").stdout)
    assert stressed["support"]["residual"] == pytest.approx(0, abs=0.01)


def test_what_cannot_be_shown_is_refused(tmp_path):
    assert "accepted are *.svg" in invoke("case2", "--figure", tmp_path / "bed.txt").stderr
    missing = invoke(tmp_path / "none.npz")
    assert missing.exit_code == 2 and "no bed" in missing.stderr
