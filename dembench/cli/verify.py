"""The verb that runs scenes whose answers are known."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from dembench import campaign, console
from dembench.cli.options import Engines, Fresh, Json, print_json, usage_errors
from dembench.runs.directory import find_runs
from dembench.runs.environment import available_cores
from dembench.runs.plan import PlannedRun, RequestError, split_list
from dembench.verification import campaign as verification
from dembench.verification import suites as suite_registry
from dembench.verification.checks import TIERS, Suite, Tier
from dembench.verification.rows import MEASURED, Row, all_right


def verify(
    suite: Annotated[str, typer.Option(help="suites, as a,b; default: what takes minutes of all of them")] = "",
    tier: Annotated[
        Tier | None, typer.Option(help="longest experiments that are run; default: all of the suites that are named")
    ] = None,
    only: Annotated[str, typer.Option(help="experiments with checks whose ids begin so, as D7,CO4")] = "",
    engines: Engines = None,
    timeout: Annotated[str, typer.Option(help="time limit of each run, as 45s, 30m, 2h")] = "10m",
    jobs: Annotated[int | None, typer.Option(min=1, help="runs at a time; default: one per core")] = None,
    out: Annotated[Path, typer.Option(help="directory of the runs and the pages")] = Path("runs/verify"),
    fresh: Fresh = False,
    json_: Json = False,
) -> None:
    """Runs scenes whose answers are known and compares: one row per check and engine, one page per suite.

    A row is ok, inaccurate, not applicable, or in the state of a run that gave no value. Exit code 0: every check that
    the engines can do is ok; 1: one is not, or there is none; 2: a usage error.
    """
    with usage_errors():
        suites = _chosen(split_list(suite), tier, split_list(only))
        chosen = campaign.chosen_engines(engines)
        limit = campaign.seconds(timeout)
        plans = [verification.planned(one, chosen, out, timeout=limit) for one in suites]
    found, pages = carry_out(suites, plans, out, jobs=jobs, fresh=fresh, quiet=json_)
    index = write_index(out)
    if json_:
        listed = [{"suite": one.name, **row.plain()} for one, rows in zip(suites, found, strict=True) for row in rows]
        print_json({"rows": listed, "reports": pages, "index": index})
    else:
        for one, rows, page in zip(suites, found, pages, strict=True):
            console.line(one.title)
            console.check_rows(rows)
            if page is not None:
                console.line(str(page))
        if index is not None:
            console.line(str(index))
    ok = all(all_right(rows) for rows in found) and None not in (*pages, index)
    raise typer.Exit(0 if ok else 1)


def carry_out(
    suites: Sequence[Suite],
    plans: Sequence[Sequence[PlannedRun]],
    out: Path,
    *,
    jobs: int | None,
    fresh: bool,
    quiet: bool,
) -> tuple[list[list[Row]], list[Path | None]]:
    """Carries out the planned runs of suites and writes their pages: rows and page of each.

    Args:
        suites: The suites.
        plans: The runs of each.
        out: Directory of the pages.
        jobs: Runs at a time; None for one per core.
        fresh: Whether finished runs are run again.
        quiet: Whether nothing is shown meanwhile.
    """
    with console.Display(quiet=quiet) as display:
        campaign.carry_out(
            [run for runs in plans for run in runs],
            at_once=jobs or len(available_cores()),
            fresh=fresh,
            judge=verification.judge(suites),
            show=display.update,
        )
    found = [verification.rows(suite, runs) for suite, runs in zip(suites, plans, strict=True)]
    pages = [_write_suite_page(*one, out) for one in zip(suites, plans, found, strict=True)]
    return found, pages


def _chosen(named: list[str], tier: Tier | None, only: list[str]) -> list[Suite]:
    """The suites with the experiments that were asked for; those without any are left out."""
    longest = tier or (None if named or only else TIERS[0])
    parts = [suite_registry.suite(name).part(longest, only) for name in named or suite_registry.names()]
    found = [part for part in parts if part.experiments]
    if not found:
        asked = " or ".join(only) if only else f"tier {longest}"
        raise RequestError(f"no experiment of {', '.join(part.name for part in parts)} fits {asked}")
    return found


def write_index(out: Path) -> Path | None:
    """Writes the index of everything that is verified in a directory."""
    from dembench.reports.matrix import INDEX, render

    try:
        return render(find_runs(out), out / INDEX)
    except Exception as error:
        console.error(f"the index could not be written: {type(error).__name__}: {error}")
        return None


def _write_suite_page(suite: Suite, runs: Sequence[PlannedRun], rows: Sequence[Row], out: Path) -> Path | None:
    """Writes the page of a suite; what the runs produced is safe whatever happens here."""
    from dembench.reports.suite import render

    records = [record for run in runs if (record := verification.record(run))]
    try:
        if suite.keep is not None:
            suite.keep([r for r in records if r.status.state in MEASURED and r.result is not None], out)
        return render(suite, records, rows, out / f"{suite.name}.html")
    except Exception as error:
        console.error(f"the page could not be written: {type(error).__name__}: {error}")
        return None
