"""The verb that measures what leaving out saves."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dembench import ablation, campaign, console
from dembench.campaign import Request
from dembench.cli.options import Engines, Fresh, Json, print_json, usage_errors
from dembench.runs.plan import RequestError, SceneChoice
from dembench.verification.ablation_scenes import SCENES


def ablate(
    what: Annotated[
        list[str] | None, typer.Argument(metavar="WHAT", help="cases as case3[bed=25k], or scene files *.json")
    ] = None,
    all_: Annotated[bool, typer.Option("--all", help=f"the small scenes of this verb: {', '.join(SCENES)}")] = False,
    engines: Engines = None,
    repeat: Annotated[int, typer.Option(min=1, help="timing samples of each run, interleaved")] = 3,
    time: Annotated[str | None, typer.Option(help="cut the simulated time, as 0.04")] = None,
    timeout: Annotated[str, typer.Option(help="time limit of each run, as 45s, 30m")] = "10m",
    out: Annotated[Path, typer.Option(help="directory of the runs and the page")] = Path("runs/ablation"),
    fresh: Fresh = False,
    json_: Json = False,
) -> None:
    """Runs scenes with what they do not need left out, and forced on: time, memory, and whether results are equal.

    Exit code 0: every run came to its end; 1: one did not; 2: a usage error.
    """
    with usage_errors():
        chosen, limit = campaign.chosen_engines(engines), campaign.seconds(timeout)
        with console.bar(json_) as progress:
            scenes = [SceneChoice(name, None, 0, make()) for name, make in SCENES.items()] if all_ else []
            if what:
                cut = campaign.seconds(time) if time else None
                scenes += campaign.build_scenes(Request(tuple(what), time=cut), progress)
        if not scenes:
            raise RequestError("name a case or a scene file, or give --all")
        runs = ablation.planned(scenes, chosen, out, repeat, limit)
    with console.Display(quiet=json_) as display:
        campaign.carry_out(runs, at_once=1, fresh=fresh, show=display.update)
    rows = ablation.rows(runs)
    from dembench.reports.ablation import render

    page = render(scenes, rows, out / "ablation.html")
    if json_:
        print_json({"rows": [row.plain() for row in rows], "report": str(page)})
    else:
        console.line(str(page))
    ended = all(row.left_out.loop is not None and (row.forced.loop is not None or not row.feature) for row in rows)
    raise typer.Exit(0 if ended else 1)
