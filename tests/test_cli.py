"""The command as a person meets it: exit codes, JSON, messages, interruption and killing."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import jsonschema
import pytest
from conftest import gone, wait_for
from typer.testing import CliRunner

from dembench.cases.registry import parse_case
from dembench.cli import app
from dembench.results import read, validate
from dembench.runs.directory import find_runs
from dembench.scene import Overlap, save_scene


@pytest.fixture
def scene_file(small_scene, tmp_path):
    path = tmp_path / "small.json"
    save_scene(small_scene(), path)
    return path


@pytest.fixture
def command(standin, tmp_path, monkeypatch):
    """Runs the command in this process, in an empty directory."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        return CliRunner().invoke(app, [str(a) for a in arguments])

    return call


def _run(command, scene_file, *arguments):
    return command("run", scene_file, "--no-report", *arguments)


def _states(out="runs"):
    return {record.spec.engine: record.status.state for record in find_runs(Path(out))}


def test_all_ok_is_code_0_and_finished_runs_are_reused(command, scene_file):
    done = _run(command, scene_file, "--engines", "standin,standin-coarse")
    assert done.exit_code == 0, done.output
    assert _states() == {"standin": "ok", "standin-coarse": "ok"}
    again = _run(command, scene_file, "--engines", "standin,standin-coarse", "--json")
    assert again.exit_code == 0
    assert {r["action"] for r in json.loads(again.stdout)["runs"]} == {"reuse"}
    fresh = _run(command, scene_file, "--engines", "standin", "--json", "--fresh")
    assert {r["action"] for r in json.loads(fresh.stdout)["runs"]} == {"run"}


@pytest.mark.parametrize(
    ("engine", "state", "shown"),
    [
        ("standin-absent", "missing", "apt install standin"),
        ("standin-picky", "skipped", "all radii must be equal"),
        ("standin", "failed", "exit code 3"),
    ],
)
def test_a_run_that_is_not_ok_is_code_1_and_the_others_finish(command, standin, scene_file, engine, state, shown):
    standin(standin=["crash", 4])
    done = _run(command, scene_file, "--engines", f"{engine},standin-coarse")
    assert done.exit_code == 1
    assert shown in done.output
    assert _states() == {engine: state, "standin-coarse": "ok"}


def test_the_last_line_is_the_path_of_the_report(command, small_scene):
    save_scene(small_scene(observables=(Overlap(name="overlap", interval=2e-3),)), Path("one.json"))
    done = command("run", "one.json", "--engines", "standin")
    assert done.exit_code == 0, done.output
    page = Path(done.stdout.splitlines()[-1])
    assert page == Path("runs/report.html")
    assert "standin" in page.read_text()


def test_report_covers_the_runs_of_a_directory(command, scene_file, monkeypatch):
    _run(command, scene_file, "--engines", "standin,standin-absent")
    seen = []
    monkeypatch.setattr("dembench.reports.report.render", lambda runs, output: seen.extend(runs) or output)
    assert command("report", "runs", "-o", "other.html").stdout.strip() == "other.html"
    assert {record.spec.engine for record in seen} == {"standin", "standin-absent"}


def test_a_report_that_cannot_be_written_loses_no_run(command, scene_file, monkeypatch):
    monkeypatch.setattr("dembench.reports.report.render", lambda runs, output: 1 / 0)
    done = command("run", scene_file, "--engines", "standin")
    assert done.exit_code == 1 and "ZeroDivisionError" in done.stderr
    assert _states() == {"standin": "ok"}


USAGE = {
    "engine": (["--engines", "standim"], "Did you mean 'standin'"),
    "engine text": (["--engines", "standin[dt"], "is no engine"),
    "setting": (["--engines", "standin[thread=1]"], "Did you mean 'threads'"),
    "setting value": (["--engines", "standin[dt=-1]"], "greater than 0"),
    "cores": (["--engines", "standin[threads=1000]"], "asks for 1000 cores"),
    "time": (["--time", "soon"], "is no time"),
    "long time": (["--time", "5"], "longer than the 0.01 s"),
    "timeout": (["--timeout", "0"], "is no time"),
    "seeds": (["--seeds", "a,b"], "is no list of different whole numbers"),
    "same seeds": (["--seeds", "1,1"], "is no list of different whole numbers"),
    "preset of a file": (["--preset", "quick"], "--preset is for cases"),
}


