"""The statistical suite: its measures on series that are known, its scenes, its checks."""

from __future__ import annotations

import numpy as np
import pytest

from dembench.engines import registry
from dembench.scene.checks import check_scene
from dembench.verification.statistical import beds, collapse, gas, grains, heaps, incline, orifice, silo
from dembench.verification.statistical.suite import suite


def test_a_gas_by_haffs_law_has_its_time_and_exponent() -> None:
    """T = T0/(1 + t/tau)^2 gives tau and -2 back; one that cools as 1/(1 + t/tau) is seen in both."""
    tau = gas.haff_time()
    time = np.linspace(0, gas.SPAN * tau, 61)
    found, exponent = gas.cooling(time, 3 / (1 + time / tau) ** 2, tau)
    assert found == pytest.approx(tau, rel=1e-9) and exponent == pytest.approx(-2, rel=1e-9)
    found, exponent = gas.cooling(time, 3 / (1 + time / tau), tau)
    (time_check, exponent_check) = gas.experiment().checks
    assert not time_check.accepts(found) and not exponent_check.accepts(exponent)
    found, _ = gas.cooling(time, 3 / (1 + time / (1.06 * tau)) ** 2, tau)
    assert not time_check.accepts(found)


def test_the_time_of_haff_is_that_of_enskogs_frequency() -> None:
    """At 5 % and e = 0.9 a sphere of 2 mm at 0.2 m/s collides 77 times a second; tau goes as 1/speed."""
    assert gas.haff_time() == pytest.approx(6 / (0.19 * 77), rel=0.01)
    assert gas.haff_time(2 * gas.THERMAL) == pytest.approx(gas.haff_time() / 2)


def test_solid_fractions_of_a_lattice_are_exact() -> None:
    """Simple cubic layers fill pi/6 of every layer that is a whole number of periods high, wherever it is cut."""
    height = np.repeat(np.arange(10) * 2.0, 9)
    for low in (4.0, 4.3, 5.0):
        assert beds.solid_fraction(height, 1.0, 36.0, low, low + 6) == pytest.approx(np.pi / 6, rel=1e-12)


def test_the_saturation_of_janssens_law_is_found() -> None:
    """Masses by the law give M_s back; a floor that carries everything is seen as no saturation and as a deviation."""
    filled = np.array([1.0, 2.0, 3.0])
    limit, deviation = silo.saturation(filled, 0.8 * (1 - np.exp(-filled / 0.8)))
    assert limit == pytest.approx(0.8, rel=1e-6) and deviation < 1e-6
    checks = {check.id: check for check in silo.experiment().checks}
    limit, _ = silo.saturation(filled, 0.999 * filled)
    assert limit > 100 and not checks["BK1c"].accepts(0.999)
    _, deviation = silo.saturation(filled, [0.3, 0.7, 1.4])
    assert not checks["BK1b"].accepts(deviation)


def test_beverloos_law_gives_its_constants_back() -> None:
    """Rates by the law have its C and exponent; k = 2, rates as the square of the width and a liquid are refused."""
    checks = {check.id: check for check in orifice.experiment().checks}
    widths = np.array([6.0, 8.0, 10.0]) * grains.DIAMETER
    rates = 0.58 * np.sqrt(9.81) * (widths - 1.4 * grains.DIAMETER) ** 2.5
    assert orifice.constant(1500 * rates[0], 1500, widths[0]) == pytest.approx(0.58)
    assert orifice.exponent(rates, widths) == pytest.approx(2.5)
    for wrong in (widths**2, (widths - 2 * grains.DIAMETER) ** 2.5):
        assert not checks["BK2b"].accepts(orifice.exponent(wrong, widths))
    time = np.linspace(0, 1, 81)
    steady, slow = (time, 5000 - 2000 * time), (time, 5000 - 100 * time**2)
    assert orifice.head_exponent([steady, steady]) == pytest.approx(0, abs=1e-12)
    assert abs(orifice.head_exponent([steady, slow])) < 0.1 * abs(orifice.head_exponent([slow]))
    liquid = orifice.head_exponent(2 * [(time, (np.sqrt(5000) - 14 * time) ** 2)])
    assert liquid == pytest.approx(0.5, abs=0.01) and not checks["BK2c"].accepts(liquid)


