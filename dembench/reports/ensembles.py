"""Tables of ensembles: every quantity over the seeds of one engine, the reference beside; and the single runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dembench.cases.base import Reference
from dembench.reports.cells import run_cell, state_cell
from dembench.reports.comparisons import leading_quantities, span
from dembench.reports.groups import Ensemble, Group
from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.reports.tables import Cell, Column, Table, decimals, grouped, numbers
from dembench.reports.units import labelled, shown_in
from dembench.scoring.ensembles import Ensemble as Seeds
from dembench.scoring.score import Score


def ensembles(group: Group) -> Table | None:
    """One row per quantity, reference and engine: mean, standard deviation, standard error and range over the seeds.

    None where every engine has one seed. Necessary conditions are left to the single runs.
    """
    if not group.seeded:
        return None
    scored = [(ensemble, score) for ensemble in group.ensembles for score in _distinct(ensemble)]
    order = list(dict.fromkeys(score.quantity.name for _, score in scored))
    scored.sort(key=lambda found: order.index(found[1].quantity.name))
    sources = list(dict.fromkeys(s.reference.source for _, s in scored if s.reference))
    rows: list[tuple[Cell, ...]] = []
    for name in order:
        own = [(e, s) for e, s in scored if s.quantity.name == name]
        rows += _rows(own, sources)
    columns = (
        Column("Quantity", kind="long"),
        Column("Unit"),
        Column("Engine", kind="long"),
        Column("Seeds", kind="number"),
        Column("Mean", kind="number"),
        Column("Standard deviation", kind="number", note="of single runs, with n − 1"),
        Column("Standard error", kind="number", note="of the mean"),
        Column("Range", kind="number", note="lowest to highest"),
        Column("Reference", "and source", "number"),
        Column("Accepted", kind="number", note="range within which a single run passes"),
        Column("Inside", kind="number", note="seeds inside the accepted range"),
    )
    return Table(
        f"{group.name}-ensembles",
        "Ensembles: quantities over the seeds",
        columns,
        tuple(rows),
        note="Runs that came to their end, one per seed. The accepted range is one of single runs, not of means.",
        footnotes=tuple(f"[{k + 1}] {source}" for k, source in enumerate(sources)),
    )


def _distinct(ensemble: Ensemble) -> list[Score]:
    """One score for each quantity and reference of the seeds, without necessary conditions."""
    found: dict[tuple[str, Reference | None], Score] = {}
    for member in ensemble.ended:
        for score in member.shown.scores:
            if score.reference is None or not score.reference.necessary:
                found.setdefault((score.quantity.name, score.reference), score)
    return list(found.values())


def _rows(scored: Sequence[tuple[Ensemble, Score]], sources: Sequence[str]) -> list[tuple[Cell, ...]]:
    """The rows of one quantity, with the same number of decimals in all."""
    spreads = [Seeds(ensemble.values(score.quantity.name)) for ensemble, score in scored]
    bounds = [b for _, s in scored if s.reference for b in (s.reference.value, s.reference.low, s.reference.high)]
    known = [v for spread in spreads for v in spread.values.tolist()] + [b for b in bounds if b is not None]
    factor, unit = shown_in(scored[0][1].quantity.unit, known)
    places = decimals([factor * v for v in known], digits=4, most=4)
    scatter = [factor * v for spread in spreads for v in _scatter(spread) if v]
    fine = decimals(scatter, digits=2, most=5)

    def cell(value: float | None, digits: int = places, detail: str = "") -> Cell:
        return Cell() if value is None else Cell(grouped(factor * value, digits), factor * value, detail=detail)

    rows: list[tuple[Cell, ...]] = []
    for (ensemble, score), spread in zip(scored, spreads, strict=True):
        reference = score.reference
        judged = reference is not None and not (reference.low is None and reference.high is None)
        source = f"[{sources.index(reference.source) + 1}]" if reference else ""
        inside = sum(_inside(v, score) for v in spread.values) if judged else 0
        rows.append(
            (
                Cell(score.quantity.title),
                Cell(unit),
                run_cell(ensemble),
                Cell(str(len(spread.values)), len(spread.values)),
                cell(float(spread.mean)),
                *(cell(value, fine) for value in _scatter(spread)),
                _range(spread, factor, places),
                cell(reference.value, places, source) if reference else Cell(),
                Cell(span(reference.low, reference.high, factor, places) if reference else ""),
                Cell(f"{inside} of {len(spread.values)}", inside, tone=_tone(inside, spread)) if judged else Cell(),
            )
        )
    return rows


def _scatter(spread: Seeds) -> tuple[float | None, float | None]:
    """Standard deviation and standard error; None of one seed."""
    return (float(spread.deviation), float(spread.error)) if len(spread) > 1 else (None, None)


def _range(spread: Seeds, factor: float, places: int) -> Cell:
    if len(spread) < 2:
        return Cell()
    low, high = min(spread.values), max(spread.values)
    return Cell(span(low, high, factor, places), factor * low)


def _tone(inside: int, spread: Seeds) -> str:
    return "within" if inside == len(spread.values) else "outside"


def _inside(value: float, score: Score) -> bool:
    """Whether a value lies in the accepted range of a score's reference."""
    reference = score.reference
    assert reference is not None
    return (reference.low is None or value >= reference.low) and (reference.high is None or value <= reference.high)


