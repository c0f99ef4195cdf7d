"""Bounces, chains, balls on floors and inclines, clusters and tops: closed forms, and measures on known motions."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from reading import Page
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

from dembench.cli import app
from dembench.results.schema import SnapshotSeries
from dembench.verification.checks import Check, Experiment
from dembench.verification.closed_forms import (
    chains,
    clusters,
    inclines,
    mfix,
    on_floor,
    order,
    tops,
    trough,
    walton,
    wedge,
)
from dembench.verification.scenes import MOTION
from dembench.verification.suites import suite

GRAVITY = 9.81


def experiment(name: str) -> Experiment:
    return next(e for e in suite("closed-forms").experiments if e.name == name)


def checks(name: str) -> dict[str, Check]:
    return {check.id: check for check in experiment(name).checks}


def measured(name: str, scene: Any, motion: SnapshotSeries, **observables: np.ndarray) -> dict[str, float]:
    seen = {key: SimpleNamespace(value=value) for key, value in observables.items()}
    result: Any = SimpleNamespace(scene=scene, snapshots={MOTION: motion}, observables=seen)
    return dict(experiment(name).measure({name: result}))


def accepted(name: str, found: dict[str, float]) -> set[str]:
    """Ids of the checks that are met."""
    return {id for id, check in checks(name).items() if check.accepts(found[id])}


def still(scene: Any) -> SnapshotSeries:
    """The bodies of a scene as they start, at all times that it records."""
    time, n = scene.frame_times(), len(scene.bodies)
    arrays = (scene.bodies.position, scene.bodies.velocity, scene.bodies.angular_velocity)
    copies = [np.broadcast_to(a, (len(time), n, 3)).copy() for a in arrays]
    return SnapshotSeries(np.arange(len(time)), time, *copies)


# ---- falls and bounces


def test_a_fall_on_a_spring_is_that_of_the_published_table() -> None:
    """MF01, time [s] and speed [m/s] of parting for three stiffnesses."""
    elastic = [mfix.spring_fall(k, 1.0) for k in mfix.SPRINGS]
    damped = [mfix.spring_fall(k, 0.8) for k in mfix.SPRINGS]
    assert [t for t, _ in elastic] == pytest.approx([0.39684, 0.35419, 0.33346], abs=1e-5)
    assert [v for _, v in elastic] == pytest.approx([2.8014] * 3, abs=1e-4)
    assert [t for t, _ in damped] == pytest.approx([0.39822, 0.35477, 0.33378], abs=1e-5)
    assert [v for _, v in damped] == pytest.approx([2.1495, 2.1854, 2.2025], abs=1e-4)


def test_the_time_of_parting_follows_from_the_flight_behind_it() -> None:
    scene = mfix.springs()
    motion, n = still(scene), 6
    known = [mfix.spring_fall(k, e) for k in mfix.SPRINGS for e in mfix.DAMPED]
    since = motion.time[-1] - np.array([t for t, _ in known])
    speed = np.array([v for _, v in known])
    for factor, letters in ((1.0, "tv"), (1.01, "t")):
        motion.position[-1, :n, 2] = mfix.RADIUS + factor * speed * since - 0.5 * GRAVITY * since**2
        motion.velocity[-1, :n, 2] = factor * speed - GRAVITY * since
        met = accepted("fall_on_spring", measured("fall_on_spring", scene, motion))
        assert {id for id in met if id.startswith("MF01")} == {f"MF01{k}{which}" for k in "abcdef" for which in letters}


def test_the_apex_of_a_bounce_lies_between_samples() -> None:
    """An exact flight, 10 ms apart: drop, two bounces with e = 0.7."""
    e, h = 0.7, mfix.HEIGHT - mfix.RADIUS
    time = np.arange(0, 1.2, 0.01) + 1e-3
    speed = mfix.FALL_SPEED * e ** np.arange(5)
    starts = mfix.FALL_TIME + np.concatenate([[0], np.cumsum(2 * speed[1:] / GRAVITY)])
    k = np.searchsorted(starts, time)
    since = time - np.where(k > 0, starts[np.maximum(k - 1, 0)], 0)
    v0, z0 = np.where(k > 0, speed[np.minimum(k, 4)], 0), np.where(k > 0, 0.0, h)
    z, v = mfix.RADIUS + z0 + v0 * since - 0.5 * GRAVITY * since**2, v0 - GRAVITY * since
    assert [mfix.apex(z, v, n) for n in (1, 2)] == pytest.approx([e**2, e**4], rel=1e-9)
    assert np.isnan(mfix.apex(z[:40], v[:40], 2))


# ---- chains


@pytest.mark.parametrize("chain", [chains.chain_of("glass", 0.0), mfix.linear_chain(10.891)])
def test_the_chain_keeps_momentum_and_energy(chain: chains.Chain) -> None:
    v = chain.velocities([chains.END if chain.exponent == 1.5 else 0.42])[-1] / chain.speed
    assert (v.sum(), (v**2).sum()) == pytest.approx((1, 1), abs=1e-7)
    assert v[-1] < 0.99 and (v[:3] < 0).all()


def test_balls_apart_hand_on_the_whole_speed() -> None:
    v = chains.chain_of("limestone", chains.APART).velocities([chains.END])[-1] / chains.SPEED
    assert v == pytest.approx([0, 0, 0, 0, 1], abs=1e-6)


# ---- on a floor


def on_the_floor(friction: float) -> tuple[Any, SnapshotSeries, np.ndarray]:
    """Balls that slide with `friction` times theirs and roll; what stands has its overlaps of rest."""
    scene = on_floor.scene()
    motion, r = still(scene), on_floor.RADIUS
    for k, (mu, u) in enumerate(on_floor.BALLS):
        slowed = np.minimum(friction * mu * GRAVITY * motion.time, 2 / 7 * u)
        motion.velocity[:, k, 0], motion.angular_velocity[:, k, 1] = u - slowed, 2.5 * slowed / r
    weight, stiff = on_floor.weight(), 4 / 3 * 1e7 / (1 - 0.25**2) * np.sqrt(r)
    overlap = lambda force, k: (force * weight / k) ** (2 / 3)  # noqa: E731
    pair = stiff / 2 / np.sqrt(2)
    column = np.array([overlap(5, stiff), *(overlap(n, pair) for n in (4, 3, 2, 1))])
    motion.position[-1, 6:11, 2] -= np.cumsum(column)
    base, side = overlap(1.5, stiff), overlap(0.5, pair)
    motion.position[-1, 11:13, 2] -= base
    motion.position[-1, 13, 2] = r - base + np.sqrt((2 * r - side) ** 2 - (on_floor.APART * r) ** 2)
    force = np.tile([0, 0, -14 * weight], (2, 1))
    return scene, motion, force


def test_right_motion_on_the_floor_is_accepted() -> None:
    scene, motion, force = on_the_floor(1.0)
    found = measured("on_floor", scene, motion, floor_force=force)
    assert accepted("on_floor", found) == set(checks("on_floor"))
    assert found["SR5a"] == pytest.approx(0, abs=1e-6) and found["SR5d"] == pytest.approx(0, abs=1e-6)


def test_wrong_friction_and_a_wrong_weight_are_seen() -> None:
    scene, motion, force = on_the_floor(1.2)
    motion.position[-1, 8, 2] += 0.02 * (on_floor.RADIUS - motion.position[-1, 6, 2])
    found = measured("on_floor", scene, motion, floor_force=1.02 * force)
    assert not {"MF04a", "MF04b", "SR5a", "SR5e"} & accepted("on_floor", found)


# ---- inclines and wedges


def test_accelerations_on_inclines() -> None:
    """Exact motion is accepted; with 1 % more gravity nothing is."""
    scene = inclines.incline()
    sin, cos = np.sin(inclines.SLOPE), np.cos(inclines.SLOPE)
    mu = np.array([*inclines.SLIDING, *inclines.ROLLING])
    slides = np.array([True] * 3 + [False] * 3)
    a = np.where(slides, GRAVITY * (sin - mu * cos), 5 / 7 * GRAVITY * sin)
    alpha = np.where(slides, 2.5 * mu * GRAVITY * cos, 5 / 7 * GRAVITY * sin) / inclines.RADIUS
    for factor, expected in ((1.0, {"SR1a", "SR1b", "SR1c", "SR1d"}), (1.01, set())):
        motion = still(scene)
        motion.velocity[:, :, 0] = factor * np.outer(motion.time, a)
        motion.angular_velocity[:, :, 1] = factor * np.outer(motion.time, alpha)
        assert accepted("incline", measured("incline", scene, motion)) == expected


def test_rolling_friction_is_measured_while_the_sphere_still_spins() -> None:
    """The deceleration of 5 mu_r g cos(10 deg)/(2 R) does not stop the sphere before the end."""
    rate = 2.5 * 0.1 * GRAVITY * np.cos(inclines.GENTLE) / inclines.RADIUS
    assert rate * inclines.END < inclines.SPIN
    scene = inclines.resistance()
    motion = still(scene)
    motion.angular_velocity[:, -1, 1] = inclines.SPIN - rate * motion.time
    assert measured("rolling_friction", scene, motion)["SR2c"] == pytest.approx(1)


def test_the_depth_in_a_wedge_is_that_of_the_statics() -> None:
    """(3 F/(4 E* sqrt(r)))^(2/3)/sin a with F = m g/(2 sin a), here from the numbers."""
    mass, sin = 1e4 * 4 / 3 * np.pi * 5e-4**3, np.sin(np.radians(10))
    force = mass * GRAVITY / (2 * sin)
    depth = (0.75 * force / (1e7 / (1 - 0.0625) * np.sqrt(5e-4))) ** (2 / 3) / sin
    assert wedge.sinking() == pytest.approx(depth, rel=1e-9)


# ---- clusters


def test_clusters_are_compared_in_their_own_frames() -> None:
    """Six clusters that fly on as they start: every invariance holds; one velocity off by 0.1 % is seen."""
    scene = clusters.scene()
    motion = still(scene)
    found = measured("clusters", scene, motion)
    assert [found[f"SR13{k}"] for k in "abcd"] == pytest.approx([0] * 4, abs=1e-12)
    assert found["SR12a"] == 0 and found["SR15a"] == 1
    for cluster, id in ((1, "SR13a"), (2, "SR13b"), (3, "SR13c"), (4, "SR13d")):
        wrong = still(scene)
        wrong.velocity[-1, 13 * cluster + 5] *= 1.001
        assert id not in accepted("clusters", measured("clusters", scene, wrong))


def test_momentum_that_is_lost_is_seen() -> None:
    scene = clusters.scene()
    motion = still(scene)
    motion.angular_velocity[-1, 4] *= 1.01
    motion.velocity[-1, 70] *= 1.05
    found = measured("clusters", scene, motion)
    assert not {"SR12b", "SR15a"} & accepted("clusters", found)


def test_the_copies_of_the_cluster_do_not_meet() -> None:
    """Farther apart than they can fly."""
    scene = clusters.scene()
    centres = scene.bodies.position.reshape(6, 13, 3).mean(axis=1)
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2) + 1e9 * np.eye(6)
    reach = np.array([1, 1, 1, 1, clusters.SCALE, 1]) * (6 * clusters.RADIUS + 1.5 * clusters.SPEED * clusters.END)
    assert (apart > reach[:, None] + reach).all()


# ---- tops


def test_both_descriptions_of_a_symmetric_top_agree() -> None:
    """Precession in closed form against the integral of Euler's equations."""
    times, start = np.linspace(0, 1, 21), np.array(tops.SPINS["rod"])
    exact, integrated = tops.precession(tops.ROD, start, times), tops.tumbling(tops.ROD, start, times)
    assert integrated == pytest.approx(exact, abs=1e-6)
    assert np.ptp(exact[:, 0]) > 15


