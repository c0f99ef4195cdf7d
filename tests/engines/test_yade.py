"""The deck of Yade, its refusals and its law. `python tests/engines/test_yade.py` writes the golden decks anew."""

from __future__ import annotations

import ast
import math
import shutil
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deck_scenes import BOX, FLOOR, VOID, box, chute, drum, layer, scene, two_spheres
from parts import DRUM, TURNING

from dembench.engines.base import SettingsError
from dembench.engines.yade import Yade
from dembench.engines.yade_walls import built
from dembench.scene import Scene

GOLDEN = Path(__file__).parent / "golden"
CLIPPED = {"kind": "hertz-mindlin", "variant": "no-tension"}
SHAKEN = {"velocity": (0.2, 0, 0), "amplitude": (0, 0, 1e-3), "frequency": 50.0}


CASES: dict[str, tuple[Any, dict[str, str]]] = {
    "yade_two_spheres": (two_spheres, {}),
    "yade_box": (box, {"threads": "2"}),
    "yade_drum": (drum, {"segments": "24"}),
    "yade_chute": (partial(chute, SHAKEN, ("belt", "slope")), {"sink_interval": "0.001"}),
    "yade_layer": (partial(layer, CLIPPED), {}),
}


def write(made: Scene, directory: Path, **overrides: str) -> str:
    """The script of a scene; all files of the deck are in the directory."""
    engine = Yade()
    engine.write(made, engine.settings(made, "closed", overrides), directory)
    return (directory / "simulate.py").read_text()


@pytest.fixture(autouse=True)
def on_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Decks name a program on PATH, wherever one is installed."""
    monkeypatch.setenv("DEMBENCH_YADE", "yade")


# ---- decks


@pytest.mark.parametrize("name", CASES)
def test_decks_are_those_on_record(name: str, tmp_path: Path) -> None:
    build, overrides = CASES[name]
    ast.parse(write(build(), tmp_path, **overrides))
    written = {path.name: path.read_text() for path in tmp_path.iterdir() if path.is_file()}
    assert written == {path.name: path.read_text() for path in (GOLDEN / name).iterdir()}


@pytest.mark.parametrize(
    ("absent", "command"),
    [
        ("friction", "frictAngle=angle"),
        ("walls", "Facet"),
        ("surfaces that move", "mask=2"),
        ("shaken walls", "def shake"),
        ("turning walls", "angVel = Vector3"),
        ("constraints", "blockedDOFs = "),
        ("tracked bodies", "tracks"),
        ("periodic axes", "O.periodic"),
        ("sinks", "def remove"),
        ("wall forces", "forces=forces"),
    ],
)
def test_a_deck_has_only_what_the_scene_needs(absent: str, command: str, tmp_path: Path) -> None:
    assert command not in write(two_spheres(), tmp_path), f"no {absent}, yet the command is there"
    assert command in "".join(write(build(), tmp_path, **overrides) for build, overrides in CASES.values())


def test_threads_are_those_of_the_command(tmp_path: Path) -> None:
    made = two_spheres()
    (phase,) = Yade().write(made, Yade().settings(made, "closed", {"threads": "2"}), tmp_path)
    assert phase.command[1:] == ("-n", "-x", "-j2", "simulate.py")


def test_the_scenes_own_clipped_law_gets_its_own_dashpots(tmp_path: Path) -> None:
    """Tsuji's ratio is sqrt(5/6) b with b = -ln e / sqrt(ln^2 e + pi^2), of the critical damping 2 sqrt(S m)."""
    line = next(
        line for line in write(layer(CLIPPED), tmp_path).splitlines() if line.startswith('    (m["glass"], m["glass"]')
    )
    log = math.log(0.5)
    assert float(line.split(", ")[2].rstrip("),")) == pytest.approx(-math.sqrt(5 / 6) * log / math.hypot(log, math.pi))


