"""What LAMMPS makes of scenes: closed forms, the law that its adapter tells, and reading; also of a recorded run.

`python tests/engines/test_lammps_runs.py` records the run anew.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deck_scenes import BOX, box, scene
from launching import installed, meets_the_times, run
from parts import DRUM, PAIRS

from dembench.engines.lammps import Lammps
from dembench.engines.lammps_output import failure_in, timing_in

RECORDED = Path(__file__).parent / "recorded" / "lammps_box"
FLOOR = {"kind": "plane", "name": "floor", "material": "steel", "point": (0, 0, 0), "normal": (0, 0, 1)}
SMOOTH = tuple({**pair, "friction": 0} for pair in PAIRS)
WALL_RESTITUTION = 0.4


# ---- reading


@pytest.fixture(params=["recorded", "run"])
def directory(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The deck directory of a run of the box that has ended, on record or made here."""
    place = tmp_path / "deck"
    if request.param == "recorded":
        shutil.copytree(RECORDED, place)
    else:
        run(installed("lammps"), box(), place)
    return place


def read(directory: Path) -> Any:
    return Lammps().read(box(), Lammps().settings(box(), "closed"), directory)


def test_frames_and_tracks_start_at_the_initial_state_and_meet_the_times(directory: Path) -> None:
    series, made = read(directory), box()
    meets_the_times(series, made, tracked=2)
    assert np.array_equal(series.frames[0].velocity, made.bodies.velocity)
    assert np.array_equal(series.frames[-1].position[0], made.bodies.position[0]), "the fixed body has moved"
    assert series.time == pytest.approx(made.duration)
    assert series.timing.source == "engine"
    assert series.timing.loop > 0
    assert series.counters["dangerous_builds"] == 0
    assert series.counters["neighbour_builds"] > 1


def test_output_that_is_still_being_written_is_left_out(directory: Path) -> None:
    whole = read(directory)
    for path in (max((directory / "frames").iterdir(), key=lambda p: int(p.stem)), directory / "tracks.bin"):
        path.write_bytes(path.read_bytes()[:-1])
    cut = read(directory)
    assert len(cut.frames) == len(whole.frames) - 1
    assert np.array_equal(cut.tracks.step, whole.tracks.step[:-1])
    assert cut.failure == "no output", "the log says that the run has ended, yet a frame is missing"
    shutil.rmtree(directory)
    begun = read(directory)
    assert (len(begun.frames), begun.failure, begun.time) == (0, None, 0.0), "a run that has not begun is no failure"


def test_dumps_of_another_revision_are_refused(directory: Path) -> None:
    first = directory / "frames" / "0.bin"
    data = bytearray(first.read_bytes())
    data[22] = 3
    first.write_bytes(data)
    with pytest.raises(ValueError, match="revision 3"):
        read(directory)


@pytest.mark.parametrize(
    ("log", "reason"),
    [
        ("ERROR: Lost atoms: original 2 current 1 (src/thermo.cpp:496)", "lost particles"),
        ("ERROR on proc 0: Failed to allocate 8 bytes for array x (src/memory.cpp:66)", "memory"),
        ("ERROR: Unknown command: nonsense (src/input.cpp:314)", "engine error"),
        ("   Step         Atoms          KinEng    \n       100              2             -nan", "nan"),
        ("       100              2   1.5e-05", None),
    ],
)
def test_the_log_tells_why_a_run_failed(log: str, reason: str | None) -> None:
    assert failure_in(log + "\n")[0] == reason


def test_times_of_all_parts_are_added() -> None:
    part = (
        "Loop time of 1.5 on 1 procs for 100 steps with 2 atoms\n"
        "Pair    | 0.25       | 0.25       | 0.25       |   0.0 | 16.7\n"
        "Modify  | 0.5        | 0.75       | 1          |   0.0 | 50.0\n"
        "Neighbor list builds = 7\nAve neighs/atom = 3.5\n"
    )
    loop, counters = timing_in(part + part)
    assert loop == 3.0
    assert counters == {"pair_s": 0.5, "modify_s": 1.5, "neighbour_builds": 14, "neighbours_per_body": 3.5}
    assert timing_in("") == (None, {})


# ---- runs


