"""Recipes: what they stand for, what is wrong with one that is not accepted, and the command that carries one out."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path

import pytest
from typer.testing import CliRunner

from dembench import recipes
from dembench.cases import drum_scores, impact_scores, publication, silo_scores
from dembench.cases import registry as cases_registry
from dembench.cases.registry import parse_case
from dembench.cli import app
from dembench.engines import registry
from dembench.initial.fetch import FetchError
from dembench.results import channels
from dembench.runs.directory import find_runs
from dembench.runs.plan import RequestError, parse_engines
from dembench.scene import Overlap, save_scene

QUANTITIES = {
    "case1": silo_scores.QUANTITIES,
    "case2": drum_scores.QUANTITIES,
    "case3": impact_scores.QUANTITIES,
}

SMALL = """
title = "Two stand-ins"
cases = ["small.json"]
[[runs]]
engines = ["standin"]
settings = { spoil = ["a", "b"], dt = 1e-4 }
[[runs]]
engines = ["standin-coarse"]
division = "open"
reference = true
"""


def test_the_text_about_velocities_names_the_times_that_are_shown() -> None:
    recipe = recipes.load(recipes.asked_for(["dosta2024-fig-silo-velocities"]))
    silo = publication.published("silo")
    assert not re.search(r"\d s\b", recipe.title)
    named = re.findall(r"after\s+(\d+) s", recipe.text)
    assert [float(time) for time in named] == [silo[preset]["snapshot"] for preset in ("published", "quick")]


def _block(**fields) -> recipes.Block:
    return recipes.Block(**{"cases": ["case3"], "engines": ["peclet"], **fields})


def test_lists_of_settings_give_every_combination() -> None:
    block = _block(settings={"rows": "rigid", "a": [1, 2], "b": [True, 0.5]})
    choices = block.engine_choices(["peclet"])
    assert choices == [
        "peclet[rows=rigid,a=1,b=true]",
        "peclet[rows=rigid,a=1,b=0.5]",
        "peclet[rows=rigid,a=2,b=true]",
        "peclet[rows=rigid,a=2,b=0.5]",
    ]
    parsed = [choice.overrides for choice in parse_engines(",".join(choices))]
    assert [block.swept(overrides) for overrides in parsed] == ["1 × true", "1 × 0.5", "2 × true", "2 × 0.5"]
    assert _block().engine_choices(["liggghts"]) == ["liggghts"]
    assert parsed[0] == {"rows": "rigid", "a": "1", "b": "true"}


def test_lists_of_parameters_give_every_combination_and_are_added_to_what_a_case_says() -> None:
    block = _block(cases=["case3", "case3[bed=50k]"], parameters={"jitter": [1e-6, 1e-5]})
    assert [choice.text for choice in block.case_choices()] == [
        "case3[jitter=1e-06]",
        "case3[jitter=1e-05]",
        "case3[bed=50k,jitter=1e-06]",
        "case3[bed=50k,jitter=1e-05]",
    ]
    assert parse_case(block.case_choices()[3].text)[1].jitter == 1e-5


def test_what_stands_above_the_blocks_holds_for_those_that_do_not_say_otherwise(tmp_path: Path) -> None:
    recipe = recipes.Recipe(
        title="t",
        cases=["case3"],
        seeds=[1, 2],
        time=0.04,
        preset="published",
        initial="beds",
        runs=[
            {"engines": ["peclet"], "division": "open", "timeout": "2h"},
            {"engines": ["liggghts", "peclet"], "time": 0.02, "settings": {"dt": 1e-6}},
        ],
    )
    (_, first), (_, second) = recipe.requests(tmp_path)
    assert (first.what, first.seeds, first.time, first.timeout) == (("case3",), (1, 2), 0.04, 7200)
    assert (first.division, second.division, second.time) == ("open", "closed", 0.02)
    assert second.engines == "liggghts[dt=1e-06],peclet[dt=1e-06]"
    assert first.initial == second.initial == Path("beds")


def test_what_is_typed_replaces_what_the_recipe_says(tmp_path: Path) -> None:
    recipe = recipes.Recipe(
        title="t",
        cases=["case3"],
        preset="published",
        initial="beds",
        runs=[{"engines": ["peclet"]}, {"engines": ["liggghts", "peclet"]}],
    )
    changed = [r for _, r in recipe.requests(tmp_path, preset="quick", seeds=(3,), division="open", time=None)]
    assert {(r.preset, r.seeds, r.division, r.time) for r in changed} == {("quick", (3,), "open", None)}
    assert {r.initial for r in changed} == {None}, "the quick preset makes its own beds"
    chosen = recipe.requests(tmp_path, ["liggghts"])
    assert [(block.engines, r.engines) for block, r in chosen] == [(("liggghts", "peclet"), "liggghts")]
    with pytest.raises(RequestError, match=r"no engine 'liggght'. Did you mean 'liggghts'\?"):
        recipe.requests(tmp_path, ["liggght"])


def test_parameters_are_not_for_scene_files(tmp_path: Path) -> None:
    recipe = recipes.Recipe(title="t", runs=[{"cases": ["a.json"], "engines": ["peclet"], "parameters": {"b": 1}}])
    with pytest.raises(RequestError, match=r"parameters are for cases; of a\.json"):
        recipe.requests(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('cases = ["small.json"]', ""), r"runs\.0\.cases is missing"),
        (('engines = ["standin"]', 'engin = ["standin"]'), r"runs\.0\.engin is not known. Did you mean 'engines'\?"),
        (("title", "titel"), r"titel is not known. Did you mean 'title'\?"),
        (("cases", "seed = 1\ncases"), r"seed is not known. Did you mean 'seeds'\?"),
        (('["a", "b"]', "[]"), r"runs\.0\.settings\.spoil.*at least 1 item"),
        (("[[runs]]", "[[runs]"), "Expected"),
        (('cases = ["small.json"]', "cases = []"), "cases.*at least 1 item"),
        (('cases = ["small.json"]', 'cases = ["small.json"]\nseeds = [-1]'), r"seeds\.0.*greater than or equal to 0"),
        (('cases = ["small.json"]', 'cases = ["small.json"]\npreset = "fast"'), "preset.*'quick' or 'published'"),
        (
            ("[[runs]]", '[page]\nquantities = ["q"]\n[sensitivity]\nparameter = "x"\nmust_vary = ["q"]\n[[runs]]'),
            r"parameter 'x' needs several values in runs\.0\.parameters",
        ),
    ],
)
def test_a_wrong_recipe_is_refused_with_the_field(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(SMALL.replace(*change, 1))
    with pytest.raises(RequestError, match=message) as error:
        recipes.load(path)
    assert str(path) in str(error.value)


def test_a_word_is_a_case_a_scene_or_a_recipe() -> None:
    assert recipes.asked_for(["case3", "case3[bed=50k]", "scene.json"]) is None
    found = recipes.asked_for(["impulse-study"])
    assert found is not None and found.name == "impulse-study.toml"
    with pytest.raises(RequestError, match="Did you mean 'impulse-study'"):
        recipes.asked_for(["impulse-stdy"])
    with pytest.raises(RequestError, match=r"absent\.toml: there is no such recipe"):
        recipes.asked_for(["absent.toml"])
    with pytest.raises(RequestError, match="run impulse-study alone"):
        recipes.asked_for(["impulse-study", "case3"])


@cache
def _what_can_be_shown(name: str) -> tuple[set[str], set[str], set[str]]:
    """Names of the recorded series, figures and pictures of a case, as its quick preset has them."""
    case, parameters = parse_case(name)
    scene = case.scene(parameters, "quick")
    recorded = set(channels(scene))
    figures = {figure.name for figure in case.figures(scene)}
    return recorded, figures, {picture.name for picture in case.pictures(scene)}


@pytest.mark.parametrize("name", recipes.names())
def test_the_recipes_of_the_package_ask_for_what_there_is(name: str, small_scene, monkeypatch) -> None:
    """Cases, engines, settings, quantities, figures and pictures exist; the published data need not be here."""
    monkeypatch.setattr(recipes, "initial_state", lambda given: given)
    recipe = recipes.load(recipes.asked_for([name]) or Path())
    for block, request in recipe.requests(Path("runs")):
        for choice in parse_engines(request.engines or ""):
            registry.engine(choice.engine).settings(small_scene(), block.division, choice.overrides)
        for text in request.what:
            case, parameters = parse_case(text)
            case.check(parameters, request.preset or "quick", request.initial)
            known = set(QUANTITIES[case.name])
            assert recipe.page is None or {*recipe.page.quantities, *recipe.page.costs} <= known
            if (page := recipe.page) is not None:
                recorded, figures, pictures = _what_can_be_shown(case.name)
                assert set(page.pictures) <= pictures
                assert set(page.figures) <= recorded | figures | {"seeds"}
                assert {curve.partition(".")[0] for curve in page.curves} <= recorded
            assert recipe.sensitivity is None or set(recipe.sensitivity.must_vary) <= known


@pytest.fixture
def command(standin, small_scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_scene(small_scene(observables=(Overlap(name="overlap", interval=2e-3),)), Path("small.json"))
    Path("small.toml").write_text(SMALL)
    return lambda *words: CliRunner().invoke(app, ["run", *words])


def test_the_command_carries_a_recipe_out(command) -> None:
    done = command("small.toml", "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert [run["engine"] for run in told["runs"]] == [
        "standin[spoil=a,dt=0.0001]",
        "standin[spoil=b,dt=0.0001]",
        "standin-coarse",
    ]
    assert Path(told["report"]) == Path("runs/small.html") and Path(told["report"]).exists()
    assert {run.spec.division for run in find_runs(Path("runs"))} == {"closed", "open"}
    assert {run["action"] for run in json.loads(command("small.toml", "--json").stdout)["runs"]} == {"reuse"}
    assert [run["action"] for run in json.loads(command("small.toml", "--fresh", "--json").stdout)["runs"]] == [
        "run"
    ] * 3


def test_plan_shows_the_runs_of_a_recipe_and_engines_chooses_among_them(command) -> None:
    planned = CliRunner().invoke(app, ["plan", "small.toml", "--engines", "standin-coarse", "--json"])
    assert [(run["engine"], run["division"]) for run in json.loads(planned.stdout)] == [("standin-coarse", "open")]
    refused = command("small.toml", "--engines", "standin-picky")
    assert refused.exit_code == 2 and "the recipe has no engine 'standin-picky'" in refused.output


def test_a_run_that_two_blocks_ask_for_is_made_once(command) -> None:
    block = '[[runs]]\nengines = ["standin"]\n'
    Path("twice.toml").write_text(f'title = "t"\ncases = ["small.json"]\n{block}{block}')
    assert len(json.loads(command("twice.toml", "--json").stdout)["runs"]) == 1


def test_a_run_that_fails_is_code_1_and_a_wrong_recipe_code_2(command) -> None:
    Path("small.toml").write_text(SMALL.replace('"a", "b"', '"nan"'))
    assert command("small.toml").exit_code == 1
    Path("small.toml").write_text("cases = 1")
    done = command("small.toml")
    assert done.exit_code == 2 and "title is missing" in done.output


SWEEP = """
title = "Does the fall depend on it?"
cases = ["flight"]
seeds = [0, 1]
[parameters]
PARAMETER = VALUES
[[runs]]
engines = ["standin"]
[sensitivity]
parameter = "PARAMETER"
must_vary = ["fall"]
[page]
quantities = ["fall"]
"""


@pytest.fixture
def sweep(command, monkeypatch):
    """Runs a sweep over a parameter of the stand-in case."""
    monkeypatch.setitem(cases_registry.BUILT_IN, "flight", "standin_case:Flight")
    cases_registry.case.cache_clear()

    def run(parameter: str, values: str):
        Path("sweep.toml").write_text(SWEEP.replace("PARAMETER", parameter).replace("VALUES", values))
        return command("sweep.toml", "--json")

    yield run
    cases_registry.case.cache_clear()


def test_a_dead_parameter_is_flagged_and_a_live_one_is_not(sweep) -> None:
    """In free flight the fall is g t^2/2 whatever the friction; its range over g from 5 to 10 is 2.5 t^2."""
    dead = sweep("friction", "[0.0, 0.5]")
    assert dead.exit_code == 1, dead.output
    (found,) = json.loads(dead.stdout)["sensitivity"]
    assert (found["verdict"], found["quantity"], found["parameter"]) == ("flat", "fall", "friction")
    assert found["change"] == 0
    assert "stays FLAT where it must vary with friction" in Path("runs/sweep.html").read_text()

    live = sweep("gravity", "[5.0, 10.0]")
    (found,) = json.loads(live.stdout)["sensitivity"]
    assert live.exit_code == 0, live.output
    assert found["verdict"] == "varies" and found["change"] == pytest.approx(2.5 * 0.01**2, rel=1e-9)
    assert "FLAT" not in Path("runs/sweep.html").read_text()


def test_words_are_swept_like_numbers_and_what_did_not_run_is_not_taken_for_an_answer(sweep, standin) -> None:
    words = sweep("medium", '["air", "vacuum"]')
    assert words.exit_code == 1 and json.loads(words.stdout)["sensitivity"][0]["verdict"] == "flat"
    standin(standin=["crash", 4])
    failed = sweep("gravity", "[3.0, 4.0]")
    assert failed.exit_code == 1 and json.loads(failed.stdout)["sensitivity"][0]["verdict"] == "unknown"


def test_data_that_a_recipe_names_is_asked_for_unless_another_place_is_typed(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("DEMBENCH_CACHE", str(tmp_path))
    recipe = recipes.Recipe(
        title="t", cases=["case2"], preset="published", initial="dosta2024", runs=[{"engines": ["peclet"]}]
    )
    with pytest.raises(FetchError, match="dembench data fetch dosta2024"):
        recipe.requests(tmp_path)
    assert [r.initial for _, r in recipe.requests(tmp_path, initial=tmp_path)] == [tmp_path]
    assert [r.initial for _, r in recipe.requests(tmp_path, preset="quick")] == [None]
