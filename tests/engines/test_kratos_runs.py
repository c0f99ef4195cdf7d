"""What Kratos makes of scenes: closed forms, the law that its adapter tells, and reading."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

import numpy as np
import pytest
from deck_scenes import BOX, box, scene
from launching import installed, meets_the_times, run
from parts import DRUM, GLASS, STEEL

from dembench.scene import Scene
from dembench.verification.laws import thornton_damping

FLOOR = {"kind": "plane", "name": "floor", "material": "steel", "point": (0, 0, 0), "normal": (0, 0, 1)}
WALL_RESTITUTION = 0.4


def test_frames_and_tracks_start_at_the_initial_state_and_meet_the_times(tmp_path: Path) -> None:
    made = box()
    series = run(installed("kratos"), made, tmp_path)
    meets_the_times(series, made, tracked=2)
    assert np.array_equal(series.frames[0].velocity, made.bodies.velocity)
    assert np.array_equal(series.frames[-1].position[0], made.bodies.position[0]), "the fixed body has moved"
    assert series.time == pytest.approx(made.duration)
    assert series.timing.loop > 0
    assert 1 <= series.counters["neighbour searches"] < 400


def test_a_body_that_leaves_the_domain_is_a_failure(tmp_path: Path) -> None:
    away = scene(bodies={"position": [[0, 0, 0], [0.01, 0, 0]], "velocity": [[0, 0, 0], [20, 0, 0]]})
    series = run(installed("kratos"), away, tmp_path)
    assert series.failure == "lost particles" and "body 1 is outside the domain at t = 0.002 s" in series.detail
    assert len(series.frames) == 2


def test_a_state_that_is_not_a_number_is_a_failure(tmp_path: Path) -> None:
    """A stiffness whose square is beyond all numbers: no force between two grains that overlap is one."""
    stiff = {**GLASS, "young": 1e200}
    made = scene(materials=(stiff, STEEL), bodies={"position": [[0, 0, 0], [0.0029, 0, 0]]}, time_step=1e-3)
    series = run(installed("kratos"), made, tmp_path)
    assert series.failure == "nan" and "not a number" in series.detail


def test_an_error_in_the_deck_ends_the_program_with_a_code(tmp_path: Path) -> None:
    engine, made = installed("kratos"), box()
    (phase,) = engine.write(made, engine.settings(made, "closed"), tmp_path)
    (tmp_path / "sceneDEM.mdpa").write_text("nothing")
    ended = subprocess.run(phase.command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ended.returncode != 0


def sliding_hit(speed: float, along: float, dt: float, duration: float) -> tuple[float, float, float]:
    """Velocity across and along a floor and spin of a glass grain after it, by the law that the adapter tells.

    Velocity Verlet, whose forces see the velocities of half a step before; a normal force that never pulls, with
    Thornton's damping; a shear force that grows by the slip of each step, that is made less as the root of the overlap
    in unloading, and that is bounded together with its dashpot; levers of the radius less the overlap.
    """
    radius, friction = 0.0015, 0.2
    mass = 4 / 3 * math.pi * radius**3 * 2500
    young = 1 / (0.96 / 1e7 + 0.96 / 2.1e11)
    shear = 1 / (2 * 1.8 * 1.2 / 1e7 + 2 * 1.8 * 1.2 / 2.1e11)
    damping = 2 * math.sqrt(5 / 6) * thornton_damping(WALL_RESTITUTION)
    height, across, spin, spring = 1.6e-3, -speed, 0.0, 0.0
    push = pull = twist = before = 0.0
    for _ in range(round(duration / dt)):
        across, along, spin = across + 0.5 * dt * push, along + 0.5 * dt * pull, spin + 0.5 * dt * twist
        height += dt * across
        overlap, push, pull, twist = radius - height, 0.0, 0.0, 0.0
        if overlap > 0:
            contact, lever = math.sqrt(radius * overlap), radius - overlap
            normal = 4 / 3 * young * contact * overlap
            normal = max(normal - damping * math.sqrt(2 * young * contact * mass) * across, 0.0)
            slip = along - spin * lever
            if before > overlap:
                spring *= math.sqrt(overlap / before)
            spring -= 8 * shear * contact * slip * dt
            spring, viscous = bounded(
                spring, -damping * math.sqrt(8 * shear * contact * mass) * slip, friction * normal
            )
            push, pull = normal / mass, (spring + viscous) / mass
            twist = -(spring + viscous) * lever / (0.4 * mass * radius**2)
        else:
            spring = 0.0
        before = overlap
        across, along, spin = across + 0.5 * dt * push, along + 0.5 * dt * pull, spin + 0.5 * dt * twist
    return across, along, spin


def bounded(spring: float, viscous: float, bound: float) -> tuple[float, float]:
    """Forces of the shear spring and of its dashpot, so that their sum keeps a bound."""
    if abs(spring + viscous) <= bound:
        return spring, viscous
    if spring * viscous >= 0:
        if abs(spring) > bound:
            return math.copysign(bound, spring), 0.0
        return spring, math.copysign(bound - abs(spring), viscous)
    if abs(viscous) >= abs(spring):
        return spring, math.copysign(bound + abs(spring), viscous)
    return math.copysign(bound, spring), 0.0


@pytest.mark.parametrize(("speed", "along"), [(0.2, 0.3), (0.2, 0.05)], ids=["slides", "sticks"])
def test_a_sliding_hit_is_that_of_the_law_that_is_told(speed: float, along: float, tmp_path: Path) -> None:
    """Step by step the same law gives the same numbers, but for a rotation of the lever by the angle of a step."""
    bodies = {"position": [[0, 0, 0.0016]], "velocity": [[along, 0, -speed]]}
    made = scene(walls=(FLOOR,), bodies=bodies, gravity=(0, 0, 0))
    last = run(installed("kratos"), made, tmp_path).frames[-1]
    across, after, spin = sliding_hit(speed, along, made.time_step, made.duration)
    assert last.velocity[0] == pytest.approx([after, 0, across], abs=1e-7)
    assert last.angular_velocity[0] == pytest.approx([0, spin, 0], abs=1e-4)


def test_pairs_of_materials_have_their_own_restitution_and_friction(tmp_path: Path) -> None:
    """Head on, each pair by its own law; Thornton's fit is off by up to 6e-4, which 1 m/s at 1 us adds to.

    The mean of Young's moduli, or the mass of one of the two, would give the third pair another restitution.
    """
    materials = (GLASS, {"name": "clay", "density": 1200, "young": 4e7, "poisson": 0.3})
    pairs = {("glass", "glass"): 0.5, ("clay", "clay"): 0.8, ("glass", "clay"): 0.3}
    made = scene(
        materials=materials,
        pair_laws=[{"a": a, "b": b, "restitution": e, "friction": 0} for (a, b), e in pairs.items()],
        species=[{"name": name, "material": name, "radius": r} for name, r in (("glass", 0.0015), ("clay", 0.002))],
        bodies={
            "position": [[0.0021 * side, 0.01 * k, 0] for k in range(3) for side in (-1, 1)],
            "velocity": [[-0.5 * side, 0, 0] for _ in range(3) for side in (-1, 1)],
            "species": [0, 0, 1, 1, 0, 1],
        },
        gravity=(0, 0, 0),
        time_step=1e-6,
    )
    last = run(installed("kratos"), made, tmp_path).frames[-1]
    measured = last.velocity[1::2, 0] - last.velocity[::2, 0]
    assert measured == pytest.approx(list(pairs.values()), abs=1e-3)


@pytest.mark.parametrize(("kind", "speed"), [("fixed", 0.0), ("kinematic", 0.2)])
def test_a_grain_rebounds_from_a_body_that_is_held(kind: str, speed: float, tmp_path: Path) -> None:
    """With the restitution of the pair, as from a wall: the held body has no mass that could give way."""
    made = scene(
        bodies={"position": [[-0.002, 0, 0], [0.002, 0, 0]], "velocity": [[speed, 0, 0], [-0.5, 0, 0]]},
        constraints=({"kind": kind, "bodies": (0,)},),
        gravity=(0, 0, 0),
        time_step=1e-6,
    )
    last = run(installed("kratos"), made, tmp_path).frames[-1]
    assert last.velocity[0].tolist() == [speed, 0, 0]
    assert (last.velocity[1, 0] - speed) / (0.5 + speed) == pytest.approx(0.5, abs=1e-3)


def test_a_sink_may_take_all(tmp_path: Path) -> None:
    sink = {"name": "outlet", "region": {"lower": (None,) * 3, "upper": (None, None, -1e-4)}}
    made = scene(bodies={"position": [[0, 0, 0], [0.004, 0, 0.0002]]}, sinks=(sink,), duration=0.02)
    series = run(installed("kratos"), made, tmp_path)
    assert series.failure is None
    assert [len(frame.present) for frame in series.frames][:10:2] == [2, 2, 2, 1, 0], "gone after 4.5 ms and 7.8 ms"


def test_the_scenes_own_clipped_law_gives_what_clipping_gives(tmp_path: Path) -> None:
    """Dashpots for e = .5 rebound at .550 where the tension is clipped (Schwager & Poeschel 2007)."""
    made = scene(
        law={"kind": "hertz-mindlin", "variant": "no-tension"},
        bodies={"position": [[-0.002, 0, 0], [0.002, 0, 0]], "velocity": [[0.5, 0, 0], [-0.5, 0, 0]]},
        gravity=(0, 0, 0),
        time_step=1e-6,
    )
    last = run(installed("kratos"), made, tmp_path).frames[-1]
    assert last.velocity[1, 0] - last.velocity[0, 0] == pytest.approx(0.5503, abs=2e-4)


@pytest.mark.parametrize("away", [0.0, 1e-4, 1e-3])
def test_a_flat_mesh_is_the_plane(away: float, tmp_path: Path) -> None:
    """An oblique hit on the common edge of two triangles, or beside it; the hit is over before the edge is passed."""
    corners = np.array([[-0.02, -0.02, 0], [0.02, -0.02, 0], [0.02, 0.02, 0], [-0.02, 0.02, 0]])
    net = {"kind": "mesh", "name": "floor", "material": "steel", "triangles": corners[[[0, 1, 2], [0, 2, 3]]]}
    bodies = {"position": [[away, -away, 0.0015103]], "velocity": [[0.2, -0.2, -0.5]]}
    ends = []
    for name, wall in (("net", net), ("plane", FLOOR)):
        made = scene(walls=(wall,), bodies=bodies, gravity=(0, 0, 0), duration=1e-3, time_step=1e-6)
        ends.append(run(installed("kratos"), made, tmp_path / name).frames[-1])
    assert ends[0].velocity == pytest.approx(ends[1].velocity, abs=1e-9)
    assert ends[0].angular_velocity == pytest.approx(ends[1].angular_velocity, abs=1e-6)


def test_walls_move_and_carry_as_they_are_told(tmp_path: Path) -> None:
    """Grains in one scene without gravity, each by a wall of its own.

    A wall at speed u leaves a grain at rest with (1 + e) u, and one that oscillates as A sin(w t) with (1 + e) times
    its speed, A w cos(pi/6) at half its amplitude; a contact lasts 1 % of 1/w.
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
    last = run(installed("kratos"), made, tmp_path).frames[-1]
    speed = 2 * math.pi * frequency * amplitude * math.cos(math.pi / 6)
    assert last.velocity[0] == pytest.approx([(1 + WALL_RESTITUTION) * 0.2, 0, 0], abs=2e-4)
    assert last.velocity[1, 2] == pytest.approx((1 + WALL_RESTITUTION) * speed, rel=0.01)


