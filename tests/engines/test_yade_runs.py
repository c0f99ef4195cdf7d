"""What Yade makes of scenes: closed forms, the law that its adapter tells, and reading."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deck_scenes import BOX, box, scene
from launching import installed, meets_the_times, run
from parts import DRUM

from dembench.engines.script_runs import failure_in, last_step, timing_in
from dembench.engines.yade import Yade
from dembench.verification.laws import thornton_damping

FLOOR = {"kind": "plane", "name": "floor", "material": "steel", "point": (0, 0, 0), "normal": (0, 0, 1)}
WALL_RESTITUTION = 0.4
ENDED = "step 0\nstep 200\nstep 400\nset-up 0.5 loop 1.5 output 0.25 cpu 1.75\n"


# ---- reading


def written(directory: Path, made: Any, frames: int, rows: float, notes: str) -> Any:
    """What is read of a run of which so many frames and rows of tracks are there."""
    settings = Yade().settings(made, "closed")
    (directory / "frames").mkdir()
    steps = [round(t / settings.dt) for t in made.frame_times()]
    state = np.hstack([made.bodies.position, made.bodies.velocity, np.zeros((len(made.bodies), 3))])
    for step in steps[:frames]:
        np.savez(directory / "frames" / f"{step}.npz", body=np.arange(len(state)), state=state)
    steps = [round(t / settings.dt) for t in made.track_times()]
    table = np.array([np.hstack([step, *(state[b, :6] for b in made.tracked_bodies())]) for step in steps])
    (directory / "tracks.bin").write_bytes(table.tobytes()[: round(rows * table[0].nbytes)])
    (directory / "progress.txt").write_text(notes)
    return Yade().read(made, settings, directory)


def test_a_run_that_goes_on_is_read_as_far_as_it_is_written(tmp_path: Path) -> None:
    series = written(tmp_path, box(), 3, 2.5, "step 0\nstep 400\nstep 55")
    assert (len(series.frames), len(series.tracks.step), series.failure) == (3, 2, None)
    assert series.time == pytest.approx(400 * 5e-6), "a line without its end does not count"
    assert np.array_equal(series.frames[2].position, box().bodies.position)


def test_a_run_that_ended_without_all_frames_is_a_failure(tmp_path: Path) -> None:
    series = written(tmp_path, box(), 3, 2, ENDED)
    assert series.failure == "no output"
    assert (series.timing.set_up, series.timing.loop, series.timing.output, series.timing.loop_cpu) == (
        0.5,
        1.5,
        0.25,
        1.75,
    )


def test_a_run_that_has_not_begun_is_no_failure(tmp_path: Path) -> None:
    series = Yade().read(box(), Yade().settings(box(), "closed"), tmp_path)
    assert (len(series.frames), series.failure, series.time) == (0, None, 0.0)


def test_notes_tell_why_a_run_failed() -> None:
    assert failure_in("step 3\nERROR nan: a speed is not a number at step 7\n") == (
        "nan",
        "a speed is not a number at step 7",
    )
    assert failure_in(ENDED) == (None, "")
    assert last_step(ENDED) == 400 and last_step("") == 0
    assert timing_in("step 3\n") is None


# ---- runs


def test_frames_and_tracks_start_at_the_initial_state_and_meet_the_times(tmp_path: Path) -> None:
    made = box()
    series = run(installed("yade"), made, tmp_path)
    meets_the_times(series, made, tracked=2)
    assert np.array_equal(series.frames[0].velocity, made.bodies.velocity)
    assert np.array_equal(series.frames[-1].position[0], made.bodies.position[0]), "the fixed body has moved"
    assert series.time == pytest.approx(made.duration)
    assert series.timing.loop > 0


def test_a_body_that_leaves_the_domain_is_a_failure(tmp_path: Path) -> None:
    away = scene(bodies={"position": [[0, 0, 0], [0.01, 0, 0]], "velocity": [[0, 0, 0], [20, 0, 0]]})
    series = run(installed("yade"), away, tmp_path)
    assert series.failure == "lost particles" and "body 1 is outside the domain at t = 0.002 s" in series.detail
    assert len(series.frames) == 2


def test_an_error_in_the_deck_ends_the_program_with_a_code(tmp_path: Path) -> None:
    engine, made = installed("yade"), box()
    (phase,) = engine.write(made, engine.settings(made, "closed"), tmp_path)
    (tmp_path / "bodies.txt").write_text("nothing")
    ended = subprocess.run(phase.command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ended.returncode != 0
    assert "nothing" in ended.stderr


def sliding_hit(speed: float, along: float, dt: float, duration: float) -> tuple[float, float, float]:
    """Velocity across and along a floor and spin of a glass grain after it, by the law that the adapter tells.

    Forces of the velocities of half a step before; a shear force that grows by the slip of each step, is cut to the
    bound and has a dashpot only below it; a normal force that never pulls, with Thornton's damping.
    """
    radius, friction = 0.0015, 0.2
    mass = 4 / 3 * math.pi * radius**3 * 2500
    young = 1 / (0.96 / 1e7 + 0.96 / 2.1e11)
    shear = 1 / (2 * 1.8 * 1.2 / 1e7 + 2 * 1.8 * 1.2 / 2.1e11)
    damping = 2 * math.sqrt(5 / 6) * thornton_damping(WALL_RESTITUTION)
    height, across, spin, spring = 1.6e-3, -speed, 0.0, 0.0
    for _ in range(round(duration / dt)):
        overlap = radius - height
        normal = tangent = 0.0
        if overlap > 0:
            contact, lever = math.sqrt(radius * overlap), radius - overlap / 2
            dashpot = damping * math.sqrt(2 * young * contact * mass) * across
            normal = max(4 / 3 * young * contact * overlap - dashpot, 0.0)
            rate = along - spin * lever
            spring -= 8 * shear * contact * rate * dt
            tangent = spring - damping * math.sqrt(8 * shear * contact * mass) * rate
            if abs(spring) > friction * normal:
                tangent = spring = math.copysign(friction * normal, spring)
            spin -= dt * tangent * lever / (0.4 * mass * radius**2)
        else:
            spring = 0.0
        across += dt * normal / mass
        along += dt * tangent / mass
        height += dt * across
    return across, along, spin


def test_a_sliding_hit_is_that_of_the_law_that_is_told(tmp_path: Path) -> None:
    """Step by step the same law gives the same numbers, but for the wall's radius, which is 1e8 that of the grain."""
    bodies = {"position": [[0, 0, 0.0016]], "velocity": [[0.3, 0, -0.2]]}
    made = scene(walls=(FLOOR,), bodies=bodies, gravity=(0, 0, 0))
    last = run(installed("yade"), made, tmp_path).frames[-1]
    across, along, spin = sliding_hit(0.2, 0.3, made.time_step, made.duration)
    assert last.velocity[0] == pytest.approx([along, 0, across], abs=1e-8)
    assert last.angular_velocity[0] == pytest.approx([0, spin, 0], abs=1e-5)


