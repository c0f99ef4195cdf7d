"""The command line: verbs that parse, call and print."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import typer

from dembench import __version__, campaign, console, recipes
from dembench.campaign import Request
from dembench.cases import registry as cases_registry
from dembench.cases.base import CaseError
from dembench.engines import registry
from dembench.engines.base import Division, Probe, SettingsError
from dembench.engines.registry import UnknownEngine
from dembench.initial.cache import cache_directory
from dembench.recipes import Recipe
from dembench.results import ResultError, export_csv, export_vtkhdf, read
from dembench.results import validate as validate_file
from dembench.runs.directory import RunRecord, find_runs
from dembench.runs.environment import available_cores, machine
from dembench.runs.plan import PlannedRun, RequestError, parse_engines, split_list
from dembench.runs.scheduler import Job
from dembench.runs.supervise import CHECKPOINT, command_line
from dembench.scene import Rigid, Scene, SceneError
from dembench.verification import campaign as verification
from dembench.verification import suites as suite_registry
from dembench.verification.checks import Row, Suite
from dembench.verification.suites import UnknownSuite

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="One description of a granular scene, run on many discrete-element engines, scored and reported.",
)

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
def _usage_errors() -> Iterator[None]:
    """One clear message and exit code 2 for what was asked for wrongly."""
    try:
        yield
    except (RequestError, CaseError, SceneError, SettingsError, UnknownEngine, UnknownSuite) as error:
        console.error(str(error))
        raise typer.Exit(2) from None


@app.command()
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
    with _usage_errors():
        request = _request(what, engines, preset, initial, seeds, repeat, time, timeout, division, out)
        with console.bar(json_) as progress:
            runs = campaign.planned(request, progress)
    if not json_:
        _say_what_runs(request, runs)
    with console.Display(quiet=json_) as display:
        done = campaign.carry_out(runs, at_once=jobs, fresh=fresh, checkpoint=checkpoint, show=display.update)
    page = _write_report(out, out / "report.html") if report else None
    if json_:
        _print_json({"runs": [_ended(job) for job in done], "report": str(page) if page else None})
    elif page is not None:
        console.line(str(page))
    ok = all(job.status is not None and job.status.state == "ok" for job in done)
    raise typer.Exit(0 if ok and (page is not None or not report) else 1)


@app.command()
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
    with _usage_errors():
        request = _request(what, engines, preset, initial, seeds, repeat, time, timeout, division, out)
        with console.bar(json_) as progress:
            runs = campaign.planned(request, progress)
    rows = console.plan_rows(runs, fresh)
    if json_:
        _print_json(rows)
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


@app.command()
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
    with _usage_errors():
        request = _request([what], engine, preset, initial, seeds, 1, time, "6h", division, output)
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
        _print_json([phase.model_dump(mode="json") for phase in phases])
        return
    console.line(f"{output}: run in it")
    for phase in phases:
        variables = "".join(f"{key}={value} " for key, value in phase.environment.items())
        console.line(f"  {variables}{' '.join(phase.command)}")


@app.command()
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

    with _usage_errors():
        request = _request([what], engine, preset, initial, seeds, 1, time, "6h", "closed", Path())
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
        _print_json({**found.plain(), "forecasts": [dict(zip(names, row, strict=True)) for row in forecasts]})
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


@app.command()
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
    with _usage_errors():
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
        _print_json({"runs": [_ended(job) for job in done], "report": str(page) if page else None})
    elif page is not None:
        console.line(str(page))
    ended = all(job.status is not None and job.status.state in ("ok", "inaccurate") for job in done)
    raise typer.Exit(0 if ended and page is not None else 1)


@app.command()
def verify(
    suite: Annotated[str, typer.Option(help="suites, as a,b; default: all")] = "",
    engines: Engines = None,
    timeout: Timeout = "10m",
    jobs: Annotated[int | None, typer.Option(min=1, help="runs at a time; default: one per core")] = None,
    out: Annotated[Path, typer.Option(help="directory of the runs and the pages")] = Path("runs/verify"),
    fresh: Fresh = False,
    json_: Json = False,
) -> None:
    """Runs scenes whose answers are known and compares: one row per check and engine, one page per suite.

    A row is ok, inaccurate, or in the state of a run that gave no value. Exit code 0: every check that the engines can
    do is ok; 1: one is not, or there is none; 2: a usage error.
    """
    with _usage_errors():
        suites = [suite_registry.suite(name) for name in split_list(suite) or suite_registry.names()]
        chosen = campaign.chosen_engines(engines)
        limit = campaign.seconds(timeout)
        plans = [verification.planned(one, chosen, out, timeout=limit) for one in suites]
    with console.Display(quiet=json_) as display:
        campaign.carry_out(
            [run for runs in plans for run in runs],
            at_once=jobs or len(available_cores()),
            fresh=fresh,
            judge=verification.judge(suites),
            show=display.update,
        )
    found = {one.name: verification.rows(one, runs) for one, runs in zip(suites, plans, strict=True)}
    pages = [_write_suite_page(one, runs, found[one.name], out) for one, runs in zip(suites, plans, strict=True)]
    if json_:
        listed = [{"suite": name, **row.plain()} for name, rows in found.items() for row in rows]
        _print_json({"rows": listed, "reports": pages})
    else:
        for one, page in zip(suites, pages, strict=True):
            console.line(one.title)
            console.check_rows(found[one.name])
            if page is not None:
                console.line(str(page))
    ok = all(verification.all_right(rows) for rows in found.values()) and None not in pages
    raise typer.Exit(0 if ok else 1)


@app.command()
def report(
    runs: Annotated[Path, typer.Argument(help="directory of runs")] = Path("runs"),
    output: Annotated[Path, typer.Option("--output", "-o", help="page to write")] = Path("report.html"),
    json_: Json = False,
) -> None:
    """Writes one page about the runs in a directory; it opens offline."""
    if not find_runs(runs):
        console.error(f"{runs} holds no runs; `dembench run` makes some")
        raise typer.Exit(2)
    page = _write_report(runs, output)
    if page is None:
        raise typer.Exit(1)
    if json_:
        _print_json({"report": str(page)})
    else:
        console.line(str(page))


@app.command()
def validate(files: Annotated[list[Path], typer.Argument(help="result files")], json_: Json = False) -> None:
    """Checks result files and lists their faults. Exit code 1 where one has any."""
    faults = {str(file): validate_file(file) for file in files}
    if json_:
        _print_json(faults)
    else:
        for file, found in faults.items():
            for fault in found or ["valid"]:
                console.line(f"{file}: {fault}")
    raise typer.Exit(1 if any(faults.values()) else 0)


@app.command()
def export(
    file: Annotated[Path, typer.Argument(help="a result file")],
    out: Annotated[Path, typer.Option("--out", "-o", help="directory of the tables")] = Path("export"),
    vtkhdf: Annotated[bool, typer.Option("--vtkhdf", help="the snapshots, too, for ParaView")] = False,
) -> None:
    """Writes every observable of a result as a CSV table."""
    try:
        result = read(file)
    except ResultError as error:
        console.error(str(error))
        raise typer.Exit(2) from None
    for path in export_csv(result, out) + (export_vtkhdf(result, out) if vtkhdf else []):
        console.line(str(path))


@app.command()
def engines(json_: Json = False) -> None:
    """Lists the engines: which are here, in which version, and how to get the others."""
    found = [(name, _probe(name)) for name in registry.names()]
    if json_:
        _print_json({name: probe.model_dump(mode="json") for name, probe in found})
        return
    console.table(
        ("engine", "version", "where, or how to get it"),
        [
            (name, p.version, p.path or "")
            if p.available
            else (name, "missing", ". ".join(text for text in (p.reason, p.install) if text))
            for name, p in found
        ],
    )


@app.command()
def cases(json_: Json = False) -> None:
    """Lists the cases with their parameters, presets and sources."""
    found = [cases_registry.case(name) for name in cases_registry.names()]
    rows: list[dict[str, Any]] = [
        {
            "name": case.name,
            "title": case.title,
            "source": case.source,
            "presets": list(case.presets),
            "parameters": {key: field.default for key, field in case.parameters.model_fields.items()},
        }
        for case in found
    ]
    if json_:
        _print_json(rows)
        return
    for row in rows:
        parameters = ",".join(f"{key}={value}" for key, value in row["parameters"].items())
        console.line(f"{row['name']}[{parameters}]  {row['title']}")
        console.line(f"  presets: {', '.join(row['presets'])}")
        console.line(f"  source: {row['source']}")


@app.command()
def doctor(json_: Json = False) -> None:
    """Shows the machine, the engines, the compute devices and the cache."""
    import warp

    with console.bar(quiet=True):
        devices = [str(device) for device in warp.get_devices()]
    found: dict[str, Any] = {
        "machine": {key: value for key, value in machine().items() if key != "packages"},
        "devices": devices,
        "cache": str(cache_directory()),
        "kernel_cache": str(warp.config.kernel_cache_dir),
        "engines": {name: _probe(name).model_dump(mode="json") for name in registry.names()},
    }
    if json_:
        _print_json(found)
        return
    shown = {**found["machine"], **{key: found[key] for key in ("devices", "cache", "kernel_cache")}}
    shown["memory"] = f"{shown['memory'] / 1e9:.1f} GB"
    for key, value in shown.items():
        console.line(f"{key}: {', '.join(value) or 'none' if isinstance(value, list) else value}")
    engines(json_=False)


@app.command()
def schema() -> None:
    """Prints the JSON schema of scene files."""
    _print_json(Scene.model_json_schema())


@app.callback(invoke_without_command=True)
def _version(version: Annotated[bool, typer.Option("--version", help="print the version")] = False) -> None:
    if version:
        console.line(__version__)
        raise typer.Exit


def main() -> None:
    """Entry point of the command `dembench`."""
    app()


def _request(what, engines, preset, initial, seeds, repeat, time, timeout, division, out) -> Request:
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


def _say_what_runs(request: Request, runs: list[PlannedRun]) -> None:
    """The first line: which preset, how long a run takes, how to get the published one."""
    if not request.is_quick_unasked():
        return
    estimates = {run.spec.label(): run.spec.estimate for run in runs}
    times = ", ".join(f"{label} {console.duration(value)}" for label, value in estimates.items())
    console.line(f"preset quick, as none was given; estimated time per run: {times}; as published: --preset published")


def _write_report(runs: Path, output: Path) -> Path | None:
    """Writes the report; what the runs produced is safe whatever happens here."""
    from dembench.reports.report import render

    try:
        return render(find_runs(runs), output)
    except Exception as error:
        console.error(f"the report could not be written: {type(error).__name__}: {error}")
        return None


def _write_suite_page(suite: Suite, runs: list[PlannedRun], rows: list[Row], out: Path) -> Path | None:
    """Writes the page of a suite; what the runs produced is safe whatever happens here."""
    from dembench.reports.suite import render

    try:
        return render(suite, [r for run in runs if (r := verification.record(run))], rows, out / f"{suite.name}.html")
    except Exception as error:
        console.error(f"the page could not be written: {type(error).__name__}: {error}")
        return None


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


def _probe(name: str) -> Probe:
    try:
        return registry.engine(name).probe()
    except ImportError as error:
        return Probe(available=False, reason=f"cannot be loaded: {error}")


def _print_json(data: Any) -> None:
    print(json.dumps(data, indent=1, default=str))
