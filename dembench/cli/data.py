"""Verbs about published data: fetch."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dembench import console
from dembench.cli.options import Json, print_json, usage_errors
from dembench.initial.fetch import MIRROR, RECORDS, fetch

app = typer.Typer(no_args_is_help=True, help="Published data: brings it into the cache.")


@app.callback()
def _data() -> None:
    """Keeps `fetch` a verb of its own."""


@app.command("fetch")
def fetch_data(
    name: Annotated[str, typer.Argument(help=f"data set: {', '.join(RECORDS)}")],
    source: Annotated[Path | None, typer.Option("--from", help="directory or archive with a local copy")] = None,
    url: Annotated[str | None, typer.Option(help="base address of a mirror", envvar=MIRROR)] = None,
    again: Annotated[bool, typer.Option("--again", help="replace all that is in the cache, damaged or not")] = False,
    json_: Json = False,
) -> None:
    """Brings published initial states and wall meshes into the cache, from their record or a local copy.

    Checksums are recorded at first and verified at every use. `--initial NAME` then stands for the directory.
    """
    with usage_errors(), console.bar(json_) as progress:
        found = fetch(name, source, url, progress, again)
    if json_:
        print_json({"directory": str(found.directory), "files": found.names, "missing": found.missing})
        return
    console.line(f"{found.directory}: {', '.join(found.names)}")
    if found.missing:
        console.line(f"not there: {', '.join(found.missing)}")
