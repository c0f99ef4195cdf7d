"""Verbs about runs: carry them out, plan them, write their decks, forecast their steps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from dembench import campaign, console, recipes
from dembench.campaign import Request
from dembench.cli.options import (
    DivisionName,
    Engines,
    Fresh,
    Initial,
    Json,
    Out,
    PresetName,
    Repeat,
    Seeds,
    Time,
    Timeout,
    What,
    print_json,
    requested,
    usage_errors,
)
from dembench.cli.results import write_report
from dembench.engines import registry
from dembench.engines.base import Division
from dembench.recipes import Recipe
from dembench.runs.directory import RunRecord
from dembench.runs.plan import PlannedRun, RequestError, parse_engines
from dembench.runs.scheduler import Job
from dembench.runs.supervise import CHECKPOINT, command_line
from dembench.scene import Rigid


def run(
    what: What,
    engines: Engines = None,
    preset: PresetName = None,
    initial: Initial = None,
    seeds: Seeds = "0",
    repeat: Repeat = 1,
    time: Time = None,
    timeout: Timeout = "6h",
    jobs: Annotated[int, typer.Option(min=1, help="runs at a time; they never share a core")] = 1,
    division: DivisionName = "closed",
    out: Out = Path("runs"),
    fresh: Fresh = False,
    report: Annotated[bool, typer.Option(help="write the report at the end")] = True,
    checkpoint: Annotated[float, typer.Option(min=0.1, help="seconds between partial results")] = CHECKPOINT,
    json_: Json = False,
) -> None:
    """Runs cases or scene files on engines, scores them and writes the report.

    Finished runs are reused. Exit code 0: every run is ok; 1: one is not; 2: a usage error.
    """
    with usage_errors():
        request = requested(what, engines, preset, initial, seeds, repeat, time, timeout, division, out)
        with console.bar(json_) as progress:
            runs = campaign.planned(request, progress)
    if not json_:
        _say_what_runs(request, runs)
    with console.Display(quiet=json_) as display:
        done = campaign.carry_out(runs, at_once=jobs, fresh=fresh, checkpoint=checkpoint, show=display.update)
    page = write_report(out, out / "report.html") if report else None
    if json_:
        print_json({"runs": [_ended(job) for job in done], "report": str(page) if page else None})
    elif page is not None:
        console.line(str(page))
    ok = all(job.status is not None and job.status.state == "ok" for job in done)
    raise typer.Exit(0 if ok and (page is not None or not report) else 1)


def plan(
    what: What,
    engines: Engines = None,
    preset: PresetName = None,
    initial: Initial = None,
    seeds: Seeds = "0",
    repeat: Repeat = 1,
    time: Time = None,
    timeout: Timeout = "6h",
    division: DivisionName = "closed",
    out: Out = Path("runs"),
    fresh: Fresh = False,
    json_: Json = False,
) -> None:
    """Shows what `run` would do: each run with its hash, whether it is reused, and its estimated time."""
    with usage_errors():
        request = requested(what, engines, preset, initial, seeds, repeat, time, timeout, division, out)
        with console.bar(json_) as progress:
            runs = campaign.planned(request, progress)
    rows = console.plan_rows(runs, fresh)
    if json_:
        print_json(rows)
        return
    _say_what_runs(request, runs)
    console.table(
        ("run", "engine", "repeat", "cores", "action", "estimate", "before"),
        [
            (
                r["name"],
                r["engine"],
                str(r["repeat"]),
                str(r["cores"]),
                r["action"],
                console.duration(r["estimate"]),
                r["before"] or "-",
            )
            for r in rows
        ],
    )


def write(
    what: Annotated[str, typer.Argument(metavar="CASE_OR_SCENE", help="case3[bed=25k], or a scene file *.json")],
    engine: Annotated[str, typer.Option(help="a, or a[dt=1e-6,...]")],
    output: Annotated[Path, typer.Option("--output", "-o", help="new or empty directory")],
    preset: PresetName = None,
    initial: Initial = None,
    seeds: Seeds = "0",
    time: Time = None,
    division: DivisionName = "closed",
    json_: Json = False,
) -> None:
    """Writes a clean, runnable deck for one engine."""
    with usage_errors():
        request = requested([what], engine, preset, initial, seeds, 1, time, "6h", division, output)
        choices = parse_engines(engine)
        if len(choices) != 1 or len(request.seeds) != 1:
            raise RequestError("a deck is for one engine and one seed")
        if output.exists() and (not output.is_dir() or any(output.iterdir())):
            raise RequestError(f"{output} is there and not empty; give a new directory")
        with console.bar(json_) as progress:
            scene = campaign.build_scenes(request, progress)[0].scene
        chosen = registry.engine(choices[0].engine)
        if refused := chosen.unsupported(scene):
            raise RequestError(f"{chosen.name} cannot do this scene: {'; '.join(refused)}")
        settings = chosen.settings(scene, division, choices[0].overrides)
    output.mkdir(parents=True, exist_ok=True)
    phases = chosen.write(scene, settings, output)
    if json_:
        print_json([phase.model_dump(mode="json") for phase in phases])
        return
    console.line(f"{output}: run in it")
    for phase in phases:
        variables = "".join(f"{key}={value} " for key, value in phase.environment.items())
        console.line(f"  {variables}{' '.join(phase.command)}")


def timestep(
    what: Annotated[str, typer.Argument(metavar="CASE_OR_SCENE", help="case3[bed=25k], or a scene file *.json")],
    engine: Annotated[str, typer.Option(help="a,b[dt=1e-6,...]: engines to forecast")] = registry.EXPLICIT,
    preset: PresetName = None,
    initial: Initial = None,
    seeds: Seeds = "0",
    time: Time = None,
    json_: Json = False,
) -> None:
    """Shows the time scales of a scene, the automatic step of the soft-sphere solver, and what a run would cost.

    Engines are forecast with their steps of both divisions, from measured throughputs of one core.
    """
    from dembench.solver.timestep import choose_step

    with usage_errors():
        request = requested([what], engine, preset, initial, seeds, 1, time, "6h", "closed", Path())
        choices = parse_engines(engine)
        with console.bar(json_) as progress:
            scene = campaign.build_scenes(request, progress)[0].scene
        if isinstance(scene.law, Rigid):
            raise RequestError("a rigid law has no contact time; give a scene with hertz-mindlin or linear")
        found = choose_step(scene)
        forecasts = [
            (adapter.name, division, settings.dt, adapter.estimate(scene, settings))
            for choice in choices
            for adapter in (registry.engine(choice.engine),)
            for division in get_args(Division)
            for settings in (adapter.settings(scene, division, choice.overrides),)
        ]
    if json_:
        names = ("engine", "division", "step", "seconds")
        print_json({**found.plain(), "forecasts": [dict(zip(names, row, strict=True)) for row in forecasts]})
        return
    console.table(
        ("quantity", "value"),
        [
            ("Rayleigh time", f"{found.rayleigh:.3g} s"),
            ("fastest impact", f"{found.speed:.3g} m/s"),
            ("largest overlap", f"{found.overlap:.3g} m"),
            ("shortest contact", f"{found.contact_time:.3g} s"),
            ("critical step", f"{found.critical:.3g} s"),
            ("automatic step", f"{found.step:.3g} s, {found.step / found.rayleigh:.2g} Rayleigh times"),
            ("bound by", found.bound),
            ("steps", f"{found.steps}"),
            ("forecast", console.duration(found.seconds)),
        ],
    )
    console.table(
        ("engine", "division", "step", "forecast"),
        [(name, division, f"{dt:.3g} s", console.duration(cost)) for name, division, dt, cost in forecasts],
    )


def recipe(
    what: Annotated[str, typer.Argument(metavar="NAME_OR_FILE", help="recipe that travels with dembench, or *.toml")],
    preset: PresetName = None,
    initial: Initial = None,
    seeds: Annotated[str | None, typer.Option(help="seeds instead of the recipe's, as 1,2,3")] = None,
    time: Time = None,
    timeout: Annotated[str | None, typer.Option(help="time limit of each run instead of the recipe's")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="runs at a time; they never share a core")] = 1,
    out: Annotated[Path | None, typer.Option(help="directory of the runs and the page; default: runs/NAME")] = None,
    fresh: Fresh = False,
    json_: Json = False,
) -> None:
    """Carries out a campaign that a TOML file describes, and writes its page.

    Exit code 0: every run came to its end, accurate or not; 1: one did not; 2: a usage error.
    """
    with usage_errors():
        file = recipes.find(what)
        chosen, out = recipes.load(file), out or Path("runs") / file.stem
        request = chosen.request(
            out,
            initial,
            preset=preset,
            seeds=campaign.whole_numbers(seeds) if seeds else None,
            time=campaign.seconds(time) if time else None,
            timeout=campaign.seconds(timeout) if timeout else None,
        )
        with console.bar(json_) as progress:
            runs = campaign.planned(request, progress)
    with console.Display(quiet=json_) as display:
        done = campaign.carry_out(runs, at_once=jobs, fresh=fresh, show=display.update)
    page = _write_recipe_page(chosen, runs, out / f"{file.stem}.html")
    if json_:
        print_json({"runs": [_ended(job) for job in done], "report": str(page) if page else None})
    elif page is not None:
        console.line(str(page))
    ended = all(job.status is not None and job.status.state in ("ok", "inaccurate") for job in done)
    raise typer.Exit(0 if ended and page is not None else 1)


def _say_what_runs(request: Request, runs: list[PlannedRun]) -> None:
    """The first line: which preset, how long a run takes, how to get the published one."""
    if not request.is_quick_unasked():
        return
    estimates = {run.spec.label(): run.spec.estimate for run in runs}
    times = ", ".join(f"{label} {console.duration(value)}" for label, value in estimates.items())
    console.line(f"preset quick, as none was given; estimated time per run: {times}; as published: --preset published")


def _write_recipe_page(recipe: Recipe, runs: list[PlannedRun], output: Path) -> Path | None:
    """Writes the page that a recipe asks for, about its own runs."""
    from dembench.reports import report, study

    records = [RunRecord(run.directory.path) for run in runs if run.directory.status() is not None]
    try:
        if recipe.page is None:
            return report.render(records, output, recipe.title)
        return study.render(recipe, recipe.page, records, output, command_line())
    except Exception as error:
        console.error(f"the page could not be written: {type(error).__name__}: {error}")
        return None


def _ended(job: Job) -> dict[str, Any]:
    status = job.status.plain() if job.status else {"state": "interrupted", "detail": "not started"}
    return {
        "name": job.run.spec.name(),
        "directory": str(job.run.directory.path),
        "engine": job.run.spec.label(),
        "action": job.action,
        **status,
    }
