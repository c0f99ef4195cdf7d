"""The verb that writes skeletons of packages."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from dembench import console, skeletons
from dembench.cli.options import usage_errors


def new(
    kind: Annotated[Literal["engine", "case"], typer.Argument(help="what to add")],
    name: Annotated[str, typer.Argument(help="its name on the command line, as my-engine")],
    directory: Annotated[Path, typer.Option(help="where the new directory is made")] = Path("."),
) -> None:
    """Writes a package that adds an engine or a case: an entry point, the contract's methods and a test that passes."""
    with usage_errors():
        made = skeletons.write(kind, name, directory)
    console.line(f"{made}\n  pip install -e {made}\n  pytest {made}")
