"""Verbs about what runs have left: report, validate, export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dembench import console
from dembench.cli.options import Json, print_json
from dembench.results import ResultError, export_csv, export_vtkhdf, read
from dembench.results import validate as validate_file
from dembench.runs.directory import find_runs


def report(
    runs: Annotated[Path, typer.Argument(help="directory of runs")] = Path("runs"),
    output: Annotated[Path, typer.Option("--output", "-o", help="page to write")] = Path("report.html"),
    json_: Json = False,
) -> None:
    """Writes one page about the runs in a directory; it opens offline."""
    if not find_runs(runs):
        console.error(f"{runs} holds no runs; `dembench run` makes some")
        raise typer.Exit(2)
    page = write_report(runs, output)
    if page is None:
        raise typer.Exit(1)
    if json_:
        print_json({"report": str(page)})
    else:
        console.line(str(page))


def validate(files: Annotated[list[Path], typer.Argument(help="result files")], json_: Json = False) -> None:
    """Checks result files and lists their faults. Exit code 1 where one has any."""
    faults = {str(file): validate_file(file) for file in files}
    if json_:
        print_json(faults)
    else:
        for file, found in faults.items():
            for fault in found or ["valid"]:
                console.line(f"{file}: {fault}")
    raise typer.Exit(1 if any(faults.values()) else 0)


def export(
    file: Annotated[Path, typer.Argument(help="a result file")],
    out: Annotated[Path, typer.Option("--out", "-o", help="directory of the tables")] = Path("export"),
    vtkhdf: Annotated[bool, typer.Option("--vtkhdf", help="the snapshots, too, for ParaView")] = False,
) -> None:
    """Writes every observable of a result as a CSV table."""
    try:
        result = read(file)
    except ResultError as error:
        console.error(str(error))
        raise typer.Exit(2) from None
    for path in export_csv(result, out) + (export_vtkhdf(result, out) if vtkhdf else []):
        console.line(str(path))


def write_report(runs: Path, output: Path) -> Path | None:
    """Writes the report; what the runs produced is safe whatever happens here."""
    from dembench.reports.report import render

    try:
        return render(find_runs(runs), output)
    except Exception as error:
        console.error(f"the report could not be written: {type(error).__name__}: {error}")
        return None
