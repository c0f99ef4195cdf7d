"""What peclet-dem makes of scenes: closed forms, the law that its adapter tells, and reading."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deck_scenes import BOX, box, scene
from launching import installed, run
from parts import DRUM

from dembench.engines.peclet_dem import PecletDem
from dembench.scene import Scene

FLOOR = {"kind": "plane", "name": "floor", "material": "steel", "point": (0, 0, 0), "normal": (0, 0, 1)}
RADIUS, WALL_RESTITUTION, WALL_FRICTION = 0.0015, 0.4, 0.2
MASS = 4 / 3 * math.pi * RADIUS**3 * 2500
IMPULSE = {"solver": "impulse"}


def last_of(made: Scene, directory: Path, **overrides: str) -> Any:
    """The last frame of a run that ended well."""
    series = run(installed("peclet-dem"), made, directory, **overrides)
    assert (series.failure, series.detail) == (None, "")
    return series.frames[-1]


# ---- reading


def test_a_run_that_has_not_begun_is_no_failure(tmp_path: Path) -> None:
    series = PecletDem().read(box(), PecletDem().settings(box(), "closed"), tmp_path)
    assert (len(series.frames), series.failure, series.time) == (0, None, 0.0)


def test_a_run_that_ended_without_all_frames_is_a_failure(tmp_path: Path) -> None:
    (tmp_path / "progress.txt").write_text("step 0\nstep 2000\nset-up 0.5 loop 1.5 output 0.25 cpu 1.75\n")
    series = PecletDem().read(box(), PecletDem().settings(box(), "closed"), tmp_path)
    assert series.failure == "no output" and "0 of 12 frames" in series.detail
    assert (series.timing.set_up, series.timing.loop, series.timing.output) == (0.5, 1.5, 0.25)


# ---- runs


def test_frames_and_tracks_start_at_the_initial_state_and_meet_the_times(tmp_path: Path) -> None:
    """As far as single precision goes: 12 mm to 1e-9 m."""
    made = box()
    series = run(installed("peclet-dem"), made, tmp_path)
    assert (series.failure, series.detail) == (None, "")
    assert [f.time for f in series.frames] == pytest.approx(made.frame_times())
    assert series.frames[0].position == pytest.approx(made.bodies.position, abs=1e-9)
    assert series.frames[0].velocity == pytest.approx(made.bodies.velocity, abs=1e-7)
    assert series.frames[-1].position[0] == pytest.approx(made.bodies.position[0], abs=1e-9), "the fixed body has moved"
    assert series.tracks.time == pytest.approx(made.track_times())
    for frame in series.frames:
        for at in np.flatnonzero(series.tracks.step == frame.step):
            assert np.array_equal(series.tracks.position[at, 0], frame.position[2])
    assert series.time == pytest.approx(made.duration)
    assert series.timing.loop > 0


def test_a_body_that_leaves_the_domain_is_a_failure(tmp_path: Path) -> None:
    away = scene(bodies={"position": [[0, 0, 0], [0.01, 0, 0]], "velocity": [[0, 0, 0], [20, 0, 0]]})
    series = run(installed("peclet-dem"), away, tmp_path)
    assert series.failure == "lost particles" and "body 1 is outside the domain at t = 0.002 s" in series.detail
    assert len(series.frames) == 2


def test_a_state_that_is_no_number_is_a_failure(tmp_path: Path) -> None:
    """A speed beyond single precision."""
    made = scene(bodies={"position": [[0, 0, 0], [0.01, 0, 0]], "velocity": [[0, 0, 0], [1e39, 0, 0]]})
    series = run(installed("peclet-dem"), made, tmp_path)
    assert series.failure == "nan" and "the state of body 1 is not a number at t = 0 s" in series.detail


def test_an_error_in_the_deck_ends_the_program_with_a_code(tmp_path: Path) -> None:
    engine, made = installed("peclet-dem"), box()
    (phase,) = engine.write(made, engine.settings(made, "closed"), tmp_path)
    (tmp_path / "bodies.txt").write_text("nothing")
    ended = subprocess.run(phase.command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ended.returncode != 0
    assert "nothing" in ended.stderr


# ---- soft spheres


def head_on(young: float, dt: float, steps: int) -> float:
    """Speed of separation of two equal spheres of 1 mm at 1 m/s by the law that the adapter tells, in its precision."""
    f = np.float32
    radius, reduced = f(1e-3), f(2500 * 4 / 3 * math.pi * 1e-9 / 2)
    stiffness, log = f(young / (2 * (1 - 0.2**2))), math.log(0.5)
    damping = f(-2 * math.sqrt(5 / 6)) * f(log / math.hypot(log, math.pi))
    x, v, dt = [f(-1.5e-3), f(1.5e-3)], [f(0.5), f(-0.5)], f(dt)
    for _ in range(steps):
        overlap, force = radius + radius - (x[1] - x[0]), f(0)
        if overlap > 0:
            contact = np.sqrt(radius / f(2) * overlap)
            dashpot = damping * np.sqrt(f(2) * stiffness * contact * reduced)
            force = f(4 / 3) * stiffness * contact * overlap - dashpot * (v[1] - v[0])
        for k, sign in ((0, f(-1)), (1, f(1))):
            v[k] += sign * force / (f(2) * reduced) * dt
            x[k] += v[k] * dt
    return float(v[1] - v[0])


@pytest.mark.parametrize("young", [1e7, 1e9])
def test_restitution_is_that_of_the_law_in_single_precision(young: float, tmp_path: Path) -> None:
    """Rounding alone makes .49949 and .49917 of .49986 and .50257: the same sums in NumPy's float32 do."""
    made = scene(
        materials=({"name": "grain", "density": 2500, "young": young, "poisson": 0.2},),
        pair_laws=({"a": "grain", "b": "grain", "restitution": 0.5, "friction": 0.3},),
        species=({"name": "grain", "material": "grain", "radius": 1e-3},),
        bodies={"position": [[-1.5e-3, 0, 0], [1.5e-3, 0, 0]], "velocity": [[0.5, 0, 0], [-0.5, 0, 0]]},
        gravity=(0, 0, 0),
        time_step=1e-6,
        duration=5e-3,
    )
    last = last_of(made, tmp_path)
    assert last.velocity[1, 0] - last.velocity[0, 0] == pytest.approx(head_on(young, 1e-6, 5000), abs=3e-5)


