"""Verbs about runs: carry them out, plan them, write their decks, forecast their steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from dembench import campaign, console
from dembench.campaign import Request
from dembench.cases.registry import softening
from dembench.cli.asked import Asked, asked, conclude
from dembench.cli.options import (
    DivisionName,
    Engines,
    Fresh,
    Initial,
    Json,
    OneScene,
    Out,
    PresetName,
    Repeat,
    Seeds,
    Time,
    Timeout,
    What,
    given,
    print_json,
    usage_errors,
)
from dembench.engines import registry
from dembench.engines.base import Division
from dembench.runs.plan import PlannedRun, RequestError, parse_engines
from dembench.runs.scheduler import Job
from dembench.runs.supervise import CHECKPOINT
from dembench.scene import HertzMindlin, Rigid
from dembench.verification.passport import record as passports


def run(
    what: What,
    engines: Engines = None,
    preset: PresetName = None,
    initial: Initial = None,
    seeds: Seeds = None,
    repeat: Repeat = None,
    time: Time = None,
    timeout: Timeout = None,
    jobs: Annotated[int, typer.Option(min=1, help="runs at a time; they never share a core")] = 1,
    division: DivisionName = None,
    out: Out = Path("runs"),
    fresh: Fresh = False,
    workload: Annotated[
        bool, typer.Option("--workload", help="time the reference workload beside each run, for `dembench check`")
    ] = False,
    report: Annotated[bool, typer.Option(help="write the report at the end")] = True,
    checkpoint: Annotated[float, typer.Option(min=0.1, help="seconds between partial results")] = CHECKPOINT,
    json_: Json = False,
) -> None:
    """Runs cases, scene files or a recipe on engines, scores them and writes the report.

    Finished runs are reused, interrupted ones go on from their last checkpoint. What is typed replaces what a recipe
    says; of its engines `--engines` names those to run.
    Exit code 0: every run is ok, or of a recipe has come to its end, accurate or not; 1: one is not, or a curve of a
    recipe stays flat where it must not; 2: a usage error.
    """
    with usage_errors():
        options = given(
            initial=initial, preset=preset, division=division, seeds=seeds, repeat=repeat, time=time, timeout=timeout
        )
        chosen, planned = _planned(what, engines, out, options, json_)
    runs = _each_once(planned)
    if not json_:
        _say_what_runs(chosen.requests, runs)
        _say_what_was_not_measured(runs)
    with console.Display(quiet=json_) as display:
        done = campaign.carry_out(
            runs,
            at_once=jobs,
            fresh=fresh,
            checkpoint=checkpoint,
            beside_workload=workload or (chosen.recipe is not None and chosen.recipe.workload),
            show=display.update,
        )
    end = conclude(chosen, planned, report)
    if json_:
        told = {"runs": [_ended(job) for job in done], "report": str(end.page) if end.page else None}
        print_json(told if end.findings is None else {**told, "sensitivity": [f.plain() for f in end.findings]})
    else:
        for finding in end.findings or ():
            console.line(finding.sentence(), None if finding.varies else "yellow")
        if end.page is not None:
            console.line(str(end.page))
    ended = all(job.status is not None and job.status.state in chosen.accepted for job in done)
    raise typer.Exit(0 if ended and end.ok else 1)


def plan(
    what: What,
    engines: Engines = None,
    preset: PresetName = None,
    initial: Initial = None,
    seeds: Seeds = None,
    repeat: Repeat = None,
    time: Time = None,
    timeout: Timeout = None,
    division: DivisionName = None,
    out: Out = Path("runs"),
    fresh: Fresh = False,
    json_: Json = False,
) -> None:
    """Shows what `run` would do: each run, whether it is reused or gone on with, and its estimated time.

    Initial states that `run` would generate first are not generated: estimates count their particles alone.
    """
    with usage_errors():
        options = given(
            initial=initial, preset=preset, division=division, seeds=seeds, repeat=repeat, time=time, timeout=timeout
        )
        chosen, planned = _planned(what, engines, out, options, json_, settle=False)
    runs = _each_once(planned)
    rows = console.plan_rows(runs, fresh)
    if json_:
        print_json(rows)
        return
    _say_what_runs(chosen.requests, runs)
    console.table(
        ("run", "problem", "engine", "repeat", "cores", "action", "estimate", "before"),
        [
            (
                r["name"],
                r["problem"],
                r["engine"],
                str(r["repeat"]),
                str(r["cores"]),
                r["action"] if r["checkpoint"] is None else f"{r['action']} from t = {r['checkpoint']:.4g} s",
                console.duration(r["estimate"]),
                r["before"] or "-",
            )
            for r in rows
        ],
    )
    for case, bodies in {run.spec.case: run.spec.bodies for run in runs if run.unsettled}.items():
        console.line(
            f"{case}: `dembench run` generates the initial state of {bodies} bodies first and keeps it in the cache; "
            "the hashes of its runs are known then"
        )


def write(
    what: OneScene,
    engine: Annotated[str, typer.Option(help="a, or a[dt=1e-6,...]")],
    output: Annotated[Path, typer.Option("--output", "-o", help="new or empty directory")],
    preset: PresetName = None,
    initial: Initial = None,
    seeds: Seeds = None,
    time: Time = None,
    division: DivisionName = "closed",
    json_: Json = False,
) -> None:
    """Writes a clean, runnable deck for one engine."""
    with usage_errors():
        request = Request(what=(what,), **given(initial=initial, preset=preset, seeds=seeds, time=time))
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
        settings = chosen.settings(scene, division or "closed", choices[0].overrides)
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
    what: OneScene,
    engine: Annotated[str, typer.Option(help="a,b[dt=1e-6,...]: engines to forecast")] = registry.EXPLICIT,
    preset: PresetName = None,
    initial: Initial = None,
    seeds: Seeds = None,
    time: Time = None,
    json_: Json = False,
) -> None:
    """Shows the time scales of a scene, the automatic step of the soft-sphere solver, and what a run would cost.

    Engines are forecast with their steps of both divisions, from measured throughputs of one core.
    """
    from dembench.solver.timestep import choose_step

    with usage_errors():
        request = Request(what=(what,), **given(initial=initial, preset=preset, seeds=seeds, time=time))
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


def _planned(
    what: Sequence[str], engines: str | None, out: Path, options: Mapping[str, Any], quiet: bool, settle: bool = True
) -> tuple[Asked, list[list[PlannedRun]]]:
    """What was asked for and its runs, of each request; see `campaign.planned` for `settle`."""
    chosen = asked(what, engines, out, options)
    with console.bar(quiet) as progress:
        return chosen, campaign.planned(chosen.requests, progress, settle)


def _each_once(blocks: Sequence[Sequence[PlannedRun]]) -> list[PlannedRun]:
    return list({run.directory.path: run for runs in blocks for run in runs}.values())


def _say_what_runs(requests: Sequence[Request], runs: Sequence[PlannedRun]) -> None:
    """The first lines: what is softened; which preset, how long a run takes, how to get the published one."""
    for case, preset in dict.fromkeys((run.spec.case, run.spec.preset) for run in runs):
        if text := softening(case, preset):
            console.line(f"{case}, {preset}: {text}")
    if not all(request.is_quick_unasked() for request in requests):
        return
    estimates = {run.spec.label(): run.spec.estimate for run in runs}
    times = ", ".join(f"{label} {console.duration(value)}" for label, value in estimates.items())
    console.line(f"preset quick, as none was given; estimated time per run: {times}; as published: --preset published")


def _say_what_was_not_measured(runs: Sequence[PlannedRun]) -> None:
    """One line about the engines that are to run a case and whose contact law was not measured with their settings."""
    unknown = {
        run.spec.label(): (run.spec.engine, run.spec.overrides)
        for run in runs
        if run.spec.preset is not None
        and isinstance(run.scene.law, HertzMindlin)
        and run.probe.available
        and not run.unsupported
        and passports.kept(run.spec.engine, run.spec.engine_version, run.spec.settings) is None
    }
    if unknown:
        console.line(
            f"no passport at hand of {', '.join(unknown)}: `{passports.command(unknown.values())}` measures which "
            "contact law is computed"
        )


def _ended(job: Job) -> dict[str, Any]:
    status = job.status.plain() if job.status else {"state": "interrupted", "detail": "not started"}
    return {
        "name": job.run.spec.name(),
        "directory": str(job.run.directory.path),
        "engine": job.run.spec.label(),
        "action": job.action,
        **status,
    }