def test_the_elbow_tumbles() -> None:
    """Turning about the axis of the middle moment is unstable: the size of the spin changes while it flips.

    Momentum and energy stay: with L^2 = sum (I w)^2 and 2 E = sum I w^2 the size lies between two values, and it goes
    through both within a second.
    """
    moments = tops.ELBOW.solid.moments
    assert moments[0] < 0.9 * moments[1] and moments[1] < 0.9 * moments[2]
    start = tops.ELBOW.solid.axes @ np.array([0.5, 40.0, 0.2])
    size = np.linalg.norm(tops.tumbling(tops.ELBOW, start, np.linspace(0, 1, 201)), axis=1)
    assert np.ptp(size) > 0.03 * size[0]


# ---- order, Walton's map


@pytest.mark.parametrize("p", [1.0, 2.0])
def test_the_slope_of_a_power_is_its_exponent(p: float) -> None:
    assert order.slope([3e-3 * n**-p for n in order.STEPS]) == pytest.approx(p)


def test_walton_map_switches_where_both_branches_meet() -> None:
    """At slip over speed = (7/2) mu (1 + e)/(1 + b0): for Foerster's glass 0.4405."""
    kind = walton.KINDS["glass"]
    switch = 3.5 * 0.092 * 1.97 / 1.44
    assert switch == pytest.approx(0.4405, abs=1e-4)
    assert walton.slip_after(kind, 1.0, 0.99 * switch) == pytest.approx(-0.44 * 0.99 * switch)
    assert walton.slip_after(kind, 1.0, 1.5 * switch) == pytest.approx(1.5 * switch - 3.5 * 0.092 * 1.97)


