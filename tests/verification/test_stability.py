"""The stability suite: scenes that can be run, measures that see what goes wrong, and engines on scenes of nothing."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from typer.testing import CliRunner

from dembench.cli import app
from dembench.engines import registry
from dembench.results.schema import SnapshotSeries
from dembench.scene import Scene, SceneError, check_scene
from dembench.verification.closed_forms.collisions import Contact, impact
from dembench.verification.scenes import MOTION, Kind
from dembench.verification.stability import (
    audits,
    chains,
    contrast,
    degenerate,
    fast_impacts,
    gas,
    overlaps,
    statics,
    stick_slip,
    stiffness,
    walls,
)
from dembench.verification.stability.common import contact_time, rayleigh
from dembench.verification.suites import suite

EXPERIMENTS = {experiment.name: experiment for experiment in suite("stability").experiments}
LARGEST = 3000
"""Bodies of the scenes that are built here."""
OVERLAPPING = ("d11", "d21")
"""Entries about starts that the check before a run refuses."""


def seen(scene: Scene, time: Any, position: Any, velocity: Any = None, spin: Any = None, **more: Any) -> Any:
    """A result with the bodies where they are said to be at some times."""
    position = np.asarray(position, dtype=float)
    none = np.zeros_like(position)
    fields = [none if values is None else np.asarray(values, dtype=float) for values in (velocity, spin)]
    time = np.asarray(time, dtype=float)
    motion = SnapshotSeries(np.arange(len(time)), time, position, *fields)
    return SimpleNamespace(scene=scene, snapshots={MOTION: motion}, **more)


# ---- the suite as a whole


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_scene_can_be_run(name: str) -> None:
    """Scenes pass the check that precedes every run, their steps divide their times, and settings are accepted."""
    for trial in EXPERIMENTS[name].trials:
        if trial.name == "d25_large":
            continue
        scene = trial.scene()
        assert scene.name == trial.name
        if name.startswith(OVERLAPPING):
            with pytest.raises(SceneError, match="overlap"):
                check_scene(scene)
        elif len(scene.bodies) <= LARGEST:
            check_scene(scene)
        for engine in map(registry.engine, registry.names()):
            known = {key: value for key, value in trial.settings.items() if key in engine.settings_type.model_fields}
            dt = engine.settings(scene, trial.division, known).dt
            assert scene.duration / dt == pytest.approx(round(scene.duration / dt), rel=1e-9)


def test_ids_and_trials_are_unique() -> None:
    ids = [check.id for experiment in EXPERIMENTS.values() for check in experiment.checks]
    trials = [trial.name for experiment in EXPERIMENTS.values() for trial in experiment.trials]
    assert len(ids) == len(set(ids)) and len(trials) == len(set(trials))


def test_entries_are_posed_or_named_with_a_reason() -> None:
    text = suite("stability").text
    posed = {check.id.rstrip("abcdefghijklmnopqrstuvwxyz") for e in EXPERIMENTS.values() for check in e.checks}
    for entry in (f"D{k}" for k in range(1, 43)):
        assert entry in posed or entry in text


# ---- what is measured, on motions that are known


def test_the_contact_of_a_pair_is_found_from_free_flight() -> None:
    scene = stiffness.young_scene(8)
    r, gap, speed = stiffness.RADIUS, 1e-6, 0.5
    start = np.array([[-r - gap / 2, 0, 0], [r + gap / 2, 0, 0]] * 3)
    x = np.array([[-r - 2e-6, 0, 0], [r + 2e-6, 0, 0]] * 3)
    towards = np.array([[speed, 0, 0], [-speed, 0, 0]] * 3)
    result = seen(scene, [0, 20e-6], [start, x], [towards, -0.5 * towards])
    restitution, duration = stiffness._rebound(result, 0)
    # 1 um at 1 m/s, then 4 um at 0.5 m/s, of 20 us
    assert restitution == pytest.approx(0.5)
    assert duration == pytest.approx(20e-6 - 1e-6 - 8e-6)


@pytest.mark.parametrize("decade", [5, 8, 12])
@pytest.mark.parametrize("restitution", stiffness.RESTITUTIONS)
def test_the_law_itself_keeps_its_restitution_from_soft_to_stiff(decade: int, restitution: float) -> None:
    """The scene's law integrated finely; at 1e5 Pa the spheres overlap by up to 0.4 r, so what changes e is the step.

    A contact has as many steps as the text of the checks says.
    """
    kind = Kind(10.0**decade, 2500, stiffness.RADIUS, restitution=restitution)
    assert impact(Contact.between(kind, kind), 1.0, 0.0).rebound == pytest.approx(restitution, abs=3e-4)
    steps = contact_time(kind, 1.0) / (0.1 * rayleigh(kind))
    assert steps == pytest.approx({5: 15, 8: 30, 12: 76}[decade], abs=0.5)


def test_a_step_is_stable_up_to_the_first_that_blows_up_or_kills() -> None:
    fine, wild = np.full(3, 0.5), np.array([0.5, 0.5, 7.0])
    assert stiffness.stable_share({0.1: fine, 0.3: fine, 0.5: wild, 0.7: fine}) == 0.3
    assert stiffness.stable_share({0.1: fine, 0.3: None, 0.5: fine}) == 0.1
    assert stiffness.stable_share({0.1: wild}) == 0


def test_growth_of_a_block_is_that_of_its_kinetic_energy() -> None:
    scene = stiffness.block_scene(0.9, 100, "block")
    position = np.stack([scene.bodies.position] * 2)
    velocity = np.stack([scene.bodies.velocity, 3 * scene.bodies.velocity])
    assert stiffness.growth(seen(scene, [0, 1], position, velocity)) == pytest.approx(9)
    assert stiffness.growth(None) == np.inf


def test_a_stack_that_sinks_or_moves_aside_is_seen() -> None:
    scene = contrast.stack_scene("stack", None)
    still = np.stack([scene.bodies.position] * 3)
    found = contrast._stacks(seen(scene, [0, 1, 2], still), rigid=False)
    assert found["D4a"] < 1e-6 and found["D4b"] < 1e-6 and found["D5a"] == 0
    sunk = still.copy()
    sunk[-1, 6, 2] -= 1e-5
    sunk[1, -2, 0] += 2e-3 * contrast.SIZE
    found = contrast._stacks(seen(scene, [0, 1, 2], sunk), rigid=False)
    assert found["D4a"] < 1e-6 and found["D4b"] > 0.005 and found["D5a"] > 1e-3


def test_the_energy_of_a_half_overlap_is_that_of_its_force() -> None:
    """The work of the Hertz force from the contact to an overlap of r, by quadrature, in two spheres that part."""
    kind = overlaps.ELASTIC
    spring = 4 / 3 * kind.young / (2 * (1 - kind.poisson**2)) * (kind.radius / 2) ** 0.5
    work, _ = quad(lambda a: spring * a**1.5, 0, kind.radius)
    assert kind.mass * overlaps.release_speed() ** 2 == pytest.approx(work, rel=1e-6)


def test_a_box_that_lets_one_out_and_energy_from_nowhere_are_seen() -> None:
    scene = overlaps.block_scene("block", None)
    position = np.stack([scene.bodies.position] * 3)
    velocity = np.zeros_like(position)
    velocity[1, :, 0] = 1.0
    elastic = 0.5 * scene.masses().sum() * np.array([1.0, 0.0, 0.3])
    result = seen(scene, [0, 1, 2], position, velocity, observables={"elastic": SimpleNamespace(value=elastic)})
    assert overlaps.outside(result) == 0 and overlaps.gain(result) == pytest.approx(1)
    position[1, 5, 2] = -1.1 * overlaps.BLOCK_ROOM * overlaps.RADIUS
    velocity[2] = [0, 1.0, 0]
    assert overlaps.outside(result) == 1 and overlaps.gain(result) == pytest.approx(1.3)


def test_spheres_from_one_point_have_to_part_and_to_do_so_again() -> None:
    scene = overlaps.point_scene("d21", None, 2)
    r = overlaps.RADIUS
    apart = np.array([np.zeros((2, 3)), [[r, 0, 0], [-r, 0, 0]]])
    other = 0.9 * apart[:, :, [1, 0, 2]]
    one, turned = seen(scene, [0, 1], apart), seen(scene, [0, 1], other)
    assert overlaps.again({"d21": one, "d21_again": one}, "d21", "ab") == {"D21a": pytest.approx(1), "D21b": 0}
    assert overlaps.again({"d21": turned, "d21_again": one}, "d21", "ab") == pytest.approx({"D21a": 0.9, "D21b": 1})


def test_stick_and_slip_is_that_of_a_coulomb_oscillator() -> None:
    """The sphere's equation of motion with Hertz's force of the plate, from the slip on: a linear spring to 2e-4."""
    scene, v = stick_slip.scene(), stick_slip.plate_speed()
    first = stick_slip.pressed() / v
    hertz = stick_slip.friction() / stick_slip.pressed() ** 1.5

    def rate(_t: float, y: np.ndarray) -> list[float]:
        force = hertz * (stick_slip.pressed() + y[0]) ** 1.5 - stick_slip.friction()
        return [v - y[1], force / stick_slip.KIND.mass]

    time = scene.frame_times()
    found = solve_ivp(rate, (0, time[-1]), [0, 0], t_eval=time[time > first] - first, rtol=1e-9, atol=1e-12)
    velocity = np.zeros((len(time), 1, 3))
    velocity[time > first, 0, 0] = found.y[1]
    position = np.zeros_like(velocity)
    measured = stick_slip.oscillation(seen(scene, time, position, velocity))
    assert measured == pytest.approx({"D36a": 1, "D36b": 1, "D36c": 1, "D36d": 0}, abs=2e-3)
    checks = {check.id: check for check in EXPERIMENTS["d36_stick_slip"].checks}
    assert all(checks[id].accepts(value) for id, value in measured.items())
    smooth = stick_slip.oscillation(seen(scene, time, position, v + 0.9 * (velocity - v)))
    assert not checks["D36b"].accepts(smooth["D36b"]) and not checks["D36d"].accepts(smooth["D36d"])


def test_hop_and_rebound_at_a_corner() -> None:
    scene = degenerate.corner_scene("corner", None, 0.06)
    v = degenerate.SLIDE
    position = np.stack([scene.bodies.position] * 2)
    moving = np.array([[v, 0, 0], [v / 2**0.5, v / 2**0.5, 0]])
    away = np.array([[-0.25 * v, 0, 0.5 * v], [0, 0, 0]])
    found = degenerate.corners(seen(scene, [0, scene.duration], position, [moving, away]))
    assert found == pytest.approx({"hop": 0.5, "rebound": 0.25})


def test_creep_counts_once_the_pile_has_settled() -> None:
    scene = statics.creep_scene("creep", False, None)
    way = np.array([0.0, 0.5, 0.5, 0.5 + 2e-4]) * statics.RADIUS
    position = scene.bodies.position + way[:, None, None] * np.array([1.0, 0, 0])
    assert statics.drift(seen(scene, [0, 10, 25, 40], position)) == pytest.approx(2e-4, rel=1e-6)


def test_slip_and_acceleration_of_rolling() -> None:
    scene = statics.incline_scene("roll", (1.0, 0.2, 0.1), 1.0, None, False)
    v = 5 / 7 * scene.gravity[0]
    velocity = np.array([[[0, 0, 0]] * 3, [[1.1 * v, 0, 0], [v, 0, 0], [v, 0, 0]]])
    spin = np.zeros((2, 3, 3))
    spin[1, :, 1] = np.array([1.1, 1.0, 0.9]) * v / statics.RADIUS
    found = statics.rolling(seen(scene, [0, 1], [scene.bodies.position] * 2, velocity, spin))
    assert found == pytest.approx((0.1, 0.0, 0.1), abs=1e-9)


def test_spheres_that_carry_nothing_may_roll() -> None:
    """Below the pyramid beside its three feet: held are the four of the pyramid, not the one that stands alone."""
    scene = statics.creep_scene("creep", False, None)
    alone = np.array([[5 * statics.RADIUS, 0, statics.RADIUS]])
    position = np.vstack([scene.bodies.position, alone])
    assert statics.carrying(scene, position).tolist() == [True] * 4 + [False]


def test_bullets_that_go_through_or_on_are_not_stopped() -> None:
    scene = fast_impacts.bullet_scene("bullets", None, True)
    x = np.arange(4) * fast_impacts.APART + np.array([-20, -20, 50, -3])
    v = fast_impacts.FAST * np.array([-0.8, 0.1, 0.9, -0.7])
    position = np.stack([scene.bodies.position, np.stack([x, 0 * x, 0 * x], axis=1)])
    velocity = np.stack([scene.bodies.velocity, np.stack([v, 0 * v, 0 * v], axis=1)])
    found = fast_impacts.stopped(seen(scene, [0, 0.4], position, velocity), 4)
    assert found == pytest.approx([0.8, -1, -1, 0.7])


def test_soft_spheres_are_deflected_less_than_rigid_ones() -> None:
    rigid = 2 * np.degrees(np.arccos(fast_impacts.GRAZE))
    assert 0.5 * rigid < fast_impacts.soft_deflection() < rigid


def test_the_time_of_cooling_is_that_of_haff() -> None:
    """A synthetic series of Haff's law, and one that cools as t^-1.5."""
    tau = gas.enskog_time()
    time = np.linspace(0, 10 * tau, 41)
    assert gas.cooled(time, (1 + time / tau) ** -2) == pytest.approx((tau, -2), rel=1e-3)
    assert gas.cooled(time, (1 + time / tau) ** -1.5)[1] == pytest.approx(-1.5, rel=1e-3)