def oblique_hit(speed: float, along: float, dt: float, duration: float) -> tuple[float, float, float]:
    """Velocity across and along a floor and spin of a glass grain after it, by the law that the adapter tells.

    The whole friction is bound by the spring's force, and the shear spring wound back to what the dashpot leaves.
    """
    young = 1 / (0.96 / 1e7 + 0.96 / 2.1e11)
    shear = 1 / (2 * 1.8 * 1.2 / 1e7 + 2 * 1.8 * 1.2 / 2.1e11)
    log = math.log(WALL_RESTITUTION)
    damping = -2 * math.sqrt(5 / 6) * log / math.hypot(log, math.pi)
    height, across, spin, spring = 1.6e-3, -speed, 0.0, 0.0
    for _ in range(round(duration / dt)):
        overlap = RADIUS - height
        normal = tangent = 0.0
        if overlap > 0:
            contact, lever = math.sqrt(RADIUS * overlap), RADIUS - overlap / 2
            elastic = 4 / 3 * young * contact * overlap
            normal = elastic - damping * math.sqrt(2 * young * contact * MASS) * across
            rate = along - spin * lever
            spring += rate * dt
            stiffness, dashpot = 8 * shear * contact, damping * math.sqrt(8 * shear * contact * MASS)
            tangent = -stiffness * spring - dashpot * rate
            if abs(tangent) > WALL_FRICTION * elastic:
                tangent = math.copysign(WALL_FRICTION * elastic, tangent)
                spring = -(tangent + dashpot * rate) / stiffness
            spin -= dt * tangent * lever / (0.4 * MASS * RADIUS**2)
        else:
            spring = 0.0
        across += dt * normal / MASS
        along += dt * tangent / MASS
        height += dt * across
    return across, along, spin


@pytest.mark.parametrize("along", [0.3, 0.05])
def test_an_oblique_hit_is_that_of_the_law_that_is_told(along: float, tmp_path: Path) -> None:
    """A hit that slides and one that sticks. Rounding costs up to 2e-4 m/s of .2 m/s, less than any other law differs:
    the bound on the whole normal force would leave 1.4e-3 m/s less along."""
    bodies = {"position": [[0, 0, 0.0016]], "velocity": [[along, 0, -0.2]]}
    made = scene(walls=(FLOOR,), bodies=bodies, gravity=(0, 0, 0))
    last = last_of(made, tmp_path)
    across, along, spin = oblique_hit(0.2, along, made.time_step, made.duration)
    assert last.velocity[0] == pytest.approx([along, 0, across], abs=3e-4)
    assert last.angular_velocity[0] == pytest.approx([0, spin, 0], abs=0.5)


