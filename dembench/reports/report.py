"""One page of everything that is known about some runs: opens offline, asks nobody for anything."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dembench.reports import comparisons, facts
from dembench.reports.case_figures import case_plots, replaced
from dembench.reports.cells import tagged
from dembench.reports.curves import plots
from dembench.reports.ensembles import ensembles, seed_plot, single_runs
from dembench.reports.figures import Drawing, draw
from dembench.reports.groups import Group, gather
from dembench.reports.imported import imported_runs
from dembench.reports.pages import write_page
from dembench.reports.passport_tables import measured_law
from dembench.reports.pictures import Album, albums
from dembench.reports.published import published_results, published_times
from dembench.reports.ratios import ratios
from dembench.reports.tables import Table
from dembench.reports.timings import timings
from dembench.runs.directory import RunRecord

STATE_ORDER = ("ok", "unscored", "inaccurate", "failed", "timeout", "interrupted", "running", "skipped", "missing")


@dataclass(frozen=True)
class SceneSection:
    """The part of a page about one group of runs."""

    name: str
    title: str
    short_title: str
    source: str
    facts: facts.Facts
    tag: str
    drawings: tuple[Drawing, ...]
    albums: tuple[Album, ...]
    verdicts: Table
    tables: tuple[Table, ...]
    commands: tuple[str, ...]


def render(runs: Sequence[RunRecord], output: Path, title: str = "Granular benchmark report") -> Path:
    """Writes the report of some runs as one HTML file that needs no other file and no network.

    Where it has pictures of particles, their snapshots are written as VTKHDF files into a directory beside it, which
    is called after the page: `report-particles/RUN/SNAPSHOT.vtkhdf`.

    Args:
        runs: Runs in any state; every one of them has its row.
        output: Path of the file.
        title: Heading of the page.

    Returns:
        The path of the file.
    """
    groups = gather(runs)
    beside = output.with_name(f"{output.stem}-particles")
    sections = [_section(group, beside) for group in groups]
    titles = [section.short_title for section in sections]
    tables = [
        imported_runs(groups),
        facts.engines(groups),
        *facts.settings(groups, titles),
        facts.load(groups),
        facts.counters(groups),
    ]
    return write_page(
        "page.html.j2",
        output,
        {entry.look.colour for group in groups for entry in group.entries}.union(
            *(album.colours for section in sections for album in section.albums)
        ),
        [drawing for section in sections for drawing in section.drawings],
        title=title,
        summary=_summary(groups),
        scenes=sections,
        ratios=ratios(groups),
        all_runs=facts.all_runs(groups),
        engine_tables=[table for table in tables if table is not None and table.rows],
        environments=facts.environments(groups),
        failures=facts.failures(groups),
    )


def _section(group: Group, beside: Path) -> SceneSection:
    entry = group.first
    case = entry.problem[0] if entry.problem else None
    short = f"{facts.problem_name(entry)}, {entry.spec.division}"
    commands = _commands(group)
    command = "\n".join(commands)
    shown = [*case_plots(group, command), *plots(group, command, replaced(group)), seed_plot(group, command)]
    found = (
        comparisons.quantities(group),
        ensembles(group),
        single_runs(group),
        comparisons.differences(group),
        measured_law(group),
        timings(group),
        published_results(group),
        published_times(group),
    )
    return SceneSection(
        name=group.name,
        title=f"{case.title} ({short} division)" if case else f"{short} division",
        short_title=short,
        source=case.source if case else "",
        facts=facts.scene_facts(group),
        tag=group.tag,
        drawings=tuple(draw(plot) for plot in shown if plot is not None),
        albums=tuple(albums(group, command, beside)),
        verdicts=tagged(comparisons.verdicts(group, short), group),
        tables=tuple(tagged(table, group) for table in found if table is not None),
        commands=commands,
    )


def _commands(group: Group) -> tuple[str, ...]:
    """The commands on record; for runs without one, the command that their specs amount to; then the report's."""
    recorded: dict[str, None] = {}
    for entry in group.entries:
        result = entry.record.result
        if result is not None and (command := result.provenance.get("command")):
            recorded[str(command)] = None
    where = group.first.record.directory.parent.name or "."
    return (*(recorded or {_command(group): None}), f"dembench report {shlex.quote(where)} -o report.html")


def _command(group: Group) -> str:
    spec = group.first.spec
    engines = dict.fromkeys(e.spec.label() for e in group.entries)
    seeds = sorted({e.spec.seed for e in group.entries})
    words = ["dembench", "run", spec.case, "--engines", ",".join(engines), "--division", spec.division]
    if spec.preset:
        words += ["--preset", spec.preset]
    if seeds != [0]:
        words += ["--seeds", ",".join(map(str, seeds))]
    if (repeats := max(e.spec.repeat for e in group.entries)) > 1:
        words += ["--repeat", str(repeats)]
    return shlex.join(words)


def _summary(groups: Sequence[Group]) -> str:
    entries = [entry for group in groups for entry in group.entries]
    counts = Counter(entry.state for entry in entries)
    states = [f"{counts[s]} {'ok (unscored)' if s == 'unscored' else s}" for s in STATE_ORDER if counts[s]]
    engines = {entry.spec.engine for entry in entries}
    days = sorted({entry.status.started[:10] for entry in entries if entry.status.started})
    when = f" Run on {days[0]}." if len(days) == 1 else f" Run from {days[0]} to {days[-1]}." if days else ""
    return (
        f"{_counted(len(entries), 'run')} of {_counted(len(engines), 'engine')} on {_counted(len(groups), 'problem')}: "
        f"{', '.join(states) or 'none'}.{when}"
    )


def _counted(number: int, word: str) -> str:
    return f"{number} {word}" if number == 1 else f"{number} {word}s"
