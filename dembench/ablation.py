"""Ablation: each feature that a scene lacks, left out and forced on: time, memory, and whether results are equal."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dembench.engines import registry
from dembench.results import Result
from dembench.runs.directory import RunRecord
from dembench.runs.plan import EngineChoice, PlannedRun, SceneChoice, plan

EVERYTHING = "all of them"
"""Name of the row in which every absent feature is forced."""
BYTES = "bytes of all arrays"
"""Counter of engines that know the size of their state."""


@dataclass(frozen=True)
class Cost:
    """What the repeats of one run took.

    Attributes:
        loop: Median CPU time of the stepping loop, its wall time where an engine knows no other [s]; None where no
            repeat came to its end.
        shortest, longest: Of the repeats [s].
        state: Size of the engine's arrays [bytes]; None where the engine does not know it.
        peak: Largest memory of the processes, least of the repeats [bytes].
    """

    loop: float | None = None
    shortest: float | None = None
    longest: float | None = None
    state: float | None = None
    peak: float | None = None


@dataclass(frozen=True)
class Ablation:
    """One feature in one scene on one engine.

    Attributes:
        scene: Case as typed, scene file or name of a scene of this suite.
        engine: The engine as typed.
        feature: The forced feature, or `EVERYTHING`; empty where the engine can force none.
        left_out, forced: Costs without and with it.
        equal: Whether both results are the same to the bit; None where one is missing.
        first: Time at which they differ first [s].
        apart: Largest difference of positions then [m].
        why: Why there is nothing to compare, or why the results differ.
    """

    scene: str
    engine: str
    feature: str
    left_out: Cost = Cost()
    forced: Cost = Cost()
    equal: bool | None = None
    first: float | None = None
    apart: float | None = None
    why: str = ""

    @property
    def slowdown(self) -> float | None:
        """Loop time with the feature forced over that without it."""
        if not self.left_out.loop or not self.forced.loop:
            return None
        return self.forced.loop / self.left_out.loop

    def plain(self) -> dict[str, Any]:
        """As JSON."""
        return {**asdict(self), "slowdown": self.slowdown}


WHY = {
    "polydisperse": "constants of each pair are scaled in the precision of the contacts, not once in float64",
    EVERYTHING: "constants of each pair are scaled in the precision of the contacts, not once in float64",
}
"""Why a forced feature changes the last digits; motion of many bodies then makes them grow."""
ROUNDING = "the compiled arithmetic rounds elsewhere"
NOTHING = "what it leaves out of its deck are commands that would act on nothing"


def planned(
    scenes: Sequence[SceneChoice], engines: Sequence[EngineChoice], out: Path, repeats: int, timeout: float
) -> list[PlannedRun]:
    """The runs of an ablation, repeats interleaved: each engine as it is, with each feature forced, and with all.

    Args:
        scenes: Scenes.
        engines: Engines with settings.
        out: Directory that holds the run directories.
        repeats: Number of timing samples of each run.
        timeout: Time limit of each run [s].

    Raises:
        RequestError, SettingsError: See `dembench.runs.plan.plan`.
    """
    runs = []
    for scene in scenes:
        choices = [variant for choice in engines for variant in _variants(scene, choice)]
        runs += plan([scene], choices, out, repeats=repeats, timeout=timeout)
    return runs


def _variants(scene: SceneChoice, choice: EngineChoice) -> list[EngineChoice]:
    names = _forceable(scene, choice)
    wanted = [*names, "+".join(names)] if len(names) > 1 else names
    forced = [EngineChoice(choice.engine, {**choice.overrides, "force": name}) for name in wanted]
    return [choice, *forced]


def _forceable(scene: SceneChoice, choice: EngineChoice) -> list[str]:
    engine = registry.engine(choice.engine)
    if engine.unsupported(scene.scene):
        return []
    return engine.forceable(scene.scene, engine.settings(scene.scene, "closed", choice.overrides))


def rows(runs: Sequence[PlannedRun]) -> list[Ablation]:
    """One row per scene, engine and forced feature, in the order of the runs."""
    by_variant: dict[tuple[str, str, str], dict[str, list[PlannedRun]]] = {}
    for run in runs:
        own = {k: v for k, v in run.spec.overrides.items() if k != "force"}
        settings = ",".join(f"{k}={v}" for k, v in own.items())
        engine = f"{run.spec.engine}[{settings}]" if settings else run.spec.engine
        variants = by_variant.setdefault((run.spec.case, run.spec.scene_digest, engine), {})
        variants.setdefault(run.spec.overrides.get("force", ""), []).append(run)
    found = []
    for (scene, _digest, engine), variants in by_variant.items():
        base = _records(variants.pop(""))
        if not variants:
            faults = base[0].status.detail if base else ""
            found.append(Ablation(scene, engine, "", _cost(base), why=faults or NOTHING))
        for name, forced in variants.items():
            found.append(_row(scene, engine, EVERYTHING if "+" in name else name, base, _records(forced)))
    return found


def _records(runs: Sequence[PlannedRun]) -> list[RunRecord]:
    return [RunRecord(run.directory.path) for run in runs if run.directory.status() is not None]


def _row(scene: str, engine: str, feature: str, base: list[RunRecord], forced: list[RunRecord]) -> Ablation:
    costs = _cost(base), _cost(forced)
    first = [next((r.result for r in records if _ended(r)), None) for records in (base, forced)]
    if first[0] is None or first[1] is None:
        lacking = base if first[0] is None else forced
        detail = lacking[0].status.detail if lacking else "no run"
        return Ablation(scene, engine, feature, *costs, why=detail or "no run came to its end")
    differs = difference(first[0], first[1])
    if differs is None:
        return Ablation(scene, engine, feature, *costs, equal=True)
    return Ablation(scene, engine, feature, *costs, False, *differs, why=WHY.get(feature, ROUNDING))


def _ended(record: RunRecord) -> bool:
    return record.status.state in ("ok", "inaccurate") and record.result is not None


def _cost(records: Sequence[RunRecord]) -> Cost:
    ended = [r.result for r in records if _ended(r) and r.result is not None]
    spent = [r.timing.get("loop_cpu") or r.timing.get("loop") for r in ended]
    loops = [float(loop) for loop in spent if loop is not None]
    peaks = [float(r.resources["peak_memory"]) for r in ended if r.resources.get("peak_memory")]
    states = [float(r.counters[BYTES]) for r in ended if BYTES in r.counters]
    return Cost(
        loop=statistics.median(loops) if loops else None,
        shortest=min(loops, default=None),
        longest=max(loops, default=None),
        state=max(states, default=None),
        peak=min(peaks, default=None),
    )


def difference(first: Result, second: Result) -> tuple[float, float] | None:
    """Time at which two results of a scene differ first [s], and by how far positions do then [m]; None for equal ones.

    Compared are all values of all series and of all snapshots, to the bit but for the sign of 0.
    """
    times = []
    for name, series in first.observables.items():
        other = second.observables[name]
        times += _unequal(series.time, [(series.value, other.value)])
    apart: dict[float, float] = {}
    for name, state in first.snapshots.items():
        other_state = second.snapshots[name]
        fields = ("position", "velocity", "angular_velocity")
        times += _unequal(state.time, [(getattr(state, f), getattr(other_state, f)) for f in fields])
        for k, time in enumerate(state.time):
            gap = np.abs(state.position[k] - other_state.position[k])
            apart[float(time)] = max(apart.get(float(time), 0.0), float(np.nanmax(gap, initial=0.0)))
    if not times:
        return None
    earliest = min(times)
    return earliest, apart.get(earliest, math.nan)


def _unequal(time: np.ndarray, pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[float]:
    """Times at which one of the pairs of arrays, shape (t, ...), is not equal."""
    return [
        float(t)
        for k, t in enumerate(time)
        if any(not np.array_equal(a[k], b[k], equal_nan=True) for a, b in pairs if a.dtype.kind in "fiu")
    ]