# ---- an engine


def test_an_engine_meets_what_it_must(tmp_path: Path) -> None:
    """Grains and cradle by velocity Verlet: two runs, all their checks, and the figures of the page."""
    words = ["verify", "--suite", "closed-forms", "--only", "CO4,SR10a", "--engines", "peclet-hertz"]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path), "--json"])
    rows = json.loads(done.stdout)["rows"]
    assert {row["id"] for row in rows if row["status"] != "ok"} == set(), rows
    assert {"CO3a", "CO4e", "IM3a", "SR10a", "SR10f"} <= {row["id"] for row in rows}
    page = Page((tmp_path / "closed-forms.html").read_text())
    assert list(page.figures) == ["oblique", "restitution", "cradle"]


# ---- trough


def rolled(turned_by: float = 0.0) -> SnapshotSeries:
    """The ball by its equation of motion, with the overlap of Hertz; `turned_by` is added to the force over m g."""
    scene, ball = trough.scene(), trough.BALL
    time = np.array(scene.frame_times())
    rho = trough.TROUGH - ball.radius
    found = solve_ivp(
        lambda _t, s: [s[1], -5 / 7 * GRAVITY / rho * np.sin(s[0])],
        (0, time[-1]),
        [trough.START, 0.0],
        t_eval=time,
        rtol=1e-10,
        atol=1e-12,
    )
    angle, speed = found.y[0], rho * found.y[1]
    force = ball.mass * (GRAVITY * (np.cos(angle) + turned_by) + speed**2 / rho)
    depth = (force / (4 / 3 * ball.modulus * np.sqrt(ball.radius))) ** (2 / 3)
    zero = np.zeros_like(time)
    position = np.stack([zero, (rho + depth) * np.sin(angle), -(rho + depth) * np.cos(angle)], axis=1)
    velocity = np.stack([zero, speed * np.cos(angle), speed * np.sin(angle)], axis=1)
    return SnapshotSeries(np.arange(len(time)), time, position[:, None], velocity[:, None], np.zeros((len(time), 1, 3)))