def test_walls_move_and_carry_as_they_are_told(tmp_path: Path) -> None:
    """Five grains in one scene without gravity, each by a wall of its own.

    A wall at speed u leaves a grain at rest with (1 + e) u, and one that oscillates as A sin(w t) with (1 + e) times
    its speed, A w cos(pi/6) at half its amplitude; a contact lasts 1 % of 1/w. A belt that presses on nothing moves
    nothing. Thornton's fit is off by 3e-4.
    """
    amplitude, frequency = 1e-2, 5.0
    pusher = {**FLOOR, "name": "pusher", "point": (-0.02, 0, 0), "normal": (1, 0, 0)}
    striker = {**FLOOR, "name": "striker", "motion": {"amplitude": (0, 0, amplitude), "frequency": frequency}}
    made = scene(
        walls=({**pusher, "motion": {"velocity": (0.2, 0, 0)}}, striker),
        bodies={"position": [[-0.0184, 0, 0.0295], [0.02, 0, 0.0015 + 0.5 * amplitude]]},
        gravity=(0, 0, 0),
        duration=0.02,
    )
    last = run(installed("yade"), made, tmp_path).frames[-1]
    speed = 2 * math.pi * frequency * amplitude * math.cos(math.pi / 6)
    assert last.velocity[0] == pytest.approx([(1 + WALL_RESTITUTION) * 0.2, 0, 0], abs=2e-4)
    assert last.velocity[1, 2] == pytest.approx((1 + WALL_RESTITUTION) * speed, rel=0.01)


