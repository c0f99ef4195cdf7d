"""The page of stability maps: the largest stable step of each engine beside the theoretical bound, and what breaks."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dembench.reports.figures import Drawing, draw
from dembench.reports.looks import look
from dembench.reports.map_figures import plots
from dembench.reports.pages import write_page
from dembench.reports.svg import variable
from dembench.reports.tables import Cell, Column, Table, significant
from dembench.verification.maps.breaking import BROKEN, MEANING
from dembench.verification.maps.rigs import TITLES
from dembench.verification.maps.store import CellFound, Map, Maps, RowFound


@dataclass(frozen=True)
class Section:
    """The part of the page about one map."""

    name: str
    title: str
    text: str
    notes: tuple[str, ...]
    drawings: tuple[Drawing, ...]
    tables: tuple[Table, ...]


def render(found: Maps, output: Path) -> Path:
    """Writes the page as one HTML file that needs no other file and no network.

    Args:
        found: The maps.
        output: Path of the file.

    Returns:
        The path of the file.
    """
    sections = [_section(one, found.command) for one in found.maps]
    engines = dict.fromkeys(row.engine for one in found.maps for row in one.rows)
    probes = {p.run for one in found.maps for row in one.rows for cell in row.cells for p in cell.probes}
    return write_page(
        "map.html.j2",
        output,
        {look(engine).colour for engine in engines},
        [drawing for section in sections for drawing in section.drawings],
        title="Stability maps",
        summary=f"Maps: {len(found.maps)}. Engines: {', '.join(engines)}. Runs: {len(probes)}.",
        overview=_overview(found),
        classes=[(kind, MEANING[kind]) for kind in BROKEN],
        sections=sections,
        complete=found.complete,
        command=found.command,
    )


def _engine_cell(row: RowFound) -> Cell:
    detail = f"computes another law: {row.law}" if row.law else ""
    return Cell(row.variant, row.variant, colour=variable(look(row.engine).colour), detail=detail)


def _overview(found: Maps) -> Table:
    """Smallest and largest of the largest stable steps of each engine and map, in theoretical bounds."""
    columns = (
        Column("Map", kind="long"),
        Column("Engine", kind="long"),
        Column("Stable up to", "bounds", "number wide", "largest stable step of the worst cell and of the best one"),
        Column("What breaks beyond", kind="wrap"),
        Column("Guard accepts up to", "bounds", "number", "on the usual cell, or range where there are several"),
        Column("Error of restitution", "at half the bound", "number", "largest of all pairs"),
    )
    rows = []
    for one in found.maps:
        for variant in one.variants():
            own = [row for row in one.rows if row.variant == variant]
            cells = [cell for row in own for cell in row.cells]
            rows.append(
                (
                    Cell(one.title),
                    _engine_cell(own[0]),
                    _range([None if cell.stable is None else cell.stable.factor for cell in cells], found.lowest),
                    _classes(cells),
                    _range(
                        [row.guard.accepted for row in own if row.guard is not None and row.guard.refused is not None]
                    ),
                    _error_at_half(cells),
                )
            )
    return Table(
        "overview-table",
        "Largest stable step in theoretical bounds",
        columns,
        tuple(rows),
        "A bound is the largest step with which explicit integration of the same contacts is stable. "
        f"Steps from {found.lowest:.2g} to {found.highest:.2g} bounds are looked at.",
    )


def _range(values: Sequence[float | None], lowest: float = 0.0) -> Cell:
    """Smallest and largest of some factors; None stands for less than the lowest that is looked at."""
    if not values:
        return Cell()
    known = [value for value in values if value is not None]
    low = f"{min(known):.2f}" if len(known) == len(values) else f"below {lowest:.2g}"
    if not known:
        return Cell(low, 0.0)
    return Cell(low if low == f"{max(known):.2f}" else f"{low} to {max(known):.2f}", min(known))


def _classes(cells: Sequence[CellFound]) -> Cell:
    """The classes of the smallest steps that break, with the number of cells."""
    kinds = [cell.breaks.kind for cell in cells if cell.breaks is not None]
    texts = [f"{kind} ({kinds.count(kind)})" for kind in BROKEN if kind in kinds]
    if any(cell.probes and cell.breaks is None for cell in cells):
        whole = sum(bool(cell.probes) and cell.breaks is None for cell in cells)
        texts.append(f"nothing ({whole})")
    return Cell(", ".join(texts))


def _error_at_half(cells: Sequence[CellFound]) -> Cell:
    near = [
        probe.error
        for cell in cells
        for probe in sorted(cell.probes, key=lambda probe: abs(probe.factor - 0.5))[:1]
        if probe.error is not None
    ]
    return Cell(significant(max(near), 2), max(near)) if near else Cell()


def _section(one: Map, command: str) -> Section:
    return Section(
        name=one.name,
        title=one.title,
        text=one.text,
        notes=tuple(_notes(one)),
        drawings=tuple(draw(plot) for plot in plots(one, command)),
        tables=(_table(one),),
    )


def _notes(one: Map) -> list[str]:
    found = []
    for variant in one.variants():
        own = [row for row in one.rows if row.variant == variant]
        cells = [cell for row in own for cell in row.cells if cell.probes]
        if cells and all(cell.breaks is None for cell in cells):
            largest = max(probe.factor for cell in cells for probe in cell.probes)
            shown = "the error of the restitution" if one.measures_restitution else "the kinetic energy"
            found.append(
                f"{variant}: nothing breaks up to {largest:.1f} bounds; what the step costs is {shown}, below."
            )
        found += [f"{variant}: {trouble}" for trouble in dict.fromkeys(row.trouble for row in own) if trouble]
        found += _refusals(variant, own)
    return found


def _refusals(variant: str, rows: Sequence[RowFound]) -> list[str]:
    said = [row.guard.detail for row in rows if row.guard is not None and row.guard.detail]
    return [f"The guard of {variant}: {said[0]}"] if said else []


def _table(one: Map) -> Table:
    """The map in numbers: the largest stable step of each cell in theoretical bounds, and the class beyond it."""
    across = one.axes[-2]
    down = [*one.axes[:-2], one.axes[-1]]
    values = sorted({cell.at[across] for row in one.rows for cell in row.cells})
    columns = [Column("Engine", kind="long"), *(Column(TITLES[axis], kind="number") for axis in down)]
    columns += [Column(f"{TITLES[across]} {value:g}", kind="long") for value in values]
    rows = []
    for row in one.rows:
        for place in itertools.product(*(sorted({cell.at[axis] for cell in row.cells}) for axis in down)):
            here = [c for c in row.cells if all(c.at[axis] == v for axis, v in zip(down, place, strict=True))]
            own = {cell.at[across]: cell for cell in here}
            labels = [Cell(f"{value:g}", value) for value in place]
            rows.append((_engine_cell(row), *labels, *(_limit(own.get(value)) for value in values)))
    return Table(
        f"{one.name}-map",
        "Largest stable step of each cell in theoretical bounds",
        tuple(columns),
        tuple(rows),
        "Below each number what the next step looks like.",
        footnotes=("s: larger steps are stable again.",) if _any_returns(one) else (),
    )


def _limit(cell: CellFound | None) -> Cell:
    if cell is None or not cell.probes:
        return Cell()
    stable, breaks = cell.stable, cell.breaks
    if breaks is None:
        top = cell.probes[0].factor
        return Cell(f"{top:.2f}", top, mark="within", detail="nothing breaks")
    flags = "s" if _returns(cell) else ""
    if stable is None:
        return Cell(f"below {breaks.factor:.2g}", breaks.factor, mark="outside", detail=breaks.kind, flags=flags)
    return Cell(f"{stable.factor:.2f}", stable.factor, detail=breaks.kind, flags=flags)


def _returns(cell: CellFound) -> bool:
    """Whether a step is stable that is larger than one that breaks."""
    return cell.breaks is not None and any(p.kind == "stable" and p.factor > cell.breaks.factor for p in cell.probes)


def _any_returns(one: Map) -> bool:
    return any(_returns(cell) for row in one.rows for cell in row.cells)
