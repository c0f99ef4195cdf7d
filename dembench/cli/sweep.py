"""Verbs about precision: what an error costs, and which setting to take."""

from __future__ import annotations

import math
import re
import shlex
from pathlib import Path
from typing import Annotated

import typer

from dembench import campaign, console
from dembench.campaign import Request
from dembench.cli.options import (
    Engines,
    Fresh,
    Initial,
    Json,
    PresetName,
    Time,
    given,
    print_json,
    usage_errors,
)
from dembench.runs.plan import RequestError, split_list
from dembench.runs.supervise import command_line
from dembench.verification import campaign as verification
from dembench.verification.precision import advice, knobs, planning, store
from dembench.verification.precision import sweep as precision
from dembench.verification.precision.levels import cheapest_settings
from dembench.verification.precision.targets import Target, known_suites, posed, target

SWEEPS = Path("runs/sweep")
SEEDS, REPEATS = 5, 3
"""Seeds of a case, and timing samples of a scene that has no seeds, unless others are typed."""


What = Annotated[
    str, typer.Argument(metavar="TARGET", help="a case as case3, a scene file *.json, or an experiment as hertz_bounce")
]


def sweep(
    what: What,
    engines: Engines = None,
    knob: Annotated[str, typer.Option(help="setting that is swept: dt, substeps, arithmetic, ...")] = knobs.DT,
    points: Annotated[int, typer.Option(min=2, max=64, help="values of the knob")] = 8,
    values: Annotated[
        str, typer.Option(help="values, from coarse to fine; for dt in steps of the closed division")
    ] = "",
    span: Annotated[str, typer.Option(help="coarsest and finest dt, in steps of the closed division")] = "8,0.125",
    seeds: Annotated[int, typer.Option(min=1, help="seeds of a case; five and more make a statement")] = SEEDS,
    repeat: Annotated[int | None, typer.Option(min=1, help="timing samples; default: 3, of cases 1 a seed")] = None,
    budget: Annotated[str, typer.Option(help="time after which no other run is started, as 30m")] = "30m",
    timeout: Annotated[str, typer.Option(help="time limit of each run")] = "10m",
    reference: Annotated[str, typer.Option(help="engines whose limits are the truth; default: all with the law")] = "",
    preset: PresetName = None,
    initial: Initial = None,
    time: Time = None,
    out: Annotated[Path, typer.Option(help="directory of the sweeps and their page")] = SWEEPS,
    fresh: Fresh = False,
    json_: Json = False,
) -> None:
    """Error against run time: runs engines with several values of one setting and measures what each error costs.

    A target with a closed form has relative errors, a scene file those of paths up to where they diverge, a case those
    of ensembles of seeds. Runs are ordinary ones: repeating the command goes on with what the budget left. The table
    is `sweep.json` in the directory of the target; the page covers all sweeps of the directory.
    Exit code 0: every run of the budget came to its end; 1: one did not; 2: a usage error.
    """
    with usage_errors():
        limits = _span(span)
        chosen = campaign.chosen_engines(engines)
        taken = knobs.values(knob, chosen, points, split_list(values), limits)
        fields = given(initial=initial, preset=preset, time=time)
        all_seeds = tuple(range(seeds)) if not campaign.is_file(what) else (0,)
        request = Request(what=(what,), seeds=all_seeds, **fields)
        with console.bar(json_) as progress:
            about = target(what, request, progress)
        repeats = repeat or (1 if about.kind == "ensemble" else REPEATS)
        directory = out / f"{_slug(about.name)}-{_slug(knob)}"
        found = planning.groups(
            about,
            chosen,
            knob,
            taken,
            directory,
            own_step=knob == knobs.DT and not values,
            repeats=repeats,
            timeout=campaign.seconds(timeout),
        )
        precision.check_references(split_list(reference), found)
        allowed = campaign.seconds(budget)
    with console.Display(quiet=json_) as display:
        jobs = campaign.carry_out(
            planning.in_order(found), fresh=fresh, budget=allowed, judge=_judge(about), show=display.update
        )
    made = precision.table(about, knob, found, command_line(), split_list(reference))
    store.write(made, directory)
    page = _write_page(out)
    if json_:
        print_json({"sweep": made.model_dump(mode="json"), "report": str(page) if page else None})
    else:
        _print(made)
        if page is not None:
            console.line(str(page))
    ended = all(job.status is None or job.status.state in ("ok", "inaccurate", "skipped") for job in jobs)
    raise typer.Exit(0 if ended and page is not None else 1)