def test_a_belt_takes_a_grain_along_and_stays(tmp_path: Path) -> None:
    """Friction makes a grain slide with mu g until it rolls or rests on the belt: 2/7 of its speed for a sphere that
    starts without spin, v = 2/7 u, with v - w r = u. The belt carries its weight."""
    belt = {**FLOOR, "motion": {"velocity": (0.1, 0, 0), "surface": True}}
    forces = ({"kind": "wall-force", "name": "force", "wall": "floor", "interval": 0.01},)
    made = scene(walls=(belt,), bodies={"position": [[0, 0, 0.0015]]}, duration=0.06, observables=forces)
    frames = run(installed("yade"), made, tmp_path).frames
    last = frames[-1]
    assert last.velocity[0] == pytest.approx([2 / 7 * 0.1, 0, 0], abs=1e-4)
    assert last.velocity[0, 0] - last.angular_velocity[0, 1] * 0.0015 == pytest.approx(0.1, abs=1e-4)
    weight = float(made.masses()[0]) * 9.81
    assert last.wall_forces["floor"] == pytest.approx([0, 0, -weight], abs=2e-3 * weight)


def test_a_grain_rolls_in_a_turning_drum_without_slip(tmp_path: Path) -> None:
    """Once sliding has ended, the point of contact moves with the wall: (v + w x n r) . t = Omega R, n the way out.

    The grain sits in the middle of a side of the polygon, away from its edges, where the wall is a plane."""
    drum = {**DRUM, "motion": {"angular_velocity": (0, -2, 0)}}
    made = scene(walls=(drum,), bodies={"position": [[0, 0.003, -0.0165]]}, duration=0.05)
    last = run(installed("yade"), made, tmp_path).frames[-1]
    out = last.position[0] * (1, 0, 1)
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
    one = run(installed("yade"), made, tmp_path / "one")
    two = run(installed("yade"), made, tmp_path / "two", threads="2")
    assert len(one.frames) == len(two.frames) == len(made.frame_times())
    assert (np.abs(one.frames[-1].angular_velocity).max(axis=1) > 1).all()
    for a, b in zip(one.frames, two.frames, strict=True):
        assert np.abs(a.position - b.position).max() < 1e-12


def test_a_box_that_moves_takes_its_faces_along(tmp_path: Path) -> None:
    """A box at speed u, whose left face meets a grain at rest: (1 + e) u."""
    made = scene(
        walls=({**BOX, "motion": {"velocity": (0.2, 0, 0)}},),
        bodies={"position": [[-0.0104, 0, 0]]},
        gravity=(0, 0, 0),
        duration=0.03,
    )
    last = run(installed("yade"), made, tmp_path).frames[-1]
    assert last.velocity[0] == pytest.approx([(1 + WALL_RESTITUTION) * 0.2, 0, 0], abs=2e-4)


def test_a_layer_between_periodic_sides_rests_on_its_floor(tmp_path: Path) -> None:
    """Sixteen grains that touch the floor from the start, some of them across a periodic face, move along it for more
    than a period. The floor carries them: pressed in as Hertz says, they move up and down by no more."""
    line = 0.004 * np.arange(4) + 0.0001
    place = np.array([(x, y, 0.0015 - 2e-6) for x in line for y in line])
    made = scene(
        walls=(FLOOR,),
        bodies={"position": place, "velocity": np.tile([1.0, -0.7, 0.0], (16, 1))},
        domain={"lower": (0, 0, -0.002), "upper": (0.016, 0.016, 0.02), "periodic": (True, True, False)},
        pair_laws=({"a": "steel", "b": "glass", "restitution": 0.4, "friction": 0},
                   {"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0}),
        duration=0.03,
        observables=({"kind": "wall-force", "name": "force", "wall": "floor", "interval": 0.01},),
    )  # fmt: skip
    frames = run(installed("yade"), made, tmp_path).frames
    weight = float(made.masses().sum()) * 9.81
    last = frames[-1]
    assert last.wall_forces["floor"] == pytest.approx([0, 0, -weight], abs=1e-3 * weight)
    assert np.abs(last.position[:, 2] - 0.0015).max() < 5e-6
    way = (place[:, :2] + np.array([1.0, -0.7]) * made.duration) % 0.016
    assert last.position[:, :2] == pytest.approx(way, abs=1e-9)
