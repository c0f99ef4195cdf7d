"""What the verbs share: options, usage errors, the request they stand for, JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from dembench import campaign, console
from dembench.cases.base import CaseError
from dembench.engines.base import SettingsError
from dembench.engines.registry import UnknownEngine
from dembench.initial.beds import BedError
from dembench.initial.fetch import initial_state
from dembench.initial.rows import CoordinatesError
from dembench.regression import RegressionError
from dembench.results.foreign import ForeignError
from dembench.runs.plan import RequestError
from dembench.scene import SceneError
from dembench.skeletons import SkeletonError
from dembench.verification.suites import UnknownSuite

What = Annotated[
    list[str],
    typer.Argument(
        metavar="WHAT", help="cases as case3[bed=25k], scene files *.json, or one recipe: its name or a file *.toml"
    ),
]
OneScene = Annotated[str, typer.Argument(metavar="CASE_OR_SCENE", help="case3[bed=25k], or a scene file *.json")]
Engines = Annotated[str | None, typer.Option(help="a,b[dt=1e-6,...]; default: all that are installed")]
PresetName = Annotated[Literal["quick", "published"] | None, typer.Option(help="default: quick")]
Initial = Annotated[Path | None, typer.Option(help="file or directory with the published initial state, or dosta2024")]
Seeds = Annotated[str | None, typer.Option(help="seeds of initial states, as 1,2,3; default: 0")]
Repeat = Annotated[int | None, typer.Option(min=1, max=1000, help="timing samples of each run; default: 1")]
Time = Annotated[str | None, typer.Option(help="cut the simulated time, as 0.04")]
Timeout = Annotated[str | None, typer.Option(help="time limit of each attempt at a run, as 45s, 2h; default: 6h")]
DivisionName = Annotated[
    Literal["closed", "open"] | None,
    typer.Option(help="same law and step, or each engine's best way; default: closed"),
]
Out = Annotated[Path, typer.Option(help="directory of the runs")]
Fresh = Annotated[bool, typer.Option("--fresh", help="run finished runs again, interrupted ones from the start")]
Json = Annotated[bool, typer.Option("--json", help="print JSON")]

USAGE = (
    RequestError,
    BedError,
    CaseError,
    CoordinatesError,
    SceneError,
    SettingsError,
    UnknownEngine,
    UnknownSuite,
    ForeignError,
    RegressionError,
    SkeletonError,
)
"""What is asked for wrongly."""


@contextmanager
def usage_errors() -> Iterator[None]:
    """One clear message and exit code 2 for what was asked for wrongly."""
    try:
        yield
    except USAGE as error:
        console.error(str(error))
        raise typer.Exit(2) from None


def given(
    *,
    initial: Path | None = None,
    preset: str | None = None,
    division: str | None = None,
    seeds: str | None = None,
    repeat: int | None = None,
    time: str | None = None,
    timeout: str | None = None,
) -> dict[str, Any]:
    """The fields of `Request` that options give; what was not typed is left out.

    Raises:
        RequestError: A text is no time or no list of seeds.
        FetchError: The initial state is a data set that is not in the cache.
    """
    fields = {
        "initial": initial_state(initial),
        "preset": preset,
        "division": division,
        "seeds": campaign.whole_numbers(seeds) if seeds is not None else None,
        "repeats": repeat,
        "time": campaign.seconds(time) if time is not None else None,
        "timeout": campaign.seconds(timeout) if timeout is not None else None,
    }
    return {name: value for name, value in fields.items() if value is not None}


def print_json(data: Any) -> None:
    """Prints data as JSON; what JSON does not know, as text."""
    print(json.dumps(data, indent=1, default=str))
