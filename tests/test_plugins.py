"""Engines, cases and suites of other packages, and the skeletons of such packages: installed and run for real."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from typer.testing import CliRunner

import dembench
from dembench import skeletons
from dembench.cli import app
from dembench.skeletons import SkeletonError

ROOT = Path(dembench.__file__).parent.parent
PLUGIN = Path(__file__).parent / "plugin_package"


def installed(package: Path, target: Path) -> dict[str, str]:
    """Installs a package offline into a directory; the environment of programs that see it."""
    if find_spec("hatchling") is None:
        pytest.skip("hatchling is not installed; it is part of the extra 'test'")
    options = ["--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--disable-pip-version-check"]
    command = [sys.executable, "-m", "pip", "install", *options, "--target", str(target), str(package)]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(target), str(ROOT)])}


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """In which the package beside the tests is installed."""
    return installed(PLUGIN, tmp_path_factory.mktemp("site"))


def command(environment: dict[str, str], folder: Path, *arguments: str) -> str:
    """Standard output of `dembench` with these arguments."""
    program = [sys.executable, "-c", "from dembench.cli import main; main()", *arguments]
    done = subprocess.run(program, capture_output=True, text=True, env=environment, cwd=folder, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_an_announced_engine_runs_an_announced_case_to_a_report(environment: dict[str, str], tmp_path: Path) -> None:
    told = json.loads(command(environment, tmp_path, "run", "drifting", "--engines", "weightless", "--json"))
    assert [run["state"] for run in told["runs"]] == ["ok"]
    page = (tmp_path / told["report"]).read_text()
    assert "weightless" in page and "A body that drifts" in page and "Straight lines, from another package" in page


def test_an_announced_suite_has_rows_and_a_page(environment: dict[str, str], tmp_path: Path) -> None:
    told = json.loads(command(environment, tmp_path, "verify", "--suite", "drift", "--engines", "weightless", "--json"))
    assert [(row["id"], row["engine"], row["status"]) for row in told["rows"]] == [("W1", "weightless", "ok")]
    assert "A suite from another package." in (tmp_path / told["reports"][0]).read_text()


def test_they_are_listed_beside_those_of_this_package(environment: dict[str, str], tmp_path: Path) -> None:
    assert "weightless" in command(environment, tmp_path, "engines")
    assert "drifting" in command(environment, tmp_path, "cases")


@pytest.mark.parametrize("kind", list(skeletons.KINDS))
def test_a_skeleton_passes_its_contract_test_as_it_is(kind: str, tmp_path: Path) -> None:
    assert CliRunner().invoke(app, ["new", kind, "my-own", "--directory", str(tmp_path)]).exit_code == 0
    made = tmp_path / "dembench-my-own"
    seen = installed(made, tmp_path / "site")
    test = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", str(made), str(made / "tests")]
    done = subprocess.run(test, capture_output=True, text=True, env=seen, cwd=made, check=False)
    assert done.returncode == 0, done.stdout[-3000:]
    assert "passed" in done.stdout and "skipped" not in done.stdout


@pytest.mark.parametrize("name", ["My", "a b", "../a", "a_b", "-a", "a--b", "class", "1a", ""])
def test_what_is_no_name_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(SkeletonError, match="is no name; accepted are small letters"):
        skeletons.write("engine", name, tmp_path)
    assert not list(tmp_path.iterdir())


def test_taken_names_and_directories_are_refused(tmp_path: Path) -> None:
    for kind, name in (("case", "case1"), ("engine", "peclet")):
        with pytest.raises(SkeletonError, match=f"the name '{name}' is taken by a known {kind}"):
            skeletons.write(kind, name, tmp_path)
    (tmp_path / "dembench-mine").mkdir()
    with pytest.raises(SkeletonError, match="dembench-mine is there already"):
        skeletons.write("case", "mine", tmp_path)
    answer = CliRunner().invoke(app, ["new", "case", "mine", "--directory", str(tmp_path)])
    assert answer.exit_code == 2
    assert not list((tmp_path / "dembench-mine").iterdir())
