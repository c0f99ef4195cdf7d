"""A campaign: from what was asked for to scenes, runs, verdicts and the report."""

from __future__ import annotations

import re
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dembench.cases.base import Preset
from dembench.cases.registry import parse_case
from dembench.engines import registry
from dembench.engines.base import Division
from dembench.initial.filling import unsettled
from dembench.initial.progress import Progress
from dembench.results import Result
from dembench.runs.environment import available_cores
from dembench.runs.plan import EngineChoice, PlannedRun, RequestError, SceneChoice, parse_engines, plan
from dembench.runs.scheduler import Job, Scheduler
from dembench.runs.spec import RunSpec
from dembench.runs.states import Verdict
from dembench.runs.supervise import CHECKPOINT, Judge, command_line
from dembench.scene import Scene, load_scene
from dembench.scene.checks import check_scene
from dembench.scoring.score import score, verdict

REFRESH = 0.25
"""Time between two looks at the runs [s]."""
_SECONDS = {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0, "d": 86400.0}


@dataclass(frozen=True)
class Request:
    """What was asked for.

    Attributes:
        what: Cases as in `case3[bed=25k]`, or scene files.
        engines: Engines with settings; None for all that are there.
        preset: Preset of the cases; None for `quick`.
        initial: Published initial state of the cases.
        seeds: Seeds of generated initial states.
        repeats: Number of timing samples.
        time: Simulated time to cut the scenes to [s].
        timeout: Time limit of each run [s].
        division: `closed` or `open`.
        out: Directory of the run directories.
    """

    what: tuple[str, ...]
    engines: str | None = None
    preset: Preset | None = None
    initial: Path | None = None
    seeds: tuple[int, ...] = (0,)
    repeats: int = 1
    time: float | None = None
    timeout: float | None = 21600.0
    division: Division = "closed"
    out: Path = Path("runs")

    def is_quick_unasked(self) -> bool:
        """Whether cases run as `quick` because no preset was given."""
        return self.preset is None and not all(is_file(text) for text in self.what)


def is_file(text: str) -> bool:
    """Whether a text names a scene file, not a case."""
    return text.endswith(".json")


def seconds(text: str) -> float:
    """A time [s] from a text such as `90`, `45s`, `30m`, `2h`; RequestError where it is none."""
    match = re.fullmatch(r"\s*([0-9]*\.?[0-9]+)\s*([smhd]?)\s*", text)
    if match is None or float(match[1]) <= 0:
        raise RequestError(f"'{text}' is no time; write it as 90, 45s, 30m, 2h or 1d")
    return float(match[1]) * _SECONDS[match[2]]


def whole_numbers(text: str) -> tuple[int, ...]:
    """Whole numbers from a text such as `1,2,5`; RequestError where it has others, or one twice."""
    parts = [part.strip() for part in text.split(",")]
    if not all(re.fullmatch(r"[0-9]{1,9}", part) for part in parts) or len({int(p) for p in parts}) < len(parts):
        raise RequestError(f"'{text}' is no list of different whole numbers; write them as 1,2,3")
    return tuple(int(part) for part in parts)


def chosen_engines(text: str | None) -> list[EngineChoice]:
    """The engines of a text, or all that are there; see `parse_engines` for errors."""
    if text is not None:
        return parse_engines(text)
    found = [EngineChoice(name) for name in registry.names() if _is_there(name)]
    if not found:
        raise RequestError("no engine is installed; see `dembench engines`")
    return found


def build_scenes(request: Request, progress: Progress) -> list[SceneChoice]:
    """The scenes of a request.

    Args:
        request: The request.
        progress: Called while an initial state is generated.

    Raises:
        CaseError, SceneError, RequestError: What was asked for does not exist, does not fit or is no scene.
    """
    _check(request)
    return _scenes(request, progress, {}, True)


def planned(requests: Sequence[Request], progress: Progress, settle: bool = True) -> list[list[PlannedRun]]:
    """The runs of each request; what several ask for is one run, which all of them list.

    Every request is checked before the first scene is built. See `build_scenes` and `dembench.runs.plan.plan` for
    errors.

    Args:
        requests: The requests.
        progress: Called while an initial state is generated.
        settle: Whether initial states are generated that are not there; otherwise their runs are `unsettled`.
    """
    engines = [chosen_engines(request.engines) for request in requests]
    for request in requests:
        _check(request)
    scenes: dict[tuple[Any, ...], tuple[Scene, bool]] = {}
    known: dict[Path, PlannedRun] = {}
    found = []
    for request, chosen in zip(requests, engines, strict=True):
        runs = plan(
            _scenes(request, progress, scenes, settle),
            chosen,
            request.out,
            division=request.division,
            repeats=request.repeats,
            timeout=request.timeout,
        )
        found.append([known.setdefault(run.directory.path, run) for run in runs])
    return found


