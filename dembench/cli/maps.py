"""The verb that looks for the largest stable time step."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dembench import campaign, console
from dembench.cli.options import Engines, Fresh, Json, print_json, usage_errors
from dembench.runs.environment import available_cores
from dembench.runs.plan import split_list
from dembench.runs.supervise import command_line
from dembench.verification.maps import families as known
from dembench.verification.maps import store
from dembench.verification.maps.explore import explore
from dembench.verification.maps.search import searches


def stability_map(
    engines: Engines = None,
    axes: Annotated[
        str, typer.Option(help="stiffness, speed, restitution, coordination, overlap, mass-ratio; default: all")
    ] = "",
    budget: Annotated[str, typer.Option(help="time after which no other run is started, as 20m")] = "20m",
    timeout: Annotated[str, typer.Option(help="time limit of each run")] = "2m",
    jobs: Annotated[int | None, typer.Option(min=1, help="runs at a time; default: one per core")] = None,
    out: Annotated[Path, typer.Option(help="directory of the runs, the table and the page")] = Path("runs/map"),
    fresh: Fresh = False,
    json_: Json = False,
) -> None:
    """Stability maps: the largest stable time step over what makes a scene stiff or extreme, by bisection.

    Every probe is an ordinary run of a scene with many small experiments; repeating the command goes on with what the
    budget left. Engines run beyond their own guard where a setting allows it, and the guard is probed beside.
    The table is `map.json`. Exit code 0: all searches came to their end, whatever broke; 1: the budget was spent, or an
    engine cannot do it; 2: a usage error.
    """
    with usage_errors():
        chosen = campaign.chosen_engines(engines)
        asked = known.axes(split_list(axes))
        families = known.families(asked)
        found = searches(families, asked, chosen)
        allowed, limit = campaign.seconds(budget), campaign.seconds(timeout)
        with console.Display(quiet=json_) as display:
            complete = explore(
                found,
                out,
                budget=allowed,
                timeout=limit,
                at_once=jobs or len(available_cores()),
                fresh=fresh,
                show=display.update,
            )
    made = store.gather(families, found, command_line(), complete)
    store.write(made, out)
    page = _write_page(made, out)
    if json_:
        print_json({**made.model_dump(mode="json"), "report": str(page) if page else None})
    else:
        _print(made)
        if page is not None:
            console.line(str(page))
    troubles = [row.trouble for one in made.maps for row in one.rows if row.trouble]
    raise typer.Exit(0 if complete and not troubles and page is not None else 1)


def _print(made: store.Maps) -> None:
    """Prints the largest stable steps over the theoretical bound: one row per engine and rig."""
    rows = []
    for one in made.maps:
        for row in one.rows:
            stable = [cell.stable.factor for cell in row.cells if cell.stable is not None]
            classes = dict.fromkeys(cell.breaks.kind for cell in row.cells if cell.breaks is not None)
            guard = row.guard.accepted if row.guard is not None and row.guard.refused is not None else None
            texts = (
                f"{min(stable):.2f} to {max(stable):.2f}" if stable else "-",
                ", ".join(classes) or "nothing breaks",
                f"{guard:.2f}" if guard is not None else "-",
            )
            rows.append((one.title, row.variant, f"{row.bound:.3g} s", *texts, row.trouble))
    console.table(("map", "engine", "bound", "stable up to, in bounds", "then", "guard", ""), rows)
    if not made.complete:
        console.line("The budget was spent; the same command goes on.")


def _write_page(made: store.Maps, out: Path) -> Path | None:
    """Writes the page; what the runs produced is safe whatever happens here."""
    from dembench.reports.map_page import render

    try:
        return render(made, out / "map.html")
    except Exception as error:
        console.error(f"the page could not be written: {type(error).__name__}: {error}")
        return None