def test_spheres_of_different_size_and_material_keep_their_momentum(tmp_path: Path) -> None:
    """And part with the restitution of the pair along the line of the impulse, which a short contact does not turn."""
    made = scene(
        species=(
            {"name": "grain", "material": "glass", "radius": 0.0015},
            {"name": "ball", "material": "steel", "radius": 0.003},
        ),
        pair_laws=({"a": "steel", "b": "glass", "restitution": 0.4, "friction": 0},
                   {"a": "glass", "b": "glass", "restitution": 0.9, "friction": 0},
                   {"a": "steel", "b": "steel", "restitution": 0.9, "friction": 0}),
        bodies={
            "position": [[-0.003, 0, 0], [0.003, 0.002, 0]],
            "velocity": [[0.5, 0, 0], [-0.3, 0, 0]],
            "species": [0, 1],
        },
        gravity=(0, 0, 0),
    )  # fmt: skip
    last = last_of(made, tmp_path)
    masses, before = made.masses(), made.bodies.velocity
    momentum = masses @ before
    assert masses @ last.velocity == pytest.approx(momentum, abs=1e-6 * np.abs(masses[:, None] * before).max())
    line = last.velocity[1] - before[1]
    line = line / np.linalg.norm(line)
    came, went = (before[1] - before[0]) @ line, (last.velocity[1] - last.velocity[0]) @ line
    assert -went / came == pytest.approx(0.4, abs=5e-3)


def test_a_column_of_soft_spheres_carries_its_weight(tmp_path: Path) -> None:
    """Hertz: the overlap under k grains is (k m g / (4/3 E* sqrt(R*)))^(2/3), once what moves has come to rest."""
    n, star = 8, 1e7 / (2 * 0.96)
    overlaps = ((np.arange(n - 1, 0, -1) * MASS * 9.81) / (4 / 3 * star * math.sqrt(RADIUS / 2))) ** (2 / 3)
    lowest = (n * MASS * 9.81 / (4 / 3 * 1 / (0.96 / 1e7 + 0.96 / 2.1e11) * math.sqrt(RADIUS))) ** (2 / 3)
    height = RADIUS - lowest + np.concatenate([[0], np.cumsum(2 * RADIUS - overlaps)])
    made = scene(
        walls=(FLOOR,),
        bodies={"position": np.column_stack([np.zeros((n, 2)), height])},
        duration=0.05,
        observables=({"kind": "energy", "name": "energy", "interval": 0.01},),
    )
    last = last_of(made, tmp_path)
    found = np.diff(last.position[:, 2])
    assert 2 * RADIUS - found == pytest.approx(overlaps, rel=0.02)
    assert np.abs(last.velocity).max() < 1e-3