def test_a_ring_that_lags_or_falls_is_seen() -> None:
    scene = gas.drum_scene("drum", 1.3)
    position = np.stack([scene.bodies.position] * 2)
    velocity = np.stack([scene.bodies.velocity, 0.9 * scene.bodies.velocity])
    inside, turning = gas.ring(seen(scene, [0, 1], position, velocity), 1.3, 3)
    assert inside > 1 and turning == pytest.approx(0.9)
    inner = int(np.argmin(np.hypot(*scene.bodies.position[:, :2].T)))
    position[1, inner] *= 0.5
    assert gas.ring(seen(scene, [0, 1], position, velocity), 1.3, 3)[0] < 1
    assert gas.ring(seen(scene, [0, 1], position, velocity), 1.3, 1)[0] > 1
    position[1, 7] *= 0.5
    assert gas.ring(seen(scene, [0, 1], position, velocity), 1.3, 1)[0] < 1


def test_a_chain_of_two_exchanges_velocities() -> None:
    """Two elastic balls: the equations of motion swap them, and the peak of a bell is found between samples."""
    kind = chains._chain_kind()
    start = np.array([0, 2.1 * kind.radius]), np.array([1.0, 0.0])
    v = chains.chain_velocities(*start, kind, np.linspace(0, 0.01, 5))
    assert v[-1] == pytest.approx([0, 1], abs=1e-6)
    time = np.linspace(0, 1, 101)
    assert chains.arrival(time, np.exp(-(((time - 0.3337) / 0.1) ** 2))) == pytest.approx(0.3337, abs=1e-5)


