"""Results of other programs among the runs: scored and shown like every run, or refused with nothing left behind."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from dembench.cases import drum, impact, silo
from dembench.cases.registry import parse_case
from dembench.cli import app
from dembench.imports import Origin, import_file, import_folder
from dembench.reports.report import render
from dembench.results import validate
from dembench.results.foreign import ForeignError
from dembench.runs.directory import find_runs

FALL = -5 * np.arange(0, 0.0601, 1e-3) - 0.5 * 9.81 * np.arange(0, 0.0601, 1e-3) ** 2


def heap(name, plan, progress, seed=0):
    """Grains of all layers on lattices without contact, where the walls of every case leave room, shape (n, 3)."""
    radii = [next(s.radius for s in plan.species if s.name == layer.species) for layer in plan.layers]
    rooms = {"barrel": (0.069, 0.069), "drum": (0.069, 0.028), "box": (0.049, 0.03)}
    half, depth = rooms[plan.walls[0].name]
    low = {"barrel": 0.03, "drum": -0.069, "box": -0.0902}[plan.walls[0].name]
    found = []
    for layer, radius in zip(plan.layers, radii, strict=True):
        pitch = 2.05 * radius
        nx, ny = int(2 * (half - radius) / pitch) + 1, int(2 * (depth - radius) / pitch) + 1
        k = np.arange(layer.count)
        centres = np.stack([k % nx, k // nx % ny, k // (nx * ny)], axis=1) * pitch
        found.append(centres + np.array([-half, -depth, low]) + radius)
        low = found[-1][:, 2].max() + radius
    return np.vstack(found)


@pytest.fixture(autouse=True)
def unsettled(monkeypatch):
    """Beds that take no time."""
    for module in (silo, drum, impact):
        monkeypatch.setattr(module, "bed", heap)


@pytest.fixture
def quick(tmp_path):
    return Origin(preset="quick", out=tmp_path / "runs")


def emptying(scene):
    time = np.arange(0, scene.duration + 1e-9, 0.1)
    return {"t": time, "count": np.clip(len(scene.bodies) - 8000 * time, 0, None).round()}


def mixing(scene):
    time = np.arange(0, scene.duration + 1e-9, 0.1)
    counts = {"t": time}
    for zone, sign in (("z1", 1), ("z2", -1)):
        for k, name in enumerate(s.name.lower() for s in scene.species):
            x, z = scene.bodies.position[scene.bodies.species == k][:, [0, 2]].T
            own = np.count_nonzero((sign * x >= 0) & (sign * z >= 0))
            counts[f"{zone}_{name}"] = np.round(own + 400 * (1 - np.cos(3 * time)))
    return counts


def impacting(scene):
    time = np.arange(0, scene.duration + 1e-9, 1e-3)
    return {"t": time, "z": np.maximum(FALL[: len(time)], -0.09)}


MADE = {"case1": emptying, "case2": mixing, "case3": impacting}
SERIES = {"case1": "inside", "case2": "zones", "case3": "ball_displacement"}


def written(folder, case, preset="quick", name="result.npz", **more):
    found, parameters = parse_case(case)
    np.savez(folder / name, **MADE[case.split("[")[0]](found.scene(parameters, preset)), **more)
    return folder / name


@pytest.mark.parametrize("case", MADE)
def test_a_result_of_each_case(tmp_path, quick, case):
    """It validates, has the quantities that its series tell, and stands on the page under a name of its own."""
    path = written(tmp_path, case, wall_s=12.5, dt=2e-6)
    run = import_file(case, path, "granoo", quick)
    assert validate(run.directory / "result.h5") == []
    assert list(run.result.observables) == [SERIES[case]]
    assert (run.spec.case, run.spec.preset, run.spec.imported) == (case, "quick", "result.npz")
    assert run.status.state in ("ok", "inaccurate") and run.status.time == pytest.approx(run.spec.duration)
    found = parse_case(case)[0].quantities(run.result.scene, run.result)
    assert {"case1": "discharge_rate", "case2": "first_peak", "case3": "deepest"}[case] in {q.name for q in found}
    origin = run.result.provenance["imported"]
    assert (origin["file"], origin["format"], origin["wall"], len(origin["sha256"])) == ("result.npz", "npz", 12.5, 64)
    assert run.result.timing == {} and run.spec.settings == {"dt": 2e-6}
    page = render(find_runs(quick.out), tmp_path / "report.html").read_text()
    assert "granoo (imported)" in page and "Imported results" in page and "12.5" in page
    assert 'id="scene1-timings"' not in page


def test_it_joins_the_group_of_a_run_of_the_same_problem(tmp_path, quick):
    """The scene is that of the run which is there, though its case was typed in another way."""
    first = import_file("case1[orifice=large]", written(tmp_path, "case1"), "granoo", quick)
    silo.bed = None  # a second bed is not made
    second = import_file("case1", tmp_path / "result.npz", "mfix", quick)
    assert second.spec.case == "case1[orifice=large]" and second.spec.scene_digest == first.spec.scene_digest
    from dembench.reports.groups import gather

    (group,) = gather(find_runs(quick.out))
    assert [member.label for member in group.members] == ["granoo (imported)", "mfix (imported)"]
    assert len({(m.shown.look.colour, m.style) for m in group.members}) == 2


@pytest.mark.parametrize("initial", [None, "elsewhere"])
def test_a_silo_needs_no_initial_state(tmp_path, monkeypatch, initial):
    """The published silo of 100 000 grains, as a user has it: no run, no fill in the cache, no file of the grains.

    A count that falls by 23 200 a second after 0.15 s, the published guide line, gets the published verdict.
    """
    monkeypatch.undo()
    monkeypatch.setenv("DEMBENCH_CACHE", str(tmp_path / "cache"))
    time = np.arange(51) * 0.1
    np.savez(tmp_path / "silo.npz", t=time, count=np.clip(100000 - 23200 * (time - 0.15), 0, 100000).round())
    given = None if initial is None else tmp_path / initial
    (tmp_path / "elsewhere").mkdir()
    run = import_file("case1", tmp_path / "silo.npz", "granoo", Origin(initial=given, out=tmp_path / "runs"))
    assert run.status.state == "ok" and run.spec.bodies == 100000
    rate = {q.name: q.value for q in silo.Silo().quantities(run.result.scene, run.result)}["discharge_rate"]
    assert rate == pytest.approx(23200, rel=1e-4)
    notes = run.result.provenance["imported"]["notes"]
    assert run.spec.scene_name.endswith("_unsettled") and "where they start is not known here" in notes[-1]
    assert any("no initial state of this problem" in note for note in notes) == (initial is not None)
    np.savez(tmp_path / "wrong.npz", t=time, z=-time)
    with pytest.raises(ForeignError, match="no column 'count'; case1 needs t, count"):
        import_file("case1", tmp_path / "wrong.npz", "granoo", Origin(initial=given, out=tmp_path / "other"))


def test_the_same_file_again_is_the_same_run(tmp_path, quick):
    path = written(tmp_path, "case1")
    first, second = (import_file("case1", path, "granoo", quick) for _ in range(2))
    assert first.directory == second.directory and len(find_runs(quick.out)) == 1
    with np.load(path) as stored:
        columns = dict(stored)
    np.savez(path, **{**columns, "count": columns["count"] - 1})
    assert import_file("case1", path, "granoo", quick).directory != first.directory


def test_a_folder(tmp_path, quick):
    """Case, variant and program come from the names, wall times from the list; a bad file does not stop the others."""
    folder = tmp_path / "data"
    folder.mkdir()
    written(folder, "case1[orifice=small,material=M2]", name="case1_small_M2_some_code.npz")
    written(folder, "case1", name="case1_large_M1_musen.npz")
    written(folder, "case2", name="case2_my-code.npz")
    np.savez(folder / "case3_25k_wrong.npz", t=[0.0, 0.1], count=[1, 2])
    np.savez(folder / "case3_25k_two words.npz", t=[0.0, 0.1], count=[1, 2])
    (folder / "timings.json").write_text('{"case2_my-code": 5586.0}')
    for name in ("case4_code.npz", "README.md"):
        (folder / name).write_text("")
    done = import_folder(folder, quick)
    assert [(r.spec.case, r.spec.engine) for r in done.runs] == [
        ("case1", "musen"),
        ("case1[orifice=small,material=M2]", "some-code"),
        ("case2", "my-code"),
    ]
    assert [r.result.provenance["imported"]["wall"] for r in done.runs] == [None, None, 5586.0]
    assert len(done.refused) == 2 and "'two words' is no name of a program" in done.refused[0]
    assert "no column 'z'; case3 needs t, z, the file has t, count" in done.refused[1]
    assert done.left_out == ("README.md", "case4_code.npz")
    words = ["import", str(folder), "--preset", "quick", "--out", str(quick.out)]
    printed = " ".join(CliRunner().invoke(app, words).output.split())
    assert "not called like case1_large_M1_NAME, case2_NAME or case3_25k_NAME: README.md, case4_code.npz" in printed


def test_imports_are_compared_like_runs(tmp_path, quick):
    """Two files of the same problem by two programs: the rates, 8000 grains a second, are those of both."""
    path = written(tmp_path, "case1")
    sets = [import_file("case1", path, name, Origin(preset="quick", out=tmp_path / name)) for name in ("one", "other")]
    done = CliRunner().invoke(app, ["compare", *(str(run.directory.parent) for run in sets), "--json"])
    found = {c["name"]: c for c in json.loads(done.stdout)["comparisons"]}
    assert found["discharge_rate"]["a"] == pytest.approx(8000, rel=1e-3)
    assert found["discharge_rate"]["engine"] == "one (imported) | other (imported)"
    assert found["discharge_rate"]["problem"] == "case1, quick, softened, 2 s"
    assert {c["verdict"] for c in found.values()} == {"indistinguishable"} and done.exit_code == 0


@pytest.mark.parametrize(
    "files,message",
    [
        ({}, "no file is called like case1_large_M1_NAME, case2_NAME or case3_25k_NAME"),
        ({"case2_a.npz": "", "timings.json": "[1]"}, "timings.json: .*; accepted is a JSON object"),
        ({"case2_a.npz": "", "timings.json": '{"a": "b"}'}, "timings.json: .*; accepted is a JSON object"),
    ],
)
def test_a_folder_that_cannot_be_used(tmp_path, quick, files, message):
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(ForeignError, match=message):
        import_folder(tmp_path, quick)


@pytest.mark.parametrize(
    "words,message",
    [
        (("case3", "FILE", "--engine", "granoo", "--preset", "quick"), "no column 'z'; case3 needs t, z"),
        (("case2", "ZONES", "--engine", "granoo"), "has no run of it whose scene could be taken"),
        (("case2", "ZONES", "--engine", "granoo", "--initial", "FOLDER"), "no file of the drum there"),
        (("case2", "FILE", "--engine", "granoo"), "no column 'z1_m2'; case2 needs t, z1_m2"),
        (("case1", "FILE", "--engine", "peclet", "--preset", "quick"), "'peclet' is an engine of this package"),
        (("case1", "MORE", "--engine", "granoo", "--preset", "quick"), "the scene has 24000: this is another case"),
        (("case1", "FILE", "--engine", "a b", "--preset", "quick"), "'a b' is no name of a program"),
        (("case9", "FILE", "--engine", "granoo"), "no case is called 'case9'"),
        (("case1", "none.npz", "--engine", "granoo"), "none.npz: No such file"),
        (("case1", "FILE"), "give CASE FILE --engine NAME, or a FOLDER"),
        (("FILE", "--engine", "granoo"), "give CASE FILE --engine NAME, or a FOLDER"),
        (("FOLDER", "--engine", "granoo"), "--engine and --wall are for a file"),
    ],
)
def test_what_is_refused_leaves_nothing_behind(tmp_path, words, message):
    folder = tmp_path / "data"
    folder.mkdir()
    places = {"FILE": written(folder, "case1"), "MORE": folder / "more.npz", "FOLDER": folder}
    places["ZONES"] = written(folder, "case2", name="zones.npz")
    np.savez(places["MORE"], t=[0.0, 1.0, 2.0], count=[23000, 10000, 0])
    given = [str(places.get(word, word)) for word in words]
    done = CliRunner().invoke(app, ["import", *given, "--out", str(tmp_path / "runs")])
    assert done.exit_code == 2
    assert message in " ".join(done.output.split())
    assert not (tmp_path / "runs").exists()


def test_the_verb(tmp_path):
    path, out = written(tmp_path, "case1"), tmp_path / "runs"
    words = ["import", "case1", str(path), "--engine", "mfix", "--preset", "quick", "--out", str(out)]
    done = CliRunner().invoke(app, [*words, "--wall", "3600", "--law", "linear spring", "--json"])
    assert done.exit_code == 0
    (run,) = find_runs(out)
    assert json.loads(done.stdout)["runs"][0]["directory"] == str(run.directory)
    assert run.spec.law == "linear spring" and run.result.provenance["imported"]["wall"] == 3600