def test_a_body_in_a_corner_meets_both_walls(tmp_path: Path) -> None:
    """Without friction each wall gives its own restitution back."""
    side = {**FLOOR, "name": "side", "normal": (1, 0, 0)}
    made = scene(
        walls=(FLOOR, side),
        pair_laws=({"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0},
                   {"a": "steel", "b": "glass", "restitution": 0.4, "friction": 0}),
        bodies={"position": [[0.0017, 0, 0.0016]], "velocity": [[-0.25, 0, -0.5]]},
        gravity=(0, 0, 0),
    )  # fmt: skip
    last = last_of(made, tmp_path)
    assert last.velocity[0] == pytest.approx([0.4 * 0.25, 0, 0.4 * 0.5], rel=5e-3, abs=1e-9)


def test_a_belt_takes_a_grain_along_and_stays(tmp_path: Path) -> None:
    """A sphere without spin slides until it rolls on the belt: v = 2/7 u, with v - w r = u."""
    belt = {**FLOOR, "motion": {"velocity": (0.1, 0, 0), "surface": True}}
    made = scene(walls=(belt,), bodies={"position": [[0, 0, 0.0015]]}, duration=0.06)
    last = last_of(made, tmp_path)
    assert last.velocity[0, 0] == pytest.approx(2 / 7 * 0.1, rel=2e-3)
    assert last.velocity[0, 0] - last.angular_velocity[0, 1] * RADIUS == pytest.approx(0.1, rel=2e-3)


@pytest.mark.parametrize("overrides", [{}, IMPULSE], ids=["hertz", "impulse"])
def test_a_grain_rolls_in_a_turning_drum_without_slip(overrides: dict[str, str], tmp_path: Path) -> None:
    """Once sliding has ended, the point of contact moves with the wall: (v + w x n r) . t = Omega R, n the way out."""
    drum = {**DRUM, "motion": {"angular_velocity": (0, -2, 0)}}
    made = scene(walls=(drum,), bodies={"position": [[0, 0.003, -0.0165]]}, duration=0.05)
    last = last_of(made, tmp_path, **overrides)
    out = last.position[0] * (1, 0, 1)
    assert np.linalg.norm(out) == pytest.approx(0.0165, abs=1e-5)
    out /= np.linalg.norm(out)
    touching = last.velocity[0] + np.cross(last.angular_velocity[0], 0.0015 * out)
    assert np.linalg.norm(touching) == pytest.approx(0.036, rel=0.02)


def test_two_threads_give_the_frames_of_one(tmp_path: Path) -> None:
    """Grains that meet with slip; sums of forces differ in their order only."""
    line = 0.004 * np.arange(-2, 3)
    left = np.column_stack([line / 4 - 0.00155, line, 0.1 * line])
    made = scene(
        bodies={
            "position": np.concatenate([left, np.add(left, [0.0031, 0, 0])]),
            "velocity": [[0.5, 0.2, 0]] * 5 + [[-0.5, 0, 0.1]] * 5,
        },
        duration=1e-3,
        observables=({"kind": "energy", "name": "energy", "interval": 2.5e-4},),
    )
    one, two = (
        run(installed("peclet-dem"), made, tmp_path / threads, threads=threads).frames for threads in ("1", "2")
    )
    assert len(one) == len(two) == len(made.frame_times())
    assert (np.abs(one[-1].angular_velocity).max(axis=1) > 1).all()
    for a, b in zip(one, two, strict=True):
        assert np.abs(a.position - b.position).max() < 1e-8


# ---- impulses


@pytest.mark.parametrize("gravity", [(0, 0, 0), (0, 0, -1e-3)])
@pytest.mark.parametrize("along", [0.3, 0.05])
def test_an_oblique_hit_of_rigid_bodies(along: float, gravity: tuple[float, ...], tmp_path: Path) -> None:
    """Walton: a hit slides and loses mu (1 + e) of the speed across, or sticks and loses 2/7 of that along.

    With gravity and without it, where the program itself would not keep to Coulomb's bound."""
    bodies = {"position": [[0, 0, 0.0017]], "velocity": [[along, 0, -0.2]]}
    made = scene(law={"kind": "rigid"}, walls=(FLOOR,), bodies=bodies, gravity=gravity)
    last = last_of(made, tmp_path, dt="5e-5")
    loss = min(WALL_FRICTION * (1 + WALL_RESTITUTION) * 0.2, 2 / 7 * along)
    assert last.velocity[0] == pytest.approx([along - loss, 0, WALL_RESTITUTION * 0.2], abs=1e-4)
    assert last.angular_velocity[0] == pytest.approx([0, 2.5 * loss / RADIUS, 0], rel=0.01)


def test_rigid_bodies_have_tangential_restitution_without_gravity(tmp_path: Path) -> None:
    """A hit that sticks turns the velocity of the surfaces round, beta times: loss 2/7 (1 + beta) along."""
    pairs = tuple(
        {"a": a, "b": "glass", "restitution": 0.4, "friction": 1, "tangential_restitution": 0.5}
        for a in ("glass", "steel")
    )
    made = scene(
        law={"kind": "rigid"},
        walls=(FLOOR,),
        pair_laws=pairs,
        bodies={"position": [[0, 0, 0.0017]], "velocity": [[0.05, 0, -0.2]]},
        gravity=(0, 0, 0),
    )
    last = last_of(made, tmp_path, dt="5e-5")
    assert last.velocity[0, 0] == pytest.approx(0.05 * (1 - 2 / 7 * 1.5), rel=0.01)


def test_a_column_of_rigid_spheres_rests(tmp_path: Path) -> None:
    """Twenty of 1.5 mm with the usual sweeps: overlaps stay below 1e-3 of the radius, speeds at 40 g dt."""
    made = scene(
        law={"kind": "rigid"},
        walls=(FLOOR,),
        bodies={"position": [[0, 0, RADIUS * (1 + 2 * k)] for k in range(20)]},
        domain={"lower": (-0.03,) * 3, "upper": (0.03, 0.03, 0.09)},
        duration=0.2,
        observables=({"kind": "energy", "name": "energy", "interval": 0.1},),
    )
    last = last_of(made, tmp_path)
    assert np.diff(last.position[:, 2]) == pytest.approx(np.full(19, 2 * RADIUS), abs=1e-3 * RADIUS)
    assert np.abs(last.velocity).max() < 0.03


def test_a_layer_between_periodic_sides_rests_on_its_floor(tmp_path: Path) -> None:
    """Sixteen rigid grains move along a floor without friction for more than a period and come back into the domain."""
    line = 0.004 * np.arange(4) + 0.0001
    place = np.array([(x, y, 0.0015) for x in line for y in line])
    made = scene(
        law={"kind": "rigid"},
        walls=(FLOOR,),
        bodies={"position": place, "velocity": np.tile([1.0, -0.7, 0.0], (16, 1))},
        domain={"lower": (0, 0, -0.002), "upper": (0.016, 0.016, 0.02), "periodic": (True, True, False)},
        pair_laws=({"a": "steel", "b": "glass", "restitution": 0.4, "friction": 0},
                   {"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0}),
        duration=0.03,
        observables=({"kind": "energy", "name": "energy", "interval": 0.01},),
    )  # fmt: skip
    last = last_of(made, tmp_path)
    assert np.abs(last.position[:, 2] - 0.0015).max() < 1e-6
    way = (place[:, :2] + np.array([1.0, -0.7]) * made.duration) % 0.016
    assert last.position[:, :2] == pytest.approx(way, abs=1e-6)


@pytest.mark.parametrize("overrides", [{}, IMPULSE], ids=["hertz", "impulse"])
def test_what_leaves_through_a_sink_no_longer_matters(overrides: dict[str, str], tmp_path: Path) -> None:
    """Two grains rise into a sink above the floor, a third falls into it; the one on the floor stays where it is."""
    made = scene(
        walls=(FLOOR,),
        bodies={
            "position": [[0, 0, RADIUS], [0.005, 0, 0.009], [0.009, 0, 0.009], [0.005, 0, 0.025]],
            "velocity": [[0, 0, 0], [0, 0, 1], [0, 0, 1], [0, 0, 0]],
        },
        sinks=({"name": "above", "region": {"lower": (None, None, 0.011), "upper": (None, None, 0.02)}},),
        observables=({"kind": "count", "name": "all", "interval": 1e-3},),
        duration=0.04,
    )
    frames = run(installed("peclet-dem"), made, tmp_path, sink_interval="0.001", **overrides).frames
    counts = [len(frame.present) for frame in frames]
    assert counts[0] == 4 and counts[-1] == 1 and sorted(counts, reverse=True) == counts
    assert frames[-1].present.tolist() == [0]
    assert frames[-1].position[0] == pytest.approx([0, 0, RADIUS], abs=1e-5)


@pytest.mark.parametrize("overrides", [{}, IMPULSE], ids=["hertz", "impulse"])
def test_a_fixed_body_is_a_wall_and_a_locked_one_does_not_turn(overrides: dict[str, str], tmp_path: Path) -> None:
    """A glass grain meets a fixed one: -e times its speed; another slides over the floor of a box without turning."""
    made = scene(
        walls=({**BOX, "open_faces": ("z+",)},),
        bodies={
            "position": [[0, 0, 0], [0.0035, 0, 0], [-0.006, 0, -0.0105]],
            "velocity": [[0, 0, 0], [-0.5, 0, 0], [0.1, 0, 0]],
        },
        constraints=({"kind": "fixed", "bodies": (0,)}, {"kind": "rotation-locked", "bodies": (2,)}),
    )
    last = last_of(made, tmp_path, **overrides)
    assert last.position[0] == pytest.approx([0, 0, 0], abs=1e-9)
    assert last.velocity[1, 0] == pytest.approx(0.25, abs=0.01)
    assert last.angular_velocity[2] == pytest.approx([0, 0, 0], abs=1e-6)
    assert last.velocity[2, 0] == pytest.approx(0.1 - WALL_FRICTION * 9.81 * made.duration, abs=5e-3)