def test_a_box_that_moves_takes_its_faces_along(tmp_path: Path) -> None:
    """A box at speed u, whose left face meets a grain at rest: (1 + e) u."""
    made = scene(
        walls=({**BOX, "motion": {"velocity": (0.2, 0, 0)}},),
        bodies={"position": [[-0.0104, 0, 0]]},
        gravity=(0, 0, 0),
        duration=0.03,
    )
    last = run(installed("kratos"), made, tmp_path).frames[-1]
    assert last.velocity[0] == pytest.approx([(1 + WALL_RESTITUTION) * 0.2, 0, 0], abs=2e-4)


def test_a_belt_takes_a_grain_along_and_stays(tmp_path: Path) -> None:
    """Friction makes a grain slide with mu g until it rolls or rests on the belt: 2/7 of its speed for a sphere that
    starts without spin, v = 2/7 u, with v - w r = u. The belt carries its weight."""
    belt = {**FLOOR, "motion": {"velocity": (0.1, 0, 0), "surface": True}}
    forces = ({"kind": "wall-force", "name": "force", "wall": "floor", "interval": 0.01},)
    made = scene(walls=(belt,), bodies={"position": [[0, 0, 0.0015]]}, duration=0.06, observables=forces)
    frames = run(installed("kratos"), made, tmp_path).frames
    last = frames[-1]
    assert last.velocity[0] == pytest.approx([2 / 7 * 0.1, 0, 0], abs=1e-4)
    assert last.velocity[0, 0] - last.angular_velocity[0, 1] * 0.0015 == pytest.approx(0.1, abs=1e-4)
    weight = float(made.masses()[0]) * 9.81
    assert last.wall_forces["floor"] == pytest.approx([0, 0, -weight], abs=2e-3 * weight)


