"""Verbs about many sets of runs: a history with trends, and two sets against each other."""

from __future__ import annotations

from collections import Counter
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from dembench import console
from dembench.cli.options import Json, print_json, usage_errors
from dembench.cli.regression import Runs

Store = Annotated[Path, typer.Option(help="directory of the history")]

app = typer.Typer(no_args_is_help=True, help="A history of metrics, and how they moved.")


@app.command()
def add(runs: Runs, store: Store = Path("history"), json_: Json = False) -> None:
    """Appends the metrics of a set of runs to a history; runs that it has already are not added again."""
    from dembench.regression import history
    from dembench.regression.gather import gather

    with usage_errors():
        now = datetime.now().astimezone().isoformat(timespec="seconds")
        lines = history.lines_of(gather(runs), now)
        added = history.add(store, lines)
    if json_:
        print_json({"history": str(store / history.FILE), "added": added, "known": len(lines) - added})
    else:
        known = f"; {len(lines) - added} metrics of this set of runs are there already" if added < len(lines) else ""
        console.line(f"{store / history.FILE}: {added} metrics added{known}")


@app.command()
def show(
    store: Store = Path("history"),
    baseline: Annotated[Path | None, typer.Option(help="marks what this baseline blessed, and its tolerances")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="page to write; default: trends.html beside the history")
    ] = None,
    json_: Json = False,
) -> None:
    """Draws the metrics of a history over time on one page that opens offline."""
    from dembench.regression import RegressionError, history
    from dembench.regression import baseline as baselines
    from dembench.reports.trends import render

    with usage_errors():
        lines = history.read(store)
        if not lines:
            raise RegressionError(f"{store} has no history; `dembench history add RUNS --store {store}` begins one")
        expected = baselines.load(baseline) if baseline is not None else None
    page = render(lines, expected, output or store / "trends.html")
    print_json({"report": str(page)}) if json_ else console.line(str(page))


def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="a directory of runs")],
    b: Annotated[Path, typer.Argument(metavar="B", help="another one")],
    margin: Annotated[
        list[str] | None, typer.Option(help="largest difference that does not matter, as rate=2% or depth=5e-4")
    ] = None,
    json_: Json = False,
) -> None:
    """Says of each metric that two sets of runs have whether they are the same within a margin given beforehand.

    Means over seeds are compared by two one-sided tests at 5 %, speeds by their smallest repeats. Exit code 0: B is
    nowhere worse or different; 1: it is; 2: a usage error.
    """
    from dembench.regression.compare import compare as compared
    from dembench.regression.compare import margins
    from dembench.regression.gather import gather
    from dembench.regression.outputs import comparison_row

    with usage_errors():
        found = compared(gather([a]), gather([b]), margins(margin or []))
    if json_:
        print_json({"comparisons": [c.plain() for c in found]})
    else:
        console.table(("verdict", "metric", "A", "B", "B - A", "margin"), [comparison_row(c) for c in found])
        console.line(", ".join(f"{n} {word}" for word, n in Counter(c.word for c in found).items()))
    raise typer.Exit(1 if any(c.word in ("worse", "different") for c in found) else 0)
