"""The deck of Kratos, its refusals and its law. `python tests/engines/test_kratos.py` writes the golden decks anew."""

from __future__ import annotations

import ast
import json
import math
import shutil
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deck_scenes import BOX, FLOOR, VOID, box, chute, drum, layer, scene, two_spheres
from parts import DRUM, TURNING

from dembench.engines.base import SettingsError
from dembench.engines.kratos import Kratos
from dembench.scene import Scene

GOLDEN = Path(__file__).parent / "golden"
CLIPPED = {"kind": "hertz-mindlin", "variant": "no-tension"}
SHAKEN = {"amplitude": (0, 0, 1e-3), "frequency": 50.0}


CASES: dict[str, tuple[Any, dict[str, str]]] = {
    "kratos_two_spheres": (two_spheres, {}),
    "kratos_box": (box, {"threads": "2"}),
    "kratos_drum": (drum, {"segments": "24"}),
    "kratos_chute": (partial(chute, SHAKEN, ("belt", "slope")), {"sink_interval": "0.001"}),
    "kratos_layer": (partial(layer, CLIPPED), {}),
}


def write(made: Scene, directory: Path, **overrides: str) -> str:
    """The script of a scene; all files of the deck are in the directory."""
    engine = Kratos()
    engine.write(made, engine.settings(made, "closed", overrides), directory)
    return (directory / "simulate.py").read_text()


def text_of(directory: Path) -> str:
    """All files of a deck."""
    return "".join(path.read_text() for path in sorted(directory.iterdir()) if path.is_file())


# ---- decks


@pytest.mark.parametrize("name", CASES)
def test_decks_are_those_on_record(name: str, tmp_path: Path) -> None:
    build, overrides = CASES[name]
    ast.parse(write(build(), tmp_path, **overrides))
    written = {path.name: path.read_text() for path in tmp_path.iterdir() if path.is_file()}
    assert written == {path.name: path.read_text() for path in (GOLDEN / name).iterdir()}


@pytest.mark.parametrize(
    ("absent", "text"),
    [
        ("spins", '"RotationOption": true'),
        ("walls", "RigidFace"),
        ("walls that move", "RIGID_BODY_MOTION"),
        ("surfaces that move", "def carry"),
        ("constraints", "NodalData ANGULAR_VELOCITY"),
        ("tracked bodies", "tracks"),
        ("periodic axes", "PeriodicDomainOption"),
        ("sinks", "def remove"),
        ("wall forces", "forces=forces"),
        ("dashpots of its own", "DAMPING_GAMMA"),
    ],
)
def test_a_deck_has_only_what_the_scene_needs(absent: str, text: str, tmp_path: Path) -> None:
    write(two_spheres(), tmp_path)
    assert text not in text_of(tmp_path), f"no {absent}, yet they are there"
    assert any(text in text_of(GOLDEN / name) for name in CASES)


def test_threads_are_those_of_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DEMBENCH_KRATOS", raising=False)
    made = two_spheres()
    (phase,) = Kratos().write(made, Kratos().settings(made, "closed", {"threads": "2"}), tmp_path)
    assert phase.command == (sys.executable, "simulate.py")
    assert phase.environment == {"OMP_NUM_THREADS": "2"}


def test_the_scenes_own_clipped_law_gets_its_own_dashpots(tmp_path: Path) -> None:
    """Tsuji's ratio is sqrt(5/6) b with b = -ln e / sqrt(ln^2 e + pi^2), of the critical damping 2 sqrt(S m)."""
    (line,) = (line for line in write(layer(CLIPPED), tmp_path).splitlines() if line.startswith("damping = "))
    ratios, log = ast.literal_eval(line.removeprefix("damping = ")), math.log(0.5)
    assert ratios[1, 1] == pytest.approx(-math.sqrt(5 / 6) * log / math.hypot(log, math.pi))
    assert ratios[1, 2] == ratios[2, 1] > ratios[1, 1], "steel on glass rebounds less"


def test_numbers_keep_their_last_bit(tmp_path: Path) -> None:
    place = np.random.default_rng(7).uniform(-0.01, 0.01, (5, 3))
    write(scene(bodies={"position": place, "velocity": place / 3}), tmp_path)
    lines = (tmp_path / "sceneDEM.mdpa").read_text().splitlines()
    begins = {line: at for at, line in enumerate(lines)}
    at = begins["Begin Nodes"] + 1
    assert np.array_equal(np.loadtxt(lines[at : at + 5])[:, 1:], place)
    at = begins["Begin NodalData VELOCITY_Y"] + 1
    assert np.array_equal(np.loadtxt(lines[at : at + 5])[:, 2], place[:, 1] / 3)


def test_each_pair_of_materials_has_its_law(tmp_path: Path) -> None:
    """Glass, steel, and the glass of the body that is held."""
    write(box(), tmp_path)
    told = json.loads((tmp_path / "materials.json").read_text())
    densities = [material["Variables"]["PARTICLE_DENSITY"] for material in told["materials"]]
    assert densities == [2500, 7200, 2500e12]
    told = {tuple(relation["material_ids_list"]): relation["Variables"] for relation in told["material_relations"]}
    assert {k: (v["COEFFICIENT_OF_RESTITUTION"], v["DYNAMIC_FRICTION"]) for k, v in told.items()} == {
        (1, 1): (0.5, 0.3),
        (2, 1): (0.4, 0.2),
        (2, 2): (0.6, 0.5),
        (1, 3): (0.5, 0.3),
        (2, 3): (0.4, 0.2),
        (3, 3): (0.5, 0.3),
    }


