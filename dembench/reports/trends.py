"""The page of a history: every metric over the sets of runs, beside what was blessed."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path

import numpy as np

from dembench.regression.baseline import Baseline, Blessing, Expectation
from dembench.regression.history import Line as Entry
from dembench.regression.metrics import Key, margin_text
from dembench.reports.figures import draw
from dembench.reports.looks import look
from dembench.reports.pages import write_page
from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.reports.svg import INK, variable
from dembench.reports.tables import Cell, Column, Table, grouped, significant
from dembench.reports.units import labelled, shown_in

DRAWN = 12
"""Most metrics of one engine on one problem that are drawn: those that moved most."""
NAMED = 8
"""Most sets of runs whose dates stand at the axis."""


@dataclass(frozen=True)
class Trend:
    """One metric over the sets of runs.

    Attributes:
        entries: Its entries, the oldest first.
        places: Number of the set of each, from 0.
        expected: What the baseline expects today; None where nothing.
        blessed: Numbers of the sets that were blessed, with the value of each.
    """

    entries: tuple[Entry, ...]
    places: tuple[int, ...]
    expected: Expectation | None
    blessed: tuple[tuple[int, float], ...]

    @property
    def key(self) -> Key:
        """What the metric is of."""
        return self.entries[0].key

    @cached_property
    def values(self) -> np.ndarray:
        """Values, shape (n,)."""
        return np.array([entry.value for entry in self.entries])

    @property
    def margin(self) -> float | None:
        """Largest change that does not matter, in the unit of the metric; None without a baseline."""
        return None if self.expected is None else self.expected.tolerance.of(self.expected.value)

    @property
    def moved(self) -> float:
        """Range of the values over the margin, or over the largest of them without one."""
        span = float(np.ptp(self.values))
        scale = self.margin or float(np.abs(self.values).max())
        return span / scale if scale else 0.0


def render(entries: Sequence[Entry], baseline: Baseline | None, output: Path) -> Path:
    """Writes the page of a history as one HTML file that needs no other file and no network.

    Args:
        entries: Lines of the history, the oldest first; at least one.
        baseline: What was blessed; None where that is not shown.
        output: Path of the file.

    Returns:
        The path of the file.
    """
    sets = list(dict.fromkeys(entry.hash for entry in entries))
    first_of = {entry.hash: entry for entry in reversed(entries)}
    trends = _trends(entries, sets, first_of, baseline)
    command = shlex.join(["dembench", "history", "show", "--output", output.name])
    groups: dict[tuple[str, str], list[Trend]] = {}
    for trend in trends:
        groups.setdefault((trend.key.problem, trend.key.engine), []).append(trend)
    names = tuple(f"{k}\n{first_of[mark].date[5:10]}" for k, mark in enumerate(sets))
    plots = [
        plot
        for k, ((problem, engine), own) in enumerate(groups.items())
        if (plot := _plot(f"trend{k + 1}", problem, engine, own, names, command)) is not None
    ]
    drawings = [draw(plot) for plot in plots]
    span = f"{entries[0].date[:10]} to {entries[-1].date[:10]}"
    return write_page(
        "trends.html.j2",
        output,
        {_colour(engine) for _, engine in groups},
        drawings,
        title="Trends",
        summary=f"{len(trends)} metrics of {len(sets)} sets of runs, {span}.",
        drawings=drawings,
        table=_table(trends),
        sets=_sets(sets, entries),
        blessings=_blessings(baseline),
        command=command,
    )


def _trends(
    entries: Sequence[Entry], sets: list[str], first_of: Mapping[str, Entry], baseline: Baseline | None
) -> list[Trend]:
    expected = baseline.by_key() if baseline else {}
    marks: dict[Key, list[tuple[int, float]]] = {}
    for blessing in baseline.blessings if baseline else ():
        place = sets.index(blessing.runs) if blessing.runs in sets else _before(blessing, sets, first_of)
        for change in blessing.changes:
            if change.after is not None:
                marks.setdefault(change.key, []).append((place, change.after))
    found: dict[Key, list[Entry]] = {}
    for entry in entries:
        found.setdefault(entry.key, []).append(entry)
    return [
        Trend(tuple(own), tuple(sets.index(e.hash) for e in own), expected.get(key), tuple(marks.get(key, ())))
        for key, own in sorted(found.items())
    ]


def _colour(engine: str) -> str:
    return look(engine.partition("[")[0].partition(",")[0]).colour if engine else INK


def _before(blessing: Blessing, sets: list[str], first_of: Mapping[str, Entry]) -> int:
    """Number of the last set before a blessing of runs that the history does not have; 0 without one."""
    when = datetime.fromisoformat(blessing.date)
    return max((k for k, mark in enumerate(sets) if first_of[mark].moment <= when), default=0)


# ---- figures


def _plot(
    name: str, problem: str, engine: str, trends: Sequence[Trend], names: tuple[str, ...], command: str
) -> Plot | None:
    """The metrics of one engine on one problem that moved, those that moved most first and speeds before all."""
    moved = [trend for trend in trends if trend.moved > 1e-6 or trend.entries[0].kind == "speed"]
    moved.sort(key=lambda trend: (trend.entries[0].kind != "speed", -trend.moved))
    if not moved:
        return None
    shown = moved[:DRAWN]
    still, more = len(trends) - len(moved), len(moved) - len(shown)
    caption = (
        "Bars are the deviation between seeds; of times, as far below the smallest repeat as the next ones lie "
        "above it. The grey band is what was blessed, with its tolerance."
    )
    caption += f" What did not move is in the table only ({still})." if still else ""
    caption += f" So is what moved less ({more})." if more else ""
    few = len(names) <= NAMED
    return Plot(
        name=name,
        title=f"{problem}: {engine}" if engine else problem.capitalize(),
        caption=caption,
        x_label="Set of runs" if few else "Set of runs, by number",
        panels=tuple(_panel(trend, len(names), _colour(engine)) for trend in shown),
        command=command,
        x_names=names if few else (),
        columns=2,
    )


def _panel(trend: Trend, sets: int, colour: str) -> Panel:
    last = trend.entries[-1]
    factor, unit = shown_in(last.unit, trend.values)
    spread = np.array([entry.spread for entry in trend.entries]) * factor
    y = trend.values * factor
    line = Line(
        "measured",
        np.array(trend.places, dtype=float),
        y,
        colour,
        points=len(y) == 1,
        low=y - spread if spread.any() else None,
        high=(y if last.kind == "speed" else y + spread) if spread.any() else None,
    )
    return Panel(
        labelled("ratio" if last.kind == "speed" else "", unit) or last.name,
        (line,),
        _known(trend, sets, factor),
        log_y=False,
        title=_short(f"{last.name}: {last.title}" if last.kind == "check" else last.title),
    )


def _known(trend: Trend, sets: int, factor: float) -> tuple[Known, ...]:
    """What was expected at each set, with the tolerance of today, and a mark at every blessing."""
    if not trend.blessed or trend.expected is None:
        return ()
    places = np.array([place for place, _ in trend.blessed], dtype=float)
    values = np.array([value for _, value in trend.blessed])
    ends = [*places[1:], float(max(sets - 1, 1))]
    x = np.array([at for pair in zip(places, ends, strict=True) for at in pair])
    y = np.repeat(values, 2)
    margins = np.array([trend.expected.tolerance.of(value) for value in y])
    band = Known("blessed, with tolerance", x, factor * y, factor * (y - margins), factor * (y + margins), points=False)
    return band, Known("blessing", places, factor * values, points=True)


def _short(text: str, most: int = 46) -> str:
    return text if len(text) <= most else text[: most - 1].rstrip() + "…"


# ---- tables


def _table(trends: Sequence[Trend]) -> Table:
    columns = (
        Column("Problem", kind="long"),
        Column("Engine", kind="long"),
        Column("Metric", kind="long"),
        Column("Last", kind="number", note="value of the latest set of runs"),
        Column("Expected", kind="number", note="what the baseline expects"),
        Column("Change", "%", "number", "of the last value against the expected one, else against the first"),
        Column("Tolerance", kind="number"),
        Column("Sets", kind="number", note="sets of runs that have it"),
    )
    return Table("metrics", "Metrics", columns, tuple(_row(trend) for trend in trends))


def _row(trend: Trend) -> tuple[Cell, ...]:
    last, expected = trend.entries[-1], trend.expected
    start = expected.value if expected else trend.entries[0].value
    change = 100 * (last.value / start - 1) if start else None
    beyond = trend.margin is not None and abs(last.value - start) > trend.margin
    unit = "" if last.unit == "1" else f" {last.unit}"
    processor = f" on {last.processor}" if last.processor else ""
    return (
        Cell(last.problem),
        Cell(last.engine, last.engine, colour=variable(_colour(last.engine))) if last.engine else Cell(),
        Cell(last.name, detail=last.title + processor),
        _number(last.value, unit),
        Cell() if expected is None else _number(expected.value, unit),
        Cell() if change is None else Cell(grouped(change, 2), change, mark="outside" if beyond else ""),
        Cell() if expected is None else Cell(margin_text(expected.tolerance)),
        Cell(str(len(trend.entries)), len(trend.entries)),
    )


def _number(value: float, unit: str) -> Cell:
    return Cell(significant(value, 5) + unit, float(f"{value:.10g}"))


def _sets(sets: Sequence[str], entries: Sequence[Entry]) -> Table:
    columns = (
        Column("Set", kind="number", note="number at the horizontal axis"),
        Column("Date"),
        Column("Commit"),
        Column("Metrics", kind="number"),
        Column("Hash", note="of the runs and when they were made"),
    )
    rows = []
    for k, mark in enumerate(sets):
        own = [entry for entry in entries if entry.hash == mark]
        date = own[0].date[:16].replace("T", " ")
        rows.append((Cell(str(k), k), Cell(date), Cell(own[0].commit), Cell(str(len(own)), len(own)), Cell(mark)))
    return Table("sets", "Sets of runs", columns, tuple(rows))


def _blessings(baseline: Baseline | None) -> Table | None:
    if baseline is None or not baseline.blessings:
        return None
    columns = (
        Column("Date"),
        Column("Reason", kind="wrap"),
        Column("Changes", kind="number"),
        Column("What changed", kind="wrap"),
        Column("Versions", kind="wrap"),
        Column("Processor"),
    )
    rows = []
    for blessing in reversed(baseline.blessings):
        changed = [change.text() for change in blessing.changes if change.word == "changed"]
        listed = "; ".join(changed[:5]) + (f"; and {len(changed) - 5} more" if len(changed) > 5 else "")
        rows.append(
            (
                Cell(blessing.date[:16].replace("T", " ")),
                Cell(blessing.reason),
                Cell(str(len(blessing.changes)), len(blessing.changes)),
                Cell(listed),
                Cell(", ".join(f"{name} {text}" for name, text in blessing.versions.items())),
                Cell(blessing.processor),
            )
        )
    return Table("blessings", "Blessings, the latest first", columns, tuple(rows))