def test_the_triangle_of_a_plane_holds_all_of_it_in_the_domain() -> None:
    """Also where a moved plane ends: no foot of a corner of the domain is nearer to an edge than the way is long."""
    tilted = {**FLOOR, "normal": (0.3, 0.4, 0.86), "motion": {"velocity": (0, 0, 2)}}
    made = scene(walls=(tilted,))
    (wall,) = built(made, 24)
    (call,) = (ast.parse(part, mode="eval").body for part in wall.parts)
    assert isinstance(call, ast.Call)
    corners = np.array(ast.literal_eval(call.args[0]))
    normal = np.array(made.walls[0].normal)
    assert np.cross(corners[1] - corners[0], corners[2] - corners[0]) @ normal > 0
    assert (corners - made.walls[0].point) @ normal == pytest.approx(np.zeros(3), abs=1e-12)
    sides = np.array(np.meshgrid(*[(-0.03, 0.03)] * 3)).reshape(3, -1).T
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inward = np.cross(normal, (b - a) / np.linalg.norm(b - a))
        assert ((sides - a) @ inward).min() > 2 * made.duration


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"law": {"kind": "rigid"}}, "contact law rigid"),
        ({"law": {"kind": "linear", "normal_stiffness": 1e4, "tangential_stiffness": 1e3}}, "contact law linear"),
        ({"pair_laws": ({"a": "glass", "b": "glass", "restitution": 0, "friction": 0},)}, "restitution 0"),
        (
            {"pair_laws": ({"a": "glass", "b": "glass", "restitution": 1, "friction": 1, "rolling_friction": 0.1},)},
            "rolling friction",
        ),
        ({"bodies": {"position": []}}, "without bodies"),
        ({"walls": (VOID,)}, "wall void: a signed distance on a grid"),
        ({"walls": ({**FLOOR, "motion": {"angular_velocity": (1, 0, 0)}},)}, "motion of wall floor: a rotation"),
        ({"walls": ({**FLOOR, "motion": {**SHAKEN, "surface": True}},)}, "motion of wall floor: a surface"),
        ({"domain": {"lower": (0, 0, 0), "upper": (0.008, 1, 1), "periodic": (True, False, False)}}, "0.008 m along x"),
        (
            {"walls": (BOX,), "domain": {"lower": (-1,) * 3, "upper": (1,) * 3, "periodic": (True, False, False)}},
            "wall box: in a periodic domain",
        ),
        (
            {"walls": (DRUM,), "domain": {"lower": (-1,) * 3, "upper": (1,) * 3, "periodic": (True, False, False)}},
            "wall drum: in a periodic domain",
        ),
    ],
)  # fmt: skip
def test_what_it_cannot_do_is_named(changes: dict[str, Any], named: str) -> None:
    faults = Yade().unsupported(scene(**changes))
    assert len(faults) == 1
    assert named in faults[0]


def test_its_law_is_told() -> None:
    engine = Yade()

    def law(**changes: Any) -> str:
        made = scene(**changes)
        return engine.law(made, engine.settings(made, "closed"))

    def alike(restitution: float, friction: float) -> tuple[dict[str, Any]]:
        return ({"a": "glass", "b": "glass", "restitution": restitution, "friction": friction},)

    clipped = {"kind": "hertz-mindlin", "variant": "no-tension"}
    assert law() == "tension clipped and damping by Thornton's fit; the shear force remembered instead of its way"
    assert law(pair_laws=alike(1, 0)) == "" and law(law=clipped, pair_laws=alike(0.5, 0)) == ""
    assert law(pair_laws=alike(0.5, 0)) == "tension clipped and damping by Thornton's fit"
    assert law(law=clipped) == "the shear force remembered instead of its way"
    assert "arm of friction" in law(law={"kind": "hertz-mindlin", "variant": "rescaled"})
    assert "drum of triangles" in law(walls=({**DRUM, "motion": TURNING},))
    assert "triangles" not in law(walls=(BOX,))


def test_settings_are_checked() -> None:
    with pytest.raises(SettingsError, match="Did you mean 'threads'"):
        Yade().settings(scene(), "closed", {"thread": "2"})
    with pytest.raises(SettingsError, match="threads"):
        Yade().settings(scene(), "closed", {"threads": "0"})
    one, two = (Yade().settings(scene(), "closed", {"threads": n}) for n in "12")
    assert (one.cores(), two.cores()) == (1, 2)
    assert Yade().estimate(scene(), one) > Yade().estimate(scene(), two)


# ---- the program


def test_a_missing_program_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DEMBENCH_YADE", "no-such-program")
    probe = Yade().probe()
    assert not probe.available
    assert "no-such-program" in probe.reason
    assert "apt-get install" in probe.install and "yade" in probe.install


@pytest.mark.parametrize(
    ("said", "version", "told"), [("Yade version: 2023.02a ", "2023.02a", ""), ("Hello", "", "no version of Yade")]
)
def test_a_program_is_asked_for_its_version(
    said: str, version: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "yade"
    program.write_text(f"#!/bin/sh\necho '{said}'\n")
    program.chmod(0o755)
    monkeypatch.setenv("DEMBENCH_YADE", str(program))
    probe = Yade().probe()
    assert (probe.available, probe.version) == (bool(version), version)
    assert told in probe.reason


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
