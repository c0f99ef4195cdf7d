"""The page of a suite: every check with its closed form and the published number beside it, and figures."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from dembench.reports import closed_forms_figures, facts, passport_figures, passport_tables, sanity_figures
from dembench.reports.cells import state_cell
from dembench.reports.figures import draw
from dembench.reports.groups import gather
from dembench.reports.looks import look
from dembench.reports.pages import write_page
from dembench.reports.plot import Plot
from dembench.reports.svg import variable
from dembench.reports.tables import Cell, Column, Table, grouped, significant
from dembench.runs.directory import RunRecord
from dembench.verification.checks import Check, Suite
from dembench.verification.rows import MEASURED, UNJUDGED, Row

Figures = Callable[[Sequence[RunRecord], str], list[Plot]]
FIGURES: dict[str, Figures] = {
    "closed-forms": closed_forms_figures.plots,
    "passport": passport_figures.plots,
    "sanity": sanity_figures.plots,
}
"""What draws the figures of a suite, from complete runs and the command that reproduces them."""
TABLES: dict[str, Callable[[Sequence[RunRecord]], list[Table]]] = {"passport": passport_tables.tables}
"""What makes tables of a suite's own, from complete runs; they stand before its checks."""


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
        own_tables=TABLES[suite.name](complete) if suite.name in TABLES else [],
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
    own = [row for row in rows if row.engine == engine and row.status not in UNJUDGED]
    published = [row for row in own if row.check.published is not None]
    inside = [row for row in published if row.inside_published]
    return len(own), sum(row.status == "ok" for row in own), len(published), len(inside)


def _summary(engine: str, rows: Sequence[Row]) -> str:
    checks, ok, published, inside = _counts(engine, rows)
    if not checks:
        return f"{engine}: no check that it can do."
    text = f"{engine}: {ok} of {checks} checks are met"
    return f"{text}, {inside} of {published} lie inside the published tolerance." if published else f"{text}."


def _verdicts(rows: Sequence[Row]) -> Table:
    with_page = any(row.check.published for row in rows)
    columns = [
        Column("Engine", kind="long"),
        Column("Checks it can do", kind="number"),
        Column("Met", kind="number"),
        Column("Not judged", kind="number", note="skipped: the engine cannot do the scene; not applicable: its law"),
        Column("States"),
    ]
    if with_page:
        columns.insert(3, Column("Inside the published tolerance", kind="number"))
    listed = []
    for engine in _engines(rows):
        checks, ok, published, inside = _counts(engine, rows)
        own = [row.status for row in rows if row.engine == engine]
        cells = [
            _engine_cell(engine),
            Cell(str(checks), checks),
            Cell(f"{ok} of {checks}", ok),
            Cell(str(len(own) - checks), len(own) - checks),
            Cell(", ".join(f"{state} {own.count(state)}" for state in dict.fromkeys(own))),
        ]
        if with_page:
            cells.insert(3, Cell(f"{inside} of {published}", inside))
        listed.append(tuple(cells))
    return Table("verdicts", "Verdict", tuple(columns), tuple(listed))


def _rows(rows: Sequence[Row]) -> Table:
    """One row for each check, with what every engine measured."""
    with_page = any(row.check.published for row in rows)
    engines = _engines(rows)
    columns = (
        Column("Check"),
        Column("What", kind="wrap", note="and where the expected value comes from"),
        Column("Expected", kind="number", note="≤ and ≥: what is accepted"),
        Column("Tolerance", kind="number", note="largest deviation that is accepted"),
        *(Column(engine, kind="number", note="measured") for engine in engines),
    )
    page_columns = (
        Column("Page measured", kind="number", note="what the published page measured"),
        Column("Page expects", kind="number", note="what the published page expects, and its tolerance"),
        Column("Inside it", kind="long", note="the engines whose values are inside the tolerance of the page"),
    )
    notes = list(dict.fromkeys(p.note for row in rows if (p := row.check.published) is not None and p.note))
    reasons = dict.fromkeys(f"{row.engine}: {row.detail}" for row in rows if row.detail)
    marks = {note: "*" * (k + 1) for k, note in enumerate(notes)}
    by_check: dict[str, dict[str, Row]] = {}
    for row in rows:
        by_check.setdefault(row.check.id, {})[row.engine] = row
    listed = []
    for own in by_check.values():
        check = next(iter(own.values())).check
        cells = (
            Cell(check.id),
            Cell(check.title, detail=f"{check.kind}: {check.source}"),
            *_expected(check),
            *(_measured(own[engine]) if engine in own else Cell() for engine in engines),
        )
        listed.append((*cells, *_page_cells(check, own, marks)) if with_page else cells)
    footnotes = (*(f"{mark} {note}" for note, mark in marks.items()), *reasons)
    shown = (*columns, *page_columns) if with_page else columns
    return Table("rows", "Checks", shown, tuple(listed), footnotes=footnotes)


def _expected(check: Check) -> tuple[Cell, Cell]:
    """What is expected and the tolerance; of a bound what is accepted."""
    if check.sense == "within":
        return _value(check.expected, check), Cell(significant(check.tolerance, 2), check.tolerance)
    sign, shown = (1, "≤ ") if check.sense == "at most" else (-1, "≥ ")
    bound = check.expected + sign * check.tolerance
    return Cell(shown + _with_unit(significant(bound), check), bound), Cell()


def _measured(row: Row) -> Cell:
    """What an engine measured, marked as met or missed; the state of a run without a value."""
    if row.measured is None:
        return state_cell(row.status)
    return replace(_value(row.measured, row.check), tone="within" if row.status == "ok" else "outside")


def _page_cells(check: Check, own: Mapping[str, Row], marks: Mapping[str, str]) -> tuple[Cell, ...]:
    page = check.published
    if page is None:
        return (Cell(), Cell(), Cell())
    expects = f"{significant(page.expected)} ± {significant(page.tolerance)}"
    known = {engine: row.inside_published for engine, row in own.items() if row.inside_published is not None}
    inside = [engine for engine, fits in known.items() if fits]
    told = Cell(", ".join(inside) or "none", mark="within" if len(inside) == len(known) else "outside")
    return (
        Cell(significant(page.value), page.value),
        Cell(expects, page.expected, flags=marks.get(page.note, "")),
        told if known else Cell(),
    )


def _exponent(value: float) -> int:
    return int(f"{value:e}".split("e")[1])


def _value(value: float, check: Check) -> Cell:
    """A value with as many digits as its tolerance needs; one of a bound at zero on its own."""
    size = abs(check.expected) or check.tolerance or 1.0
    fine = _exponent(check.tolerance or size)
    if check.sense != "within" and not check.expected:
        text = significant(value, 2)
    elif fine < -5:
        text = significant(value, max(2, _exponent(size) - fine + 2))
    else:
        text = grouped(value, max(0, 1 - fine))
    return Cell(_with_unit(text, check), float(f"{value:.10g}"))


def _with_unit(text: str, check: Check) -> str:
    return text if check.unit == "1" else f"{text} {check.unit}"


def _engine_cell(engine: str) -> Cell:
    return Cell(engine, engine, colour=variable(look(engine.partition("[")[0]).colour))


def _command(suite: Suite, runs: Sequence[RunRecord]) -> str:
    engines = dict.fromkeys(run.spec.label() for run in runs)
    return shlex.join(["dembench", "verify", "--suite", suite.name, "--engines", ",".join(engines)])
