"""What runs are of, in the words of a baseline."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from dembench.runs.directory import RunRecord


def problem_of(record: RunRecord) -> str:
    """The problem of a run in words: case, preset where there is one, and simulated time where it was cut."""
    spec = record.spec
    if spec.preset is None:
        return spec.case
    return f"{spec.case} {spec.preset} {spec.duration:g} s"


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
