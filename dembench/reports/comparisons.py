"""Tables that set runs beside each other: verdicts, quantities, differences."""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dembench.reports.cells import run_cell, state_cell
from dembench.reports.entries import Entry, common_times
from dembench.reports.groups import Ensemble, Group, Member
from dembench.reports.tables import Cell, Column, Table, decimals, grouped, numbers, significant
from dembench.reports.timings import RATIO, loop_cells, marks_explained, ratios
from dembench.reports.units import measure, shown_in
from dembench.scene import Trajectory
from dembench.scoring.score import Score

MOST_OUTSIDE = 2


# ---- verdicts


def verdicts(group: Group, title: str) -> Table:
    """One row per engine and setting: state, verdict in words, leading quantities, loop time, ratio.

    Of several seeds the quantities are means with their standard deviations, and the loop time is the median.
    """
    columns = [
        Column("Engine", kind="long"),
        Column("State"),
        Column("Verdict", kind="wrap"),
        Column("Loop time", "s", "number"),
        RATIO,
    ]
    rows = group.ensembles
    cells = [loop_cells(rows), ratios(rows)]
    for name in leading_quantities(group):
        known = next(s.quantity for m in group.members for s in m.shown.scores if s.quantity.name == name)
        values = [_values(e, name) for e in rows]
        factor, unit = shown_in(known.unit, [v for own in values for v in own])
        columns.append(Column(known.title, unit, "number wide"))
        means = numbers([factor * statistics.fmean(own) if own else None for own in values], digits=4, most=4)
        cells.append([_with_deviation(cell, own, factor) for cell, own in zip(means, values, strict=True)])
    table = [
        (
            run_cell(e, _seeds(e)),
            state_cell(e.state, _share(e)),
            Cell(verdict_text(e)),
            *(column[k] for column in cells),
        )
        for k, e in enumerate(rows)
    ]
    note = "Of several seeds: mean ± standard deviation, median of the loop times." if group.seeded else ""
    marks = marks_explained(cells[:1])
    return Table(f"{group.name}-verdicts", title, tuple(columns), tuple(table), note, marks)


def _values(ensemble: Ensemble, name: str) -> list[float]:
    """A quantity of every seed; of a run that did not come to its end where it is alone."""
    alone = ensemble.shown.quantity(name) if len(ensemble.members) == 1 else None
    return ensemble.values(name) or ([] if alone is None else [alone])


def _with_deviation(cell: Cell, values: Sequence[float], factor: float) -> Cell:
    if len(values) < 2:
        return cell
    return replace(cell, detail=f"± {significant(factor * statistics.stdev(values), 2)}")


def _seeds(ensemble: Ensemble) -> str:
    return f"{len(ensemble.members)} seeds" if len(ensemble.members) > 1 else ""


def _share(ensemble: Ensemble) -> str:
    """How many of several seeds are in the state that stands for all."""
    if len(ensemble.members) == 1:
        return ""
    return f"{sum(m.state == ensemble.state for m in ensemble.members)} of {len(ensemble.members)}"


def verdict_text(member: Member | Ensemble) -> str:
    """What came of a run, or of the first of several seeds that is in the state of all, in a sentence."""
    if isinstance(member, Ensemble):
        worst = next(m for m in member.members if m.state == member.state)
        several = len(member.members) > 1
        return (f"Seed {worst.shown.spec.seed}: " if several else "") + verdict_text(worst)
    entry = next((e for e in member.entries if e.state == member.state), member.shown)
    status = entry.status
    judged = [s for s in entry.scores if s.within is not None]
    match entry.state:
        case "failed" if status.state in ("ok", "inaccurate"):
            return "It ran to its end, and its result file cannot be read."
        case "ok" if not judged:
            return "Found accurate when it ran; its case is not known here."
        case "ok":
            return f"All {len(judged)} judged quantities lie within their references."
        case "unscored":
            held = f" {_conditions(judged)} held." if judged else ""
            return f"Ran to its end; there is no reference to compare with.{held}"
        case "inaccurate":
            outside = [s for s in judged if not s.within]
            if not outside:
                return _sentence(f"Found inaccurate when it ran: {status.detail}")
            shown = "; ".join(_outside(s) for s in outside[:MOST_OUTSIDE])
            more = f"; {len(outside) - MOST_OUTSIDE} more below" if len(outside) > MOST_OUTSIDE else ""
            return f"{len(outside)} of {len(judged)} judged quantities lie outside their references: {shown}{more}."
        case "missing":
            how = f"To get it: {status.install}" if status.install else ""
            return _sentence(f"Not run: {status.detail or status.reason}", how)
        case "skipped":
            return _sentence(f"Not run: {status.detail or status.reason}")
        case "running":
            return "Still going on; what is shown is what it has written so far."
        case _:
            reached = f"Reached {measure(entry.reached, 's')} of {measure(entry.spec.duration, 's')}"
            said = ": ".join(text for text in (status.reason, status.detail) if text)
            return _sentence(said[:1].upper() + said[1:], reached if entry.observables else "")