@pytest.mark.parametrize("fault", USAGE)
def test_a_usage_error_is_one_message_and_code_2(command, scene_file, fault):
    arguments, message = USAGE[fault]
    if "--engines" not in arguments:
        arguments = [*arguments, "--engines", "standin"]
    done = _run(command, scene_file, *arguments)
    assert done.exit_code == 2, done.output
    assert message in done.stderr
    assert "Traceback" not in done.output
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("case99", "no case is called 'case99'"),
        ("case3[bad=25k]", "no parameter 'bad'. Did you mean 'bed'?"),
        ("absent.json", "absent.json: No such file"),
    ],
)
def test_an_unknown_case_is_a_usage_error(command, what, message):
    done = command("run", what, "--engines", "standin", "--no-report")
    assert done.exit_code == 2
    assert message in done.stderr and "Traceback" not in done.output


def test_a_bad_scene_names_its_fault(command, scene_file):
    data = json.loads(scene_file.read_text())
    data["bodies"]["position"][1][0] = 0.001
    scene_file.write_text(json.dumps(data))
    done = _run(command, scene_file, "--engines", "standin")
    assert done.exit_code == 2 and "overlap" in done.stderr
    data["species"][0]["radius"] = -1
    scene_file.write_text(json.dumps(data))
    done = _run(command, scene_file, "--engines", "standin")
    assert done.exit_code == 2 and "species.0.radius" in done.stderr


def test_a_case_without_preset_is_quick_and_the_first_line_says_so(command, small_scene, monkeypatch):
    monkeypatch.setattr("dembench.cases.impact.Impact.scene", lambda *_: small_scene())
    first = command("plan", "case3", "--engines", "standin,standin-coarse").stdout.splitlines()[0]
    assert first.startswith("preset quick") and "standin 3 s, standin-coarse 3 s" in first
    assert "--preset published" in first
    assert "preset quick" not in command("plan", "case3", "--engines", "standin", "--preset", "quick").stdout


def test_an_engine_without_a_passport_is_named_with_the_command_that_measures_it(
    command, small_scene, monkeypatch, tmp_path
):
    monkeypatch.setattr("dembench.cases.impact.Impact.scene", lambda *_: small_scene())
    monkeypatch.setenv("DEMBENCH_CACHE", str(tmp_path / "cache"))
    said = command("run", "case3", "--engines", "standin,standin[dt=2e-5]", "--no-report").stdout
    (line,) = [line for line in said.splitlines() if "no passport" in line]
    assert "`dembench passport --engines standin`" in line and "standin[dt=2e-5]" in line


def test_time_cuts_the_scene(command, scene_file):
    _run(command, scene_file, "--engines", "standin", "--time", "0.004")
    (record,) = find_runs(Path("runs"))
    assert record.spec.duration == pytest.approx(0.004)
    assert record.result.observables["low"].time[-1] == pytest.approx(0.004)


def test_repeats_are_runs_of_their_own(command, scene_file):
    done = _run(command, scene_file, "--engines", "standin", "--repeat", "2", "--json")
    assert len({r["name"] for r in json.loads(done.stdout)["runs"]}) == 2
    assert sorted(r.spec.repeat for r in find_runs(Path("runs"))) == [1, 2]


