"""The table of ratios between variants of a case, such as the rates of two orifices."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from dembench.cases.base import Ratio
from dembench.reports.cells import run_cell
from dembench.reports.entries import RANKED, Entry
from dembench.reports.groups import Group, Member
from dembench.reports.tables import Cell, Column, Table, numbers, significant


@dataclass(frozen=True)
class Pair:
    """Two runs whose quantities are divided, and the parameters of the first."""

    ratio: Ratio
    parameters: Any
    over: Member
    under: Member
    value: float


def ratios(groups: Sequence[Group]) -> Table | None:
    """One row per ratio and pair of runs that differ in nothing else; None where there is no such pair.

    The published range holds for the published scenes: other presets and changed contacts are shown and not judged.
    """
    found = list(_pairs(groups))
    if not found:
        return None
    columns = (
        Column("Ratio", kind="wrap"),
        Column("Engine", kind="long"),
        Column("Preset"),
        Column("Seed", kind="number"),
        Column("Value", kind="number"),
        Column("Reference", kind="number"),
        Column("Accepted"),
        Column("Within"),
        Column("Source", kind="wrap"),
    )
    values = numbers([pair.value for pair in found], digits=3)
    references = numbers([pair.ratio.value for pair in found], digits=3)
    rows = []
    for k, pair in enumerate(found):
        spec = pair.over.shown.spec
        judged = spec.preset == "published" and not pair.parameters.changed()
        within = pair.ratio.low <= pair.value <= pair.ratio.high
        rows.append(
            (
                Cell(pair.ratio.title),
                run_cell(pair.over),
                Cell(spec.preset or "", detail="softened" if pair.over.shown.softening else ""),
                Cell(str(spec.seed), spec.seed),
                values[k],
                references[k],
                Cell(f"{significant(pair.ratio.low)} to {significant(pair.ratio.high)}"),
                Cell("yes" if within else "no", mark="within" if within else "outside") if judged else Cell(),
                Cell(pair.ratio.source),
            )
        )
    return Table("ratios", "Ratios between variants", columns, tuple(rows))


def _pairs(groups: Sequence[Group]) -> Iterator[Pair]:
    members = [member for group in groups for member in group.members if member.state in (*RANKED, "inaccurate")]
    for over in members:
        if over.shown.problem is None:
            continue
        case, parameters = over.shown.problem
        for ratio in case.ratios():
            if _changed(parameters, ratio.under) == parameters or _changed(parameters, ratio.over) != parameters:
                continue
            wanted = _key(over.shown, _changed(parameters, ratio.under))
            for under in members:
                if under.shown.problem is None or _key(under.shown, under.shown.problem[1]) != wanted:
                    continue
                above, below = (_value(m.shown, ratio.quantity) for m in (over, under))
                if above is not None and below:
                    yield Pair(ratio, parameters, over, under, above / below)


def _changed(parameters: Any, values: Any) -> Any:
    return parameters.model_copy(update=dict(values))


def _key(entry: Entry, parameters: Any) -> tuple[Any, ...]:
    """What two runs of a pair share, the parameters of the case being those given."""
    spec = entry.spec
    name = entry.problem[0].name if entry.problem else ""
    return (name, repr(parameters), spec.preset, spec.division, spec.label(), spec.engine_version, spec.seed)


def _value(entry: Entry, quantity: str) -> float | None:
    return next((s.quantity.value for s in entry.scores if s.quantity.name == quantity), None)
