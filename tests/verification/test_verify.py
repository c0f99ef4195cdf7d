"""`dembench verify`: rows in every state, exit codes, JSON, the page; on a suite that needs no solver."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import pytest
from reading import Page
from typer.testing import CliRunner, Result

from dembench.cli import app
from dembench.runs.directory import find_runs
from dembench.verification import suites


@pytest.fixture
def verify(standin, tmp_path, monkeypatch):
    """Runs `dembench verify` on the suite `falling` with the stand-in engines, in an empty directory."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(suites, "BUILT_IN", {"falling": "falling:suite", "planets": "falling:planets"})
    suites.suite.cache_clear()
    yield lambda *words: CliRunner().invoke(app, ["verify", *words])
    suites.suite.cache_clear()


def rows(done: Result) -> dict[str, dict]:
    return {row["id"]: row for row in json.loads(done.stdout)["rows"]}


def test_a_right_engine_is_ok_and_its_rows_say_what_was_measured(verify) -> None:
    done = verify("--engines", "standin", "--json")
    assert done.exit_code == 0, done.output
    found = rows(done)
    assert {"id", "engine", "measured", "expected", "tolerance", "status", "suite"} <= set(found["F1"])
    assert found["F1"]["measured"] == pytest.approx(-0.05)
    assert [row["status"] for row in found.values()] == ["ok"] * 3
    assert {row["engine"] for row in found.values()} == {"standin"}


def test_both_verdicts_stand_beside_each_other(verify) -> None:
    """A value that agrees with the closed form can lie outside a published tolerance, and the reason is printed."""
    found = rows(verify("--engines", "standin", "--json"))
    assert [found[k]["published"] and found[k]["published"]["inside"] for k in ("F1", "F2", "F3")] == [
        False,
        True,
        None,
    ]
    assert "The page forgot something." in verify("--engines", "standin").output


def test_settings_of_the_suite_reach_engines_that_know_them(verify) -> None:
    verify("--engines", "standin,standin-coarse[spoil=no]")
    found = {r.spec.engine: (r.spec.settings["spoil"], r.spec.label()) for r in find_runs(Path("runs/verify"))}
    assert found == {"standin": ("nothing", "standin"), "standin-coarse": ("no", "standin-coarse[spoil=no]")}


def test_a_missed_check_is_inaccurate_and_code_1(verify, monkeypatch) -> None:
    import falling

    monkeypatch.setattr(falling, "measure", lambda result: {"F1": -0.05, "F2": -1.1, "F3": float("nan")})
    done = verify("--engines", "standin", "--json")
    assert done.exit_code == 1
    assert {k: row["status"] for k, row in rows(done).items()} == {"F1": "ok", "F2": "inaccurate", "F3": "inaccurate"}
    assert rows(done)["F3"]["measured"] is None
    (run,) = find_runs(Path("runs/verify"))
    assert run.status.state == "inaccurate" and "F2 -1.1 is not -1 within 1e-09" in run.status.detail


@pytest.mark.parametrize(
    ("engines", "state", "detail", "code"),
    [
        ("standin,standin-picky", "skipped", "all radii must be equal", 0),
        ("standin-picky", "skipped", "all radii must be equal", 1),
        ("standin,standin-absent", "missing", "not on the path", 1),
        ("standin-wordless", "failed", "no ink left", 1),
    ],
)
def test_what_gave_no_value_is_a_row(verify, engines: str, state: str, detail: str, code: int) -> None:
    """A scene that an engine cannot do is no fault of it, but a suite of which nothing ran proves nothing."""
    done = verify("--engines", engines, "--json")
    assert done.exit_code == code, done.output
    last = json.loads(done.stdout)["rows"][-1]
    assert (last["status"], last["measured"]) == (state, None)
    assert detail in last["detail"]


def test_an_unknown_suite_is_a_usage_error(verify) -> None:
    done = verify("--suite", "fallin")
    assert done.exit_code == 2
    assert "Did you mean 'falling'?" in done.output


def test_a_number_can_rest_on_several_runs_and_a_bound_has_one_side(verify) -> None:
    found = rows(verify("--suite", "planets", "--only", "G", "--engines", "standin", "--json"))
    assert {k: (row["status"], row["sense"]) for k, row in found.items()} == {
        "G1": ("ok", "within"),
        "G2": ("ok", "within"),
        "G3": ("ok", "at most"),
        "G4": ("ok", "at least"),
    }
    assert found["G2"]["measured"] == pytest.approx(10) and len(found["G2"]["runs"]) == 2
    assert {r.spec.case: r.spec.settings["spoil"] for r in find_runs(Path("runs/verify"))} == {
        "heavy": "more",
        "light": "nothing",
    }


@pytest.mark.parametrize(("deaths_count", "status"), [(True, "inaccurate"), (False, "failed")])
def test_an_engine_that_dies_is_an_answer_where_that_counts(verify, monkeypatch, deaths_count, status) -> None:
    """Nothing is left of the two falls, which `measure` sees, or is not asked about."""
    import falling

    monkeypatch.setenv("STANDIN", json.dumps({"standin": ["crash", 1]}))
    monkeypatch.setattr(falling, "planets", partial(falling.planets, deaths_count))
    found = rows(verify("--suite", "planets", "--only", "G", "--engines", "standin", "--json"))
    assert {row["status"] for row in found.values()} == {status}
    assert (found["G1"]["measured"] == 0) is deaths_count


def test_only_what_was_asked_for_is_run(verify) -> None:
    """Without a name the long experiments are left out; those of a suite that is named are run."""
    assert set(rows(verify("--engines", "standin", "--json"))) == {"F1", "F2", "F3"}
    assert set(rows(verify("--tier", "long", "--engines", "standin", "--json"))) > {"F1", "G1"}
    assert set(rows(verify("--suite", "planets", "--engines", "standin", "--json"))) == {"G1", "G2", "G3", "G4"}
    assert set(rows(verify("--only", "G3", "--engines", "standin", "--json"))) == {"G1", "G2", "G3", "G4"}
    nothing = verify("--only", "H7", "--engines", "standin")
    assert nothing.exit_code == 2 and "no experiment of falling, planets fits H7" in nothing.output


def test_the_page_opens_offline_and_shows_every_check(verify) -> None:
    verify("--engines", "standin,standin-picky")
    text = Path("runs/verify/falling.html").read_text()
    page = Page(text)
    head, *listed = page.tables["rows"]
    assert [cell.text for cell in listed[1]][:2] == ["F2", "speedclosed form: g t"]
    assert len(listed) == 3
    assert [cell.text.split()[0] for cell in head][4:6] == ["standin", "standin-picky"]
    assert [cell.text for cell in page.tables["verdicts"][1]][:4] == ["standin", "3", "3 of 3", "1 of 2"]
    assert "The page forgot something." in text
    assert "dembench verify --suite falling --engines standin,standin-picky" in text
    assert "https:" not in text and "http:" not in text.replace("http://www.w3.org", "")