def test_the_floor_of_a_silo_has_a_hole_of_the_right_area() -> None:
    """The triangles face up, cover the floor without overlap up to the barrel, and leave the area of the orifice."""
    triangles = orifice.ring(2.0, 5.0)
    area = 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert (area[:, 2] > 0).all()
    turn = 2 * np.pi / orifice.SIDES
    outer = orifice.SIDES * np.tan(0.5 * turn) * 5.0**2
    assert outer - area[:, 2].sum() == pytest.approx(np.pi * 2.0**2, rel=1e-12)
    middles = 0.5 * (triangles + np.roll(triangles, 1, axis=1)).reshape(-1, 3)
    outside = np.linalg.norm(middles, axis=1) > 4.9
    assert outside.any() and (np.linalg.norm(middles[outside], axis=1) >= 5.0 - 1e-12).all()


def points_in(size: float, height: float, generator: np.random.Generator) -> np.ndarray:
    """Random points in a box of that half-width and height [m] on z = 0, three for the volume of a sphere's cube."""
    count = int(3 * 4 * size**2 * height / grains.DIAMETER**3)
    return generator.uniform([-size, -size, 0], [size, size, height], (count, 3))


@pytest.mark.parametrize("angle", [15.0, 22.0, 30.0])
def test_the_slope_of_a_cone_is_measured(angle: float) -> None:
    """The angle of a cone of ten to seventeen layers of points is found to 1.5 degrees, also with rollers about it.

    The highest point of a cell lies below the surface by about a third of a diameter everywhere, which the slope does
    not see; near the foot it cannot, since a cell there has few points.
    """
    generator = np.random.default_rng(0)
    size, steep = 30 * grains.DIAMETER, np.tan(np.radians(angle))
    points = points_in(size, size * steep, generator)
    points = points[points[:, 2] < (size - np.hypot(points[:, 0], points[:, 1])) * steep]
    turn = generator.uniform(0, 2 * np.pi, 30)
    away = generator.uniform(31, 50, 30) * grains.DIAMETER
    alone = np.column_stack([away * np.cos(turn), away * np.sin(turn), np.zeros(30)])
    found = heaps.slope_angle(np.vstack([points, alone]))
    assert found == pytest.approx(angle, abs=1.5)


def test_a_heap_that_is_a_layer_has_no_slope() -> None:
    """Grains that have rolled apart are no heap."""
    points = grains.column(20 * grains.DIAMETER, 1, np.random.default_rng(0))
    with pytest.raises(ValueError, match="too small"):
        heaps.slope_angle(points)


def test_the_edge_of_a_deposit_is_measured_without_lone_grains() -> None:
    """A disc has its radius to a ring, whatever rolls alone about it; a gap ends it; none is no heap."""
    generator = np.random.default_rng(0)
    size = 20 * grains.DIAMETER
    points = points_in(size, 10 * grains.DIAMETER, generator)
    away = np.hypot(points[:, 0], points[:, 1])
    disc = points[away < size]
    turn = generator.uniform(0, 2 * np.pi, 40)
    beyond = generator.uniform(1.1, 1.5, 40) * size
    alone = np.column_stack([beyond * np.cos(turn), beyond * np.sin(turn), np.zeros(40)])
    assert grains.edge(np.vstack([disc, alone])) == pytest.approx(size, abs=grains.DIAMETER)
    gap = points[(away < 8 * grains.DIAMETER) | (away > 10 * grains.DIAMETER)]
    assert grains.edge(gap) == pytest.approx(8 * grains.DIAMETER, abs=grains.DIAMETER)
    assert grains.edge(alone) == 0


def test_the_law_of_lube_has_its_numbers() -> None:
    """Run-outs at aspect ratios 0.9 and 3 by hand; run-outs in proportion to the aspect ratio are refused."""
    assert collapse.run_out(0.9) == pytest.approx(1.116) and collapse.run_out(3) == pytest.approx(2.771, abs=1e-3)
    (check,) = (check for check in collapse.experiment().checks if check.id == "BK3c")
    assert check.expected == pytest.approx(0.75546, abs=1e-5)
    assert not check.accepts(collapse.growth(0.9, 3.0))


