"""Figures of stability maps: the limit in Rayleigh times with the bound, and what a stable step costs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from dembench.reports.looks import look
from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.verification.maps.breaking import BROKEN, GROWTH, LATTICE_GROWTH, Class
from dembench.verification.maps.rigs import TITLES
from dembench.verification.maps.store import CellFound, Map, RowFound

CLASS_COLOURS: dict[Class, str] = {
    "energy growth": "#c0392b",
    "tunnelling": "#7b3fa0",
    "lost particles": "#8a5a2b",
    "not a number": "#5d6672",
    "no rebound": "#b07a00",
    "refused": "#00808a",
    "died": "#c2185b",
}
Series = list[tuple[float, list[CellFound]]]
"""Cells by a value on an axis."""


def plots(one: Map, command: str) -> list[Plot]:
    """The figures of a map.

    Args:
        one: The map.
        command: What reproduces it.
    """
    rows = [row for row in one.rows if any(cell.probes for cell in row.cells)]
    if not rows:
        return []
    return [plot for plot in (_limits(one, rows, command), _costs(one, rows, command)) if plot.panels]


def _limits(one: Map, rows: Sequence[RowFound], command: str) -> Plot:
    """One panel per engine and rig: limit and bound over one axis, a line for each value of another."""
    across = one.axes[-2]
    columns = max(sum(row.variant == variant for row in rows) for variant in one.variants())
    return Plot(
        name=f"{one.name}-limits",
        title=f"{one.title}: largest stable step",
        caption=f"Coloured lines: largest step that is stable, by {one.axes[-1]}; thin lines: theoretical bound. "
        "Markers: the smallest step that breaks, by what it looks like; without one nothing breaks up to the line. "
        "Diamonds: where the engine's own guard ends.",
        x_label=TITLES[across],
        panels=tuple(_limit_panel(one, row) for row in rows),
        command=command,
        log_x=across != "coordination",
        columns=columns if columns > 1 else min(len(rows), 3),
    )


def _limit_panel(one: Map, row: RowFound) -> Panel:
    lines, known, marks = [], [], dict[Class, list[tuple[float, float]]]()
    for style, (value, cells) in enumerate(_series(row.cells, one.axes[-1])):
        ordered = sorted((cell for cell in cells if cell.probes), key=lambda cell: cell.at[one.axes[-2]])
        x = np.array([cell.at[one.axes[-2]] for cell in ordered])
        unit = np.array([row.bound / cell.rayleigh for cell in ordered])
        limit = np.array([cell.stable.factor if cell.stable else np.nan for cell in ordered]) * unit
        label = f"{row.variant}, {one.axes[-1]} {value:g}"
        lines.append(Line(label, x, limit, look(row.engine).colour, style=style))
        known.append(Known(f"bound, {one.axes[-1]} {value:g}", x, unit, points=False, style=style))
        for cell, place, scale in zip(ordered, x, unit, strict=True):
            if cell.breaks is not None:
                marks.setdefault(cell.breaks.kind, []).append((place, cell.breaks.factor * scale))
    for kind, points in marks.items():
        places, steps = np.array(points).T
        style = BROKEN.index(kind)
        lines.append(Line(kind, places, steps, CLASS_COLOURS[kind], style=style, points=True))
    known += _guard(one, row)
    place = ", ".join(f"{axis} {row.cells[0].at[axis]:.0e}" for axis in one.axes[:-2])
    title = f"{row.variant}, {place}" if place else row.variant
    return Panel("Time step / Rayleigh time", tuple(lines), tuple(known), log_y=True, title=title)


def _guard(one: Map, row: RowFound) -> list[Known]:
    guard = row.guard
    if guard is None or guard.accepted is None or guard.refused is None:
        return []
    usual = [cell for cell in row.cells if cell.at == guard.at]
    if not usual:
        return []
    step = guard.accepted * row.bound / usual[0].rayleigh
    return [Known("guard accepts up to", np.array([guard.at[one.axes[-2]]]), np.array([step]), points=True)]


def _series(cells: Sequence[CellFound], axis: str) -> Series:
    return [(value, [c for c in cells if c.at[axis] == value]) for value in sorted({c.at[axis] for c in cells})]


def _costs(one: Map, rows: Sequence[RowFound], command: str) -> Plot:
    """One panel per engine: the largest error or energy of all cells at each step."""
    restitution = one.measures_restitution
    panels = []
    for variant in one.variants():
        own = [row for row in rows if row.variant == variant]
        cells = [cell for row in own for cell in row.cells]
        if cells and (panel := _cost_panel(one, variant, own[0], cells)).lines:
            panels.append(panel)
    growth = LATTICE_GROWTH if one.name == "lattices" else GROWTH
    return Plot(
        name=f"{one.name}-costs",
        title=f"{one.title}: {'error of the restitution' if restitution else 'kinetic energy'} against the step",
        caption="Largest of all cells at each step that was probed; runs that came to no end are left out."
        + ("" if restitution else f" Dashed: {growth:g}, from which on it counts as growth."),
        x_label="Time step / theoretical bound",
        panels=tuple(panels),
        command=command,
        log_x=True,
        columns=min(len(panels), 3),
    )


def _cost_panel(one: Map, variant: str, row: RowFound, cells: Sequence[CellFound]) -> Panel:
    lines, factors = [], sorted({probe.factor for cell in cells for probe in cell.probes})
    for style, (value, own) in enumerate(_series(cells, one.axes[-1])):
        points = []
        for factor, found in itertools.groupby(
            sorted((p for cell in own for p in cell.probes), key=lambda p: p.factor), key=lambda p: round(p.factor, 6)
        ):
            seen = [p.error if one.measures_restitution else p.energy for p in found]
            known = [v for v in seen if v is not None]
            if known:
                points.append((factor, max(known)))
        if points:
            x, y = np.array(points).T
            lines.append(Line(f"{variant}, {one.axes[-1]} {value:g}", x, y, look(row.engine).colour, style=style))
    ends = np.array([factors[0], factors[-1]])
    growth = LATTICE_GROWTH if one.name == "lattices" else GROWTH
    limit = () if one.measures_restitution else (Known("growth", ends, np.full(2, growth), points=False, style=1),)
    label = "|e − e of the scene|" if one.measures_restitution else "Energy / that at start"
    return Panel(label, tuple(lines), limit, log_y=True, title=variant)