def _conditions(judged: Sequence[Score]) -> str:
    return (
        "One condition that every correct run meets"
        if len(judged) == 1
        else (f"The {len(judged)} conditions that every correct run meets")
    )


def _sentence(*parts: str) -> str:
    return " ".join(part if part.endswith(".") else f"{part}." for part in parts if part)


def _outside(score: Score) -> str:
    quantity, reference = score.quantity, score.reference
    assert reference is not None
    known = [v for v in (reference.low, reference.high) if v is not None]
    factor, unit = shown_in(quantity.unit, known)
    places = decimals([v * factor for v in known], digits=4, most=4)
    inside = span(reference.low, reference.high, factor, places)
    name = quantity.title[:1].lower() + quantity.title[1:]
    return f"{name} {grouped(quantity.value * factor, places)} {unit} (accepted {inside})"


def leading_quantities(group: Group, most: int = 3) -> list[str]:
    """Quantities with a reference that is more than a necessary condition, then others, in the order of the case."""
    scores = [s for m in group.members for s in m.shown.scores]
    named = dict.fromkeys(s.quantity.name for s in scores if s.reference and not s.reference.necessary)
    if not named:
        conditions = {s.quantity.name for s in scores if s.reference is not None}
        named = dict.fromkeys(s.quantity.name for s in scores if s.quantity.name not in conditions)
    return list(named)[:most]


def _score(entry: Entry, name: str) -> Score | None:
    return next((s for s in entry.scores if s.quantity.name == name), None)


# ---- quantities


def quantities(group: Group) -> Table | None:
    """One row per quantity and reference, one column per run; None where there are none, or several seeds to show."""
    members = [m for m in group.members if m.shown.scores]
    if not members or group.seeded:
        return None
    keys = dict.fromkeys(_key(s) for m in members for s in m.shown.scores)
    order = list(dict.fromkeys(key[0] for key in keys))
    sources = list(dict.fromkeys(s.reference.source for m in members for s in m.shown.scores if s.reference))
    rows = [_quantity_row(key, members, sources) for key in sorted(keys, key=lambda key: order.index(key[0]))]
    columns = (
        Column("Quantity", kind="wrap"),
        Column("Unit"),
        Column("Reference", kind="number"),
        Column("Accepted", kind="number", note="range within which a run passes"),
        *(Column(m.label, "value, error", "number run") for m in members),
        Column("Kind", kind="long"),
        Column("Source"),
    )
    notes = (
        "Error: value minus reference; for a pure bound the distance beyond it. "
        "\u2713 lies within the accepted range, \u2260 outside; without a sign nothing is judged.",
        *(f"[{k + 1}] {source}" for k, source in enumerate(sources)),
    )
    title = "Quantities and references"
    return Table(f"{group.name}-quantities", title, columns, tuple(rows), footnotes=notes)


Key = tuple[str, float | None, float | None, float | None, str]


def _key(score: Score) -> Key:
    reference = score.reference
    if reference is None:
        return (score.quantity.name, None, None, None, "")
    return (score.quantity.name, reference.value, reference.low, reference.high, reference.source)


