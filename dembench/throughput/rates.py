"""From scenes, engines and numbers of cores to runs, and from their times to rates.

What is timed is measured from outside and alike for all engines: each sample is a run to the shorter and a run to the
longer end of a scene, by the same supervisor, and the differences of their wall times and of the CPU times of all their
processes are those of the steps in between. Starting, compiling, reading, the first list of neighbours and the output
are part of both and fall out. The clocks that engines keep themselves are shown beside it and decide nothing.
"""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from dembench.engines import registry
from dembench.engines.base import SettingsError
from dembench.results import ResultError, read_records
from dembench.runs.plan import EngineChoice, PlannedRun, RequestError, SceneChoice, plan
from dembench.runs.scheduler import Job
from dembench.runs.spec import label
from dembench.throughput.scenes import Timed

ENDED = ("ok", "inaccurate")
"""States of runs whose time counts."""
WARM_UP = 1
"""Samples before those that count: kernels are compiled and files are read then."""
LEAST_BUSY = 0.9
"""Core-seconds over wall time and cores below which a row is marked: the cores were held by others, or the engine
waited [-]."""


@dataclass(frozen=True)
class Entry:
    """An engine on some cores with a scene: what becomes a row.

    Attributes:
        scene: The scene.
        engine: The engine with its settings as typed.
        cores: Number of cores.
        samples: Runs to the shorter and to the longer end, by repeat, the warm-up first; none where it is refused.
        refused: Why the engine cannot do the scene, or not on so many cores; else empty.
    """

    scene: Timed
    engine: str
    cores: int
    samples: tuple[tuple[PlannedRun, PlannedRun], ...] = ()
    refused: str = ""


@dataclass(frozen=True)
class Spent:
    """What a run took, or the difference of two.

    Attributes:
        wall: Wall time of its processes [s].
        cpu: CPU time of all of them [s].
        loop: Time of the stepping loop by the engine's own clock [s]; None where it has none.
        memory: Largest memory [B].
        contended: Whether other programs held the cores before its start or made it wait.
    """

    wall: float
    cpu: float
    loop: float | None = None
    memory: float = 0.0
    contended: bool = False

    def beyond(self, short: Spent) -> Spent:
        """What the longer of two runs took beyond the shorter one; the memory is its own."""
        loop = None if self.loop is None or short.loop is None else self.loop - short.loop
        contended = self.contended or short.contended
        return Spent(self.wall - short.wall, self.cpu - short.cpu, loop, self.memory, contended)


@dataclass(frozen=True)
class Rate:
    """How fast an engine makes the steps of a scene on some cores; None where there is no rate.

    Attributes:
        scene, engine: Names; the engine with its settings as typed.
        cores: Cores that it had.
        particle_steps_per_second: Bodies times steps over the wall time of the steps, median of the samples [1/s].
        spread: Distance of the fastest and slowest sample over the median [-].
        slowest, fastest: Those of the samples [1/s].
        samples: Number of samples.
        wall: Wall time of the steps, median [s].
        core_seconds: CPU time of all processes in them, median [s].
        busy: Core-seconds over wall time and cores, the least of the samples [-].
        own_clock: The rate by the engine's own clock, median [1/s]; None where it has none.
        peak_memory: Largest memory of its processes [B].
        bodies, steps, dt: Bodies, steps that are timed, and the time step [s].
        touching: Pairs that touch at the start, over the number of bodies [-].
        start: Name of the scene with its initial state.
        version: Version of the engine.
        settings: All its settings.
        law: Contact law that the engine computes; empty where it is the scene's.
        contended: Whether other programs used the cores, or the engine let them idle.
        detail: Why there is no rate, or why samples are missing.
    """

    scene: str
    engine: str
    cores: int
    particle_steps_per_second: float | None = None
    spread: float | None = None
    slowest: float | None = None
    fastest: float | None = None
    samples: int = 0
    wall: float | None = None
    core_seconds: float | None = None
    busy: float | None = None
    own_clock: float | None = None
    peak_memory: float | None = None
    bodies: int = 0
    steps: int = 0
    dt: float = 0.0
    touching: float = 0.0
    start: str = ""
    version: str = ""
    settings: dict[str, Any] = field(default_factory=dict)
    law: str = ""
    contended: bool = False
    detail: str = ""

    def plain(self) -> dict[str, Any]:
        """As JSON."""
        return asdict(self)


def settings_text(settings: Mapping[str, Any]) -> str:
    """Settings in a line, those without a value left out: `dt=1e-05, threads=1`."""
    known = {key: value for key, value in settings.items() if value is not None}
    return ", ".join(f"{key}={value:.8g}" if type(value) is float else f"{key}={value}" for key, value in known.items())


# ---- runs


def planned(
    scenes: Sequence[Timed],
    engines: Sequence[EngineChoice],
    cores: Sequence[int],
    out: Path,
    *,
    samples: int,
    timeout: float | None,
) -> list[Entry]:
    """What becomes rows: every scene with every engine on every number of cores.

    Args:
        scenes: Scenes.
        engines: Engines with settings.
        cores: Numbers of cores.
        out: Directory that holds the run directories.
        samples: Samples that count.
        timeout: Time limit of each run [s].

    Raises:
        RequestError: Settings of an engine ask for another step or number of cores than the others have, or there are
            not as many cores.
        SettingsError: A setting is not known or not accepted.
    """
    return [
        _entry(scene, choice, number, out, samples + WARM_UP, timeout)
        for scene in scenes
        for number in cores
        for choice in engines
    ]


