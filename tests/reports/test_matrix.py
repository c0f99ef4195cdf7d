"""The verification matrix, from run directories of stand-in engines."""

from __future__ import annotations

from pathlib import Path

import pytest
from reading import Page
from typer.testing import CliRunner

from dembench.cli import app
from dembench.reports.matrix import verified
from dembench.runs.directory import find_runs
from dembench.verification import suites


@pytest.fixture
def verify(standin, tmp_path, monkeypatch):
    """Runs `dembench verify` on the suite `falling` with the stand-in engines, in an empty directory."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(suites, "BUILT_IN", {"falling": "falling:suite"})
    suites.suite.cache_clear()
    yield lambda *words: CliRunner().invoke(app, ["verify", *words])
    suites.suite.cache_clear()


def test_features_come_from_the_scene_also_for_engines_that_refuse_it(verify) -> None:
    assert verify("--engines", "standin,standin-picky").exit_code == 0
    found = verified(find_runs(Path("runs/verify")))
    assert {(check.engine, check.status) for check in found} == {("standin", "ok"), ("standin-picky", "skipped")}
    assert {check.kind for check in found} == {"closed form"}
    assert all(check.features == {"friction", "tangential_history", "rotation", "gravity"} for check in found)


def test_the_index_counts_what_earlier_commands_have_left(verify) -> None:
    verify("--engines", "standin")
    verify("--engines", "standin-picky,standin-wordless")
    page = Page(Path("runs/verify/index.html").read_text())
    heading, *rows = [[cell.text.strip() for cell in row] for row in page.tables["matrix"]]
    (gravity,) = [row for row in rows if row[0] == "gravity"]
    assert gravity[1:3] == ["falling", "closed form"]
    assert dict(zip([name.strip() for name in heading[3:]], gravity[3:], strict=True)) == {
        "standin": "3 of 3",
        "standin-picky": "cannot",
        "standin-wordless": "0 of 3",
    }
    assert ("a", "falling.html") in {(tag, found.get("href")) for tag, found in page.tags}
