"""The statistical suite: its measures on series that are known, its scenes, its checks."""

from __future__ import annotations

import numpy as np
import pytest

from dembench.scene.checks import check_scene
from dembench.verification.statistical import beds, gas, silo
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


def test_scenes_fit_and_seeds_differ() -> None:
    """Every trial builds; names are unique; two seeds are two starts of one scene."""
    made = [(trial.name, trial.scene()) for e in suite().experiments for trial in e.trials]
    assert len({name for name, _ in made}) == len(made)
    for _, scene in made:
        check_scene(scene)
    assert len({scene.digest() for _, scene in made}) == len(made)
    assert all(experiment.tier == "statistical" for experiment in suite().experiments)
