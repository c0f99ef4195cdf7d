"""The workflow files that users copy, and the commands of ours in them."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from typing import Any

import yaml

from dembench.share import share

FILES = ("github.yml", "gitlab.yml")


def document(name: str) -> Any:
    """A workflow as data."""
    return yaml.safe_load(share("data", "workflows", name).read_text())


def variables(name: str) -> dict[str, str]:
    """The variables of a workflow."""
    found = document(name)
    values: dict[str, str] = found.get("env") or found["variables"]
    return values


def _texts(data: Any) -> Iterator[str]:
    """All strings in a document."""
    if isinstance(data, str):
        yield data
    elif isinstance(data, dict):
        yield from (text for value in data.values() for text in _texts(value))
    elif isinstance(data, list):
        yield from (text for value in data for text in _texts(value))


def lines(name: str) -> list[str]:
    """All lines of all strings in a workflow, those that go on joined."""
    return [line.strip() for text in _texts(document(name)) for line in text.replace("\\\n", " ").splitlines()]


def commands(name: str) -> list[list[str]]:
    """The commands of ours in a workflow, as words."""
    ours = [line.split("||")[0].split("#")[0] for line in lines(name) if line.startswith("dembench ")]
    return [shlex.split(line)[1:] for line in ours]
