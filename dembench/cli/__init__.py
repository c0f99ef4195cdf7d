"""The command line: verbs that parse, call and print."""

from __future__ import annotations

from typing import Annotated

import typer

from dembench import __version__, console
from dembench.cli import (
    ablate,
    bench,
    data,
    history,
    imports,
    initial,
    inspection,
    maps,
    new,
    passport,
    regression,
    results,
    run,
    sweep,
    verify,
)

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="One description of a granular scene, run on many discrete-element engines, scored and reported.",
)
for verb in (
    run.run,
    run.plan,
    run.write,
    run.timestep,
    verify.verify,
    ablate.ablate,
    bench.bench,
    new.new,
    passport.passport,
    regression.check,
    regression.bless,
    history.compare,
    sweep.sweep,
    sweep.advise,
    results.report,
    results.validate,
    results.export,
    inspection.engines,
    inspection.cases,
    inspection.doctor,
    inspection.schema,
):
    app.command()(verb)
app.command("map")(maps.stability_map)
app.command("import")(imports.import_results)
app.add_typer(history.app, name="history")
app.add_typer(initial.app, name="initial")
app.add_typer(data.app, name="data")


@app.callback(invoke_without_command=True)
def _version(version: Annotated[bool, typer.Option("--version", help="print the version")] = False) -> None:
    if version:
        console.line(__version__)
        raise typer.Exit


def main() -> None:
    """Entry point of the command `dembench`."""
    app()