def advise(
    what: What,
    engines: Annotated[str, typer.Option(help="engines to advise on, as a,b; default: all that were swept")] = "",
    preset: PresetName = None,
    initial: Initial = None,
    sweeps: Annotated[Path, typer.Option(help="directory of sweeps; those that ship are looked at, too")] = SWEEPS,
    json_: Json = False,
) -> None:
    """Which setting of each engine reaches an error at the least cost, from the sweep of the nearest problem.

    Exit code 0: a sweep fits; 1: none does, with the reason; 2: a usage error.
    """
    with usage_errors():
        request = Request(what=(what,), **given(initial=initial, preset=preset))
        with console.bar(json_) as progress:
            name, scene = posed(what, request, progress)
        makes = shlex.join(["dembench", "sweep", what, *(["--preset", preset] if preset else [])])
        found = advice.advise(scene, name, sweeps, split_list(engines), makes)
    if json_:
        print_json(found.plain())
    else:
        console.line(found.sentence())
        if found.rows:
            console.table(advice.COLUMNS, [row.texts() for row in found.rows])
        for note in found.notes:
            console.line(note)
    raise typer.Exit(0 if found.rows else 1)


def _span(text: str) -> tuple[float, float]:
    try:
        first, last = (float(part) for part in text.split(","))
    except ValueError:
        raise RequestError(f"--span: '{text}' is no pair of factors; write them as 8,0.125") from None
    if not (first > 0 and last > 0 and math.isfinite(first * last)):
        raise RequestError(f"--span: '{text}' has a factor that is not above 0")
    return max(first, last), min(first, last)


def _slug(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9]+", "-", text.removesuffix(".json")).strip("-")


def _judge(about: Target) -> verification.Judge:
    """How runs are judged: by the checks of an experiment, else as everywhere."""
    if about.experiment is None:
        return campaign.judge
    suites = [one for one in known_suites() if about.experiment.name in {e.name for e in one.experiments}]
    return verification.judge(suites)


def _write_page(out: Path) -> Path | None:
    """Writes the page of all sweeps of a directory; what the runs produced is safe whatever happens here."""
    from dembench.reports.precision import render

    try:
        return render(store.find(out), out / "precision.html")
    except Exception as error:
        console.error(f"the page could not be written: {type(error).__name__}: {error}")
        return None


def _print(made: store.Sweep) -> None:
    """Prints the points of a sweep and the cheapest settings."""
    console.line(f"{made.target}, {made.problem.title}: error against run time, {made.knob}")
    names = [measure.name for measure in made.measures]
    rows = []
    for variant in made.variants():
        for one in made.of(variant):
            errors = [one.error(name) for name in names]
            texts = ["-" if e is None or e.total is None else f"{e.total:.2e}" for e in errors]
            loop = f"{one.loop.median:.3g} s" if one.loop else "-"
            mark = "contended" if one.contended else ""
            rows.append((variant, made.words(one.value), f"{one.dt:.3g} s", one.state, loop, *texts, mark))
    console.table(("engine", made.knob, "step", "state", "loop", *names, ""), rows)
    cheapest = [(c, made.words(c.value) if c.point else "not reached") for c in cheapest_settings(made)]
    console.table(
        ("engine", "reaches", "at", "loop", "limited by"),
        [(c.variant, c.level, words, c.cost(), c.limit) for c, words in cheapest],
    )
    for note in made.notes:
        console.line(note)
