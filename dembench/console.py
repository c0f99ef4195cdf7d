"""What is shown in a terminal: tables, the live table of runs, progress of generated beds."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar
from rich.table import Table
from rich.text import Text

from dembench.cases.registry import problem_title
from dembench.initial.progress import Progress, silent
from dembench.runs.plan import PlannedRun
from dembench.runs.scheduler import Job
from dembench.verification.rows import Row

COLOURS = {
    "running": "cyan",
    "ok": "green",
    "inaccurate": "yellow",
    "failed": "red",
    "timeout": "red",
    "interrupted": "magenta",
    "skipped": "bright_black",
    "missing": "bright_black",
}
PLAIN_INTERVAL = 15.0
"""Time between two lines about a run that goes on, where there is no terminal [s]."""
LIVE_INTERVAL = 1.0
"""Time between two pictures of the live table [s]: drawing one takes some milliseconds of a core."""
PLAIN_WIDTH = 160
"""Width of tables where there is no terminal [letters]."""

out = Console(highlight=False, width=None if sys.stdout.isatty() else PLAIN_WIDTH)
err = Console(stderr=True, highlight=False)


def duration(value: float | None) -> str:
    """A time in words: `45 s`, `3 min 20 s`, `2 h 5 min`."""
    if value is None:
        return "not known"
    if value < 100:
        return f"{value:.2g} s" if value < 10 else f"{value:.0f} s"
    minutes, rest = divmod(round(value), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s" if rest else f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60} min"


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Prints a table; texts are shown as they are."""
    made = Table(box=None, pad_edge=False, header_style="bold")
    for column in columns:
        made.add_column(column, overflow="fold")
    for row in rows:
        made.add_row(*(Text(cell) for cell in row))
    out.print(made)


def line(text: str, style: str | None = None) -> None:
    """Prints one line as it is, never broken."""
    out.print(Text(text, style=style or ""), soft_wrap=True)


def error(text: str) -> None:
    """Prints one message about what is wrong."""
    err.print(Text(f"error: {text}", style="red"), soft_wrap=True)


def plan_rows(runs: Sequence[PlannedRun], fresh: bool) -> list[dict[str, Any]]:
    """What would be done, as plain data."""
    return [
        {
            "name": run.spec.name().rpartition("__")[0] if run.unsettled else run.spec.name(),
            "hash": None if run.unsettled else run.spec.digest(),
            "initial": "to be generated" if run.unsettled else "ready",
            "action": run.action(fresh),
            "case": run.spec.case,
            "preset": run.spec.preset,
            "problem": problem_title(run.spec.case, run.spec.preset),
            "engine": run.spec.label(),
            "settings": run.spec.settings,
            "division": run.spec.division,
            "seed": run.spec.seed,
            "repeat": run.spec.repeat,
            "cores": run.spec.cores,
            "estimate": run.spec.estimate,
            "before": run.before.label() if run.before else None,
            "checkpoint": run.checkpoint.time if run.checkpoint and not fresh else None,
            "detail": "; ".join(run.unsupported) or run.probe.reason,
        }
        for run in runs
    ]


def check_rows(rows: Sequence[Row]) -> None:
    """Prints the rows of a suite, with the published number beside each that has one."""
    with_page = any(row.check.published for row in rows)
    columns = ("id", "check", "engine", "measured", "expected", "status")
    shown = []
    for row in rows:
        check, page = row.check, row.check.published
        cells = (
            check.id,
            check.title,
            row.engine,
            "-" if row.measured is None else f"{row.measured:.6g} {_unit(check.unit)}".strip(),
            check.range_text(),
            row.status if not row.detail else f"{row.status}: {row.detail}",
        )
        published = (
            "-" if page is None else f"{page.value:.5g}",
            "-" if page is None else f"{page.expected:.4g} ± {page.tolerance:g}",
            {True: "yes", False: "no", None: "-"}[row.inside_published],
        )
        shown.append((*cells, *published) if with_page else cells)
    table((*columns, "page", "it expects", "inside it") if with_page else columns, shown)
    for note in dict.fromkeys(row.check.published.note for row in rows if row.check.published):
        if note:
            line(note)


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit


@contextmanager
def bar(quiet: bool) -> Iterator[Progress]:
    """A progress bar on the error stream for work before the runs; it vanishes when done.

    What libraries print meanwhile is left out: the output is what the verb says it is.
    """
    with redirect_stdout(StringIO()):
        if quiet or not err.is_terminal:
            yield silent if quiet else _Lines()
            return
        columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
        with Bar(*columns, console=err, transient=True, redirect_stdout=False) as shown:
            task = shown.add_task("preparing", total=1.0, visible=False)

            def update(fraction: float, message: str) -> None:
                shown.update(task, completed=fraction, description=message, visible=True)

            yield update