def judge(run: PlannedRun, result: Result) -> Verdict:
    """The verdict of scoring on a run; see `judged`."""
    return judged(run.spec, run.scene, result)


def judged(spec: RunSpec, scene: Scene, result: Result) -> Verdict:
    """The verdict of scoring on a result; a scene file has no references."""
    if spec.preset is None:
        return Verdict()
    case, parameters = parse_case(spec.case)
    preset: Any = spec.preset
    scores = score(case, scene, result, parameters, preset)
    found = verdict(scores)
    outside = [
        f"{s.quantity.title} {s.quantity.value:.6g} {s.quantity.unit} is outside"
        f" {_range(s.reference.low, s.reference.high)} ({s.reference.source})"
        for s in scores
        if s.within is False and s.reference is not None
    ]
    return Verdict(
        state="inaccurate" if found == "inaccurate" else "ok", scored=found != "unscored", detail="; ".join(outside)
    )


def carry_out(
    runs: list[PlannedRun],
    *,
    at_once: int = 1,
    fresh: bool = False,
    checkpoint: float = CHECKPOINT,
    budget: float | None = None,
    judge: Judge = judge,
    beside_workload: bool = False,
    show: Callable[[list[Job]], None],
) -> list[Job]:
    """Carries out the runs that are not finished yet; SIGINT and SIGTERM end them in good order.

    Args:
        runs: Planned runs.
        at_once: Largest number of runs at a time.
        fresh: Whether finished runs are run again, and interrupted ones from the start.
        checkpoint: Time between checkpoints of a result [s].
        budget: Time after which no other run is started [s]; None for no limit.
        judge: Gives a finished run its verdict.
        beside_workload: Whether the reference workload is timed before and after each run.
        show: Called a few times per second with all jobs.
    """
    jobs = [Job(run, run.action(fresh)) for run in runs]
    options: dict[str, Any] = {
        "judge": judge,
        "fresh": fresh,
        "checkpoint": checkpoint,
        "command": command_line(),
        "beside_workload": beside_workload,
    }
    scheduler = Scheduler(jobs, available_cores(), at_once, budget=budget, **options)
    with _signals() as asked_to_end:
        scheduler.start()
        try:
            while not scheduler.wait(REFRESH):
                if asked_to_end():
                    scheduler.interrupt()
                show(scheduler.jobs)
            show(scheduler.jobs)
        finally:
            scheduler.interrupt()  # also where showing failed: no engine outlives the command
    return scheduler.jobs


@contextmanager
def _signals() -> Iterator[Callable[[], bool]]:
    """Within it SIGINT and SIGTERM are noted, not raised: ending in good order takes a moment."""
    seen: list[int] = []
    old = {number: signal.signal(number, lambda n, _: seen.append(n)) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(seen)
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)


def _is_there(name: str) -> bool:
    try:
        return registry.engine(name).probe().available
    except ImportError:
        return False


def _check(request: Request) -> None:
    for text in request.what:
        if is_file(text):
            _check_options_of_file(text, request)
        else:
            case, parameters = parse_case(text)
            case.check(parameters, request.preset or "quick", request.initial)


def _check_options_of_file(text: str, request: Request) -> None:
    for option, given in (
        ("--preset", request.preset is not None),
        ("--initial", request.initial is not None),
        ("--seeds", request.seeds != (0,)),
    ):
        if given:
            raise RequestError(f"{option} is for cases; the scene file {text} says everything itself")


def _scenes(
    request: Request, progress: Progress, made: dict[tuple[Any, ...], tuple[Scene, bool]], settle: bool
) -> list[SceneChoice]:
    """The scenes of a checked request; those that are in `made` are taken from it, the others added to it."""
    found = []
    for text in request.what:
        for seed in request.seeds:
            key = (text, request.preset, request.initial, seed, request.time)
            if key not in made:
                with ExitStack() as stack:
                    lattices = [] if settle else stack.enter_context(unsettled())
                    scene = _cut(_scene(text, request, seed, progress), request.time)
                if not lattices:
                    check_scene(scene)
                made[key] = scene, bool(lattices)
            name = Path(text).name if is_file(text) else text
            found.append(SceneChoice(name, None if is_file(text) else request.preset or "quick", seed, *made[key]))
    return found


def _scene(text: str, request: Request, seed: int, progress: Progress) -> Scene:
    if is_file(text):
        return load_scene(Path(text))
    case, parameters = parse_case(text)
    return case.scene(parameters, request.preset or "quick", request.initial, seed, progress)


def _cut(scene: Scene, time: float | None) -> Scene:
    if time is None:
        return scene
    try:
        return scene.cut(time)
    except ValueError as error:
        raise RequestError(f"--time: {error}") from None


def _range(low: float | None, high: float | None) -> str:
    return f"{'-inf' if low is None else f'{low:g}'} to {'inf' if high is None else f'{high:g}'}"