def _entry(scene: Timed, choice: EngineChoice, cores: int, out: Path, repeats: int, timeout: float | None) -> Entry:
    engine, name = registry.engine(choice.engine), label(choice.engine, choice.overrides)
    given = {"dt": repr(scene.dt)}
    settings = engine.settings(scene.long, "closed", {**given, **choice.overrides})
    if engine.cores_setting is not None:
        given[engine.cores_setting] = str(cores)
        try:
            settings = engine.settings(scene.long, "closed", {**given, **choice.overrides})
        except SettingsError as error:
            return Entry(scene, name, cores, refused=str(error))
    elif cores > 1:
        return Entry(scene, name, cores, refused="it cannot share a step among cores")
    if faults := engine.unsupported(scene.long):
        return Entry(scene, name, cores, refused=f"unsupported: {'; '.join(faults)}")
    if settings.cores() != cores:
        raise RequestError(f"{name} occupies {settings.cores()} cores; --cores says how many, here {cores}")
    if abs(settings.dt / scene.dt - 1) > 1e-9:
        raise RequestError(
            f"{name} has a step of {settings.dt:g} s; all engines make that of {scene.name}, {scene.dt:g} s"
        )
    ends = [SceneChoice(f"{scene.name}-short", None, 0, scene.short), SceneChoice(scene.name, None, 0, scene.long)]
    given_choice = EngineChoice(choice.engine, choice.overrides, given)
    runs = plan(ends, [given_choice], out, repeats=repeats, timeout=timeout)
    return Entry(scene, name, cores, tuple(zip(runs[:repeats], runs[repeats:], strict=True)))


def in_turn(entries: Sequence[Entry]) -> list[PlannedRun]:
    """All runs in their order: scene by scene, and in each the engines in turn, sample after sample.

    So a slow drift of the machine meets all engines alike; both runs of a sample follow each other.
    """
    runs: list[PlannedRun] = []
    for scene in dict.fromkeys(entry.scene.name for entry in entries):
        own = [entry.samples for entry in entries if entry.scene.name == scene and entry.samples]
        runs += [run for turn in zip(*own, strict=True) for pair in turn for run in pair]
    return runs


# ---- rows


def rates(entries: Sequence[Entry], jobs: Sequence[Job]) -> list[Rate]:
    """A row for each entry, in their order, whatever became of its runs."""
    spent = {job.run.directory.path: _spent(job) for job in jobs}
    found = []
    for entry in entries:
        counted = entry.samples[WARM_UP:]
        found.append(rate(entry, [(spent[a.directory.path], spent[b.directory.path]) for a, b in counted]))
    return found


def rate(entry: Entry, samples: Sequence[tuple[Spent | str, Spent | str]]) -> Rate:
    """The row of an entry.

    Args:
        entry: The entry.
        samples: What the runs to the shorter and to the longer end took, or why one came to no end.
    """
    scene = entry.scene
    known: dict[str, Any] = {
        "scene": scene.name,
        "engine": entry.engine,
        "cores": entry.cores,
        "bodies": scene.bodies,
        "steps": scene.steps,
        "dt": scene.dt,
        "touching": scene.touching,
        "start": scene.long.name,
    }
    if entry.refused:
        return Rate(**known, detail=entry.refused)
    first = entry.samples[0][1]
    known |= {"version": first.probe.version, "settings": first.spec.settings, "law": first.spec.law}
    faults = list(dict.fromkeys(part for pair in samples for part in pair if isinstance(part, str)))
    steps = [long.beyond(short) for short, long in _both(samples)]
    if any(s.wall <= 0 for s in steps):
        faults.append("the steps are too few to be told from the start of the program; --steps takes more")
        steps = []
    if not steps:
        return Rate(**known, detail="; ".join(faults))
    speeds = [scene.bodies * scene.steps / s.wall for s in steps]
    loops = [s.loop for s in steps if s.loop]
    median, busy = statistics.median(speeds), min(s.cpu / (s.wall * entry.cores) for s in steps)
    return Rate(
        **known,
        particle_steps_per_second=median,
        spread=(max(speeds) - min(speeds)) / median,
        slowest=min(speeds),
        fastest=max(speeds),
        samples=len(steps),
        wall=statistics.median(s.wall for s in steps),
        core_seconds=statistics.median(s.cpu for s in steps),
        busy=busy,
        own_clock=scene.bodies * scene.steps / statistics.median(loops) if len(loops) == len(steps) else None,
        peak_memory=max(s.memory for s in steps),
        contended=busy < LEAST_BUSY or any(s.contended for s in steps),
        detail="; ".join(faults),
    )


def _both(samples: Sequence[tuple[Spent | str, Spent | str]]) -> list[tuple[Spent, Spent]]:
    """The samples of which both runs came to their end."""
    return [(a, b) for a, b in samples if isinstance(a, Spent) and isinstance(b, Spent)]


def _spent(job: Job) -> Spent | str:
    """What a run took, or why it came to no end."""
    status = job.status
    if status is None:
        return "not run"
    if status.state not in ENDED:
        return f"{status.label()}: {status.detail}".rstrip(": ")
    try:
        records = read_records(job.run.directory.result)
    except ResultError as error:
        return str(error)
    timing, resources = records["timing"], records["resources"]
    loop = timing.get("loop") if timing.get("source") != "wall" else None
    return Spent(resources["wall"], resources["cpu"], loop, resources["peak_memory"], status.contended)
