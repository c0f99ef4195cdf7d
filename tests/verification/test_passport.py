"""Law passports: the named laws against closed forms and solve_ivp, and engines that compute another law."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from passports import passport
from scipy.integrate import solve_ivp

from dembench.results import Result
from dembench.results.schema import SnapshotSeries
from dembench.verification.laws import LAWS, NamedLaw
from dembench.verification.passport import measure, record, scenes
from dembench.verification.passport.pairs import Motion, clipped_restitution, motions
from dembench.verification.passport.suite import SLIP_TOLERANCE, TOLERANCE, suite
from dembench.verification.rows import measured

PUBLISHED_CLIPPED = [0.2527, 0.3249, 0.3971, 0.4720, 0.5503, 0.6323, 0.7182, 0.8081, 0.9020, 0.9801]
"""Restitution with clipped tension for e = 0.1 to 0.9 and 0.98 (Schwager & Poeschel 2007, to four digits)."""


def law(name: str) -> NamedLaw:
    return next(law for law in LAWS if law.name == name)


def restitutions(name: str) -> np.ndarray:
    seen = measure.restitution(measure.pairs(), measure.predicted()[name])
    return seen[scenes.of_family("normal")]


@pytest.mark.parametrize("name", ["hertz-mindlin", "full-lever", "linear", "rigid"])
def test_laws_with_tension_return_the_restitution_of_the_pair(name: str) -> None:
    """Antypov & Elliott 2011; a linear dashpot sets in at once, so that a 400th of a contact counts in its first step.

    Half a step of that dashpot changes the velocity by b pi/400, at most 2e-3 of what is left.
    """
    np.testing.assert_allclose(restitutions(name), scenes.RESTITUTIONS, atol=1e-3 if name == "linear" else 4e-4)


def test_clipped_tension_follows_schwager_and_poeschel() -> None:
    exact = [clipped_restitution(e) for e in scenes.RESTITUTIONS]
    np.testing.assert_allclose(exact, PUBLISHED_CLIPPED, atol=6e-5)
    np.testing.assert_allclose(restitutions("no-tension"), exact, atol=3e-4)


def test_thorntons_damping_makes_up_for_the_clipped_tension() -> None:
    """Up to 0.9 the fit is off by 2.5e-4 and the first of 400 steps by 2.2e-4; at 0.98 the fit itself is by 0.0076."""
    given = np.array([e for e in scenes.RESTITUTIONS if e <= 0.9])
    np.testing.assert_allclose(restitutions("thornton")[: len(given)], given, atol=5e-4)
    assert restitutions("thornton")[-1] == pytest.approx(0.98 - 0.0076, abs=5e-4)


def test_a_head_on_impact_is_that_of_solve_ivp() -> None:
    """m* x'' = -k x^1.5 - c x^0.25 x', to 1e-10; the first of the reference's 400 steps leaves 2.2e-4."""
    pairs, k = measure.pairs(), scenes.of_family("normal")[2]
    mass, stiff = pairs.reduced_mass[k], pairs.hertz[k]
    log = math.log(pairs.restitution[k])
    damping = -2 * math.sqrt(5 / 6) * log / math.hypot(log, math.pi) * math.sqrt(1.5 * stiff * mass)

    def motion(_: float, y: np.ndarray) -> list[float]:
        x = max(y[0], 0.0)
        return [y[1], -(stiff * x**1.5 + damping * x**0.25 * y[1]) / mass * (y[0] > 0)]

    seen = measure.predicted()["hertz-mindlin"]
    touch = scenes.FIRST * scenes.DT
    times = seen.time[(seen.time > touch) & (seen.time < touch + 0.9 * scenes.contact_time())]
    exact = solve_ivp(motion, (touch, times[-1]), [0.0, scenes.SPEED], t_eval=times, rtol=1e-10, atol=1e-14)
    found = measure.overlap(pairs, seen)[np.isin(seen.time, times), k]
    np.testing.assert_allclose(found, exact.y[0], atol=5e-4 * pairs.deepest[k])


def test_gross_slip_of_rigid_spheres_is_walton() -> None:
    own = scenes.of_family("sliding")
    found = measure.friction(measure.pairs(), measure.predicted()["rigid"])[own]
    np.testing.assert_allclose(found, scenes.FRICTION, rtol=1e-12)


def test_the_dashpot_adds_to_friction_at_low_restitution_only() -> None:
    """A law whose bound leaves the dashpot out exceeds mu; without it, and with the dashpot inside, it does not."""
    own = scenes.of_family("sliding")
    found = {name: measure.friction(measure.pairs(), m)[own] for name, m in measure.predicted().items()}
    assert found["hertz-mindlin"][0] > 1.5 * scenes.FRICTION
    assert found["hertz-mindlin"][-1] < 1.03 * scenes.FRICTION
    assert (found["spring-bound"] < 1.03 * scenes.FRICTION).all()


@pytest.mark.parametrize("name", [law.name for law in LAWS])
def test_momentum_and_angular_momentum_are_kept(name: str) -> None:
    """Reduced levers meet in the middle of the overlap only where radii are equal, so the others are left out.

    Steps of fourth order keep what is linear in the velocities to rounding, the product with positions to their order.
    """
    pairs, seen = measure.pairs(), measure.predicted()[name]
    momentum = (pairs.mass[:, :, None] * seen.velocity).sum(axis=2)
    np.testing.assert_allclose(momentum, momentum[:1].repeat(len(momentum), axis=0), atol=1e-12)
    if name in ("full-lever", "two-thirds", "rigid"):
        return  # their levers overlap, and turn more than the forces do
    x, v = seen.position, seen.velocity
    orbit = (pairs.mass * (x[..., 0] * v[..., 1] - x[..., 1] * v[..., 0])).sum(axis=2)
    total = orbit + (pairs.inertia * seen.spin).sum(axis=2)
    equal = pairs.radius[:, 0] == pairs.radius[:, 1]
    scale = pairs.reduced_mass * pairs.approach * pairs.radius.sum(axis=1)
    assert np.abs((total - total[0]) / scale)[:, equal].max() < 2e-9


def test_energy_never_rises() -> None:
    pairs = measure.pairs()
    for name, seen in measure.predicted().items():
        moving = (pairs.mass[:, :, None] * seen.velocity**2).sum(axis=(2, 3)) + (pairs.inertia * seen.spin**2).sum(2)
        assert (moving[-1] <= moving[0] * (1 + 1e-9)).all(), name


def test_rolling_takes_the_spin_that_the_impulse_gives() -> None:
    """mu_r R* (1 + e) m* v/I, and a little more: the pull at the end of a contact counts as a push, for e 0.9 0.1 %."""
    pairs, k = measure.pairs(), scenes.of_family("normal")[0]
    impulse = 1.9 * pairs.reduced_mass[k] * scenes.SPEED
    plain = np.array(scenes.ROLLING) * pairs.reduced_radius[k] * impulse / pairs.inertia[k, 0]
    share = measure.rolling_losses() / plain
    assert (share > 1).all() and (share < 1.01).all()


# ---- synthetic engines


def as_result(seen: Motion) -> Result:
    """What an engine would have recorded."""
    scene = measure.scene()
    n = len(scene.bodies)

    def in_space(values: np.ndarray) -> np.ndarray:
        flat = values.reshape(len(seen.time), n, 2)
        return np.concatenate([flat, np.zeros_like(flat[..., :1])], axis=2)

    spin = np.zeros((len(seen.time), n, 3))
    spin[..., 2] = seen.spin.reshape(len(seen.time), n)
    series = SnapshotSeries(
        np.arange(len(seen.time)), seen.time, in_space(seen.position), in_space(seen.velocity), spin
    )
    return Result(scene, "synthetic", "closed", snapshots={scenes.MOTION: series})


def rows(result: Result) -> tuple[dict[str, float], set[str]]:
    """Values of the suite's checks, and the ids of those that are missed."""
    experiment = suite().experiments[0]
    found, trouble = measured(experiment, {experiment.trials[0].name: result})
    assert not trouble
    return found, {check.id for check in experiment.checks if not check.accepts(found[check.id])}


