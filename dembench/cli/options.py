"""What the verbs share: options, usage errors, the request they stand for, JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from dembench import campaign, console
from dembench.campaign import Request
from dembench.cases.base import CaseError
from dembench.engines.base import SettingsError
from dembench.engines.registry import UnknownEngine
from dembench.runs.plan import RequestError
from dembench.scene import SceneError
from dembench.verification.suites import UnknownSuite

What = Annotated[list[str], typer.Argument(metavar="CASE_OR_SCENE", help="case3[bed=25k], or a scene file *.json")]
Engines = Annotated[str | None, typer.Option(help="a,b[dt=1e-6,...]; default: all that are installed")]
PresetName = Annotated[Literal["quick", "published"] | None, typer.Option(help="default: quick")]
Initial = Annotated[Path | None, typer.Option(help="file or directory with the published initial state")]
Seeds = Annotated[str, typer.Option(help="seeds of generated initial states, as 1,2,3")]
Repeat = Annotated[int, typer.Option(min=1, max=1000, help="timing samples of each run")]
Time = Annotated[str | None, typer.Option(help="cut the simulated time, as 0.04")]
Timeout = Annotated[str, typer.Option(help="time limit of each run, as 45s, 30m, 2h")]
DivisionName = Annotated[Literal["closed", "open"], typer.Option(help="same law and step, or each engine's best way")]
Out = Annotated[Path, typer.Option(help="directory of the runs")]
Fresh = Annotated[bool, typer.Option("--fresh", help="run finished runs again")]
Json = Annotated[bool, typer.Option("--json", help="print JSON")]


@contextmanager
def usage_errors() -> Iterator[None]:
    """One clear message and exit code 2 for what was asked for wrongly."""
    try:
        yield
    except (RequestError, CaseError, SceneError, SettingsError, UnknownEngine, UnknownSuite) as error:
        console.error(str(error))
        raise typer.Exit(2) from None


def requested(what, engines, preset, initial, seeds, repeat, time, timeout, division, out) -> Request:
    """The request that the options of a verb stand for; RequestError where a text is no time or no list of seeds."""
    return Request(
        what=tuple(what),
        engines=engines,
        preset=preset,
        initial=initial,
        seeds=campaign.whole_numbers(seeds),
        repeats=repeat,
        time=campaign.seconds(time) if time is not None else None,
        timeout=campaign.seconds(timeout),
        division=division,
        out=out,
    )


def print_json(data: Any) -> None:
    """Prints data as JSON; what JSON does not know, as text."""
    print(json.dumps(data, indent=1, default=str))
