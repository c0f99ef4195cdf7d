"""MUSEN's deck, its refusals and its settings. `python tests/engines/test_musen.py` writes the golden decks anew."""

from __future__ import annotations

import itertools
import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from musen_scenes import BOX, CONE, DRUM, FLOOR, TURNING, everything, scene, two_spheres

from dembench.engines.base import SettingsError
from dembench.engines.musen import Musen
from dembench.engines.musen_output import parts, saving
from dembench.engines.musen_scene import geometries
from dembench.engines.musen_text import read_text
from dembench.scene import Scene

GOLDEN = Path(__file__).parent / "golden"
CASES: dict[str, tuple[Callable[[], Scene], dict[str, str]]] = {
    "musen_two_spheres": (two_spheres, {}),
    "musen_everything": (everything, {"segments": "8", "threads": "2", "digits": "17"}),
}


def write(made: Scene, directory: Path, **overrides: str) -> dict[str, str]:
    """The deck of a scene: its files by name."""
    engine = Musen()
    engine.write(made, engine.settings(made, "closed", overrides), directory)
    return {path.name: path.read_text() for path in directory.iterdir() if path.is_file()}


# ---- decks


@pytest.mark.parametrize("name", CASES)
def test_decks_are_those_on_record(name: str, tmp_path: Path) -> None:
    build, overrides = CASES[name]
    assert write(build(), tmp_path, **overrides) == {p.name: p.read_text() for p in (GOLDEN / name).iterdir()}


def test_initial_state_is_written_to_the_last_bit(tmp_path: Path) -> None:
    position = np.random.default_rng(1).uniform(-0.02, 0.02, (20, 3))
    given = {"position": position, "velocity": position / 3, "angular_velocity": 100 * position}
    write(scene(bodies=given), tmp_path)
    grains = read_text(tmp_path / "scene.txt").grains
    for tag, field in ((12, "position"), (15, "velocity"), (16, "angular_velocity")):
        assert np.array_equal(grains.values[tag][0], given[field])
    assert grains.id.tolist() == list(range(20)) and np.isinf(grains.left).all()


def test_every_pair_and_property_is_stated(tmp_path: Path) -> None:
    """Also of two walls that never meet: what is left out gets the program's own values, rolling friction 0.05."""
    write(scene(walls=(FLOOR,)), tmp_path)
    text = read_text(tmp_path / "scene.txt")
    assert text.pairs == {
        "glass-glass": {200: 0.5, 201: 0.3, 202: 0},
        "glass-steel": {200: 0.4, 201: 0.2, 202: 0},
        "steel-steel": {200: 1, 201: 0, 202: 0},
    }
    assert text.materials == {"glass": {0: 2500, 7: 1e7, 10: 0.2}, "steel": {0: 7200, 7: 2.1e11, 10: 0.2}}


@pytest.mark.parametrize(
    ("absent", "words"),
    [("walls", "MODEL_PW"), ("moving walls", "GEOMETRY_MOTION_TIME"), ("wall forces", "TEXT_EXPORT_TD_WALL 0 1 0 0")],
)
def test_a_deck_has_only_what_the_scene_needs(absent: str, words: str, tmp_path: Path) -> None:
    assert words not in "".join(write(two_spheres(), tmp_path).values()), f"no {absent}, yet it is there"
    assert words in "".join(write(everything(), tmp_path).values())


def test_gravity_is_written_where_there_is_none(tmp_path: Path) -> None:
    """The program's default is -9.81 m/s^2."""
    assert "EXT_ACCEL 0.0 0.0 0.0\n" in write(two_spheres(), tmp_path)["simulate.txt"]


# ---- walls


