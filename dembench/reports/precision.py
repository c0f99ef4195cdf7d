"""The page of sweeps: what an error costs, how it falls with the time step, and which setting to take."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dembench.reports.cells import state_cell
from dembench.reports.figures import Drawing, draw
from dembench.reports.looks import look
from dembench.reports.pages import write_page
from dembench.reports.precision_figures import plots, profile_plot
from dembench.reports.svg import variable
from dembench.reports.tables import Cell, Column, Table, numbers, significant
from dembench.scoring.precision import Order
from dembench.verification.precision import knobs
from dembench.verification.precision.levels import BAND, LEVELS, cheapest_settings, levels, measured_order
from dembench.verification.precision.store import Point, Sweep


@dataclass(frozen=True)
class Section:
    """The part of the page about one sweep."""

    name: str
    title: str
    notes: tuple[str, ...]
    facts: tuple[tuple[str, str], ...]
    drawings: tuple[Drawing, ...]
    tables: tuple[Table, ...]
    command: str


def render(found: Sequence[tuple[Path, Sweep]], output: Path) -> Path:
    """Writes the page of all sweeps of a directory as one HTML file that needs no other file and no network.

    Args:
        found: Sweeps with their files.
        output: Path of the file.

    Returns:
        The path of the file.
    """
    sweeps = [sweep for _, sweep in found]
    sections = [_section(sweep) for sweep in sweeps]
    profile = profile_plot(sweeps, "; ".join(sweep.command for sweep in sweeps))
    overview = (draw(profile),) if profile else ()
    return write_page(
        "precision.html.j2",
        output,
        {look(point.engine).colour for sweep in sweeps for point in sweep.points},
        [*overview, *(drawing for section in sections for drawing in section.drawings)],
        title="Error against run time",
        summary=f"Sweeps: {len(sweeps)}. Points: {sum(len(s.points) for s in sweeps)}.",
        cheapest=_cheapest(sweeps),
        overview=overview,
        sections=sections,
    )


def _section(sweep: Sweep) -> Section:
    name = _slug(f"{sweep.target}-{sweep.knob}")
    tables = [_orders(sweep, name) if sweep.knob == knobs.DT else None, _points(sweep, name)]
    return Section(
        name=name,
        title=f"{sweep.problem.title}: {sweep.knob}",
        notes=sweep.notes,
        facts=tuple(_facts(sweep)),
        drawings=tuple(draw(plot) for plot in plots(sweep, name)),
        tables=tuple(table for table in tables if table is not None and table.rows),
        command=sweep.command,
    )


def _slug(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9]+", "-", text).strip("-")


def _facts(sweep: Sweep) -> list[tuple[str, str]]:
    law = sweep.problem.law
    found = [("Target", sweep.target), ("Machine", sweep.machine), ("Made", sweep.made)]
    found.append(
        ("Problem", f"{sweep.problem.bodies} bodies, law {law}, {', '.join(sweep.problem.features) or 'bare'}")
    )
    found += [(measure.title, f"error of one: {measure.scale}; {measure.source}") for measure in sweep.measures]
    if sweep.kind == "path":
        reached = f"{sweep.horizon:.4g} s" if sweep.horizon is not None else "not reached"
        found.append(("Paths that start 1e-12 diameters apart diverge after", reached))
    if sweep.converged:
        words = {True: "yes", False: "no", None: "not known"}
        settled = ", ".join(f"{variant}: {words[value]}" for variant, value in sweep.converged.items())
        found.append(("Has the limit settled", settled))
    return found


def _engine_cell(variant: str, detail: str = "") -> Cell:
    return Cell(variant, variant, colour=variable(look(variant.partition("[")[0]).colour), detail=detail)


def _cheapest(sweeps: Sequence[Sweep]) -> Table:
    """Cheapest setting that reaches each level, one row per sweep and engine."""
    names = [*LEVELS, *([BAND] if any(BAND in levels(s) for s in sweeps) else [])]
    columns = [Column("Target", kind="long"), Column("Engine", kind="long")]
    columns += [Column(level, "s", "number", "loop time and setting that reach it in every measure") for level in names]
    rows = []
    for sweep in sweeps:
        settings = cheapest_settings(sweep)
        for variant in sweep.variants():
            own = {one.level: one for one in settings if one.variant == variant}
            cells = [Cell(sweep.problem.title, detail=sweep.knob), _engine_cell(variant, _law(sweep.of(variant)))]
            for level in names:
                one = own.get(level)
                if one is None:
                    cells.append(Cell())
                elif one.point is None or one.point.loop is None:
                    cells.append(Cell("not reached", mark="outside", detail=one.limit))
                else:
                    time, flags = one.point.loop.median, "c" if one.point.contended else ""
                    cells.append(Cell(significant(time, 3), time, detail=sweep.words(one.value), flags=flags))
            rows.append(tuple(cells))
    return Table(
        "cheapest",
        "Cheapest setting that reaches an error",
        tuple(columns),
        tuple(rows),
        "Time of the stepping loop. The error is the largest of all measures of the target. Below the band of the "
        "seeds nothing is ranked.",
        footnotes=("c: contended, other programs used its cores, so the time is overstated.",),
    )


def _law(points: Sequence[Point]) -> str:
    return f"computes another law: {points[0].law}" if points and points[0].law else ""


def _orders(sweep: Sweep, name: str) -> Table:
    """Measured order of accuracy beside the theoretical one."""
    columns = (
        Column("Engine", kind="long"),
        Column("Measure", kind="long"),
        Column("Total error", "order", "number", "slope of log error over log step"),
        Column("95 % interval", kind="number"),
        Column(
            "Own limit",
            "order",
            "number",
            "of the distance to the engine's own finest run, which stands for its limit and is none: a little too high",
        ),
        Column("95 % interval", kind="number"),
        Column("Theory", "order", "number", "of the method for this scene; empty where it divides its steps by itself"),
    )
    rows = []
    for variant in sweep.variants():
        points = [p for p in sweep.of(variant) if p.state == "ok"]
        for measure in sweep.measures:
            if measure.kind in ("closed form", "path") and points:
                total, own = (_order_cells(measured_order(points, measure.name, own)) for own in (False, True))
                theory = points[0].order
                last = Cell() if theory is None else Cell(f"{theory:g}", theory)
                rows.append((_engine_cell(variant), Cell(measure.title), *total, *own, last))
    note = (
        "Errors above 0.3 and below 1e-7, and those within a factor of two of the smallest, with everything finer, are "
        "left out: there no order holds, or rounding and the limit of the model show."
    )
    return Table(f"{name}-orders", "Order of accuracy in the time step", columns, tuple(rows), note)


def _order_cells(found: Order | None) -> tuple[Cell, Cell]:
    """An order with its interval and number of points."""
    if found is None:
        return Cell("none shows"), Cell()
    interval = f"{found.low:.2f} to {found.high:.2f} ({found.points} points)"
    return Cell(f"{found.slope:.2f}", found.slope), Cell(interval, found.low)


def _points(sweep: Sweep, name: str) -> Table:
    """All points with their costs and errors."""
    ordered = [p for variant in sweep.variants() for p in sweep.of(variant)]
    columns: list[tuple[Column, list[Cell]]] = [
        (Column("Engine", kind="long"), [_engine_cell(p.variant, _law([p])) for p in ordered]),
        (
            Column("Value", kind="number"),
            [Cell(p.value, float(p.value) if _number(p.value) else p.value) for p in ordered],
        ),
        (Column("State"), [state_cell(p.state, p.detail[:120]) for p in ordered]),
        (Column("Time step", "s", "number"), [Cell(significant(p.dt, 3), p.dt) for p in ordered]),
    ]
    for measure in sweep.measures:
        errors = [p.error(measure.name) for p in ordered]
        total = [e.total if e else None for e in errors]
        words = [e.verdict if e else "" for e in errors]
        columns.append(
            (
                Column(measure.title, "total", "number wide", f"{measure.source}; an error of one is {measure.scale}"),
                [_error_cell(t, w) for t, w in zip(total, words, strict=True)],
            )
        )
        own = [e.own if e else None for e in errors]
        columns.append((Column(measure.title, "own limit", "number wide"), [_error_cell(o) for o in own]))
    columns += [
        (Column("Loop time", "s", "number", "median"), [_loop_cell(p) for p in ordered]),
        (Column("Shortest to longest", "s", "number"), [_spread(p) for p in ordered]),
        (
            Column("Outside", "s", "number", "set-up, compilation and output"),
            numbers([p.loop.outside if p.loop else None for p in ordered]),
        ),
        (Column("Core-seconds", "s", "number"), [_plain(p.core_seconds) for p in ordered]),
        (Column("Steps", kind="number"), numbers([p.steps for p in ordered], digits=1)),
        (
            Column("Passes", kind="number", note="over the contacts"),
            numbers([p.passes for p in ordered], digits=1, most=0),
        ),
        (Column("Seeds", kind="number"), numbers([p.seeds for p in ordered], digits=1)),
        (Column("Precision", kind="line"), [Cell(p.precision) for p in ordered]),
    ]
    rows = tuple(tuple(cells[k] for _, cells in columns) for k in range(len(ordered)))
    return Table(
        f"{name}-points",
        "Points",
        tuple(column for column, _ in columns),
        rows,
        footnotes=("c: contended, other programs used its cores, so the time is overstated.",)
        if any(p.contended for p in ordered)
        else (),
    )


def _number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _error_cell(value: float | None, detail: str = "") -> Cell:
    return Cell() if value is None else Cell(f"{value:.2e}".replace("-", "−"), value, detail=detail)


def _plain(value: float | None) -> Cell:
    return Cell() if value is None else Cell(significant(value, 3), value)


def _loop_cell(point: Point) -> Cell:
    if point.loop is None:
        return Cell()
    return Cell(significant(point.loop.median, 3), point.loop.median, flags="c" if point.contended else "")


def _spread(point: Point) -> Cell:
    if point.loop is None or point.loop.count < 2:
        return Cell()
    text = f"{significant(point.loop.low, 3)} to {significant(point.loop.high, 3)} ({point.loop.count})"
    return Cell(text, point.loop.high - point.loop.low)
