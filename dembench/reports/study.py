"""The page of a recipe: variants of solvers and cases, what each gives and costs, and what stays flat and must not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dembench.cases.base import Reference
from dembench.recipes import Page, Recipe
from dembench.reports import facts, sensitivity
from dembench.reports.cells import STATE_NAMES, run_cell, state_cell, tagged
from dembench.reports.ensembles import ensembles
from dembench.reports.figures import Drawing, draw
from dembench.reports.groups import Group
from dembench.reports.pages import write_page
from dembench.reports.pictures import Album, albums
from dembench.reports.published import published_times
from dembench.reports.ratios import ratios
from dembench.reports.sensitivity import Finding
from dembench.reports.study_figures import figures
from dembench.reports.tables import Cell, Column, Table, numbers, significant
from dembench.reports.units import shown_in
from dembench.reports.variants import Problem, Variant


@dataclass(frozen=True)
class Section:
    """The part of a page about one problem."""

    name: str
    title: str
    tag: str
    facts: facts.Facts
    drawings: tuple[Drawing, ...]
    albums: tuple[Album, ...]
    results: tuple[Table, ...]
    tables: tuple[Table, ...]


def render(
    recipe: Recipe, page: Page, problems: Sequence[Problem], findings: Sequence[Finding], output: Path, command: str
) -> Path:
    """Writes the page of a recipe as one HTML file that needs no other file and no network.

    Snapshots of pictures are written as VTKHDF files into a directory beside it; see `dembench.reports.report.render`.

    Args:
        recipe: The recipe.
        page: What the page shows.
        problems: Its problems; see `dembench.reports.variants.problems`.
        findings: What was found of quantities that must vary; see `dembench.reports.sensitivity.findings`.
        output: Path of the file.
        command: What reproduces it.

    Returns:
        The path of the file.
    """
    groups = [group for problem in problems for group in problem.groups]
    beside = output.with_name(f"{output.stem}-particles")
    sections = [_section(recipe, page, problem, findings, command, beside) for problem in problems]
    settings = facts.settings([_each_setting(problem) for problem in problems], [p.title for p in problems])
    tables = [facts.engines(groups), *settings, facts.load(groups), facts.all_runs(groups)]
    return write_page(
        "study.html.j2",
        output,
        {entry.look.colour for group in groups for entry in group.entries}.union(
            *(album.colours for section in sections for album in section.albums)
        ),
        [drawing for section in sections for drawing in section.drawings],
        title=recipe.title,
        summary=_summary(problems),
        text=recipe.text,
        warnings=[finding.sentence() for finding in findings if not finding.varies],
        ratios=ratios(groups),
        scenes=sections,
        engine_tables=[table for table in tables if table is not None and table.rows],
        environments=facts.environments(groups),
        failures=facts.failures(groups),
        command=command,
    )


def _each_setting(problem: Problem) -> Group:
    """One run of each setting that occurs."""
    members = [member for group in problem.groups for member in group.members]
    distinct = {(m.shown.spec.label(), repr(m.shown.spec.settings)): m for m in reversed(members)}
    return Group(problem.name, tuple(m for m in members if m in distinct.values()))


def _summary(problems: Sequence[Problem]) -> str:
    members = [m for problem in problems for group in problem.groups for m in group.members]
    states = Counter(STATE_NAMES.get(m.state, m.state) for m in members)
    counts = ", ".join(f"{count} {state}" for state, count in states.items())
    return f"{sum(states.values())} runs: {counts}. A run that is inaccurate is a finding here, not a fault."


def _section(
    recipe: Recipe, page: Page, problem: Problem, findings: Sequence[Finding], command: str, beside: Path
) -> Section:
    plots, results = figures(problem, page, command), [_table(recipe, problem, page.quantities)]
    if (study := recipe.sensitivity) is not None:
        curves = sensitivity.plot(study, problem, page.quantities, command)
        plots = [*([curves] if curves else []), *plots]
        results = [*([sensitivity.table(study, problem, findings)] if study.must_vary else []), *results]
        tables = []
    else:
        found = [(group, table) for group in problem.groups for table in (ensembles(group), published_times(group))]
        tables = [tagged(table, group) for group, table in found if table is not None]
    shown = [album for group in problem.groups for album in albums(group, command, beside, page.pictures)]
    return Section(
        name=problem.name,
        title=problem.title,
        tag=problem.tag,
        facts=facts.scene_facts(problem.groups[0]),
        drawings=tuple(draw(plot) for plot in plots),
        albums=tuple(shown),
        results=tuple(results),
        tables=tuple(tables),
    )


def _table(recipe: Recipe, problem: Problem, names: Sequence[str]) -> Table:
    """One row per variant: its state, seeds, quantities and loop time; at the end what they are compared with."""
    variants = problem.variants
    columns = [Column("Variant", kind="long")]
    cells: list[list[Cell]] = [[_name_cell(v) for v in variants] + [Cell("references")]]
    if recipe.sensitivity is not None:
        columns.append(Column(recipe.sensitivity.words.capitalize(), kind="number"))
        cells.append([Cell(str(v.value), v.value) for v in variants] + [Cell()])
    columns += [Column("State"), Column("Seeds", kind="number")]
    cells.append([state_cell(v.state) for v in variants] + [Cell()])
    cells.append([_seeds_cell(v) for v in variants] + [Cell()])
    sources: list[str] = []
    for name in names:
        if (known := problem.known(name)) is not None:
            unit, column = _quantity_column(problem, name, known.unit, sources)
            columns.append(Column(known.title, unit, "number wide"))
            cells.append(column)
    columns.append(Column("Loop time", "s", "number"))
    cells.append([*numbers([v.loop for v in variants]), Cell()])
    rows = list(zip(*cells, strict=True))
    return Table(
        f"{problem.name}-variants",
        "What each choice gives and costs",
        tuple(columns),
        tuple(rows if sources else rows[:-1]),
        "Means over the seeds, with half the range of the seeds where there are several.",
        tuple(f"[{k + 1}] {source}" for k, source in enumerate(sources)),
        problem.tag,
    )


def _quantity_column(problem: Problem, name: str, unit: str, sources: list[str]) -> tuple[str, list[Cell]]:
    """Unit and cells of a quantity, the reference last; its source is added to `sources`."""
    reference = problem.reference(name)
    means = [v.mean(name) for v in problem.variants]
    published = reference.value if reference else None
    factor, shown = shown_in(unit, [m for m in (*means, published) if m is not None])
    *column, last = numbers([None if m is None else factor * m for m in (*means, published)], digits=4, most=4)
    column = [_with_spread(cell, v, name, factor) for cell, v in zip(column, problem.variants, strict=True)]
    if reference is None:
        return shown, [*column, last]
    if reference.source not in sources:
        sources.append(reference.source)
    detail = _accepted(reference, factor)
    mark = f"[{sources.index(reference.source) + 1}]"
    return shown, [*column, replace(last, text=last.text or detail, detail=detail if last.text else "", flags=mark)]


def _accepted(reference: Reference, factor: float) -> str:
    low, high = (None if bound is None else significant(factor * bound) for bound in (reference.low, reference.high))
    if low and high:
        return f"{low} to {high}"
    return f"at least {low}" if low else f"at most {high}" if high else ""


def _name_cell(variant: Variant) -> Cell:
    detail = "reference" if variant.block.reference else variant.title
    divisions = {m.shown.spec.division for m in variant.members}
    shown = "" if detail == variant.choice else detail
    open_ = "open division" if divisions == {"open"} else ""
    colour = run_cell(variant.members[0]).colour
    return Cell(variant.choice, variant.choice, colour=colour, detail=", ".join(filter(None, (shown, open_))))


def _seeds_cell(variant: Variant) -> Cell:
    """How many seeds came to their end, and of how many where others did not."""
    ended, all_ = len(variant.ended), len(variant.members)
    return Cell(str(ended) if ended == all_ else f"{ended} of {all_}", ended)


def _with_spread(cell: Cell, variant: Variant, name: str, factor: float) -> Cell:
    values = variant.values(name)
    if len(values) < 2:
        return cell
    return Cell(cell.text, cell.value, detail=f"± {factor * (max(values) - min(values)) / 2:.2g}")
