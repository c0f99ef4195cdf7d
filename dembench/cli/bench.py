"""The verb that times the steps of engines side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from dembench import campaign, console
from dembench.cli.options import Engines, Initial, Json, print_json, usage_errors
from dembench.initial.fetch import initial_state
from dembench.runs.environment import available_cores
from dembench.runs.plan import RequestError
from dembench.throughput import machine, rates
from dembench.throughput.rates import Rate, settings_text
from dembench.throughput.scenes import SCENES, SERIES, WIDE, names, timed


def bench(
    scene: Annotated[str, typer.Option(help=f"scenes, as a,b: {', '.join(SCENES)}; {SERIES}, {WIDE}: all of theirs")],
    engines: Engines = None,
    cores: Annotated[str, typer.Option(help="numbers of cores, as 1,2")] = "1",
    repeat: Annotated[int, typer.Option(min=5, help="samples of each rate, interleaved; one more warms up")] = 5,
    steps: Annotated[
        int | None, typer.Option(min=10, help="steps that are timed; default: by number of bodies")
    ] = None,
    initial: Initial = None,
    timeout: Annotated[str, typer.Option(help="time limit of each run, as 45s, 30m")] = "30m",
    out: Annotated[Path, typer.Option(help="directory of the runs and the page")] = Path("runs/bench"),
    json_: Json = False,
) -> None:
    """Times the steps of engines on the same scenes, with the same law, step and output, one run at a time.

    Each command times all of its engines anew. Exit code 0: all engines that can do a scene came to their end; 1: one
    did not; 2: a usage error.
    """
    with usage_errors():
        chosen, limit = campaign.chosen_engines(engines), campaign.seconds(timeout)
        numbers, wanted, given = campaign.whole_numbers(cores), names(scene), initial_state(initial)
        there = len(available_cores())
        if min(numbers) < 1 or max(numbers) > there:
            raise RequestError(f"--cores {cores}: accepted are 1 to {there}, the cores of this machine")
        with console.bar(json_) as progress:
            scenes = [timed(name, SCENES[name](given, progress), steps) for name in wanted]
            entries = rates.planned(scenes, chosen, numbers, out, samples=repeat, timeout=limit)
    limits = [machine.measured(sorted(available_cores())[:number]) for number in numbers]
    with console.Display(quiet=json_) as display:
        jobs = campaign.carry_out(rates.in_turn(entries), fresh=True, show=display.update)
    rows = rates.rates(entries, jobs)
    from dembench.reports.throughput import render

    page = render(rows, limits, out / "bench.html")
    if json_:
        print_json({"rows": [row.plain() for row in rows], "machine": [vars(m) for m in limits], "report": str(page)})
    else:
        _show(rows)
        console.line(str(page))
    raise typer.Exit(int(any(row.detail and not entry.refused for row, entry in zip(rows, entries, strict=True))))


def _show(rows: Sequence[Rate]) -> None:
    """Prints the rows, and the settings that each engine had."""

    def shown(value: float | None, form: str) -> str:
        return "-" if value is None else format(value, form)

    console.table(
        ("scene", "engine", "cores", "particle-steps/s", "spread", "wall [s]", "core-seconds", "busy", ""),
        [
            (
                row.scene,
                row.engine,
                str(row.cores),
                shown(row.particle_steps_per_second, ".3e"),
                shown(row.spread, ".1%"),
                shown(row.wall, ".3g"),
                shown(row.core_seconds, ".3g"),
                shown(row.busy, ".0%"),
                "; ".join(filter(None, ("contended" * row.contended, row.law * bool(row.samples), row.detail))),
            )
            for row in rows
        ],
    )
    for text in dict.fromkeys(f"{row.engine}: {settings_text(row.settings)}" for row in rows if row.settings):
        console.line(text)
