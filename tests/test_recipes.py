"""Recipes: what they stand for, what is wrong with one that is not accepted, and the command that carries one out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from dembench import recipes
from dembench.cases.impact_scores import QUANTITIES
from dembench.cases.registry import parse_case
from dembench.cli import app
from dembench.engines import registry
from dembench.runs.directory import find_runs
from dembench.runs.plan import RequestError, parse_engines
from dembench.scene import Overlap, save_scene

SMALL = """
title = "Two stand-ins"
cases = ["small.json"]
[[variants]]
engine = "standin"
settings = { spoil = ["a", "b"], dt = 1e-4 }
[[references]]
engine = "standin-coarse"
"""


def test_lists_of_settings_give_every_combination() -> None:
    entry = recipes.Entry(engine="peclet", settings={"rows": "rigid", "a": [1, 2], "b": [True, 0.5]})
    choices = entry.choices()
    assert choices == [
        "peclet[rows=rigid,a=1,b=true]",
        "peclet[rows=rigid,a=1,b=0.5]",
        "peclet[rows=rigid,a=2,b=true]",
        "peclet[rows=rigid,a=2,b=0.5]",
    ]
    assert [entry.short(choice) for choice in choices] == ["1 × true", "1 × 0.5", "2 × true", "2 × 0.5"]
    assert recipes.Entry(engine="liggghts").choices() == ["liggghts"]
    assert [c.overrides for c in parse_engines(choices[0])] == [{"rows": "rigid", "a": "1", "b": "true"}]


def test_the_request_is_that_of_the_recipe_unless_something_else_is_asked_for(tmp_path: Path) -> None:
    recipe = recipes.Recipe(
        title="t", cases=["case3"], seeds=[1, 2], time=0.04, timeout="2h", variants=[{"engine": "peclet"}]
    )
    request = recipe.request(tmp_path)
    assert (request.what, request.seeds, request.time, request.timeout) == (("case3",), (1, 2), 0.04, 7200)
    changed = recipe.request(tmp_path, preset="published", seeds=(3,), time=None)
    assert (changed.preset, changed.seeds, changed.time) == ("published", (3,), 0.04)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('cases = ["small.json"]', ""), "cases is missing"),
        (('engine = "standin"', 'engin = "standin"'), r"variants\.0\.engin is not known. Did you mean 'engine'\?"),
        (("title", "titel"), r"titel is not known. Did you mean 'title'\?"),
        (('["a", "b"]', "[]"), r"variants\.0\.settings\.spoil.*at least 1 item"),
        (("[[variants]]", "[[variants]"), "Expected"),
        (('cases = ["small.json"]', "cases = []"), "cases.*at least 1 item"),
        (('cases = ["small.json"]', 'cases = ["small.json"]\nseeds = [-1]'), r"seeds\.0.*greater than or equal to 0"),
        (('cases = ["small.json"]', 'cases = ["small.json"]\npreset = "fast"'), "preset.*'quick' or 'published'"),
    ],
)
def test_a_wrong_recipe_is_refused_with_the_field(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(SMALL.replace(*change, 1))
    with pytest.raises(RequestError, match=message) as error:
        recipes.load(path)
    assert str(path) in str(error.value)


def test_an_unknown_recipe_names_the_nearest() -> None:
    with pytest.raises(RequestError, match="Did you mean 'impulse-study'"):
        recipes.find("impulse-stdy")


@pytest.mark.parametrize("name", recipes.names())
def test_the_recipes_of_the_package_ask_for_what_there_is(name: str, small_scene) -> None:
    """Cases, presets, engines, settings and quantities exist."""
    recipe = recipes.load(recipes.find(name))
    request = recipe.request(Path("runs"))
    for choice in parse_engines(request.engines or ""):
        registry.engine(choice.engine).settings(small_scene(), recipe.division, choice.overrides)
    if recipe.page is not None:
        assert {*recipe.page.quantities, *recipe.page.errors} <= set(QUANTITIES)
    for text in recipe.cases:
        case, parameters = parse_case(text)
        case.check(parameters, recipe.preset or "quick")


@pytest.fixture
def command(standin, small_scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_scene(small_scene(observables=(Overlap(name="overlap", interval=2e-3),)), Path("small.json"))
    Path("small.toml").write_text(SMALL)
    return lambda *words: CliRunner().invoke(app, ["recipe", *words])


def test_the_command_carries_a_recipe_out(command) -> None:
    done = command("small.toml", "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert [run["engine"] for run in told["runs"]] == [
        "standin[spoil=a,dt=0.0001]",
        "standin[spoil=b,dt=0.0001]",
        "standin-coarse",
    ]
    assert Path(told["report"]) == Path("runs/small/small.html") and Path(told["report"]).exists()
    assert len(find_runs(Path("runs/small"))) == 3
    assert {run["action"] for run in json.loads(command("small.toml", "--json").stdout)["runs"]} == {"reuse"}


def test_a_run_that_fails_is_code_1_and_a_wrong_recipe_code_2(command) -> None:
    Path("small.toml").write_text(SMALL.replace('"a", "b"', '"nan"'))
    assert command("small.toml").exit_code == 1
    Path("small.toml").write_text("cases = 1")
    done = command("small.toml")
    assert done.exit_code == 2 and "title is missing" in done.output