@pytest.mark.slow
def test_two_ranks_give_the_frames_of_one(tmp_path: Path) -> None:
    """Grains that meet with slip across the cut between the ranks. Ranks poll: slow where other work has the cores."""
    engine = installed("lammps")
    if "mpiexec" not in engine.probe().facts:
        pytest.skip("no mpiexec")
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
    one = run(engine, made, tmp_path / "one")
    two = run(engine, made, tmp_path / "two", ranks="2")
    assert len(one.frames) == len(two.frames) == len(made.frame_times())
    assert (np.abs(one.frames[-1].angular_velocity).max(axis=1) > 1).all()
    for a, b in zip(one.frames, two.frames, strict=True):
        assert np.array_equal(a.present, b.present)
        assert np.abs(a.position - b.position).max() < 1e-9


def test_a_body_that_leaves_the_domain_is_a_failure(tmp_path: Path) -> None:
    away = scene(bodies={"position": [[0, 0, 0], [0.01, 0, 0]], "velocity": [[0, 0, 0], [20, 0, 0]]})
    series = run(installed("lammps"), away, tmp_path)
    assert series.failure == "lost particles"
    assert 0 < len(series.frames) < len(away.frame_times())


def test_an_error_in_the_deck_is_a_failure(tmp_path: Path) -> None:
    engine, made = installed("lammps"), box()
    settings = engine.settings(made, "closed")
    (phase,) = engine.write(made, settings, tmp_path)
    (tmp_path / "bodies.data").write_text("nothing")
    subprocess.run(phase.command, cwd=tmp_path, env=phase.environment, capture_output=True, check=False)
    series = engine.read(made, settings, tmp_path)
    assert series.failure == "engine error"
    assert series.detail.startswith("ERROR")


def sliding_hit(speed: float, along: float, dt: float, duration: float) -> tuple[float, float, float]:
    """Velocity across and along a floor and spin of a glass grain after it, by the law that the adapter tells.

    Velocity Verlet with forces of the velocities of half a step, and everything that `law` names: a bound for the sum
    of spring and dashpot, to which the spring is wound back, and the radius as lever.
    """
    radius, restitution, friction = 0.0015, WALL_RESTITUTION, 0.2
    mass = 4 / 3 * math.pi * radius**3 * 2500
    young = 1 / (0.96 / 1e7 + 0.96 / 2.1e11)
    shear = 1 / (2 * 1.8 * 1.2 / 1e7 + 2 * 1.8 * 1.2 / 2.1e11)
    damping = -2 * math.sqrt(5 / 6) * math.log(restitution) / math.hypot(math.pi, math.log(restitution))
    height, across, spin, slip = 1.6e-3, -speed, 0.0, 0.0
    normal = tangent = 0.0
    for _ in range(round(duration / dt)):
        across += 0.5 * dt * normal / mass
        along += 0.5 * dt * tangent / mass
        spin -= 0.5 * dt * tangent * radius / (0.4 * mass * radius**2)
        height += dt * across
        overlap = radius - height
        if overlap > 0:
            contact = math.sqrt(radius * overlap)
            normal = 4 / 3 * young * contact * overlap - damping * math.sqrt(2 * young * contact * mass) * across
            rate = along - spin * radius
            slip += dt * rate
            dashpot = damping * math.sqrt(8 * shear * contact * mass) * rate
            tangent = -8 * shear * contact * slip - dashpot
            if abs(tangent) > friction * abs(normal):
                tangent = math.copysign(friction * abs(normal), tangent)
                slip = -(tangent + dashpot) / (8 * shear * contact)
        else:
            normal = tangent = slip = 0.0
        across += 0.5 * dt * normal / mass
        along += 0.5 * dt * tangent / mass
        spin -= 0.5 * dt * tangent * radius / (0.4 * mass * radius**2)
    return across, along, spin