def single_runs(group: Group) -> Table | None:
    """One row per run, one column per quantity without necessary conditions; None where all have one seed."""
    if not group.seeded:
        return None
    names: dict[str, Score] = {}
    for ensemble in group.ensembles:
        for score in _distinct(ensemble):
            names.setdefault(score.quantity.name, score)
    columns = [Column("Engine", kind="long"), Column("Seed", kind="number"), Column("State")]
    cells: list[list[Cell]] = []
    for name, one in names.items():
        values = [m.shown.quantity(name) for m in group.members]
        factor, unit = shown_in(one.quantity.unit, [v for v in values if v is not None])
        columns.append(Column(one.quantity.title, unit, "number wide"))
        cells.append(numbers([None if v is None else factor * v for v in values], digits=4, most=4))
    rows = tuple(
        (
            run_cell(m),
            Cell(str(m.shown.spec.seed), m.shown.spec.seed),
            state_cell(m.state),
            *(column[k] for column in cells),
        )
        for k, m in enumerate(group.members)
    )
    return Table(f"{group.name}-single-runs", "Single runs", tuple(columns), rows)


# ---- the figure


def seed_plot(group: Group, command: str) -> Plot | None:
    """The leading quantities of every seed, with the mean and standard deviation of each engine; None without seeds."""
    if not group.seeded:
        return None
    panels = [panel for name in leading_quantities(group) if (panel := _seed_panel(group, name)) is not None]
    if not panels:
        return None
    return Plot(
        name=f"{group.name}-seeds",
        title="Quantities by seed",
        caption="A seed is one initial state, the same for all engines. Lines and bands: mean and standard deviation "
        "of an engine over its seeds. Grey: the reference and the range that it accepts of single runs.",
        x_label="Seed",
        panels=tuple(panels),
        command=command,
        tag=group.tag,
    )


def _seed_panel(group: Group, name: str) -> Panel | None:
    found = []
    for ensemble in group.ensembles:
        seen = [(m.shown.spec.seed, v) for m in ensemble.ended if (v := m.shown.quantity(name)) is not None]
        if seen:
            found.append((ensemble, np.array(seen, dtype=float)))
    if not found:
        return None
    scores = [s for e, _ in found for s in _distinct(e) if s.quantity.name == name]
    factor, unit = shown_in(scores[0].quantity.unit, *(pairs[:, 1] for _, pairs in found))
    seeds = [seed for _, pairs in found for seed in pairs[:, 0]]
    ends = np.linspace(min(seeds) - 0.3, max(seeds) + 0.3, 21)
    lines = []
    for k, (ensemble, pairs) in enumerate(found):
        colour, spread = ensemble.shown.look.colour, Seeds(factor * pairs[:, 1])
        style = ensemble.members[0].style
        lines.append(Line(ensemble.label, pairs[:, 0], factor * pairs[:, 1], colour, k, points=True))
        if len(spread) > 1:
            mean = np.full_like(ends, spread.mean)
            band = mean - spread.deviation, mean + spread.deviation
            lines.append(Line(f"{ensemble.label}, mean", ends, mean, colour, style, low=band[0], high=band[1]))
    known: list[Known] = []
    for reference in dict.fromkeys(s.reference for s in scores if s.reference and s.reference.value is not None):
        level = np.full_like(ends, factor * (reference.value or 0.0))
        low, high = (None if v is None else np.full_like(ends, factor * v) for v in (reference.low, reference.high))
        known.append(Known(f"reference, {reference.kind}", ends, level, low, high, points=False, style=len(known)))
    return Panel(labelled("Value", unit), tuple(lines), tuple(known), log_y=False, title=scores[0].quantity.title)
