"""The workflow files that users copy: they parse, and every command of ours in them is one that the program takes."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from dembench import recipes
from dembench.cli import app
from dembench.regression.baseline import load
from dembench.share import share

FILES = ("github.yml", "gitlab.yml")


def texts(data: Any) -> Iterator[str]:
    """All strings in a document."""
    if isinstance(data, str):
        yield data
    elif isinstance(data, dict):
        yield from (text for value in data.values() for text in texts(value))
    elif isinstance(data, list):
        yield from (text for value in data for text in texts(value))


def commands(name: str) -> list[list[str]]:
    """The commands of ours in a workflow, as words."""
    document = yaml.safe_load(share("data", "workflows", name).read_text())
    lines = [line for text in texts(document) for line in text.replace("\\\n", " ").splitlines()]
    ours = [line.split("||")[0].split("#")[0] for line in lines if line.strip().startswith("dembench ")]
    return [shlex.split(line)[1:] for line in ours]


@pytest.mark.parametrize("name", FILES)
def test_every_command_is_one_that_the_program_takes(name: str) -> None:
    found = commands(name)
    assert [words[0] for words in found] == ["run", "verify", "check", "history", "history"]
    for words in found:
        verb = words[:2] if words[0] == "history" else words[:1]
        help_text = CliRunner().invoke(app, [*verb, "--help"], env={"COLUMNS": "200"}).stdout
        options = [word for word in words if word.startswith("-")]
        assert options and all(option in help_text for option in options), words


@pytest.mark.parametrize("name", FILES)
def test_the_recipe_and_the_baseline_are_there(name: str) -> None:
    assert commands(name)[0][1] in recipes.names()
    document = yaml.safe_load(share("data", "workflows", name).read_text())
    variables = document.get("env") or document["variables"]
    baseline = load(share(*variables["BASELINE"].split("/")))
    assert {expected.engine for expected in baseline.metrics} == set(variables["ENGINES"].split(","))


@pytest.mark.parametrize("name", FILES)
def test_no_address_stands_in_it(name: str) -> None:
    assert not re.search(r"https?://|--index-url|extra-index", share("data", "workflows", name).read_text())


def test_github_runs_jobs_of_steps() -> None:
    document = yaml.safe_load(share("data", "workflows", "github.yml").read_text())
    assert {"name", "jobs", "permissions"} <= set(document)
    (job,) = document["jobs"].values()
    assert job["runs-on"] and all(("uses" in step) != ("run" in step) for step in job["steps"])


def test_gitlab_reports_junit() -> None:
    job = yaml.safe_load(share("data", "workflows", "gitlab.yml").read_text())["dembench"]
    assert job["artifacts"]["reports"]["junit"] in " ".join(job["script"])


@pytest.mark.parametrize("name", ("ci.json", "kernels.json"))
def test_baselines_of_the_package_are_whole(name: str) -> None:
    found = load(share("data", "baselines", name))
    assert found.metrics and all(blessing.reason for blessing in found.blessings)
    assert all(expected.n >= 3 for expected in found.metrics if expected.kind == "speed")