@pytest.mark.parametrize("name", [law.name for law in LAWS])
def test_an_engine_is_named_by_its_law(name: str) -> None:
    """Also with steps twice as long as those of the reference."""
    (seen,) = motions([law(name)], measure.pairs(), measure.scene().frame_times(), steps=2)
    found = measure.distances(measure.motion_of(as_result(seen)))
    assert measure.nearest(found).name == name
    _, missed = rows(as_result(seen))
    assert missed == set() if name == "hertz-mindlin" else "LP1" in missed
    assert "LP0" not in missed


FAULTS = {
    "restitution": ("restitution", lambda p: dataclasses.replace(p, restitution=p.restitution * 0.97)),
    "friction": ("sliding", lambda p: dataclasses.replace(p, friction=p.friction * 1.05)),
    "stiffness": ("normal", lambda p: dataclasses.replace(p, young=p.young * 1.1)),
    "shear": ("shear", lambda p: dataclasses.replace(p, shear=p.shear * 1.1)),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_wrong_constant_is_seen_in_its_aspect(fault: str) -> None:
    aspect, spoil = FAULTS[fault]
    (seen,) = motions(LAWS[:1], spoil(measure.pairs()), measure.scene().frame_times())
    _, missed = rows(as_result(seen))
    assert f"LP1-{aspect}" in missed


def test_a_pair_table_by_mixing_is_seen() -> None:
    """An engine that takes the mean of both materials for a pair of two: e = 0.7 in the place of 0.3."""
    pairs = measure.pairs()
    mixed = pairs.restitution.copy()
    mixed[scenes.of_family("mixed")[:2]] = 0.7
    (seen,) = motions(
        LAWS[:1], dataclasses.replace(pairs, restitution=mixed), measure.scene().frame_times(), measure.SUBSTEPS
    )
    assert rows(as_result(seen))[1] == {"LP0", "LP1", "LP1-mixing"}


def test_tolerances_tell_all_named_laws_apart() -> None:
    found = {name: measure.distances(seen) for name, seen in measure.predicted().items()}
    apart = [measure.together(found[a.name][b.name]) for a in LAWS for b in LAWS if a is not b]
    assert min(apart) > 1.1 * TOLERANCE
    assert SLIP_TOLERANCE < 0.1


# ---- what is kept


def test_a_passport_speaks_for_other_steps_but_not_for_other_rows(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("DEMBENCH_CACHE", str(tmp_path / "cache"))
    one = passport("any", "1", {"dt": 1e-6, "rows": "rigid"}, "rigid")
    file = record.keep([one], tmp_path / "verify")
    assert json.loads(file.read_text())[0]["fits"] == "rigid"
    assert record.kept("any", "1", {"dt": 1e-3, "rows": "rigid", "skin": 0.1}) == one
    assert record.kept("any", "1", {"dt": 1e-6, "rows": "compliant"}) is None
    assert record.kept("any", "2", {"dt": 1e-6, "rows": "rigid"}) is None
    later = one.model_copy(update={"date": "2026-02-01", "settings": {"dt": 2e-6, "rows": "rigid"}})
    record.keep([later], tmp_path / "verify")
    assert record.kept("any", "1", {"rows": "rigid"}) == later