def test_a_round_wall_shares_its_corners(tmp_path: Path) -> None:
    """A cylinder of 24 sides and two fans: 2 (24 + 1) corners, also where its first side meets the last."""
    write(drum(), tmp_path, segments="24")
    lines = (tmp_path / "sceneDEM_FEM_boundary.mdpa").read_text().splitlines()
    assert lines.index("End Nodes") - lines.index("Begin Nodes") - 1 == 2 * (24 + 1)
    assert lines.index("End Conditions") - lines.index("Begin Conditions RigidFace3D3N") - 1 == 4 * 24


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"law": {"kind": "rigid"}}, "contact law rigid"),
        ({"law": {"kind": "linear", "normal_stiffness": 1e4, "tangential_stiffness": 1e3}}, "contact law linear"),
        ({"pair_laws": ({"a": "glass", "b": "glass", "restitution": 0, "friction": 0},)}, "restitution 0"),
        ({"pair_laws": ({"a": "glass", "b": "glass", "restitution": 0.9995, "friction": 0},)}, "restitution 0.9995"),
        (
            {"pair_laws": ({"a": "glass", "b": "glass", "restitution": 1, "friction": 1, "rolling_friction": 0.1},)},
            "rolling friction",
        ),
        ({"bodies": {"position": []}}, "without bodies"),
        ({"walls": (VOID,)}, "wall void: a signed distance on a grid"),
        ({"walls": ({**FLOOR, "motion": {"angular_velocity": (1, 0, 0)}},)}, "motion of wall floor: a rotation"),
        ({"walls": ({**FLOOR, "motion": {**SHAKEN, "surface": True}},)}, "motion of wall floor: a surface"),
        (
            {"walls": ({**FLOOR, "motion": {**SHAKEN, "velocity": (1, 0, 0)}},)},
            "motion of wall floor: an oscillation and a constant velocity",
        ),
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
    faults = Kratos().unsupported(scene(**changes))
    assert len(faults) == 1
    assert named in faults[0]


def test_its_law_is_told() -> None:
    engine = Kratos()

    def law(**changes: Any) -> str:
        made = scene(**changes)
        return engine.law(made, engine.settings(made, "closed"))

    def alike(restitution: float, friction: float) -> tuple[dict[str, Any]]:
        return ({"a": "glass", "b": "glass", "restitution": restitution, "friction": friction},)

    clipped = {"kind": "hertz-mindlin", "variant": "no-tension"}
    assert law().startswith("tension clipped and damping by Thornton's fit; the shear force remembered")
    assert law(pair_laws=alike(1, 0)) == "" and law(law=clipped, pair_laws=alike(0.5, 0)) == ""
    assert law(pair_laws=alike(0.5, 0)) == "tension clipped and damping by Thornton's fit"
    assert law(law=clipped).startswith("the shear force remembered")
    assert "lever" not in law() and "lever" in law(walls=(BOX,))
    assert "drum of triangles" in law(walls=({**DRUM, "motion": TURNING},))
    assert "triangles" not in law(walls=(BOX,))


def test_settings_are_checked() -> None:
    with pytest.raises(SettingsError, match="Did you mean 'threads'"):
        Kratos().settings(scene(), "closed", {"thread": "2"})
    with pytest.raises(SettingsError, match="threads"):
        Kratos().settings(scene(), "closed", {"threads": "0"})
    one, two = (Kratos().settings(scene(), "closed", {"threads": n}) for n in "12")
    assert (one.cores(), two.cores()) == (1, 2)
    assert Kratos().estimate(scene(), one) > Kratos().estimate(scene(), two)


# ---- the program


def test_a_missing_interpreter_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DEMBENCH_KRATOS", "no-such-interpreter")
    probe = Kratos().probe()
    assert not probe.available
    assert "no-such-interpreter" in probe.reason
    assert "dembench[kratos]" in probe.install


def test_a_missing_module_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DEMBENCH_KRATOS", raising=False)
    monkeypatch.setattr("dembench.engines.kratos.find_spec", lambda name: None)
    probe = Kratos().probe()
    assert not probe.available
    assert "KratosMultiphysics" in probe.reason and "dembench[kratos]" in probe.install


def answering(directory: Path, line: str) -> str:
    """A program that says one line, whatever it is asked."""
    program = directory / "python"
    program.write_text(f"#!/bin/sh\necho '{line}'\necho 'No module named KratosDEMApplication' >&2\n")
    program.chmod(0o755)
    return str(program)


def test_an_interpreter_is_asked_for_the_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (library := tmp_path / "core.so").write_text("")
    monkeypatch.setenv("DEMBENCH_KRATOS", answering(tmp_path, json.dumps(["10.4.4", "10.4.4", str(library)])))
    probe = Kratos().probe()
    assert (probe.available, probe.version, probe.facts["KratosMultiphysics"]) == (True, "10.4.4", "10.4.4")


def test_an_interpreter_without_the_program_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DEMBENCH_KRATOS", answering(tmp_path, ""))
    probe = Kratos().probe()
    assert not probe.available
    assert "has no KratosDEMApplication: No module named" in probe.reason


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
