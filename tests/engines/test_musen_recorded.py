"""Recorded runs of MUSEN 1.74.2: what is read from them, what is seen of errors, and that we write the same scenes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dembench.engines.musen import Musen
from dembench.engines.musen_launch import DONE, verdict
from dembench.engines.musen_output import difference
from dembench.engines.musen_scene import geometries
from dembench.engines.musen_text import Text, TextError, read_text
from dembench.results import observe
from dembench.scene import Scene, scene_from

PROGRAM = Path(__file__).with_name("musen_program.py")
RECORDED = Path(__file__).parents[3] / "shared" / "data" / "musen"
pytestmark = pytest.mark.skipif(not RECORDED.exists(), reason="no recorded runs here")

RUNS = ("two-spheres/e1e7", "two-spheres/e1e9", "mini-impact", "mini-drum", "mini-silo")
DRUM_MOTION = (0.0, 0.0, 0.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.0)
DIGITS = {"mini-impact": 8, "mini-drum": 6, "mini-silo": 6}
"""Significant digits of the exports; 12 where none are given."""


def export_of(run: str) -> Text:
    return read_text(RECORDED / run / "export.txt")


def words(path: Path) -> str:
    return path.read_text() if path.exists() else ""


# ---- what is read


@pytest.mark.parametrize("run", RUNS)
def test_the_export_is_that_of_the_scene(run: str) -> None:
    motions = {"Drum": DRUM_MOTION} if run == "mini-drum" else {}
    written = read_text(RECORDED / run / "scene.txt")
    assert difference(written, export_of(run), motions, DIGITS.get(run, 12)) == ""


@pytest.mark.parametrize("run", RUNS)
def test_the_log_is_that_of_a_run_that_ended_well(run: str, tmp_path: Path) -> None:
    assert verdict_of(RECORDED / run, tmp_path) == ""


@pytest.mark.parametrize(("run", "restitution"), [("two-spheres/e1e7", 0.499862), ("two-spheres/e1e9", 0.502567)])
def test_two_spheres(run: str, restitution: float) -> None:
    velocity = export_of(run).grains.values[15][-1]
    assert velocity[1, 0] - velocity[0, 0] == pytest.approx(restitution, abs=5e-7)


def test_the_ball_of_the_impact_is_slowed_down() -> None:
    grains = export_of("mini-impact").grains
    ball = int(np.argmax(grains.radius))
    assert len(grains.id) == 295 and grains.radius[ball] == 0.004
    assert grains.values[15][0, ball, 2] == -2
    assert np.abs(grains.values[15][-1, ball, 2]) == pytest.approx(0.15, abs=0.01)
    assert grains.time[-2:].tolist() == [0.01, 0.0100005], "the last state is saved twice"


def test_grains_leave_the_silo() -> None:
    """Until they leave they are above z = -15 mm; where they went out is below it, at the six digits of the export."""
    grains = export_of("mini-silo").grains
    left = np.isfinite(grains.left)
    assert np.count_nonzero(left) == 90 and sorted(grains.exits) == grains.id[left].tolist()
    for number, place in grains.exits.items():
        row = int(np.flatnonzero(grains.id == number)[0])
        before = grains.time < grains.left[row]
        assert grains.values[12][before, row, 2].min() > -0.015
        assert place[2] <= -0.015 and (np.abs(place[:2]) < 0.01).all()
    for name, count in (("export_last.txt", 204), ("export_last_all.txt", 294)):
        last = read_text(RECORDED / "mini-silo" / name).grains
        there = np.flatnonzero(last.left > last.time[0])
        assert len(last.id) == count and np.array_equal(last.id[there], grains.id[~left])


def test_the_walls_of_the_drum_turn() -> None:
    """+x goes to +z: (15, 0, 0) mm to (12.38, 0, 8.47) mm after 0.3 s at -2 rad/s about y, and one step more."""
    walls = export_of("mini-drum").walls
    start, end = (walls.values[44][k].reshape(-1, 3) for k in (0, -1))
    vertex = int(np.argmin(np.linalg.norm(start - [0.015, 0, 0], axis=1)))
    angle = 2 * (0.3 + 2e-6)
    assert end[vertex] == pytest.approx([0.015 * np.cos(angle), 0, 0.015 * np.sin(angle)], abs=1e-7)
    assert not walls.values[15].any(), "the velocity of a rotating wall is that of its translation"


def test_the_force_on_a_floor_is_the_weight_of_a_grain_at_rest() -> None:
    walls = export_of("errors/wall-winding-ok").walls
    weight = 9.81 * 2500 * 4 / 3 * np.pi * 1e-9
    assert walls.values[20][-1].sum(axis=0) == pytest.approx([0, 0, -weight], rel=1e-5)


def test_a_file_that_was_cut_off_is_refused(tmp_path: Path) -> None:
    whole = (RECORDED / "mini-silo" / "export.txt").read_bytes()
    (tmp_path / "export.txt").write_bytes(whole[:5000])
    with pytest.raises(TextError, match="line 2"):
        read_text(tmp_path / "export.txt")


# ---- what is seen of errors


def verdict_of(run: Path, tmp_path: Path) -> str:
    """What the launcher says of a recorded run; its binary results are not on record and count as present."""
    script = tmp_path / "job.txt"
    text = words(run / "job.txt").replace("\r\n", "\n")
    script.write_text(text if text.endswith("\n") else text + "\n")
    for name in ("scene.mdem", "result.mdem"):
        (tmp_path / name).write_text("binary")
    for found in run.rglob("export*.txt"):
        (tmp_path / found.relative_to(run)).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / found.relative_to(run)).write_bytes(found.read_bytes())
    code = int(words(run / "exit_code.txt"))
    return verdict(script, words(run / "log.txt") + words(run / "stderr.txt"), 128 - code if code > 128 else code)


TOLD = {
    "missing-script": "Error: The script file cannot be opened, contains errors, or has no jobs.",
    "missing-source-simulator": "Error: The source file cannot be opened. It may not exist or is not readable.",
    "missing-source-text": "./export.txt is missing or empty",
    "hang-empty-scene": "ended by SIGKILL",
    "unknown-key": "Unknown script key: END_TMIE",
    "unknown-component": "./export.txt is missing or empty",
    "unknown-model-pp": "ended by SIGSEGV",
    "unknown-model-pw": "ended by SIGSEGV",
    "no-pw-model": "Error: Particle-wall contact model is not specified",
    "no-simulator-type": "Error: Wrong simulator type",
    "missing-material": "Error: Materials not for all particles are defined in database",
    "export-without-directory": "terminate called after throwing an instance of",
    "tag-order-wrong": "./export.txt is missing or empty",
    "comment-and-lowercase": "Unknown script key: #",
}
"""What the log or the missing file says of each error; all others end as if all were well."""

SILENT = {
    "missing-interaction": "property 200 of M1-M1 is 0.6, written was 0.5",
    "partial-interaction": "property 201 of M1-M1 is 0.45, written was 0.3",
    "interaction-before-material": "property 200 of M1-M1 is 0.6, written was 0.5",
    "domain-too-small": "1 of 2 grains are gone at the start, the first is 0",
    "geometry-unknown-name": "geometry Floor moves by [], written was",
    "unknown-tag": "the initial state of the grains is missing in the export",
    "garbage-value": "the initial state of grains is not as it was written, the first is number 0",
    "no-activity-no-orientation": "2 of 2 grains are gone at the start, the first is 0",
    "duplicate-id": "1 of 2 grains are missing in the export, the first is 1",
    "walls-without-geometry": "geometry Floor is not as it was written",
}
"""What comparing the export with the scene that was meant says of each silent error."""

LOST = ("step-too-large", "wall-winding-reversed")
"""Silent errors whose export is that of their scene: only the grains that leave tell."""

FINE = (
    "ok-reference",
    "ids-not-contiguous",
    "crlf",
    "no-final-newline",
    "result-directory-missing",
    "wall-winding-ok",
    "defaults",
    "motion-order",
)
"""No errors; `defaults` and `motion-order` show what is left out and how a motion is exported."""


def test_every_recorded_error_is_known() -> None:
    """`restart` holds no run."""
    known = {*TOLD, *SILENT, *LOST, *FINE, "restart"}
    assert {path.name for path in (RECORDED / "errors").iterdir()} == known


@pytest.mark.parametrize("error", TOLD)
def test_a_failure_that_is_told(error: str, tmp_path: Path) -> None:
    assert verdict_of(RECORDED / "errors" / error, tmp_path).startswith(TOLD[error])


@pytest.mark.parametrize("error", [*SILENT, *LOST, *FINE])
def test_a_run_that_seems_well(error: str, tmp_path: Path) -> None:
    assert verdict_of(RECORDED / "errors" / error, tmp_path) == ""


@pytest.mark.parametrize("error", SILENT)
def test_a_silent_failure_is_seen_in_the_export(error: str) -> None:
    run = RECORDED / "errors" / error
    motions = {"Floor": (0.0,) * 3 + (1.0,) + (0.0,) * 5} if error == "geometry-unknown-name" else {}
    meant = "ok-reference"
    if error == "walls-without-geometry":  # its own scene, with the geometry that it lacks
        written = read_text(run / "scene.txt")
        written.geometries = {"Floor": [1, 2]}
    else:
        written = read_text(RECORDED / "errors" / meant / "scene.txt")
    assert SILENT[error] in difference(written, read_text(run / "export.txt"), motions, 6)


@pytest.mark.parametrize("error", LOST)
def test_grains_that_were_thrown_out_are_seen(error: str) -> None:
    run = RECORDED / "errors" / error
    text = read_text(run / "export.txt")
    assert difference(read_text(run / "scene.txt"), text, {}, 6) == ""
    assert np.isfinite(text.grains.left).any() and (text.grains.left > 0).all()


# ---- the stand-in


@pytest.mark.parametrize("run", ["two-spheres/e1e7", "errors/ok-reference", "errors/wall-winding-ok"])
def test_the_stand_in_does_what_the_program_does(run: str, tmp_path: Path) -> None:
    """Of a recorded job and scene it makes the recorded export, where no shear acts: to the last digit but one."""
    for name in ("job.txt", "scene.txt"):
        (tmp_path / name).write_bytes((RECORDED / run / name).read_bytes())
    command = [sys.executable, str(PROGRAM), "-s=job.txt", "-t=1"]
    log = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    for sign in DONE.values():
        assert sign in log and sign in (RECORDED / run / "log.txt").read_text()
    own, recorded = read_text(tmp_path / "export.txt"), export_of(run)
    digits = DIGITS.get(run, 12 if run.startswith("two") else 6)
    for a, b in ((own.grains, recorded.grains), (own.walls, recorded.walls)):
        assert np.array_equal(a.time, b.time) and np.array_equal(a.id, b.id) and np.array_equal(a.left, b.left)
        for tag in a.values:
            assert a.values[tag] == pytest.approx(b.values[tag], rel=10.0 ** (2 - digits), abs=1e-9), tag
    assert own.geometries == recorded.geometries and own.domain.tolist() == recorded.domain.tolist()


# ---- the same scenes, written by us


def scene_like(run: str, **changes: Any) -> Scene:
    """A scene with the grains of a recorded one, its walls as meshes."""
    text = read_text(RECORDED / run / "scene.txt")
    grains, keys = text.grains, list(text.materials)
    kinds = sorted({(m, r) for m, r in zip(grains.material, grains.radius.tolist(), strict=True)})
    triangles = {n: text.walls.values[44][0][np.isin(text.walls.id, ids)] for n, ids in text.geometries.items()}
    pairs = [(name.split("-"), p) for name, p in text.pairs.items()]
    fields: dict[str, Any] = {
        "name": "recorded",
        "materials": [
            {"name": key, "density": p[0], "young": p[7], "poisson": p[10]} for key, p in text.materials.items()
        ],
        "pair_laws": [{"a": a, "b": b, "restitution": p[200], "friction": p[201]} for (a, b), p in pairs],
        "species": [{"name": f"s{k}", "material": m, "radius": r} for k, (m, r) in enumerate(kinds)],
        "walls": [
            {"kind": "mesh", "name": n, "material": keys[-1], "triangles": t.reshape(-1, 3, 3)}
            for n, t in triangles.items()
        ],
        "bodies": {
            "position": grains.values[12][0],
            "velocity": grains.values[15][0],
            "angular_velocity": grains.values[16][0],
            "species": [kinds.index(k) for k in zip(grains.material, grains.radius.tolist(), strict=True)],
        },
        "domain": {"lower": text.domain[:3], "upper": text.domain[3:]},
        "duration": 0.01,
        "time_step": 1e-5,
    }
    return scene_from({**fields, **changes})


@pytest.mark.parametrize("run", RUNS)
def test_the_same_scene_is_written(run: str, tmp_path: Path) -> None:
    made = scene_like(run)
    Musen().write(made, Musen().settings(made, "closed"), tmp_path)
    ours, recorded = read_text(tmp_path / "scene.txt"), read_text(RECORDED / run / "scene.txt")
    assert difference(recorded, ours, {}, 17) == ""
    assert np.isinf(ours.grains.left).all() and np.isinf(ours.walls.left).all()
    extra = ours.pairs.keys() - recorded.pairs.keys()
    assert extra <= {"STEEL-STEEL"}, "the pair of two walls, which the recorded scene leaves to the program"


def test_a_round_wall_is_the_recorded_polygon() -> None:
    """The 48 sides of the recorded drum lie inside R = 15 mm; ours touch it from outside."""
    cylinder = {
        "kind": "cylinder",
        "name": "Drum",
        "material": "STEEL",
        "start": (0, 0, 0),
        "end": (0, 0.0192, 0),
        "radius": 0.015 * np.cos(np.pi / 48),
        "closed_start": True,
        "closed_end": True,
    }
    (ours,) = geometries(scene_like("mini-drum", walls=[cylinder]), 48)
    recorded = read_text(RECORDED / "mini-drum" / "scene.txt").walls.values[44][0].reshape(-1, 3)
    assert len(ours.triangles) == 192
    own = {tuple(np.round(v, 7) + 0.0) for v in ours.triangles.reshape(-1, 3)}
    assert own == {tuple(np.round(v, 7) + 0.0) for v in recorded}


def test_observables_of_a_recorded_run(tmp_path: Path) -> None:
    """The adapter reads the recorded silo as if it had run it: 90 of 294 grains have left after 0.2 s."""
    counts = ({"kind": "count", "name": "inside", "interval": 5e-3},)
    sink = {"name": "out", "region": {"upper": (None, None, -0.015)}}
    lower = {"lower": (-0.01, -0.01, -0.03), "upper": (0.01, 0.01, 0.032)}
    made = scene_like("mini-silo", observables=counts, sinks=[sink], domain=lower, duration=0.2)
    engine = Musen()
    settings = engine.settings(made, "closed", {"digits": "6"})
    engine.write(made, settings, tmp_path)
    text = (RECORDED / "mini-silo" / "export.txt").read_text().splitlines()
    rows = [with_spin(line) if " 1 1 5 " in line[:14] else line for line in text]
    (tmp_path / "frames" / "export_0000.txt").write_text("\n".join(rows) + "\n")
    (tmp_path / "scene.txt").write_bytes((RECORDED / "mini-silo" / "scene.txt").read_bytes())
    (tmp_path / "simulate.log").write_bytes((RECORDED / "mini-silo" / "log.txt").read_bytes())
    (tmp_path / "export.log").write_text("Export to text finished\n")
    series = engine.read(made, settings, tmp_path)
    assert (series.failure, series.detail, series.time) == (None, "", 0.2)
    found = observe(made, series.frames)["inside"]
    assert len(found.time) == 41
    assert found.value[0] == 294 and found.value[-1] == 204
    assert (np.diff(found.value.ravel()) <= 0).all()


def with_spin(line: str) -> str:
    """A line of the recorded export with an angular velocity of zero in every frame, which it leaves out."""
    head, activity, frames = line.partition(" 24 0 ")
    return head + activity + frames.replace(" 12 ", " 16 0 0 0 12 ")