@pytest.mark.parametrize("kind", ["primitive", "region"])
def test_a_sliding_hit_is_that_of_the_law_that_is_told(kind: str, tmp_path: Path) -> None:
    """Step by step the same law gives the same numbers; the scene's own differs by a tenth."""
    moving = {"motion": {"velocity": (0, 0, 0), "angular_velocity": (0, 0, 0)}} if kind == "region" else {}
    made = scene(
        walls=({**FLOOR, **moving},),
        bodies={"position": [[0, 0, 0.0016]], "velocity": [[0.3, 0, -0.2]]},
        gravity=(0, 0, 0),
    )
    last = run(installed("lammps"), made, tmp_path).frames[-1]
    across, along, spin = sliding_hit(0.2, 0.3, made.time_step, made.duration)
    assert last.velocity[0] == pytest.approx([along, 0, across], abs=1e-9)
    assert last.angular_velocity[0] == pytest.approx([0, spin, 0], abs=1e-6)


@pytest.mark.parametrize("radius", [0.001, 0.0015])
def test_a_mantle_is_as_stiff_as_a_plane(radius: float, tmp_path: Path) -> None:
    """A grain that hits the inside of a cylinder across its axis moves as from a plane, to rounding."""
    lengths = {"lower": (-0.03,) * 3, "upper": (0.03,) * 3}
    made = scene(
        walls=(DRUM,),
        species=({"name": "grain", "material": "glass", "radius": radius},
                 {"name": "other", "material": "glass", "radius": 0.0012}),
        bodies={"position": [[0, 0, -0.0178 + radius], [0, 0, 0.005]], "velocity": [[0, 0, -0.5], [0, 0, 0]],
                "species": [0, 1]},
        gravity=(0, 0, 0), domain=lengths,
    )  # fmt: skip
    flat = {**FLOOR, "point": (0, 0, -0.018)}
    inside, plane = (
        run(installed("lammps"), made.model_copy(update={"walls": scene(walls=(wall,)).walls}), tmp_path / wall["name"])
        for wall in (DRUM, flat)
    )
    assert inside.frames[-1].velocity[0, 2] > 0.1
    assert inside.frames[-1].position == pytest.approx(plane.frames[-1].position, abs=1e-12)


@pytest.mark.parametrize(("axis", "spin"), [(0, (2, 0, 0)), (1, (0, -2, 0)), (2, (0, 0, 2))], ids="xyz")
def test_grains_roll_on_a_turning_cylinder_without_slip(axis: int, spin: tuple[float, ...], tmp_path: Path) -> None:
    """Once sliding has ended, the point of contact moves with the wall: (v + w x n r) . t = Omega R, n the way out."""
    along = np.eye(3)[axis]
    down = -np.roll(along, 1)
    drum = {**DRUM, "start": tuple(-0.012 * along), "end": tuple(0.012 * along), "motion": {"angular_velocity": spin}}
    radii = np.array([0.001, 0.0015])
    made = scene(
        walls=(drum,),
        species=tuple({"name": f"s{k}", "material": "glass", "radius": r} for k, r in enumerate(radii)),
        bodies={"position": (0.018 - radii)[:, None] * down + np.array([[-0.004], [0.004]]) * along, "species": [0, 1]},
        gravity=tuple(9.81 * down),
        duration=0.06,
    )
    last = run(installed("lammps"), made, tmp_path).frames[-1]
    out = last.position - (last.position @ along)[:, None] * along
    out /= np.linalg.norm(out, axis=1)[:, None]
    touching = last.velocity + np.cross(last.angular_velocity, out * radii[:, None])
    assert touching == pytest.approx(np.cross(np.array(spin), 0.018 * out), abs=0.036 * 1e-3)


def test_a_slope_without_friction_accelerates_by_its_inclination(tmp_path: Path) -> None:
    """Frictionless sliding on a tilted plane, a region here: s = g sin(angle) t^2 / 2."""
    angle = 0.3
    normal = np.array([math.sin(angle), 0, math.cos(angle)])
    slope = {**FLOOR, "normal": tuple(normal)}
    made = scene(walls=(slope,), pair_laws=SMOOTH, bodies={"position": [0.0015 * normal]}, duration=0.05)
    moved = run(installed("lammps"), made, tmp_path).frames[-1].position[0] - made.bodies.position[0]
    along = np.array([math.cos(angle), 0, -math.sin(angle)])
    assert moved @ along == pytest.approx(0.5 * 9.81 * math.sin(angle) * 0.05**2, rel=1e-9)
    assert abs(moved @ normal) < 1e-5