def _quantity_row(key: Key, members: Sequence[Member], sources: Sequence[str]) -> tuple[Cell, ...]:
    found = [next((s for s in m.shown.scores if _key(s) == key), None) for m in members]
    one = next(s for s in found if s is not None)
    _, value, low, high, source = key
    known = [v for v in (value, low, high) if v is not None]
    values = [s.quantity.value for s in found if s is not None]
    factor, unit = shown_in(one.quantity.unit, known + values)
    pure_bound = value is None and known
    places = decimals([v * factor for v in known or values], digits=3 if pure_bound else 4, most=4)
    kind = one.reference.kind + (", necessary" if one.reference.necessary else "") if one.reference else ""
    return (
        Cell(one.quantity.title),
        Cell(unit),
        Cell() if value is None else Cell(grouped(value * factor, places), value * factor),
        Cell(span(low, high, factor, places)),
        *(_scored_cell(s, factor, places) for s in found),
        Cell(kind),
        Cell(f"[{sources.index(source) + 1}]") if source else Cell(),
    )


def _scored_cell(score: Score | None, factor: float, places: int) -> Cell:
    if score is None:
        return Cell()
    value = score.quantity.value * factor
    detail = ""
    if score.error:
        detail = ("+" if score.error > 0 else "") + significant(score.error * factor, 2)
    tone = {True: "within", False: "outside", None: ""}[score.within]
    return Cell(grouped(value, places), value, detail=detail, tone=tone)


def span(low: float | None, high: float | None, factor: float, places: int) -> str:
    """A range as text; a side that is None is open, and two such are no range."""
    lower, upper = ("" if v is None else grouped(v * factor, places) for v in (low, high))
    if lower and upper:
        return f"{lower} to {upper}"
    return f"at least {lower}" if lower else f"at most {upper}" if upper else ""


# ---- differences


def comparable(group: Group, name: str) -> list[tuple[Member, Member]]:
    """Pairs of complete runs that recorded a series, from one initial state: that of the lowest seed of several."""
    having = [m for m in group.members if m.shown.complete and name in m.shown.observables]
    first = min((m.shown.spec.seed for m in having), default=0)
    return list(itertools.combinations([m for m in having if m.shown.spec.seed == first], 2))


def differences(group: Group) -> Table | None:
    """Largest and root-mean-square difference of the tracked displacements of each two runs; None without two."""
    scene = group.first.scene
    names = [f"{o.name}_displacement" for o in scene.observables if isinstance(o, Trajectory)] if scene else []
    found = []
    for name in names:
        for a, b in comparable(group, name):
            first, second = a.shown.observables[name], b.shown.observables[name]
            rows, other = common_times(first, second)
            if len(rows) > 1:
                apart = np.abs(first.value[rows] - second.value[other])
                worst = int(np.argmax(apart))
                time = first.time[rows]
                found.append((a, b, first.title, apart.max(), time[worst], np.sqrt(np.mean(apart**2)), time[-1]))
    if not found:
        return None
    factor, unit = shown_in("m", [row[3] for row in found])
    time_factor, time_unit = shown_in("s", [row[6] for row in found])
    largest = numbers([row[3] * factor for row in found], digits=2)
    rms = numbers([row[5] * factor for row in found], digits=2)
    at = numbers([row[4] * time_factor for row in found])
    columns = (
        Column("Engine", kind="long"),
        Column("Other engine", kind="long"),
        Column("Series", kind="long"),
        Column("Largest difference", unit, "number"),
        Column("at", time_unit, "number"),
        Column("Root mean square", unit, "number"),
    )
    table = tuple(
        (run_cell(a), run_cell(b), Cell(title), largest[k], at[k], rms[k]) for k, (a, b, title, *_) in enumerate(found)
    )
    return Table(
        f"{group.name}-differences",
        "Differences between runs",
        columns,
        table,
        note="Between each two runs that reached the end, over the times that both recorded."
        + (" Of several seeds the lowest is compared." if group.seeded else ""),
    )
