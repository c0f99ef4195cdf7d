"""Every rule of fair comparison has tests, and they are there."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "site" / "rules.md").read_text()
RULE = re.compile(r"^\*\*R(\d+)\. ", re.MULTILINE)
TEST = re.compile(r"`(tests/[\w/]+\.py)::(test_\w+)`")


def rules(page: str) -> dict[int, str]:
    """Text of each rule by its number: up to the next rule or heading."""
    parts = RULE.split(page)[1:]
    return {
        int(number): re.split(r"^#", text, flags=re.M)[0] for number, text in zip(parts[::2], parts[1::2], strict=True)
    }


def faults(page: str) -> list[str]:
    """Rules of a page without a test, and tests that are not there."""
    found = []
    for number, text in rules(page).items():
        named = TEST.findall(text)
        found += [f"R{number} has no test"] * (not named)
        for path, test in named:
            source = ROOT / path
            defined = ast.parse(source.read_text()).body if source.exists() else []
            if test not in {node.name for node in defined if isinstance(node, ast.FunctionDef)}:
                found.append(f"R{number}: there is no {path}::{test}")
    return found


def test_every_rule_has_a_test_that_is_there() -> None:
    assert faults(PAGE) == []


def test_rules_are_numbered_in_order_and_nothing_under_a_heading_is_without() -> None:
    numbers = [int(n) for n in RULE.findall(PAGE)]
    assert numbers == list(range(1, len(numbers) + 1))
    for section in re.split(r"^## ", PAGE, flags=re.MULTILINE)[1:]:
        assert RULE.search(section), f"no rule under '{section.splitlines()[0]}'"
        first = section.split("\n", 1)[1].strip()
        assert RULE.match(first), f"text that is no rule under '{section.splitlines()[0]}'"


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("**R1. Fair.** Be fair.\n", "R1 has no test"),
        (
            "**R1. Fair.**\nTests: `tests/test_rules.py::test_nothing`\n",
            "there is no tests/test_rules.py::test_nothing",
        ),
        ("**R1. Fair.**\nTests: `tests/test_none.py::test_a`\n", "there is no tests/test_none.py::test_a"),
    ],
)
def test_a_rule_without_a_test_is_found(text: str, fault: str) -> None:
    assert any(fault in found for found in faults(text))