class _Lines:
    """Progress of preparations as plain lines, one in `PLAIN_INTERVAL` seconds."""

    def __init__(self) -> None:
        self._next = 0.0

    def __call__(self, fraction: float, message: str) -> None:
        if time.monotonic() >= self._next:
            err.print(Text(f"{fraction:4.0%} {message}"), soft_wrap=True)
            self._next = time.monotonic() + PLAIN_INTERVAL


class Display:
    """Shows jobs: a live table in a terminal, plain lines elsewhere, nothing where quiet."""

    def __init__(self, quiet: bool) -> None:
        """Prepares the display."""
        self._quiet = quiet
        self._live = Live(console=out, auto_refresh=False) if out.is_terminal and not quiet else None
        self._shown: dict[str, tuple[str | None, float]] = {}
        self._next = 0.0

    def __enter__(self) -> Display:
        if self._live:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._live.stop()

    def update(self, jobs: Sequence[Job]) -> None:
        """Shows the jobs as they are now."""
        if self._quiet:
            return
        if self._live:
            if time.monotonic() >= self._next or all(job.status is not None for job in jobs):
                self._live.update(_jobs_table(jobs), refresh=True)
                self._next = time.monotonic() + LIVE_INTERVAL
            return
        for job in jobs:
            self._plain(job)

    def _plain(self, job: Job) -> None:
        name, state = job.run.spec.name(), _state(job)
        before, when = self._shown.get(name, (None, 0.0))
        if state is None or (state == before and (state != "running" or time.monotonic() < when + PLAIN_INTERVAL)):
            return
        self._shown[name] = (state, time.monotonic())
        if job.status is None:
            line(f"{name}: {state} {_reached(job)} ({job.run.spec.label()})")
        else:
            line(f"{name}: {_ending(job)}")
        sys.stdout.flush()


def _ending(job: Job) -> str:
    assert job.status is not None
    parts = [job.status.label()]
    if job.action == "reuse":
        parts.append("reused")
    elif job.status.wall is not None:
        parts.append(duration(job.status.wall))
    parts += [f"gone on from t = {there.time:.4g} s" for there in job.status.resumed[-1:]]
    notes = (job.status.note, job.status.detail, job.status.install and f"install: {job.status.install}")
    parts += [text for text in notes if text]
    if job.status.contended:
        parts.append("contended")
    return ", ".join(parts)


def _jobs_table(jobs: Sequence[Job]) -> Table:
    made = Table(box=None, pad_edge=False, header_style="bold")
    for column in ("run", "engine", "state", "simulated", "done", "time", "left", "memory", ""):
        made.add_column(column, no_wrap=column not in ("run", "engine", ""), overflow="fold")
    for job in jobs:
        progress, state = job.progress, _state(job)
        running = state == "running"
        elapsed = job.status.wall if job.status and job.status.wall is not None else progress.elapsed
        made.add_row(
            Text(job.run.spec.name()),
            Text(job.run.spec.label()),
            Text(job.status.label() if job.status else state or "waiting", style=COLOURS.get(state or "", "")),
            Text(f"{progress.time:.4g} of {job.run.spec.duration:.4g} s" if running else ""),
            Text(f"{progress.fraction:.1%}" if running else ""),
            Text(duration(elapsed) if elapsed else ""),
            Text(_left(job) if running else ""),
            Text(f"{progress.memory / 1e6:.0f} MB" if progress.memory else ""),
            Text("reused" if job.action == "reuse" else progress.note, style="bright_black"),
        )
    return made


def _reached(job: Job) -> str:
    """How far a run is, for a line: `t = 0.31 of 5 s, 6.2%, 3 h 20 min left`."""
    progress, left = job.progress, _left(job)
    share = f"t = {progress.time:.4g} of {job.run.spec.duration:.4g} s, {progress.fraction:.1%}"
    return f"{share}, {left} left" if left else share


def _state(job: Job) -> str | None:
    """State as shown: a run has ended once its job has a status."""
    if job.status is not None:
        return job.status.state
    return "running" if job.progress.state is not None else None


def _left(job: Job) -> str:
    left = job.progress.left()
    if left is None and job.run.spec.estimate is not None:
        left = max(0.0, job.run.spec.estimate - job.progress.elapsed)
    return duration(left) if left is not None else ""