def test_a_ball_in_a_trough_is_measured() -> None:
    """The pendulum meets all checks; a spring that does not turn takes (2/7) m g (1 - cos) off the wall and is seen."""
    assert accepted("trough", measured("trough", trough.scene(), rolled())) == {"TR1a", "TR1b", "TR1c", "TR1d"}
    spring = -2 / 7 * (1 - np.cos(trough.START))
    assert accepted("trough", measured("trough", trough.scene(), rolled(spring))) == {"TR1a", "TR1b", "TR1c"}


def test_a_ball_that_stays_in_the_trough_has_no_period() -> None:
    assert accepted("trough", measured("trough", trough.scene(), still(trough.scene()))) == set()


def test_pairs_of_materials_are_told_apart() -> None:
    """No two pairs have restitutions that a check would take for each other."""
    expected = sorted(check.expected for check in checks("pair_table").values())
    assert np.diff(expected).min() > 2 * next(iter(checks("pair_table").values())).tolerance


@pytest.mark.parametrize("name", ["trough", "meetings", "pair_table", "crystal"])
def test_both_solvers_meet_all_checks(name: str, tmp_path: Path) -> None:
    ids = ",".join(sorted({id[:2] for id in checks(name)}))
    command = ["verify", "--suite", "closed-forms", "--only", ids, "--engines", "peclet,peclet-hertz"]
    done = CliRunner().invoke(app, [*command, "--json", "--out", str(tmp_path)])
    rows = json.loads(done.stdout)["rows"]
    assert {row["status"] for row in rows} == {"ok"} and len(rows) == 2 * len(checks(name))
