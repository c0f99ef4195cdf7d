"""What others published: results of single codes; and run times, in a table of their own, for other hardware."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from statistics import median

from dembench.cases.published_results import PublishedResult
from dembench.cases.run_times import RunTime
from dembench.reports.groups import Group
from dembench.reports.tables import Cell, Column, Table, decimals, grouped
from dembench.reports.units import labelled, shown_in

SHORT = 12
"""So many results stand one by one [-]."""
MARKS = {
    "a": "a: approximate, as quoted.",
    "c": "c: contended, the device was shared with other jobs, so the time is overstated.",
    "x": "x: extrapolated from a part of the run.",
}


def published_results(group: Group) -> Table | None:
    """The published results of single codes; None where there is none.

    One row per result, or, where there are more than `SHORT`, one per quantity with the results folded below.
    """
    found = group.first.published_results
    if not found:
        return None
    name, title = f"{group.name}-published", "Published results of other codes"
    if len(found) <= SHORT:
        return _single_results(found, name, title)
    columns = (
        Column("Quantity", kind="wrap"),
        Column("Lowest", "and whose", "number"),
        Column("Highest", "and whose", "number"),
        Column("Median", kind="number", note="of single numbers, where there are three or more"),
        Column("Results", kind="number"),
    )
    return Table(
        name,
        title,
        columns,
        tuple(_range(quantity, own) for quantity, own in _by_quantity(found)),
        note="A result is that of one code, a mean of its runs or, where several were quoted together, a range.",
        folded=_single_results(found, f"{name}-single", "Published results, one by one"),
    )


def _range(quantity: str, results: list[PublishedResult]) -> tuple[Cell, ...]:
    """The row of a quantity: lowest and highest result, and the median of the single numbers."""
    factor, unit = shown_in(results[0].unit, [r.value for r in results])
    low = min(results, key=lambda r: r.value)
    high = max(results, key=_upper)
    single = [r.value for r in results if r.high is None]
    return (
        Cell(labelled(quantity, unit)),
        replace(_as_published(factor * low.value), detail=low.code),
        replace(_as_published(factor * _upper(high)), detail=high.code),
        _as_published(factor * median(single)) if len(single) > 2 else Cell(),
        Cell(str(len(results)), len(results)),
    )


def _upper(result: PublishedResult) -> float:
    return result.value if result.high is None else result.high


def _by_quantity(results: Sequence[PublishedResult]) -> Iterator[tuple[str, list[PublishedResult]]]:
    for quantity in dict.fromkeys(r.quantity for r in results):
        yield quantity, [r for r in results if r.quantity == quantity]


def _single_results(found: Sequence[PublishedResult], name: str, title: str) -> Table:
    """One row per result."""
    sources = list(dict.fromkeys(r.source for r in found))
    rows = []
    for quantity, own in _by_quantity(found):
        factor, unit = shown_in(own[0].unit, [r.value for r in own])
        for r in own:
            source = Cell(f"[{sources.index(r.source) + 1}]")
            value = _as_published(factor * r.value)
            if r.high is not None:
                value = Cell(f"{value.text} to {_as_published(factor * r.high).text}", value.value)
            deviation = Cell() if r.deviation is None else _as_published(factor * r.deviation)
            rows.append((Cell(r.code), Cell(quantity), Cell(unit), value, deviation, source))
    columns = (
        Column("Code", kind="long"),
        Column("Quantity", kind="wrap"),
        Column("Unit"),
        Column("Value", kind="number"),
        Column("Standard deviation", kind="number", note="over initial conditions"),
        Column("Source"),
    )
    footnotes = tuple(f"[{k + 1}] {source}" for k, source in enumerate(sources))
    return Table(name, title, columns, tuple(rows), footnotes=footnotes)


def _as_published(value: float) -> Cell:
    """A number with the decimals that were published."""
    _, _, decimal = f"{value:.10g}".partition(".")
    return Cell(grouped(value, len(decimal)), float(f"{value:.10g}"))


def published_times(group: Group) -> Table | None:
    """One row per published run time of the group's case; None where there is none."""
    found = group.first.run_times
    if not found:
        return None
    sources = list(dict.fromkeys(t.source for t in found))
    places = decimals([t.low for t in found], digits=3, most=1)
    columns = (
        Column("Code", kind="long"),
        Column("Wall time", "s", "number"),
        Column("Device", kind="long"),
        Column("Hardware", kind="wrap"),
        Column("Note", kind="wrap"),
        Column("Source"),
    )
    rows = tuple(
        (
            Cell(t.code),
            _time(t, places),
            Cell(t.device),
            Cell(t.hardware),
            Cell(t.note),
            Cell(f"[{sources.index(t.source) + 1}]"),
        )
        for t in sorted(found, key=lambda t: t.low)
    )
    used = {mark for t in found for mark in t.marks}
    return Table(
        f"{group.name}-published-times",
        "Published run times on other hardware",
        columns,
        rows,
        note="Wall times of whole runs of the published case, as published. They were measured on other machines, so "
        "they say nothing about the times above.",
        footnotes=(
            *(text for mark, text in MARKS.items() if mark in used),
            *(f"[{k + 1}] {source}" for k, source in enumerate(sources)),
        ),
    )


def _time(time: RunTime, places: int) -> Cell:
    if time.low == time.high:
        return Cell(grouped(time.low, places), time.low, flags=time.marks)
    return Cell(f"{grouped(time.low, 0)} to {grouped(time.high, 0)}", time.low, flags=time.marks)
