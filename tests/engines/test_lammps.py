"""The deck of LAMMPS, its refusals and its law. `python tests/engines/test_lammps.py` writes the golden decks anew."""

from __future__ import annotations

import math
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deck_scenes import BOX, VOID, box, drum, scene, two_spheres
from parts import DRUM, GLASS, TURNING

from dembench.engines.base import SettingsError
from dembench.engines.lammps import Lammps
from dembench.scene import Scene

GOLDEN = Path(__file__).parent / "golden"
CONE = {"kind": "frustum", "name": "cone", "material": "steel", "start": (0, 0, -0.008), "end": (0, 0, 0),
        "radius_start": 0.01, "radius_end": 0.018}  # fmt: skip
NET = {"kind": "mesh", "name": "net", "material": "steel", "triangles": np.eye(3)[None]}
SHAKEN = {"velocity": (0.2, 0, 0), "amplitude": (0, 0, 1e-3), "frequency": 50.0}
SINKS = ({"name": "outlet", "region": {"lower": (0.01, None, None), "upper": (None, None, -0.01)}},)


def vessel() -> Scene:
    """Grains of two sizes and two materials in a turning barrel with a shaken lid, forces on both, and a sink."""
    barrel = {**DRUM, "start": (0, 0, -0.012), "end": (0, 0, 0.03), "closed_end": False}
    barrel |= {"name": "barrel", "motion": {"angular_velocity": (0, 0, 2)}}
    lid = {"kind": "plane", "name": "lid", "material": "glass", "point": (0, 0, 0.02), "normal": (0, 0.6, -0.8)}
    forces = ({"kind": "wall-force", "name": name, "wall": name, "interval": 1e-3} for name in ("barrel", "lid"))
    return scene(
        name="vessel",
        walls=(barrel, {**lid, "motion": SHAKEN}),
        species=(
            {"name": "grain", "material": "glass", "radius": 0.0015},
            {"name": "gravel", "material": "glass", "radius": 0.002},
            {"name": "ball", "material": "steel", "radius": 0.002},
        ),
        pair_laws=(
            {"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0.3},
            {"a": "steel", "b": "glass", "restitution": 0.4, "friction": 0.2},
            {"a": "steel", "b": "steel", "restitution": 0.6, "friction": 0.5},
        ),
        bodies={"position": [[0, 0, 0], [0.005, 0, 0], [-0.005, 0, 0]], "species": [0, 1, 2]},
        sinks=SINKS,
        observables=({"kind": "count", "name": "all", "interval": 1e-3}, *forces),
    )


CASES = {
    "lammps_two_spheres": (two_spheres, {}),
    "lammps_box": (box, {"ranks": "2"}),
    "lammps_drum": (drum, {}),
    "lammps_vessel": (vessel, {"sink_interval": "0.001"}),
}


def write(made: Scene, directory: Path, **overrides: str) -> str:
    """The script of a scene; all files of the deck are in the directory."""
    engine = Lammps()
    engine.write(made, engine.settings(made, "closed", overrides), directory)
    return (directory / "in.lammps").read_text()


@pytest.fixture(autouse=True)
def on_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Decks name a program on PATH, wherever one is installed."""
    monkeypatch.setenv("DEMBENCH_LAMMPS", "lmp")


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
        ("friction", "tangential mindlin"),
        ("rotation", "nve/sphere"),
        ("walls", "wall/gran"),
        ("moving walls", "rotate v_"),
        ("shaken walls", "move v_"),
        ("gravity", "fix              gravity"),
        ("constraints", "freeze"),
        ("tracked bodies", "dump             tracks"),
        ("ranks", "processors"),
        ("large bodies", "multi"),
        ("several materials", "group"),
        ("sinks", "delete_atoms"),
        ("wall forces", "compute"),
    ],
)
def test_a_deck_has_only_the_commands_that_the_scene_needs(absent: str, command: str, tmp_path: Path) -> None:
    assert command not in write(two_spheres(), tmp_path), f"no {absent}, yet the command is there"
    everything = "".join(write(build(), tmp_path, **overrides) for build, overrides in CASES.values())
    assert command in everything


def test_a_feature_that_is_forced_has_its_commands(tmp_path: Path) -> None:
    """Rotation entails no history; friction entails both."""
    turning, rough = (write(two_spheres(), tmp_path, force=name) for name in ("rotation", "friction"))
    assert "nve/sphere" in turning and "tangential mindlin" not in turning
    assert "nve/sphere" in rough and "tangential mindlin" in rough


def test_constants_are_those_of_the_law(tmp_path: Path) -> None:
    """Of equal materials: 4/3 E* with E* = E / (2 (1 - nu^2)), 8 G* with G* = E / (4 (2 - nu) (1 + nu)), and a ratio
    of the dashpots of sqrt(S_t / S_n) = sqrt(8 G* / (2 E*))."""
    alike = ({"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0.3},)
    deck = write(scene(materials=(GLASS,), pair_laws=alike), tmp_path)
    words = next(line for line in deck.splitlines() if line.startswith("pair_coeff")).split()
    young, shear = 1e7 / (2 * 0.96), 1e7 / (4 * 1.8 * 1.2)
    expected = [4 / 3 * young, 0.5, 8 * shear, math.sqrt(8 * shear / (2 * young)), 0.3]
    assert [float(words[k]) for k in (4, 5, 8, 9, 10)] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"law": {"kind": "rigid"}}, "contact law rigid"),
        ({"law": {"kind": "linear", "normal_stiffness": 1e4, "tangential_stiffness": 1e3}}, "contact law linear"),
        ({"law": {"kind": "hertz-mindlin", "variant": "no-tension"}}, "variant no-tension"),
        ({"pair_laws": ({"a": "glass", "b": "glass", "restitution": 0, "friction": 0},)}, "restitution 0"),
        (
            {"pair_laws": ({"a": "glass", "b": "glass", "restitution": 1, "friction": 1, "rolling_friction": 0.1},)},
            "rolling friction",
        ),
        ({"constraints": ({"kind": "rotation-locked", "bodies": (0,)},)}, "rotation-locked"),
        ({"bodies": {"position": []}}, "without bodies"),
        ({"walls": ({**DRUM, "motion": {**TURNING, "velocity": (0, 1, 0)}},)}, "wall drum: a cylinder must"),
        ({"walls": ({**DRUM, "end": (0, 0.005, 0), "closed_end": False},)}, "wall drum: a cylinder must"),
        ({"walls": ({**DRUM, "end": (0.001, 0.012, 0)},)}, "wall drum: a cylinder must"),
        ({"walls": ({**BOX, "motion": {**TURNING, "surface": True}},)}, "motion of wall box: a surface"),
        ({"walls": (CONE,)}, "wall cone: a cone"),
        ({"walls": (NET,)}, "wall net: a mesh"),
        ({"walls": (VOID,)}, "wall void: a signed distance on a grid"),
    ],
)  # fmt: skip
def test_what_it_cannot_do_is_named(changes: dict[str, Any], named: str) -> None:
    faults = Lammps().unsupported(scene(**changes))
    assert len(faults) == 1
    assert named in faults[0]


def test_its_law_is_told() -> None:
    engine = Lammps()

    def law(**changes: Any) -> str:
        made = scene(**changes)
        return engine.law(made, engine.settings(made, "closed"))

    smooth = ({"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0},)
    assert law(pair_laws=smooth) == ""
    assert law() == "friction bounds shear spring and dashpot together; shear history rescaled to its old length"
    assert law(walls=(BOX,)).endswith("arm of friction at walls the full radius")
    assert "arm of friction between bodies" in law(law={"kind": "hertz-mindlin", "variant": "rescaled"})
    many = tuple({"name": f"s{k}", "material": "glass", "radius": 1e-3 + 1e-5 * k} for k in range(9))
    bodies = {"position": [[0.003 * (k - 4), 0, 0] for k in range(9)], "species": list(range(9))}
    assert "curvature" not in law(species=many[:8], bodies={k: v[:8] for k, v in bodies.items()}, walls=(DRUM,))
    assert "stiffness at round walls by their curvature" in law(species=many, bodies=bodies, walls=(DRUM,))


def test_settings_are_checked() -> None:
    with pytest.raises(SettingsError, match="Did you mean 'ranks'"):
        Lammps().settings(scene(), "closed", {"rank": "2"})
    with pytest.raises(SettingsError, match="ranks"):
        Lammps().settings(scene(), "closed", {"ranks": "0"})
    one, two = (Lammps().settings(scene(), "closed", {"ranks": n}) for n in "12")
    assert (one.cores(), two.cores()) == (1, 2)
    assert Lammps().estimate(scene(), one) > Lammps().estimate(scene(), two)


# ---- the program


def test_a_missing_program_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DEMBENCH_LAMMPS", "no-such-program")
    probe = Lammps().probe()
    assert not probe.available
    assert "no-such-program" in probe.reason
    assert "dembench[lammps]" in probe.install


@pytest.mark.parametrize(
    ("said", "available", "told"),
    [
        ("LAMMPS (22 Jul 2025 - Update 4)", True, ""),
        ("LAMMPS (29 Sep 2021)\nERROR: Illegal pair_coeff command", False, "lacks the granular package"),
        ("Hello", False, "no banner of LAMMPS"),
    ],
)
def test_a_program_is_asked_for_what_decks_need(
    said: str, available: bool, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "lmp"
    program.write_text(f"#!/bin/sh\ncat >/dev/null\necho '{said}'\n")
    program.chmod(0o755)
    monkeypatch.setenv("DEMBENCH_LAMMPS", str(program))
    probe = Lammps().probe()
    assert probe.available is available
    assert told in probe.reason
    assert probe.version == ("22 Jul 2025 - Update 4" if available else probe.version)


def test_the_library_that_came_with_a_program_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The package puts the program into a folder below the one that holds its MPI library and launcher."""
    for name in ("lib/site-packages/lammps/lmp", "bin/mpiexec", "lib/libmpi.so.12"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch(0o755)
    monkeypatch.setenv("DEMBENCH_LAMMPS", str(tmp_path / "lib/site-packages/lammps/lmp"))
    monkeypatch.delenv("LD_LIBRARY_PATH", raising=False)
    (deck := tmp_path / "deck").mkdir()
    made = two_spheres()
    (phase,) = Lammps().write(made, Lammps().settings(made, "closed", {"ranks": "2"}), deck)
    assert phase.command[:3] == (str(tmp_path / "bin/mpiexec"), "-n", "2")
    assert phase.environment["LD_LIBRARY_PATH"] == str(tmp_path / "lib")


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
