"""The deck of LIGGGHTS and what is read back. `python tests/engines/test_liggghts.py` writes the golden decks anew."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deck_scenes import BOX, VOID, box, drum, grains, scene, two_spheres
from launching import installed, meets_the_times, run
from parts import DRUM, GLASS, STEEL, TURNING

from dembench.engines.base import SettingsError
from dembench.engines.liggghts import Liggghts
from dembench.scene import Cylinder, Scene, SceneError

GOLDEN = Path(__file__).parent / "golden"


def silo(**changes: Any) -> Scene:
    """Case 1 in small: a cylinder, a cone of triangles, forces on both, a sink, parts with checkpoints."""
    barrel = {**DRUM, "name": "barrel", "start": (0, 0, 0), "end": (0, 0, 0.02), "closed_start": False}
    cone = {"kind": "frustum", "name": "cone", "material": "steel", "start": (0, 0, -0.008), "end": (0, 0, 0),
            "radius_start": 0.01, "radius_end": 0.018}  # fmt: skip
    forces = ({"kind": "wall-force", "name": name, "wall": name, "interval": 1e-3} for name in ("barrel", "cone"))
    made = {
        "name": "silo",
        "walls": ({**barrel, "closed_end": False}, cone),
        "bodies": {"position": [[0, 0, 0.004], [0.001, 0, 0.008], [0, 0.001, 0.012]]},
        "sinks": ({"name": "outlet", "region": {"upper": (None, None, -0.01)}},),
        "observables": ({"kind": "count", "name": "all", "interval": 1e-3}, *forces),
    }
    return scene(**{**made, **changes})


def mixer() -> Scene:
    """Case 2 in small: a turning mesh, two species, parts with checkpoints."""
    drum = Cylinder(**{**DRUM, "kind": "cylinder"}).triangulate(6)
    return scene(
        name="mixer",
        walls=({"kind": "mesh", "name": "drum", "material": "steel", "triangles": drum, "motion": TURNING},),
        species=tuple({"name": n, "material": "glass", "radius": r} for n, r in (("M1", 0.001), ("M2", 0.002))),
        bodies={"position": [[0, 0, -0.012], [0.004, 0, -0.012], [-0.005, 0, -0.01]], "species": [0, 0, 1]},
    )


CASES = {
    "two_spheres": (two_spheres, {}),
    "box": (box, {"ranks": "2"}),
    "drum": (drum, {"segments": "8"}),
    "silo": (silo, {"segments": "8", "checkpoint": "0.001", "sink_interval": "0.001"}),
    "mixer": (mixer, {"checkpoint": "0.001"}),
}


def write(made: Scene, directory: Path, **overrides: str) -> str:
    """The deck of a scene as text; all its files are in the directory, with the deck of a launch from a checkpoint."""
    engine = Liggghts()
    settings = engine.settings(made, "closed", overrides)
    engine.write(made, settings, directory)
    text = (directory / "in.liggghts").read_text()
    if parts := re.findall(r"checkpoints/\d+\.restart$", text, re.M):
        (directory / parts[0]).write_bytes(b"")
        engine.resume(made, settings, directory)
        (directory / parts[0]).unlink()
    return text


# ---- decks


@pytest.mark.parametrize("name", CASES)
def test_decks_are_those_on_record(name: str, tmp_path: Path) -> None:
    build, overrides = CASES[name]
    write(build(), tmp_path, **overrides)
    written = {path.name: path.read_text() for path in tmp_path.iterdir() if path.is_file()}
    assert written == {path.name: path.read_text() for path in (GOLDEN / name).iterdir()}


@pytest.mark.parametrize(
    ("absent", "command"),
    [
        ("friction", "tangential history"),
        ("rotation", "nve/sphere"),
        ("walls", "wall/gran"),
        ("moving walls", "move/mesh"),
        ("gravity", "fix              gravity"),
        ("constraints", "freeze"),
        ("tracked bodies", "dump             tracks"),
        ("ranks", "processors"),
        ("stiff materials", "hard_particles"),
        ("sinks", "delete_atoms"),
        ("wall forces", "compute"),
        ("checkpoints", "write_restart"),
    ],
)
def test_a_deck_has_only_the_commands_that_the_scene_needs(absent: str, command: str, tmp_path: Path) -> None:
    assert command not in write(two_spheres(), tmp_path), f"no {absent}, yet the command is there"
    everything = "".join(write(build(), tmp_path, **overrides) for build, overrides in CASES.values())
    assert command in everything


def test_a_feature_that_is_forced_has_its_commands(tmp_path: Path) -> None:
    """Rotation entails no history; friction entails both."""
    turning, rough = (write(two_spheres(), tmp_path, force=name) for name in ("rotation", "friction"))
    assert "nve/sphere" in turning and "tangential history" not in turning
    assert "nve/sphere" in rough and "tangential history" in rough


def test_soft_grains_are_announced(tmp_path: Path) -> None:
    assert "soft_particles   yes" in write(scene(materials=({**GLASS, "young": 1e6}, STEEL)), tmp_path)


@pytest.mark.parametrize("field", ["name", "materials", "species", "walls"])
def test_no_name_can_carry_a_command(field: str) -> None:
    evil = "x\nshell touch pwned"
    changes: dict[str, Any] = {
        "name": evil,
        "materials": ({**GLASS, "name": evil}, STEEL),
        "species": ({"name": evil, "material": "glass", "radius": 0.0015},),
        "walls": ({**BOX, "name": evil},),
    }
    with pytest.raises(SceneError, match="pattern"):
        scene(**{field: changes[field]})


def test_initial_state_is_written_to_the_last_bit(tmp_path: Path) -> None:
    position = np.random.default_rng(1).uniform(-0.02, 0.02, (20, 3))
    write(scene(bodies={"position": position, "velocity": position / 3}), tmp_path)
    atoms, velocities = (tmp_path / "bodies.data").read_text().split("Atoms")[1].split("Velocities")
    assert np.array_equal(np.array(atoms.split(), float).reshape(-1, 7)[:, 4:], position)
    assert np.array_equal(np.array(velocities.split(), float).reshape(-1, 7)[:, 1:4], position / 3)


@pytest.mark.parametrize(
    ("end", "primitive"), [(0.03, True), (0.012, False)], ids=["open at the domain's end", "open inside the domain"]
)
def test_an_infinite_cylinder_stands_only_for_one_without_an_end(end: float, primitive: bool, tmp_path: Path) -> None:
    wall = {**DRUM, "end": (0, end, 0), "closed_end": False}
    assert ("ycylinder 0.018" in write(drum(walls=(wall,)), tmp_path)) is primitive


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"law": {"kind": "rigid"}}, "rigid"),
        ({"law": {"kind": "hertz-mindlin", "variant": "rescaled"}}, "rescaled"),
        ({"pair_laws": ({"a": "glass", "b": "glass", "restitution": 0.04, "friction": 0},)}, "restitution 0.04"),
        ({"constraints": ({"kind": "rotation-locked", "bodies": (0,)},)}, "rotation-locked"),
        ({"bodies": {"position": []}}, "without bodies"),
        ({"walls": ({**DRUM, "motion": {**TURNING, "velocity": (0, 1, 0)}},)}, "motion of wall drum"),
        ({"walls": ({**DRUM, "motion": {"amplitude": (0, 0, 1e-3), "frequency": 50}},)}, "motion of wall drum"),
        ({"walls": ({**DRUM, "motion": {**TURNING, "surface": True}},)}, "motion of wall drum"),
        ({"walls": ({**DRUM, "motion": TURNING, "radius": 0.05},)}, "domain"),
        ({"walls": (VOID,)}, "wall void: a signed distance on a grid"),
    ],
)
def test_what_it_cannot_do_is_named(changes: dict[str, Any], named: str) -> None:
    faults = Liggghts().unsupported(scene(**changes))
    assert len(faults) == 1
    assert named in faults[0]


def test_settings_are_checked() -> None:
    with pytest.raises(SettingsError, match="Did you mean 'ranks'"):
        Liggghts().settings(scene(), "closed", {"rank": "2"})
    with pytest.raises(SettingsError, match="ranks"):
        Liggghts().settings(scene(), "closed", {"ranks": "0"})
    assert Liggghts().settings(scene(), "closed", {"ranks": "2"}).cores() == 2


def test_a_missing_program_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DEMBENCH_LIGGGHTS", "no-such-program")
    probe = Liggghts().probe()
    assert not probe.available
    assert "no-such-program" in probe.reason
    assert probe.install == "apt-get install liggghts"


# ---- runs


def test_frames_and_tracks_start_at_the_initial_state_and_meet_the_times(tmp_path: Path) -> None:
    made = box()
    series = run(installed("liggghts"), made, tmp_path)
    meets_the_times(series, made, tracked=2)
    assert np.array_equal(series.frames[0].velocity, made.bodies.velocity)
    assert np.array_equal(series.frames[-1].position[0], made.bodies.position[0]), "the fixed body has moved"
    assert series.time == pytest.approx(made.duration)
    assert series.timing.source == "engine"
    assert series.timing.loop is not None
    assert series.counters["dangerous_builds"] == 0


def test_ranks_are_started_by_the_launcher_beside_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """That of another MPI, which a Python package may put first on PATH, starts two runs of one rank each."""
    for place in ("own", "other"):
        (tmp_path / place).mkdir()
        for name in ("liggghts", "mpirun"):
            (tmp_path / place / name).write_text("#!/bin/sh\n")
            (tmp_path / place / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path / "other"), prepend=os.pathsep)
    monkeypatch.setenv("DEMBENCH_LIGGGHTS", str(tmp_path / "own" / "liggghts"))
    (tmp_path / "deck").mkdir()
    settings = Liggghts().settings(scene(), "closed", {"ranks": "2"})
    (phase,) = Liggghts().write(scene(), settings, tmp_path / "deck")
    assert str(tmp_path / "own" / "mpirun") in phase.command


def test_two_ranks_give_the_frames_of_one(tmp_path: Path) -> None:
    if shutil.which("mpirun") is None:
        pytest.skip("no mpirun")
    one = run(installed("liggghts"), grains(), tmp_path / "one")
    two = run(installed("liggghts"), grains(), tmp_path / "two", ranks="2")
    assert len(one.frames) == len(two.frames) == len(grains().frame_times())
    for a, b in zip(one.frames, two.frames, strict=True):
        assert np.array_equal(a.present, b.present)
        assert np.abs(a.position - b.position).max() < 1e-9


def test_a_body_that_leaves_the_domain_is_a_failure(tmp_path: Path) -> None:
    away = scene(bodies={"position": [[0, 0, 0], [0.01, 0, 0]], "velocity": [[0, 0, 0], [20, 0, 0]]})
    series = run(installed("liggghts"), away, tmp_path)
    assert series.failure == "lost particles"
    assert "Lost atoms" in series.detail
    assert 0 < len(series.frames) < len(away.frame_times())


def test_an_error_in_the_deck_is_a_failure(tmp_path: Path) -> None:
    engine = installed("liggghts")
    made = box()
    settings = engine.settings(made, "closed")
    (phase,) = engine.write(made, settings, tmp_path)
    (tmp_path / "bodies.data").write_text("nothing")
    assert engine.read(made, settings, tmp_path).failure is None, "a run that has not begun is no failure"
    subprocess.run(phase.command, cwd=tmp_path, capture_output=True, check=False)
    series = engine.read(made, settings, tmp_path)
    assert series.failure == "engine error"
    assert series.detail.startswith("ERROR")


def test_output_that_is_still_being_written_is_left_out(tmp_path: Path) -> None:
    engine, made = installed("liggghts"), box()
    whole = run(engine, made, tmp_path)
    assert whole.tracks is not None
    for path in (max((tmp_path / "frames").iterdir(), key=lambda p: int(p.stem)), tmp_path / "tracks.bin"):
        path.write_bytes(path.read_bytes()[:-1])
    cut = engine.read(made, engine.settings(made, "closed"), tmp_path)
    assert len(cut.frames) == len(whole.frames) - 1
    assert cut.tracks is not None
    assert np.array_equal(cut.tracks.step, whole.tracks.step[:-1])
    assert cut.failure == "no output", "the log says that the run has ended, yet a frame is missing"


def test_a_slope_without_friction_accelerates_by_its_inclination(tmp_path: Path) -> None:
    """Frictionless sliding on a tilted plane, a wall of triangles here: s = g sin(angle) t^2 / 2."""
    angle = 0.3
    normal = np.array([math.sin(angle), 0, math.cos(angle)])
    made = scene(
        walls=({"kind": "plane", "name": "slope", "material": "steel", "point": (0, 0, 0), "normal": tuple(normal)},),
        pair_laws=(
            {"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0},
            {"a": "steel", "b": "glass", "restitution": 0.4, "friction": 0},
        ),
        bodies={"position": [0.0015 * normal]},
        duration=0.05,
    )
    last = run(installed("liggghts"), made, tmp_path).frames[-1]
    moved = last.position[0] - made.bodies.position[0]
    along = np.array([math.cos(angle), 0, -math.sin(angle)])
    assert moved @ along == pytest.approx(0.5 * 9.81 * math.sin(angle) * 0.05**2, rel=1e-9)
    assert abs(moved @ normal) < 1e-5


def test_a_turning_drum_carries_the_grains_along(tmp_path: Path) -> None:
    """The lowest point of a drum with omega = -2 rad/s about y moves to +x with 0.036 m/s."""
    made = drum(bodies={"position": [[0, 0, -0.0165]]}, duration=0.02)
    last = run(installed("liggghts"), made, tmp_path).frames[-1]
    assert 0.005 < last.velocity[0, 0] < 0.036
    assert last.angular_velocity[0, 1] < 0


def test_a_moving_wall_strikes_a_grain(tmp_path: Path) -> None:
    """A wall at speed u leaves a grain that was at rest with (1 + e) u."""
    made = scene(
        walls=({**BOX, "motion": {"velocity": (0.2, 0, 0)}},),
        bodies={"position": [[-0.0104, 0, 0]]},
        gravity=(0, 0, 0),
        duration=0.03,
    )
    last = run(installed("liggghts"), made, tmp_path).frames[-1]
    assert last.velocity[0] == pytest.approx([1.4 * 0.2, 0, 0], abs=1e-4)


def test_a_grain_that_crosses_a_periodic_face_comes_in_at_the_other(tmp_path: Path) -> None:
    made = scene(
        bodies={"position": [[0.029, 0, 0]], "velocity": [[1, 0, 0]]},
        domain={"lower": (-0.03,) * 3, "upper": (0.03,) * 3, "periodic": (True, False, False)},
        gravity=(0, 0, 0),
    )
    series = run(installed("liggghts"), made, tmp_path)
    assert series.failure is None
    assert series.frames[-1].position[0] == pytest.approx([-0.021, 0, 0], abs=1e-12)


def regenerate() -> None:
    """Writes the golden decks."""
    for name, (build, overrides) in CASES.items():
        with tempfile.TemporaryDirectory() as directory:
            write(build(), Path(directory), **overrides)
            shutil.rmtree(GOLDEN / name, ignore_errors=True)
            (GOLDEN / name).mkdir(parents=True)
            for path in Path(directory).iterdir():
                if path.is_file():
                    (GOLDEN / name / path.name).write_text(path.read_text())


if __name__ == "__main__":
    regenerate()