def test_the_landing_phase_of_an_exact_orbit_and_of_a_late_one() -> None:
    """Free flights of one period on the shaking plate; a plate that starts later shifts the phase."""
    for late in (0.0, 0.05):
        scene = walls.plate_scene("plate", None)
        period, omega = 1 / walls.FREQUENCY, 2 * np.pi * walls.FREQUENCY
        landing = (walls.landing_phase() + 2 * np.pi * late) / omega
        level = walls.GAMMA * 9.81 / omega**2 * np.sin(walls.landing_phase() + 2 * np.pi * late)
        time = np.array(scene.observables[0].times)
        since = (time - landing) % period
        v = 0.5 * 9.81 * period - 9.81 * since
        z = 1e-3 + level + 0.5 * 9.81 * since * (period - since)
        zero = np.zeros_like(time)
        position = np.stack([zero, zero, z], axis=1)[:, None]
        velocity = np.stack([zero, zero, v], axis=1)[:, None]
        assert walls._phase(seen(scene, time, position, velocity)) == pytest.approx(late, abs=2e-3)


def test_a_run_that_differs_in_one_bit_is_no_repetition() -> None:
    scene = audits.again_scene("d42_1")
    one = np.stack([scene.bodies.position] * 2)
    other = one.copy()
    other[1, 3, 0] = np.nextafter(other[1, 3, 0], 1)
    assert audits._again({"d42_1": seen(scene, [0, 1], one), "d42_2": seen(scene, [0, 1], one)})["D42"] == 0
    assert audits._again({"d42_1": seen(scene, [0, 1], one), "d42_2": seen(scene, [0, 1], other)})["D42"] > 0


# ---- on engines


def test_engines_have_settings_for_a_scene_without_bodies() -> None:
    scene = degenerate.few_scene(0)
    for engine in map(registry.engine, registry.names()):
        assert engine.settings(scene, "closed").dt > 0


def test_default_entries_hold_for_the_soft_spheres(tmp_path: Path) -> None:
    """Nothing, one particle, and slow motion, through the adapter; a scene of nothing is a run that ends."""
    words = ["verify", "--suite", "stability", "--tier", "default", "--only", "D24,D27", "--engines", "peclet-hertz"]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path), "--json"])
    rows = {row["id"]: row["status"] for row in json.loads(done.stdout)["rows"]}
    assert rows == {"D24a": "ok", "D24b": "ok", "D27": "ok"}
