"""The page of a study: variants of a solver against references, what each gives and what it costs."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from dembench.cases.base import Quantity
from dembench.recipes import Entry as RecipeEntry
from dembench.recipes import Recipe, StudyPage
from dembench.reports import facts
from dembench.reports.cells import STATE_NAMES, run_cell, state_cell
from dembench.reports.entries import Group, Member, gather
from dembench.reports.figures import Drawing, Known, Line, Panel, Plot, draw
from dembench.reports.pages import write_page
from dembench.reports.tables import Cell, Column, Table, numbers
from dembench.reports.units import labelled, shown_in
from dembench.results import Observed
from dembench.runs.directory import RunRecord

ENDED = ("ok", "unscored", "inaccurate")
"""States of runs that came to their end: what is inaccurate is a finding here."""


@dataclass(frozen=True)
class Variant:
    """One engine with one setting: its runs with all seeds and repeats.

    Attributes:
        entry: The entry of the recipe that asked for it.
        family: Number of that entry.
        choice: The engine as typed.
        members: Its runs, one member per seed.
        reference: Whether others are compared with it.
    """

    entry: RecipeEntry
    family: int
    choice: str
    members: tuple[Member, ...]
    reference: bool

    @property
    def title(self) -> str:
        """Name of its family in legends."""
        return self.entry.title or self.entry.engine

    @property
    def ended(self) -> list[Member]:
        """The runs that came to their end."""
        return [m for m in self.members if m.state in ENDED]

    @cached_property
    def quantities(self) -> dict[str, list[Quantity]]:
        """Quantities by name, one per seed."""
        found: dict[str, list[Quantity]] = {}
        for member in self.ended:
            for quantity in {s.quantity.name: s.quantity for s in member.shown.scores}.values():
                found.setdefault(quantity.name, []).append(quantity)
        return found

    def mean(self, quantity: str) -> float | None:
        """Mean of a quantity over the seeds; None where no run has it."""
        values = [q.value for q in self.quantities.get(quantity, [])]
        return statistics.fmean(values) if values else None

    @property
    def loop(self) -> float | None:
        """Median time of the stepping loop over seeds and repeats [s]."""
        loops = [loop for member in self.ended for loop in member.loops]
        return statistics.median(loops) if loops else None


@dataclass(frozen=True)
class Section:
    """The part of a page about one problem."""

    name: str
    title: str
    facts: facts.Facts
    drawings: tuple[Drawing, ...]
    table: Table


def render(recipe: Recipe, page: StudyPage, runs: Sequence[RunRecord], output: Path, command: str) -> Path:
    """Writes the page of a study as one HTML file that needs no other file and no network.

    Args:
        recipe: The recipe.
        page: What the page shows.
        runs: Its runs in any state.
        output: Path of the file.
        command: What reproduces it.

    Returns:
        The path of the file.
    """
    groups = gather(runs)
    sections = [_section(recipe, page, group, command) for group in groups]
    titles = [section.title for section in sections]
    tables = [facts.engines(groups), *facts.settings(groups, titles), facts.load(groups), facts.all_runs(groups)]
    return write_page(
        "study.html.j2",
        output,
        {entry.look.colour for group in groups for entry in group.entries},
        [drawing for section in sections for drawing in section.drawings],
        title=recipe.title,
        summary=_summary(groups),
        text=recipe.text,
        scenes=sections,
        engine_tables=[table for table in tables if table is not None and table.rows],
        environments=facts.environments(groups),
        failures=facts.failures(groups),
        command=command,
    )


def _summary(groups: Sequence[Group]) -> str:
    states = Counter(STATE_NAMES.get(m.state, m.state) for group in groups for m in group.members)
    counts = ", ".join(f"{count} {state}" for state, count in states.items())
    return f"{sum(states.values())} runs: {counts}. A run that is inaccurate is a finding here, not a fault."


def _section(recipe: Recipe, page: StudyPage, group: Group, command: str) -> Section:
    variants = _variants(recipe, group)
    plots = [_curves(group, variants, name, page.start, command) for name in page.curves]
    plots.append(_costs(group, variants, page.errors, command))
    return Section(
        name=group.name,
        title=facts.problem_name(group.first),
        facts=facts.scene_facts(group),
        drawings=tuple(draw(plot) for plot in plots if plot is not None),
        table=_table(group, variants, page.quantities),
    )


def _variants(recipe: Recipe, group: Group) -> list[Variant]:
    """The choices of the recipe in its order; one of which no run is known is left out."""
    found = []
    entries = [(entry, False) for entry in recipe.variants] + [(entry, True) for entry in recipe.references]
    for family, (entry, reference) in enumerate(entries):
        for choice in entry.choices():
            members = tuple(m for m in group.members if m.shown.spec.label() == choice)
            if members:
                found.append(Variant(entry, family, choice, members, reference))
    return found


# ---- the table


def _table(group: Group, variants: Sequence[Variant], names: Sequence[str]) -> Table:
    known = {q.name: q for v in variants for quantities in v.quantities.values() for q in quantities}
    names = [name for name in names if name in known]
    columns = [Column("Variant", kind="long"), Column("State"), Column("Seeds", kind="number")]
    cells: list[list[Cell]] = []
    for name in names:
        means = [v.mean(name) for v in variants]
        factor, unit = shown_in(known[name].unit, [m for m in means if m is not None])
        columns.append(Column(known[name].title, unit, "number wide"))
        column = numbers([None if m is None else factor * m for m in means], digits=4, most=4)
        cells.append([_with_spread(cell, v, name, factor) for cell, v in zip(column, variants, strict=True)])
    columns.append(Column("Loop time", "s", "number"))
    loops = numbers([v.loop for v in variants])
    rows = tuple(
        (
            Cell(
                v.choice,
                v.choice,
                colour=run_cell(v.members[0]).colour,
                detail="reference" if v.reference else v.title,
            ),
            state_cell(_state(v)),
            Cell(str(len(v.ended)), len(v.ended)),
            *(column[k] for column in cells),
            loops[k],
        )
        for k, v in enumerate(variants)
    )
    note = "Means over the seeds, with half the range of the seeds where there are several."
    return Table(f"{group.name}-variants", "What each choice gives and costs", tuple(columns), rows, note)


def _with_spread(cell: Cell, variant: Variant, name: str, factor: float) -> Cell:
    values = [q.value for q in variant.quantities.get(name, [])]
    if len(values) < 2:
        return cell
    return Cell(cell.text, cell.value, detail=f"± {factor * (max(values) - min(values)) / 2:.2g}")


def _state(variant: Variant) -> str:
    states = [m.state for m in variant.members]
    return next((s for s in states if s not in ENDED), states[0])


# ---- the figures


def _curves(group: Group, variants: Sequence[Variant], name: str, start: float, command: str) -> Plot | None:
    """One panel per family, each with the range of the references as a band."""
    drawn = [v for v in variants if not v.reference and _series(v, name, start)]
    if not drawn:
        return None
    shown = [series for v in variants for series in _series(v, name, start)]
    factor, time_unit = shown_in("s", *(o.time for o in shown))
    scale, unit = shown_in(shown[0].unit, *(o.value for o in shown))
    band = _band([o for v in variants if v.reference for o in _series(v, name, start)], factor, scale)
    panels = []
    for family in dict.fromkeys(v.family for v in drawn):
        own = [v for v in drawn if v.family == family]
        lines = [
            Line(_label(v), o.time * factor, o.value * scale, v.members[0].shown.look.colour, style)
            for style, v in enumerate(own)
            for o in _series(v, name, start)[:1]
        ]
        label = labelled(shown[0].title.partition(" of ")[0].removeprefix("Vertical ").capitalize(), unit)
        panels.append(Panel(label, tuple(lines), band, title=own[0].title.capitalize()))
    return Plot(
        name=f"{group.name}-{name}".replace("_", "-"),
        title=shown[0].title,
        caption="One panel per kind of variant; of several seeds the first is drawn. Band and thin line: range and "
        "mean of the references.",
        x_label=labelled("Time", time_unit),
        panels=tuple(panels),
        command=command,
    )


def _label(variant: Variant) -> str:
    short = variant.entry.short(variant.choice)
    return f"{variant.title}: {short}" if short else variant.title


def _series(variant: Variant, name: str, start: float) -> list[Observed]:
    """A series of every seed, from a time on [s]."""
    found = [m.shown.observables[name] for m in variant.ended if name in m.shown.observables]
    kept = [(o, o.time >= start * (1 - 1e-9)) for o in found]
    return [replace(o, step=o.step[rows], time=o.time[rows], value=o.value[rows]) for o, rows in kept if rows.any()]


def _band(references: Sequence[Observed], factor: float, scale: float) -> tuple[Known, ...]:
    if not references:
        return ()
    time = references[0].time
    values = np.array([np.interp(time, o.time, o.value) for o in references]) * scale
    return (Known("references", time * factor, values.mean(axis=0), values.min(axis=0), values.max(axis=0)),)


def _costs(group: Group, variants: Sequence[Variant], names: Sequence[str], command: str) -> Plot | None:
    """Difference from the mean of the references against run time, one panel per quantity."""
    timed = [v for v in variants if v.loop is not None]
    panels = [panel for name in names if (panel := _cost_panel(timed, name)) is not None]
    if not panels:
        return None
    return Plot(
        name=f"{group.name}-costs",
        title="Error against run time",
        caption="Difference of each variant from the mean of the references, which are drawn too; the band is the "
        "range of the references. Numbers beside points are the settings that a kind of variant sweeps.",
        x_label="Time of the stepping loop [s]",
        panels=tuple(panels),
        command=command,
        log_x=True,
    )


def _cost_panel(variants: Sequence[Variant], name: str) -> Panel | None:
    quantities = [q for v in variants for q in v.quantities.get(name, [])]
    references = [q.value for v in variants if v.reference for q in v.quantities.get(name, [])]
    if not quantities:
        return None
    centre = statistics.fmean(references) if references else 0.0
    factor, unit = shown_in(quantities[0].unit, [q.value - centre for q in quantities])
    lines = []
    for family in dict.fromkeys(v.family for v in variants):
        own = [v for v in variants if v.family == family and v.mean(name) is not None]
        if own:
            lines.append(
                Line(
                    own[0].title,
                    np.array([v.loop for v in own], dtype=float),
                    np.array([factor * ((v.mean(name) or 0.0) - centre) for v in own]),
                    own[0].members[0].shown.look.colour,
                    family,
                    points=True,
                    names=tuple(v.entry.short(v.choice) for v in own),
                )
            )
    loops = [v.loop for v in variants if v.loop is not None]
    time = np.geomspace(min(loops), max(loops), 21)
    known: tuple[Known, ...] = ()
    if references and len(set(loops)) > 1:
        low, high = (factor * (bound - centre) + 0 * time for bound in (min(references), max(references)))
        known = (Known("references", time, 0 * time, low, high),)
    return Panel(labelled("Difference", unit), tuple(lines), known, log_y=False, title=quantities[0].title)
