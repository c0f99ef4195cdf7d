"""`dembench sweep` and `dembench advise` as a person meets them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from reading import Page
from typer.testing import CliRunner

from dembench.cases.registry import parse_case
from dembench.cli import app
from dembench.runs.plan import SceneChoice
from dembench.scene import HertzMindlin, LinearSpring, save_scene
from dembench.share import share
from dembench.verification.precision import advice, problems, store
from dembench.verification.precision.levels import measured_order
from dembench.verification.precision.targets import Target


def call(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, [str(w) for w in words])
    return done.exit_code, done.stdout, done.stderr


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, store.Sweep]:
    """A sweep of the elastic collision with the soft-sphere solver: steps from 1/6 to 1/400 of a contact."""
    out = tmp_path_factory.mktemp("sweep")
    engines = "peclet-hertz"
    words = ["hertz_bounce", "--engines", engines, "--values", "8,4,2,0.5,0.125", "--repeat", "1", "--out", str(out)]
    code, text, error = call("sweep", *words, "--json")
    assert code == 0, error
    assert json.loads(text)["report"] == str(out / "precision.html")
    return out, store.find(out)[0][1]


def test_the_order_of_velocity_verlet_shows(swept) -> None:
    """Contact times of elastic collisions converge with the second order that the method has in theory.

    Root mean squares over 256 phases scatter by 1/sqrt(512) = 4 % a point, 0.03 in the slope over three octaves.
    """
    _, found = swept
    points = found.of("peclet-hertz")
    order = measured_order(points, "hertz_bounce_duration")
    assert order is not None and order.slope == pytest.approx(2.0, abs=0.1)
    assert {p.order for p in points} == {2.0}
    assert [p.rank for p in points] == [0, 1, 2, 3, 4]


def test_points_carry_their_costs_and_both_errors(swept) -> None:
    """Steps grow with the inverse factor; the finest point is its own limit; only the first misses 1 %."""
    _, found = swept
    steps = [p.steps or 0 for p in found.points]
    assert steps == [19, 38, 75, 300, 1200]
    assert [p.passes for p in found.points] == [float(n) for n in steps]
    assert all(p.loop is not None and p.loop.median > 0 and p.core_seconds == p.loop.median for p in found.points)
    errors = [p.error("hertz_bounce_duration") for p in found.points]
    assert all(e is not None for e in errors)
    assert errors[-1].own is None and errors[0].own == pytest.approx(errors[0].total, rel=0.01)
    assert errors[0].total > 0.01 > errors[-1].total


def test_the_page_has_a_diagram_the_orders_and_the_cheapest_settings(swept) -> None:
    """Every point is in the tables, and the command that reproduces the sweep beside each figure."""
    out, found = swept
    page = Page((out / "precision.html").read_text())
    assert {"profile", "hertz-bounce-dt-closed-form-time", "hertz-bounce-dt-closed-form-work"} <= set(page.figures)
    assert len(page.tables["hertz-bounce-dt-points"]) == 1 + len(found.points)
    assert len(page.tables["hertz-bounce-dt-orders"]) == 3
    assert "× closed step" in page.tables["cheapest"][1][3].text


def test_what_the_budget_left_is_listed_and_a_repeated_command_goes_on(tmp_path) -> None:
    """No run is started after the budget, the points say so, and the table stands all the same."""
    words = [
        "sweep",
        "hertz_bounce",
        "--engines",
        "peclet-hertz",
        "--values",
        "8,4,2",
        "--repeat",
        "1",
        "--out",
        tmp_path,
    ]
    code, text, _ = call(*words, "--budget", "0.0001", "--json")
    points = json.loads(text)["sweep"]["points"]
    assert [p["state"] for p in points].count("not run") >= 2
    assert "the budget was spent" in json.loads(text)["sweep"]["notes"][0]
    assert code == 0


def test_advice_says_where_it_comes_from(swept, tmp_path) -> None:
    """The same scene as was swept: its cheapest settings, with the step that they mean here."""
    out, _ = swept
    path = tmp_path / "scene.json"
    scene = problems.bounce(1.0, "like_it")
    save_scene(scene, path)
    code, text, error = call("advise", path, "--sweeps", out, "--json")
    assert code == 0, error
    found = json.loads(text)
    assert found["target"] == "hertz_bounce" and found["why"] == "the same kind of problem"
    row = next(row for row in found["rows"] if row["level"] == "5 %")
    factor = float(row["setting"].removesuffix(" × closed step"))
    assert row["dt"] == pytest.approx(scene.fitted_step(factor * scene.closed_step()))
    assert "From the sweep of hertz_bounce" in call("advise", path, "--sweeps", out)[1]
    code, text, error = call("advise", "hertz_bounce", "--sweeps", out, "--json")
    assert code == 0 and json.loads(text)["rows"], error


def test_sweeps_that_ship_advise_on_their_own_problems(tmp_path) -> None:
    """Elastic and damped collisions differ in nothing but restitution; each is advised from its own sweep."""
    for name in ("hertz_bounce", "damped_bounce", "sliding_ball"):
        code, text, error = call("advise", name, "--sweeps", tmp_path, "--json")
        assert code == 0, error
        assert (found := json.loads(text))["target"] == name and found["distance"] == 0.0


def test_no_advice_is_better_than_that_of_another_law(swept, tmp_path) -> None:
    """A linear spring has no contact time of Hertz: exit code 1 and the reason; so where nothing was swept."""
    out, _ = swept
    path = tmp_path / "linear.json"
    law = LinearSpring(normal_stiffness=1e4, tangential_stiffness=1e4)
    assert problems.bounce(1.0, "x").law == HertzMindlin()
    save_scene(problems.bounce(1.0, "linear").model_copy(update={"law": law}), path)
    code, text, _ = call("advise", path, "--sweeps", out)
    assert code == 1 and "another kind: its law is hertz-mindlin, not linear" in text


def test_without_sweeps_the_command_that_makes_one_is_named(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(advice, "_shipped", lambda: tmp_path / "none")
    code, text, _ = call("advise", "hertz_bounce", "--sweeps", tmp_path / "none")
    assert code == 1 and "`dembench sweep hertz_bounce` makes one" in text
    code, _, error = call("advise", "hertz_bonce", "--sweeps", tmp_path)
    assert code == 2 and "Did you mean 'hertz_bounce'" in error


def test_softened_cases_are_called_so() -> None:
    """The page, the console and advice name the problem of a sweep by its target and its title."""
    case, _ = parse_case("case1")
    scenes = (SceneChoice("hard", None, 0, problems.bounce(1.0, "hard")),)
    quick, published = (
        Target("case1", "Silo", "ensemble", scenes, case=case, preset=preset) for preset in ("quick", "published")
    )
    assert quick.problem_name == "case1, quick, softened" and published.problem_name == "case1, published"
    assert quick.problem().title == "Silo (case1, quick, softened)"


USAGE = {
    "target": (["case9"], "no case, scene file or experiment"),
    "near": (["hertz_bonce"], "Did you mean 'hertz_bounce'"),
    "knob": (["hertz_bounce", "--knob", "dx"], "no engine here has a setting 'dx'"),
    "span": (["hertz_bounce", "--span", "1"], "is no pair of factors"),
    "reference": (["hertz_bounce", "--reference", "peclet"], "the engines of this sweep are peclet-hertz"),
    "budget": (["hertz_bounce", "--budget", "soon"], "is no time"),
}


@pytest.mark.parametrize("fault", USAGE)
def test_a_usage_error_is_one_message_and_code_2(fault, tmp_path) -> None:
    """What was typed wrongly is named with what would be accepted, and nothing is left behind."""
    arguments, message = USAGE[fault]
    code, _, error = call("sweep", *arguments, "--engines", "peclet-hertz", "--out", tmp_path / "out")
    assert code == 2 and message in error
    assert not (tmp_path / "out").exists()


def test_sweeps_ship_and_advise_where_none_was_made(tmp_path) -> None:
    """Each has both engines of this package and LIGGGHTS, and names no place of the machine that it was made on."""
    path = share("data", "advice")
    known = store.find(path)
    assert {sweep.target for _, sweep in known} >= {"hertz_bounce", "damped_bounce", "sliding_ball"}
    for at, sweep in known:
        assert {"peclet", "peclet-hertz", "liggghts"} <= {point.engine for point in sweep.points}
        assert "--out" not in sweep.command and "/tmp" not in at.read_text()
    code, text, error = call("advise", "case3", "--sweeps", tmp_path / "none", "--json")
    assert code == 0, error
    reached = {row["variant"]: row["setting"] for row in json.loads(text)["rows"] if row["level"] == "band"}
    assert reached["peclet"] and reached["liggghts"]