@pytest.mark.parametrize("wall", [FLOOR, BOX, DRUM, CONE], ids=lambda wall: wall["kind"])
def test_triangles_face_the_void_and_do_not_reach_into_it(wall: dict[str, Any]) -> None:
    """A step along the normal from a triangle's middle leads into the void; its middle is not in the void.

    A polygon of 100 sides around a circle of radius R is R (1/cos(pi/100) - 1) = 4.9e-4 R outside at most.
    """
    made = scene(walls=(wall,))
    (geometry,) = geometries(made, 100)
    middle = geometry.triangles.mean(axis=1)
    normal = np.cross(
        geometry.triangles[:, 1] - geometry.triangles[:, 0], geometry.triangles[:, 2] - geometry.triangles[:, 0]
    )
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    distance = made.walls[0].signed_distance(middle)
    assert distance.max() < 1e-12
    if wall["kind"] in ("cylinder", "frustum"):
        assert distance.min() > -1e-3 * 0.018
        assert (made.walls[0].signed_distance(middle + 1e-4 * normal) > distance).all()
    else:
        inner = (0, 0, 0.01) if wall["kind"] == "plane" else (0, 0, 0)
        assert ((inner - middle) * normal).sum(axis=1) == pytest.approx(0.01)


def test_a_mantle_with_the_void_outside_is_a_polygon_inside_it() -> None:
    pillar = {**DRUM, "closed_start": False, "closed_end": False, "outside": True}
    (geometry,) = geometries(scene(walls=(pillar,)), 12)
    radius = np.hypot(geometry.triangles[..., 0], geometry.triangles[..., 2])
    assert radius == pytest.approx(0.018)


@pytest.mark.parametrize(
    "motion", [None, {"velocity": (0.5, 0, 0)}, {"angular_velocity": (3, 0, 0), "centre": (0.1, 0, 0)}]
)
def test_a_plane_covers_the_domain_at_all_times(motion: dict[str, Any] | None) -> None:
    """The corners of the domain, seen from the plane that has moved, lie above its square."""
    made = scene(walls=({**FLOOR, "motion": motion},), duration=0.1)
    (geometry,) = geometries(made, 8)
    half = np.abs(geometry.triangles).max()
    corners = np.array(np.meshgrid(*[[-0.03, 0.03]] * 3)).reshape(3, -1).T
    moving = made.walls[0].motion
    if moving is not None:
        angle = 0.1 * np.array(moving.angular_velocity)[0]
        turn = np.array([[1, 0, 0], [0, math.cos(angle), math.sin(angle)], [0, -math.sin(angle), math.cos(angle)]])
        corners = (corners - 0.1 * np.array(moving.velocity) - moving.centre) @ turn.T + moving.centre
    assert np.abs(corners[:, :2]).max() < half


# ---- what it cannot do, settings


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"law": {"kind": "rigid"}}, "rigid"),
        ({"law": {"kind": "hertz-mindlin", "variant": "no-tension"}}, "no-tension"),
        (
            {"pair_laws": ({"a": "glass", "b": "glass", "restitution": 0, "friction": 0},)},
            "restitution 0 of glass-glass",
        ),
        (
            {"pair_laws": ({"a": "glass", "b": "glass", "restitution": 1, "friction": 0, "rolling_friction": 0.1},)},
            "rolling friction",
        ),
        ({"sinks": ({"name": "out", "region": {}},)}, "sink out"),
        (
            {"sinks": ({"name": "out", "region": {"lower": (0.02, None, None), "upper": (0.03, None, None)}},)},
            "sink out",
        ),
        ({"sinks": ({"name": "out", "region": {"upper": (0, None, None)}},)}, "1 bodies that start in a sink"),
        ({"constraints": ({"kind": "fixed", "bodies": (0,)},)}, "constraint fixed"),
        ({"bodies": {"position": []}}, "without bodies"),
        ({"domain": {"lower": (-1,) * 3, "upper": (1,) * 3, "periodic": (True, False, False)}}, "periodic"),
        ({"walls": ({**DRUM, "motion": {**TURNING, "velocity": (0, 1, 0)}},)}, "motion of wall drum"),
        ({"walls": ({**DRUM, "motion": {"amplitude": (0, 0, 1e-3), "frequency": 50}},)}, "motion of wall drum"),
        ({"walls": ({**DRUM, "motion": {**TURNING, "surface": True}},)}, "motion of wall drum"),
    ],
)
def test_what_it_cannot_do_is_named(changes: dict[str, Any], named: str) -> None:
    faults = Musen().unsupported(scene(**changes))
    assert len(faults) == 1
    assert named in faults[0]