def test_a_moving_wall_strikes_a_grain(tmp_path: Path) -> None:
    """A wall at speed u leaves a grain that was at rest with (1 + e) u."""
    made = scene(
        walls=({**BOX, "motion": {"velocity": (0.2, 0, 0)}},),
        bodies={"position": [[-0.0104, 0, 0]]},
        gravity=(0, 0, 0),
        duration=0.03,
    )
    last = run(installed("lammps"), made, tmp_path).frames[-1]
    assert last.velocity[0] == pytest.approx([(1 + WALL_RESTITUTION) * 0.2, 0, 0], abs=1e-4)


def test_a_shaken_wall_strikes_a_grain(tmp_path: Path) -> None:
    """A floor at A sin(w t) meets a grain at half its amplitude with A w cos(pi/6); a contact lasts 1 % of 1/w."""
    amplitude, frequency = 1e-2, 5.0
    floor = {**FLOOR, "motion": {"amplitude": (0, 0, amplitude), "frequency": frequency}}
    bodies = {"position": [[0, 0, 0.0015 + 0.5 * amplitude]]}
    made = scene(walls=(floor,), bodies=bodies, gravity=(0, 0, 0), duration=0.02)
    last = run(installed("lammps"), made, tmp_path).frames[-1]
    wall = 2 * math.pi * frequency * amplitude * math.cos(math.pi / 6)
    assert last.velocity[0, 2] == pytest.approx((1 + WALL_RESTITUTION) * wall, rel=0.01)


def test_a_round_wall_carries_the_weight_of_what_lies_in_it(tmp_path: Path) -> None:
    """Grains of two radii and materials at rest at the bottom: the force on the mantle is their weight."""
    made = scene(
        walls=(DRUM,),
        species=(
            {"name": "small", "material": "glass", "radius": 0.001},
            {"name": "large", "material": "steel", "radius": 0.0015},
        ),
        pair_laws=(*PAIRS, {"a": "steel", "b": "steel", "restitution": 0.4, "friction": 0.2}),
        materials=tuple({**m.model_dump(), "young": 1e7} for m in scene().materials),
        bodies={"position": [[0, -0.005, -0.017], [0, 0.005, -0.0165]], "species": [0, 1]},
        duration=0.05,
        observables=({"kind": "wall-force", "name": "force", "wall": "drum", "interval": 0.01},),
    )
    frames = run(installed("lammps"), made, tmp_path).frames
    weight = float(made.masses().sum()) * 9.81
    assert frames[-1].wall_forces["drum"] == pytest.approx([0, 0, -weight], abs=1e-3 * weight)
    assert np.abs(frames[0].wall_forces["drum"]).max() < 1e-9 * weight, "the grains start without overlap"


def test_small_and_large_bodies_that_are_searched_apart_meet_with_memory(tmp_path: Path) -> None:
    """A ball of four radii far away changes nothing between two grains, and another of them meets the ball."""
    position = [[-0.002, 0, 0], [0.002, 0.001, 0], [0, 0, 0.0085], [0, 0, 0.018]]
    velocity = [[0.5, 0, 0], [-0.5, 0, 0], [0, 0, 0], [0, 0, -0.5]]
    species = (
        {"name": "grain", "material": "glass", "radius": 0.0015},
        {"name": "ball", "material": "glass", "radius": 0.006},
    )
    ends = []
    for count in (2, 4):
        bodies = {"position": position[:count], "velocity": velocity[:count], "species": [0, 0, 0, 1][:count]}
        made = scene(bodies=bodies, species=species, gravity=(0, 0, 0))
        ends.append(run(installed("lammps"), made, tmp_path / f"{count}").frames[-1])
    assert np.abs(ends[0].angular_velocity).max() > 1
    assert ends[1].velocity[:2] == pytest.approx(ends[0].velocity, abs=1e-12)
    assert ends[1].velocity[3, 2] - ends[1].velocity[2, 2] == pytest.approx(0.5 * 0.5, rel=0.01)


def record() -> None:
    """Records the run of the box."""
    with tempfile.TemporaryDirectory() as place:
        run(installed("lammps"), box(), Path(place))
        shutil.rmtree(RECORDED, ignore_errors=True)
        shutil.copytree(place, RECORDED)


if __name__ == "__main__":
    record()
