"""The timing table, and what its marks say."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from dembench.reports.cells import run_cell, state_cell
from dembench.reports.entries import RANKED, Entry
from dembench.reports.groups import Ensemble, Group, Member
from dembench.reports.tables import Cell, Column, Table, numbers, significant
from dembench.reports.units import shown_in

RATIO = Column(
    "Ratio", "to fastest", "number", "loop time relative to that of the fastest run that is ok and of the division"
)
MARKS = {
    "c": "c: contended, other programs used its cores before or while it ran, so the time is overstated.",
    "l": "l: another contact law than the scene's; such a time compares methods, not implementations, and is not "
    "ranked in the closed division; a run with `--division open` ranks it.",
    "p": "p: partial, the run ended before its simulated time; the time is that of the part.",
    "r": "r: resumed from a checkpoint after an interruption; the time is that of all attempts together.",
    "s": "s: own time step, not that of the closed division; such a time compares methods, not implementations, and is "
    "not ranked; a run with `--division open` compares engines each in its best way.",
    "w": "w: wall time of the engine's process, since the engine gives no time of its stepping loop.",
}


def ratios(runs: Sequence[Member | Ensemble]) -> list[Cell]:
    """Median loop time of each that is ok and keeps to its division, relative to the shortest of them.

    Runs of the two divisions are ranked apart.
    """
    loops = [run.loop if run.state in RANKED and run.shown.of_division else None for run in runs]
    divisions = [run.shown.spec.division for run in runs]
    fastest = {
        name: min((loop for loop, own in zip(loops, divisions, strict=True) if loop and own == name), default=None)
        for name in divisions
    }
    return numbers(
        [loop / best if loop and (best := fastest[own]) else None for loop, own in zip(loops, divisions, strict=True)]
    )


def timings(group: Group) -> Table | None:
    """The timing table: only runs that are ok get a ratio; the marks say what else to know.

    Imported results are not in it: their times were taken elsewhere. None where there are no others.
    """
    group = Group(group.name, tuple(m for m in group.members if not m.shown.spec.imported))
    if not group.members:
        return None
    shown = [m.shown for m in group.members]
    loops = [_loop(m) for m in group.members]
    bodies = group.first.spec.bodies
    steps = [e.steps for e in shown]
    rates = [bodies * n / t / 1e6 if n and t else None for n, t in zip(steps, loops, strict=True)]
    pace = [e.reached / t if t and e.reached else None for e, t in zip(shown, loops, strict=True)]
    cores = [e.spec.cores for e in shown]
    pace_factor, pace_unit = shown_in("s", [p for p in pace if p is not None])
    columns: list[tuple[Column, list[Cell]]] = [
        (Column("Engine", kind="long"), [run_cell(m, _settings(m)) for m in group.members]),
        (Column("State"), [state_cell(m.state) for m in group.members]),
        (Column("Loop time", "s", "number", "median of the repeats"), loop_cells(group.members)),
        (RATIO, ratios(group.members)),
        (Column("Particle-steps", "10⁶/s", "number"), numbers(rates)),
        (
            Column("Core-seconds", "s", "number", "loop time times cores"),
            numbers([t * c if t else None for t, c in zip(loops, cores, strict=True)]),
        ),
        (
            Column("Simulated per wall time", f"{pace_unit}/s", "number"),
            numbers([p * pace_factor if p else None for p in pace]),
        ),
        (Column("Peak memory", "MB", "number"), numbers([_megabytes(e) for e in shown], digits=2)),
        (Column("Time step", "s", "number"), [_step(e) for e in shown]),
        (Column("Steps", kind="number"), numbers(steps, digits=1)),
        (Column("Cores", "or ranks", "number"), numbers(cores, digits=1)),
        (Column("Precision"), [Cell(e.spec.precision) for e in shown]),
        (Column("Device"), [Cell(e.spec.device) for e in shown]),
        (Column("Spread of repeats", "s", "number", "shortest to longest"), [_spread(m) for m in group.members]),
        (Column("Set-up", "s", "number"), _part(shown, "set_up")),
        (Column("Compile", "s", "number"), _part(shown, "compile")),
        (Column("Output", "s", "number"), _part(shown, "output")),
    ]
    rows = tuple(tuple(cells[k] for _, cells in columns) for k in range(len(group.members)))
    return Table(
        f"{group.name}-timings",
        "Timings",
        tuple(column for column, _ in columns),
        rows,
        note="Only runs that are ok and keep to their division are compared: accuracy comes before speed.",
        footnotes=(*_measured_by(group), *marks_explained(rows)),
    )


def marks(entries: Sequence[Entry]) -> str:
    """The letters of `MARKS` that apply to the repeats of a run."""
    timed = [e for e in entries if e.loop is not None]
    found = "c" if any(e.status.contended for e in entries) else ""
    found += "p" if any(not e.complete for e in timed) else ""
    found += "l" if any(e.spec.law for e in timed) else ""
    found += "r" if any(e.status.resumed for e in timed) else ""
    found += "s" if any(e.own_step for e in timed) else ""
    return found + ("w" if any(e.timing.get("source") == "wall" for e in timed) else "")


def marks_explained(rows: Iterable[Sequence[Cell]]) -> tuple[str, ...]:
    """One line for each mark that the cells carry."""
    used = {letter for row in rows for cell in row for letter in cell.flags}
    return tuple(text for letter, text in MARKS.items() if letter in used)


def _measured_by(group: Group) -> tuple[str, ...]:
    sources = {str(e.timing.get("source", "")) for e in group.entries if e.loop is not None} - {"", "wall"}
    return (f"Loop times without the mark w were measured by: {', '.join(sorted(sources))}.",) if sources else ()


def loop_cells(runs: Sequence[Member | Ensemble]) -> list[Cell]:
    """Loop times with their marks [s]; of a run that has not come to its end, that of the part."""
    return [
        Cell(cell.text, cell.value, flags=marks(run.entries)) if cell.text else cell
        for cell, run in zip(numbers([_loop(run) for run in runs]), runs, strict=True)
    ]


def _loop(run: Member | Ensemble) -> float | None:
    return run.loop if run.loop is not None else run.shown.loop


def _spread(member: Member) -> Cell:
    if len(member.loops) < 2:
        return Cell()
    low, high = min(member.loops), max(member.loops)
    return Cell(f"{significant(low)} to {significant(high)} ({len(member.loops)})", high - low)


def _settings(member: Member) -> str:
    """Settings that are not columns of their own."""
    kept = {key: value for key, value in member.shown.spec.settings.items() if key != "dt"}
    return ", ".join(f"{key}={f'{v:g}' if isinstance(v, float) else v}" for key, v in kept.items())


def _step(entry: Entry) -> Cell:
    return Cell(significant(entry.dt), entry.dt) if entry.dt is not None else Cell()


def _part(entries: Sequence[Entry], name: str) -> list[Cell]:
    return numbers([e.timing.get(name) for e in entries], digits=2, most=3)


def _megabytes(entry: Entry) -> float | None:
    peak = entry.resources.get("peak_memory")
    return peak / 1e6 if peak else None