@pytest.mark.parametrize("aspect", collapse.ASPECTS)
def test_a_column_is_a_dense_random_packing(aspect: float) -> None:
    """It has the solid fraction of a settled bed, 0.54 to 0.6; the seam of two cuts is at most a diameter wide."""
    height = aspect * collapse.COLUMN
    points = collapse.packed(height, np.random.default_rng(0))
    area = np.pi * collapse.COLUMN**2
    for low, high in ((0.05, 0.45), (0.55, 0.95)):
        assert 0.54 < beds.solid_fraction(points[:, 2], grains.RADIUS, area, low * height, high * height) < 0.6
    assert points[:, 2].max() < height + grains.DIAMETER


def flow(inertial: float, slip: float = 0.0, power: float = 1.5) -> incline.Flow:
    """What is measured of a flow of uniform density with a profile h^p - (h - z)^p and the shear rate of I at h/2."""
    generator = np.random.default_rng(0)
    top, pressing = 20 * grains.DIAMETER, grains.GRAVITY * np.cos(np.radians(25))
    count = round(0.57 * incline.AREA * top / (np.pi / 6 * grains.DIAMETER**3))
    height = generator.uniform(0, top, (100, count))
    shear = inertial * np.sqrt(0.57 * pressing * 0.5 * top) / grains.DIAMETER
    speed = slip + shear * (top**power - (top - height) ** power) / (power * (0.5 * top) ** (power - 1))
    return incline.measured(np.linspace(0, 1, 100), height, speed, pressing)


@pytest.mark.parametrize("inertial", [0.02, 0.2])
def test_the_inertial_number_of_a_bagnold_flow_is_found(inertial: float) -> None:
    """A profile by Bagnold gives its I back to 1 %, its solid fraction, and hardly a misfit, with and without slip."""
    for slip in (0.0, 0.1):
        found = flow(inertial, slip)
        assert found.inertial == pytest.approx(inertial, rel=0.01)
        assert found.fraction == pytest.approx(0.57, rel=0.01)
        assert found.misfit < 0.01 and abs(found.drift) < 1e-3


def test_other_profiles_are_no_bagnold_flow() -> None:
    """A linear profile, as of thin slow flows, and that of a liquid, h^2 - (h - z)^2, exceed the tolerance."""
    (check,) = (check for check in incline.experiment().checks if check.id == "BK9")
    assert all(not check.accepts(flow(0.1, power=power).misfit) for power in (1.0, 2.2))


def test_the_friction_law_is_found() -> None:
    """Flows by the law of glass beads, mu_s = tan 20.9 degrees, give it back; flows of one I at all angles are none."""
    checks = {check.id: check for check in incline.experiment().checks}
    inertial = np.array([0.05, 0.1, 0.2])
    friction = np.tan(np.radians(20.9)) + incline.rise(inertial)
    static, distance = incline.friction_law(np.degrees(np.arctan(friction)), inertial)
    assert static == pytest.approx(0.38186, abs=1e-5) and distance < 1e-12
    assert incline.rise(np.array([0.279]))[0] == pytest.approx(0.5 * (0.64446 - 0.38186), abs=1e-5)
    _, distance = incline.friction_law(np.array(list(incline.START)), np.full(3, 0.1))
    assert not checks["BK8b"].accepts(distance)


def test_bounds_have_the_kind_that_they_are_given() -> None:
    """What publications say is no closed form, whichever way a check of it is made; steady flow is the balance."""
    kinds = {check.id: check.kind for check in incline.experiment().checks}
    assert kinds.pop("BK8d") == "closed form" and set(kinds.values()) == {"publication"}


@pytest.mark.parametrize("name", ["peclet", "peclet-hertz", "liggghts"])
def test_every_engine_of_the_law_runs_every_scene(name: str) -> None:
    """No feature of a scene is beyond an engine that computes the law of the scenes."""
    for experiment in suite().experiments:
        trial = experiment.trials[0]
        assert registry.engine(name).unsupported(trial.scene()) == []


def test_scenes_fit_and_seeds_differ() -> None:
    """Every trial builds; names are unique; two seeds are two starts of one scene."""
    made = [(trial.name, trial.scene()) for e in suite().experiments for trial in e.trials]
    assert len({name for name, _ in made}) == len(made)
    for _, scene in made:
        check_scene(scene)
    assert len({scene.digest() for _, scene in made}) == len(made)
    assert all(experiment.tier == "statistical" for experiment in suite().experiments)