def test_its_law_is_told() -> None:
    engine = Musen()

    def law(made: Scene, **overrides: str) -> str:
        return engine.law(made, engine.settings(made, "closed", overrides))

    frictionless = tuple({**pair, "friction": 0} for pair in two_spheres().model_dump()["pair_laws"])
    rescaled = {"kind": "hertz-mindlin", "variant": "rescaled"}
    assert law(scene(pair_laws=frictionless)) == law(scene(law=rescaled)) == ""
    assert "arm the full radius" in law(scene())
    assert law(scene(law=rescaled, walls=(FLOOR,))).startswith("spring force of walls times |cos|")
    assert "polygons of 48 sides" in law(scene(walls=(DRUM,)), segments="48")


def test_settings_are_checked() -> None:
    engine = Musen()
    with pytest.raises(SettingsError, match="Did you mean 'threads'"):
        engine.settings(scene(), "closed", {"thread": "2"})
    with pytest.raises(SettingsError, match="hardware"):
        engine.settings(scene(), "closed", {"hardware": "tpu"})
    chosen = engine.settings(scene(), "closed", {"threads": "2", "hardware": "gpu"})
    assert (chosen.cores(), chosen.device(), chosen.dt) == (2, "gpu", 1e-5)
    one, two = (engine.settings(scene(), "closed", {"threads": n}) for n in "12")
    assert engine.estimate(scene(), one) > engine.estimate(scene(), two)


def test_a_missing_program_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DEMBENCH_MUSEN", "no-such-program")
    probe = Musen().probe()
    assert not probe.available
    assert "no-such-program" in probe.reason
    assert "10.1016/j.softx.2020.100618" in probe.install


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("#!/bin/sh\necho hello\n", "prints no version"),
        ("#!/bin/sh\necho Version: 1.74.2\n", "ModelPPHertzMindlin"),
        ("#!/no/such/shell\n", "does not start"),
        ("#!/bin/sh\nexec sleep 1000\n", "does not start"),
    ],
    ids=["another program", "no models", "no shell", "hangs"],
)
def test_a_program_that_is_not_musen_is_told_apart(
    text: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "CMUSEN"
    program.write_text(text)
    program.chmod(0o755)
    monkeypatch.setenv("DEMBENCH_MUSEN", str(program))
    monkeypatch.setattr("dembench.engines.musen.PROBE_SECONDS", 0.3)
    probe = Musen().probe()
    assert not probe.available and reason in probe.reason


# ---- saving and parts


def test_saving_meets_frames_and_tracks() -> None:
    saved = saving(everything(), 1e-5)
    assert (saved.step, saved.count) == (10, 100)  # 4.5 ms and multiples of 0.2 ms
    assert saved.frames.tolist()[:7] == [0, 10, 20, 30, 40, 45, 50] and saved.tracks.tolist()[:3] == [0, 2, 4]
    assert saving(scene(observables=()), 1e-5).count == 1


@pytest.mark.parametrize("bodies", [10, 100_000, 3_000_000])
def test_parts_hold_every_saved_frame_once(bodies: int) -> None:
    found = parts(bodies, saving(scene(), 1e-5), 12)
    assert [k for part in found for k in part.new()] == list(range(11))
    assert all(a.last == b.first for a, b in itertools.pairwise(found))
    assert (len(found) > 1) is (bodies > 100_000)


def regenerate() -> None:
    """Writes the golden decks."""
    for name, (build, overrides) in CASES.items():
        with tempfile.TemporaryDirectory() as directory:
            (GOLDEN / name).mkdir(parents=True, exist_ok=True)
            for file, text in write(build(), Path(directory), **overrides).items():
                (GOLDEN / name / file).write_text(text)


if __name__ == "__main__":
    regenerate()
