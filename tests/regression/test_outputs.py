"""Verdicts for other programs: JUnit that parses, Markdown that holds its columns."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from making import blessed, gathered, metric, speed

from dembench.regression.outputs import junit, markdown, sentence, write
from dembench.regression.verdicts import Verdict, counts, judge


@pytest.fixture
def verdicts() -> list[Verdict]:
    old = [metric("depth", 1.0), metric("period", 2.0), metric("gone", 3.0), speed([1.0, 1.01, 1.02])]
    odd = metric("period", 2.0, title="a | b <c> \x01")
    return judge(gathered(metric("depth", 1.5), odd, speed([1.5])), blessed(*old))


def test_junit_counts_what_it_lists(verdicts: list[Verdict]) -> None:
    suite = ElementTree.fromstring(junit(verdicts)).find("testsuite")
    assert suite is not None
    cases = suite.findall("testcase")
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors"), suite.get("skipped")) == (
        "4",
        "2",
        "0",
        "1",
    )
    assert {c.get("name"): [e.tag for e in c] for c in cases} == {
        "depth": ["failure"],
        "gone": ["failure"],
        "speed": ["skipped"],
        "period": [],
    }
    failure = cases[0].find("failure")
    assert failure is not None and "expected 1 m within 1%, change +50%" in str(failure.get("message"))


def test_markdown_keeps_its_columns(verdicts: list[Verdict]) -> None:
    lines = markdown(verdicts, "dembench check").splitlines()
    rows = [line for line in lines if line.startswith("|")]
    assert len(rows) == 2 + len(verdicts)
    assert {line.replace("\\|", "").count("|") for line in rows} == {7}
    assert "a \\| b &lt;c>" in markdown(verdicts, "")
    assert "1 regression, 1 missing, 1 undecided, 1 ok" in lines


def test_what_is_no_plain_file_is_written_to_and_stays(tmp_path: Path) -> None:
    target, link = tmp_path / "target.md", tmp_path / "link.md"
    link.symlink_to(target)
    write("text", link)
    assert link.is_symlink() and target.read_text() == "text"


def test_many_metrics_that_are_ok_are_counted() -> None:
    names = [f"m{k}" for k in range(70)]
    found = judge(gathered(*[metric(n, 1.0) for n in names]), blessed(*[metric(n, 1.0) for n in names]))
    assert "and 20 more that are ok" in markdown(found, "check")
    assert counts(found) == "70 ok"


def test_a_sentence_says_what_was_expected(verdicts: list[Verdict]) -> None:
    assert sentence(verdicts[0]) == "Depth: 1.5 m, expected 1 m within 1%, change +50%"