def test_plan_shows_what_would_run_and_runs_nothing(command, scene_file):
    planned = json.loads(command("plan", scene_file, "--engines", "standin,standin-absent", "--json").stdout)
    assert [(r["engine"], r["action"], r["estimate"]) for r in planned] == [
        ("standin", "run", 3.0),
        ("standin-absent", "missing", 3.0),
    ]
    assert len(planned[0]["hash"]) == 64
    assert not Path("runs").exists()
    _run(command, scene_file, "--engines", "standin")
    again = json.loads(command("plan", scene_file, "--engines", "standin", "--json").stdout)
    assert again[0]["action"] == "reuse" and again[0]["hash"] == planned[0]["hash"]
    assert "reuse" in command("plan", scene_file, "--engines", "standin").stdout


def test_plan_generates_no_initial_state(command, monkeypatch):
    """A published bed takes minutes to settle: its particles are counted until it is there."""
    monkeypatch.setenv("DEMBENCH_CACHE", "cache")
    monkeypatch.setattr("dembench.initial.filling._settle", lambda *_: pytest.fail("it settles"))
    words = ("plan", "case3[bed=25k]", "--preset", "published", "--engines", "standin")
    (row,) = json.loads(command(*words, "--json").stdout)
    assert (row["action"], row["initial"], row["hash"], row["estimate"]) == ("run", "to be generated", None, 3.0)
    assert row["name"] == "case3-bed-25k-published__standin"
    assert "initial state of 25001 bodies" in " ".join(command(*words).stdout.split())
    monkeypatch.setattr("dembench.initial.filling._settle", lambda plan, start, *_: start)
    case, parameters = parse_case("case3[bed=25k]")
    case.scene(parameters, "published")
    monkeypatch.setattr("dembench.campaign.check_scene", lambda _: None)
    (row,) = json.loads(command(*words, "--json").stdout)
    assert row["initial"] == "ready" and row["name"].startswith("case3-bed-25k-published__standin__")


def test_without_engines_all_that_are_there_are_used(command, scene_file):
    planned = json.loads(command("plan", scene_file, "--json").stdout)
    names = ("standin", "standin-coarse", "standin-picky", "standin-forgetful", "standin-wordless")
    assert {r["engine"] for r in planned} == set(names)


def test_write_makes_a_deck_and_says_how_to_run_it(command, scene_file):
    done = command("write", scene_file, "--engine", "standin[dt=5e-6]", "-o", "deck")
    assert done.exit_code == 0 and "standin_program.py" in done.stdout
    assert (Path("deck") / "deck.txt").exists()
    assert command("write", scene_file, "--engine", "standin", "-o", "deck").exit_code == 2
    refused = command("write", scene_file, "--engine", "standin-picky", "-o", "other")
    assert refused.exit_code == 2 and "radii" in refused.stderr and not Path("other").exists()
    phases = json.loads(command("write", scene_file, "--engine", "standin", "-o", "third", "--json").stdout)
    assert phases[0]["name"] == "simulate"


def test_export_writes_a_table_per_observable_and_the_snapshots(command, scene_file, tmp_path):
    _run(command, scene_file, "--engines", "standin")
    (record,) = find_runs(Path("runs"))
    done = command("export", record.directory / "result.h5", "-o", tmp_path / "tables", "--vtkhdf")
    assert done.exit_code == 0
    assert {"energy.csv", "ends.vtkhdf"} <= {path.name for path in (tmp_path / "tables").iterdir()}
    refused = command("export", scene_file)
    assert refused.exit_code == 2 and "no readable result" in refused.stderr


def test_validate_has_code_1_where_there_is_a_fault(command, scene_file):
    _run(command, scene_file, "--engines", "standin")
    (record,) = find_runs(Path("runs"))
    assert command("validate", record.directory / "result.h5").exit_code == 0
    faulty = command("validate", record.directory / "result.h5", scene_file, "--json")
    assert faulty.exit_code == 1
    found = json.loads(faulty.stdout)
    assert found[str(record.directory / "result.h5")] == [] and "not an HDF5" in found[str(scene_file)][0]


