"""The page of a suite: every check with its closed form and the published number beside it, and figures."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

from dembench.reports import facts, sanity_figures
from dembench.reports.cells import state_cell
from dembench.reports.entries import gather
from dembench.reports.figures import draw
from dembench.reports.looks import look
from dembench.reports.pages import write_page
from dembench.reports.plot import Plot
from dembench.reports.svg import variable
from dembench.reports.tables import Cell, Column, Table, grouped, significant
from dembench.runs.directory import RunRecord
from dembench.verification.checks import MEASURED, Row, Suite

Figures = Callable[[Sequence[RunRecord], str], list[Plot]]
FIGURES: dict[str, Figures] = {"sanity": sanity_figures.plots}
"""What draws the figures of a suite, from complete runs and the command that reproduces them."""


def render(suite: Suite, runs: Sequence[RunRecord], rows: Sequence[Row], output: Path) -> Path:
    """Writes the page of a suite as one HTML file that needs no other file and no network.

    Args:
        suite: The suite.
        runs: Its runs in any state.
        rows: Its rows.
        output: Path of the file.

    Returns:
        The path of the file.
    """
    groups = gather(runs)
    command = _command(suite, runs)
    complete = [run for run in runs if run.status.state in MEASURED and run.result is not None]
    plots = FIGURES[suite.name](complete, command) if suite.name in FIGURES else []
    drawings = [draw(plot) for plot in plots]
    titles = [facts.problem_name(group.first) for group in groups]
    tables = [facts.engines(groups), *facts.settings(groups, titles), facts.load(groups), facts.all_runs(groups)]
    return write_page(
        "suite.html.j2",
        output,
        {entry.look.colour for group in groups for entry in group.entries},
        drawings,
        title=suite.title,
        summary=" ".join(_summary(engine, rows) for engine in _engines(rows)),
        text=suite.text,
        source=suite.source,
        verdicts=_verdicts(rows),
        rows=_rows(rows),
        drawings=drawings,
        scenes=[(title, facts.scene_facts(group)) for title, group in zip(titles, groups, strict=True)],
        engine_tables=[table for table in tables if table is not None and table.rows],
        environments=facts.environments(groups),
        failures=facts.failures(groups),
        command=command,
    )


def _engines(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row.engine for row in rows))


def _counts(engine: str, rows: Sequence[Row]) -> tuple[int, int, int, int]:
    """Of one engine: checks that it can do, the ok ones, those with a published number, those inside its tolerance."""
    own = [row for row in rows if row.engine == engine and row.status != "skipped"]
    published = [row for row in own if row.check.published is not None]
    inside = [row for row in published if row.inside_published]
    return len(own), sum(row.status == "ok" for row in own), len(published), len(inside)


def _summary(engine: str, rows: Sequence[Row]) -> str:
    checks, ok, published, inside = _counts(engine, rows)
    if not checks:
        return f"{engine}: no check that it can do."
    text = f"{engine}: {ok} of {checks} checks agree with the closed form"
    return f"{text}, {inside} of {published} lie inside the published tolerance." if published else f"{text}."


def _verdicts(rows: Sequence[Row]) -> Table:
    columns = (
        Column("Engine", kind="long"),
        Column("Checks it can do", kind="number"),
        Column("Agree with the closed form", kind="number"),
        Column("Inside the published tolerance", kind="number"),
        Column("States"),
    )
    listed = []
    for engine in _engines(rows):
        checks, ok, published, inside = _counts(engine, rows)
        states = dict.fromkeys(row.status for row in rows if row.engine == engine)
        listed.append(
            (
                _engine_cell(engine),
                Cell(str(checks), checks),
                Cell(f"{ok} of {checks}", ok),
                Cell(f"{inside} of {published}", inside),
                Cell(", ".join(states)),
            )
        )
    return Table("verdicts", "Verdict", columns, tuple(listed))


def _rows(rows: Sequence[Row]) -> Table:
    columns = (
        Column("Check"),
        Column("What", kind="long"),
        Column("Status"),
        Column("Engine", kind="long"),
        Column("Measured", kind="number"),
        Column("Closed form", kind="number"),
        Column("Tolerance", kind="number", note="largest deviation that is accepted"),
        Column("Page measured", kind="number", note="what the published page measured"),
        Column("Page expects", kind="number", note="what the published page expects, and its tolerance"),
        Column("Inside it", note="whether the measured value is inside the tolerance of the page"),
    )
    notes = list(dict.fromkeys(p.note for row in rows if (p := row.check.published) is not None and p.note))
    reasons = dict.fromkeys(f"{row.engine}: {row.detail}" for row in rows if row.detail)
    marks = {note: "*" * (k + 1) for k, note in enumerate(notes)}
    listed = []
    for row in rows:
        check, page = row.check, row.check.published
        places = max(0, min(6, 1 - _exponent(check.tolerance)))
        listed.append(
            (
                Cell(check.id),
                Cell(check.title, detail=check.source),
                state_cell(row.status),
                _engine_cell(row.engine),
                _value(row.measured, places, check.unit),
                _value(check.expected, places, check.unit),
                Cell(significant(check.tolerance, 2), check.tolerance),
                Cell() if page is None else Cell(significant(page.value), page.value),
                Cell()
                if page is None
                else Cell(
                    f"{significant(page.expected)} ± {significant(page.tolerance)}",
                    page.expected,
                    flags=marks.get(page.note, ""),
                ),
                _inside(row),
            )
        )
    footnotes = (*(f"{mark} {note}" for note, mark in marks.items()), *reasons)
    return Table("rows", "Checks", columns, tuple(listed), footnotes=footnotes)


def _exponent(value: float) -> int:
    return int(f"{value:e}".split("e")[1])


def _value(value: float | None, places: int, unit: str) -> Cell:
    if value is None:
        return Cell()
    text = grouped(value, places)
    return Cell(text if unit == "1" else f"{text} {unit}", float(f"{value:.10g}"))


def _inside(row: Row) -> Cell:
    if row.inside_published is None:
        return Cell()
    return Cell("inside", mark="within") if row.inside_published else Cell("outside", mark="outside")


def _engine_cell(engine: str) -> Cell:
    return Cell(engine, engine, colour=variable(look(engine.partition("[")[0]).colour))


def _command(suite: Suite, runs: Sequence[RunRecord]) -> str:
    engines = dict.fromkeys(run.spec.label() for run in runs)
    return shlex.join(["dembench", "verify", "--suite", suite.name, "--engines", ",".join(engines)])
