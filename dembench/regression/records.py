"""What runs are of, in the words of a baseline."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from dembench.cases.registry import problem_title
from dembench.runs.directory import RunRecord


def problem_of(record: RunRecord) -> str:
    """The problem of a run in words; of a case with the simulated time, by which runs that were cut differ."""
    spec = record.spec
    title = problem_title(spec.case, spec.preset)
    return title if spec.preset is None else f"{title}, {spec.duration:g} s"


def engine_of(record: RunRecord) -> str:
    """The engine of a run with its settings as typed, and the division where it is open."""
    return record.spec.label() + (", open" if record.spec.division == "open" else "")


def grouped(
    records: Iterable[RunRecord], by: Callable[[RunRecord], tuple[str, ...]]
) -> dict[tuple[str, ...], list[RunRecord]]:
    """Runs by what they have in common, in the order of first appearance."""
    found: dict[tuple[str, ...], list[RunRecord]] = {}
    for record in records:
        found.setdefault(by(record), []).append(record)
    return found
