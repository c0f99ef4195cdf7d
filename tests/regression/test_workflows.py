"""The workflow files that users copy: they parse, and every command of ours in them is one that the program takes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner
from workflows import FILES, commands, document, lines, variables

from dembench import recipes
from dembench.cli import app
from dembench.regression.baseline import load
from dembench.share import share
from dembench.verification.suites import suite


@pytest.mark.parametrize("name", FILES)
def test_every_command_is_one_that_the_program_takes(name: str) -> None:
    found = commands(name)
    assert sorted(words[0] for words in found) == ["check", "check", "history", "history", "run", "verify"]
    for words in found:
        verb = words[:2] if words[0] == "history" else words[:1]
        help_text = CliRunner().invoke(app, [*verb, "--help"], env={"COLUMNS": "200"}).stdout
        options = [word for word in words if word.startswith("-")]
        assert options and all(option in help_text for option in options), words


@pytest.mark.parametrize("name", FILES)
def test_the_recipe_and_the_baseline_are_there(name: str) -> None:
    assert commands(name)[0][1] in recipes.names()
    baseline = load(share(*variables(name)["BASELINE"].split("/")))
    assert {expected.engine for expected in baseline.metrics} == set(variables(name)["ENGINES"].split(","))


@pytest.mark.parametrize("name", FILES)
def test_a_flight_answers_to_gravity(name: str) -> None:
    """The projectile of `SR8` is in the baseline for every engine, and among what the workflow verifies."""
    engines = variables(name)["ENGINES"].split(",")
    baseline = load(share(*variables(name)["BASELINE"].split("/")))
    assert [e.engine for e in baseline.metrics if e.name == "SR8"] == engines
    (words,) = [words for words in commands(name) if words[0] == "verify"]
    only = words[words.index("--only") + 1].split(",")
    taken = [e for text in words[2].split(",") for e in suite(text).part("default", only).experiments]
    assert "SR8" in {check.id for experiment in taken for check in experiment.checks}


@pytest.mark.parametrize("name", FILES)
def test_kernels_are_timed_and_compared(name: str) -> None:
    """What `make bench` times is timed, and what it writes is checked against a baseline of these kernels."""
    (timed,) = [line for line in lines(name) if "pytest" in line]
    written = re.search(r"--benchmark-json=(\S+)", timed)
    assert written and "tests/bench/test_kernels.py" in timed and timed in _makefile().replace("$(OUT)", "runs")
    (checked,) = [words for words in commands(name) if words[:2] == ["check", written[1]]]
    assert checked[checked.index("--baseline") + 1] == "$KERNELS"
    known = {expected.name for expected in load(share(*variables(name)["KERNELS"].split("/"))).metrics}
    kernels = (Path(__file__).parents[1] / "bench" / "test_kernels.py").read_text()
    assert known == set(re.findall(r"^def test_(\w+)", kernels, re.MULTILINE))


def _makefile() -> str:
    """The Makefile with the Python of a workflow in the place of its own."""
    return (Path(__file__).parents[2] / "Makefile").read_text().replace("$(BIN)/", "")


@pytest.mark.parametrize("name", FILES)
def test_no_address_stands_in_it(name: str) -> None:
    assert not re.search(r"https?://|--index-url|extra-index", share("data", "workflows", name).read_text())


def test_github_runs_jobs_of_steps() -> None:
    found = document("github.yml")
    assert {"name", "jobs", "permissions"} <= set(found)
    (job,) = found["jobs"].values()
    assert job["runs-on"] and all(("uses" in step) != ("run" in step) for step in job["steps"])


@pytest.mark.parametrize("job", ("dembench", "kernels"))
def test_gitlab_reports_junit(job: str) -> None:
    found = document("gitlab.yml")[job]
    assert found["artifacts"]["reports"]["junit"] in " ".join(found["script"])


@pytest.mark.parametrize("name", ("ci.json", "kernels.json"))
def test_baselines_of_the_package_are_whole(name: str) -> None:
    found = load(share("data", "baselines", name))
    assert found.metrics and all(blessing.reason for blessing in found.blessings)


def test_no_expectation_of_the_package_is_a_share_of_nothing() -> None:
    """What can be zero has a tolerance in its unit, so that a change of it can be judged."""
    found = load(share("data", "baselines", "ci.json"))
    assert not [e.key for e in found.metrics if e.tolerance.relative and not e.value]
