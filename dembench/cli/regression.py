"""Verbs that compare runs with what earlier ones gave: check and bless."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dembench import console
from dembench.cli.options import Json, print_json, usage_errors

if TYPE_CHECKING:
    from dembench.regression.verdicts import Verdict

Runs = Annotated[
    list[Path], typer.Argument(metavar="RUNS", help="directories of runs, and JSON files of pytest-benchmark")
]
BaselineFile = Annotated[Path, typer.Option(help="file with the expected values, as data/baselines/ci.json")]
COLOURS = {
    "ok": "green",
    "improvement": "green",
    "undecided": "yellow",
    "new": "cyan",
    "regression": "red",
    "missing": "red",
    "failed": "red",
}


def check(
    runs: Runs,
    baseline: BaselineFile,
    junit: Annotated[Path | None, typer.Option(help="write the verdicts as JUnit XML")] = None,
    markdown: Annotated[Path | None, typer.Option(help="write them as a Markdown table")] = None,
    json_: Json = False,
) -> None:
    """Compares quantities, checks of suites and speeds of runs with a baseline: one verdict for each metric.

    A change beyond the tolerance with its whole interval of confidence is a regression; so are a metric that the runs
    do not give and a failed run. Exit code 0: no regression; 1: there is one; 2: a usage error.
    """
    from dembench.regression import baseline as baselines
    from dembench.regression import outputs
    from dembench.regression.gather import gather
    from dembench.regression.verdicts import judge

    with usage_errors():
        found = judge(gather(runs), baselines.load(baseline))
    if junit is not None:
        outputs.write(outputs.junit(found), junit)
    if markdown is not None:
        outputs.write(outputs.markdown(found, f"dembench check against {baseline.name}"), markdown)
    fails = any(v.fails for v in found)
    if json_:
        print_json({"regression": fails, "verdicts": [v.plain() for v in found]})
    else:
        _show(found)
    raise typer.Exit(1 if fails else 0)


def bless(
    runs: Runs,
    baseline: BaselineFile,
    reason: Annotated[str, typer.Option(help="why the new values are right; it stays in the file")],
    json_: Json = False,
) -> None:
    """Makes what runs gave the expected values, and shows what that changes.

    Tolerances and directions in the file are kept, and so are values that did not change by more than their tolerance.
    Failed runs are refused with exit code 2, and nothing is written.
    """
    from dembench.regression import baseline as baselines
    from dembench.regression import bless as blessings
    from dembench.regression.gather import gather

    with usage_errors():
        before = baselines.load(baseline) if baseline.exists() else baselines.Baseline()
        date = datetime.now().astimezone().isoformat(timespec="seconds")
        after = blessings.bless(gather(runs), before, reason, date)
    changes = after.blessings[-1].changes
    if changes:
        baselines.save(after, baseline)
    if json_:
        print_json({"baseline": str(baseline), "changes": [c.model_dump(mode="json") for c in changes]})
        return
    for change in changes:
        console.line(change.text())
    console.line(f"{baseline}: {blessings.summary(changes)}")


def _show(verdicts: Sequence[Verdict]) -> None:
    """Every metric that is not ok, and how many there are of each kind."""
    from dembench.regression import outputs
    from dembench.regression.verdicts import counts

    shown = [v for v in verdicts if v.word != "ok"]
    if shown:
        columns = ("verdict", "metric", "expected", "found", "change", "tolerance")
        console.table(columns, [outputs.row(v) for v in shown])
    worst = verdicts[0].word if verdicts else "ok"
    console.line(counts(verdicts) or "no metrics", COLOURS[worst])