def test_engines_cases_doctor_and_schema_are_json(command, scene_file):
    engines = json.loads(command("engines", "--json").stdout)
    assert engines["standin"]["available"] and not engines["standin-absent"]["available"]
    assert "apt install standin" in command("engines").stdout
    cases = json.loads(command("cases", "--json").stdout)
    assert any(case["name"] == "case3" and "bed" in case["parameters"] for case in cases)
    assert "case3" in command("cases").stdout
    doctor = json.loads(command("doctor", "--json").stdout)
    assert doctor["machine"]["cores"] >= 1 and doctor["devices"] and doctor["cache"]
    assert "standin-absent" in command("doctor").stdout
    schema = json.loads(command("schema").stdout)
    jsonschema.validate(json.loads(scene_file.read_text()), schema)


def test_an_empty_directory_has_no_report(command):
    done = command("report", "nothing")
    assert done.exit_code == 2 and "holds no runs" in done.stderr


# ---- interruption: the command as a process of its own


@pytest.fixture
def process(start_run, scene_file):
    return lambda modes, *options: start_run(scene_file, *options, modes=modes)


def _record(out, engine):
    return next((r for r in find_runs(out) if r.spec.engine == engine), None)


def _rows(out, engine):
    record = _record(out, engine)
    return len(record.result.observables["low"].time) if record and record.result else 0


def _pids(out, engine):
    path = _record(out, engine).directory / "deck" / "pids"
    return [int(pid) for pid in path.read_text().split()]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_command_leaves_readable_partial_results(process, tmp_path, number):
    out = tmp_path / "runs"
    child = process({"standin": ["hang", 5]}, "--engines", "standin,standin-coarse")
    wait_for(lambda: _rows(out, "standin") == 5)
    pids = _pids(out, "standin")
    child.send_signal(number)
    output, _ = child.communicate(timeout=30)
    assert child.returncode == 1 and "Traceback" not in output, output
    record = _record(out, "standin")
    assert record.status.state == "interrupted"
    assert _rows(out, "standin") == 5 and validate(record.directory / "result.h5") == []
    assert _record(out, "standin-coarse") is None, "the run that waited was not started"
    assert all(gone(pid) for pid in pids)


def test_a_killed_command_takes_its_engine_along_and_a_second_one_completes_the_missing_run(process, tmp_path):
    out = tmp_path / "runs"
    child = process({"standin": ["hang", 5]}, "--engines", "standin-coarse,standin")
    wait_for(lambda: _rows(out, "standin") == 5)
    pids = _pids(out, "standin")
    assert _record(out, "standin").status.state == "running"
    child.kill()
    child.wait()
    for pid in pids:
        wait_for(lambda pid=pid: gone(pid))
    record = _record(out, "standin")
    assert record.status.state == "interrupted" and "standin starts" in record.status.log_tail
    assert validate(record.directory / "result.h5") == []
    assert read(record.directory / "result.h5").status["state"] == "interrupted"
    finished = _record(out, "standin-coarse").directory / "result.h5"
    before = finished.stat().st_mtime_ns

    second = process({}, "--engines", "standin-coarse,standin")
    output, _ = second.communicate(timeout=60)
    assert second.returncode == 0, output
    assert _states(out) == {"standin": "ok", "standin-coarse": "ok"}
    assert finished.stat().st_mtime_ns == before, "the finished run was not touched"
    assert _rows(out, "standin") == 11
    assert [r.time for r in _record(out, "standin").status.resumed] == pytest.approx([4e-3])
    assert "gone on from t = 0.004 s" in output


def test_killing_the_engine_fails_its_run_and_the_command_goes_on(process, tmp_path):
    out = tmp_path / "runs"
    child = process({"standin": ["hang", 5]}, "--engines", "standin,standin-coarse")
    wait_for(lambda: _rows(out, "standin") == 5)
    os.kill(_pids(out, "standin")[0], signal.SIGKILL)
    output, _ = child.communicate(timeout=60)
    assert child.returncode == 1
    assert _states(out) == {"standin": "failed", "standin-coarse": "ok"}
    assert "SIGKILL" in output