def test_a_turntable_carries_a_grain_round(tmp_path: Path) -> None:
    """A floor that turns about its normal: without rotation of the grain it moves with the point that it lies on.

    After an eighth of a turn the surface at the grain moves in another direction than at the start."""
    turntable = {**FLOOR, "motion": {"angular_velocity": (0, 0, 5 * math.pi), "centre": (0, 0, 0)}}
    made = scene(
        walls=(turntable,),
        pair_laws=({"a": "steel", "b": "glass", "restitution": 0.4, "friction": 1e3},
                   {"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0}),
        bodies={"position": [[0.01, 0, 0.0015]], "velocity": [[0, 0.05 * math.pi, 0]]},
        constraints=({"kind": "rotation-locked", "bodies": (0,)},),
        duration=0.05,
    )  # fmt: skip
    last = run(installed("kratos"), made, tmp_path).frames[-1]
    angle = 5 * math.pi * made.duration
    assert last.position[0, :2] == pytest.approx([0.01 * math.cos(angle), 0.01 * math.sin(angle)], abs=2e-4)


def test_a_grain_rolls_in_a_turning_drum_without_slip(tmp_path: Path) -> None:
    """Once sliding has ended, the point of contact moves with the wall: (v + w x n r) . t = Omega R, n the way out."""
    drum = {**DRUM, "motion": {"angular_velocity": (0, -2, 0)}}
    made = scene(walls=(drum,), bodies={"position": [[0, 0.003, -0.0165]]}, duration=0.05)
    last = run(installed("kratos"), made, tmp_path).frames[-1]
    out = last.position[0] * (1, 0, 1)
    out /= np.linalg.norm(out)
    touching = last.velocity[0] + np.cross(last.angular_velocity[0], 0.0015 * out)
    assert np.linalg.norm(touching) == pytest.approx(0.036, rel=0.02)


def test_a_mesh_that_turns_moves_its_triangles(tmp_path: Path) -> None:
    """A plate of two triangles that turns about the y axis strikes a grain at rest: (1 + e) w x where it hits."""
    spin, arm = -10.0, 0.015
    plate = {
        "kind": "mesh",
        "name": "plate",
        "material": "steel",
        "triangles": np.array([[0, -0.02, 0], [0.02, -0.02, 0], [0.02, 0.02, 0], [0, 0.02, 0]])[[[0, 1, 2], [0, 2, 3]]],
        "motion": {"angular_velocity": (0, spin, 0)},
    }
    made = scene(
        walls=(plate,), bodies={"position": [[arm, -0.004, 0.002]]}, gravity=(0, 0, 0), duration=0.01, time_step=2e-6
    )
    last = run(installed("kratos"), made, tmp_path).frames[-1]
    speed = math.hypot(last.velocity[0, 0], last.velocity[0, 2])
    assert speed == pytest.approx((1 + WALL_RESTITUTION) * -spin * arm, rel=0.02)


def test_two_threads_give_the_frames_of_one(tmp_path: Path) -> None:
    """Grains that meet with slip; sums of forces differ in their order only."""
    made = crowd()
    one = run(installed("kratos"), made, tmp_path / "one")
    two = run(installed("kratos"), made, tmp_path / "two", threads="2")
    assert len(one.frames) == len(two.frames) == len(made.frame_times())
    assert (np.abs(one.frames[-1].angular_velocity).max(axis=1) > 1).all()
    for a, b in zip(one.frames, two.frames, strict=True):
        assert np.abs(a.position - b.position).max() < 1e-12


def test_the_skin_changes_nothing(tmp_path: Path) -> None:
    """Neighbours that are sought in every step, and a few times only: no contact is found late."""
    made = crowd()
    often = run(installed("kratos"), made, tmp_path / "often", skin="1e-9")
    seldom = run(installed("kratos"), made, tmp_path / "seldom")
    assert seldom.counters["neighbour searches"] < 20 < 200 == often.counters["neighbour searches"]
    assert seldom.frames[-1].velocity == pytest.approx(often.frames[-1].velocity, abs=1e-12)
    assert seldom.frames[-1].angular_velocity == pytest.approx(often.frames[-1].angular_velocity, abs=1e-9)


def crowd() -> Scene:
    """Five pairs of grains that meet with slip, each pair at another angle."""
    line = 0.004 * np.arange(-2, 3)
    left = np.column_stack([line / 4 - 0.00155, line, 0.1 * line])
    return scene(
        bodies={
            "position": np.concatenate([left, np.add(left, [0.0031, 0, 0])]),
            "velocity": [[0.5, 0.2, 0]] * 5 + [[-0.5, 0, 0.1]] * 5,
        },
        duration=1e-3,
        observables=({"kind": "energy", "name": "energy", "interval": 2.5e-4},),
    )


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
    frames = run(installed("kratos"), made, tmp_path).frames
    weight = float(made.masses().sum()) * 9.81
    last = frames[-1]
    assert last.wall_forces["floor"] == pytest.approx([0, 0, -weight], abs=1e-3 * weight)
    assert np.abs(last.position[:, 2] - 0.0015).max() < 5e-6
    way = (place[:, :2] + np.array([1.0, -0.7]) * made.duration) % 0.016
    assert last.position[:, :2] == pytest.approx(way, abs=1e-9)
