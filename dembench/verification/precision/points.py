"""From the runs of a sweep to its points: states, times and work. Errors are added by the kind of the target."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import Any, cast

from dembench.engines import registry
from dembench.runs.directory import RunRecord
from dembench.runs.plan import PlannedRun
from dembench.verification.precision.planning import Group
from dembench.verification.precision.store import Loop, Point, State
from dembench.verification.rows import MEASURED

WORST: tuple[str, ...] = ("failed", "timeout", "interrupted", "skipped", "missing", "not run", "ok")
"""States of the runs of a point; the first that occurs is that of the point."""


def complete(group: Group) -> list[RunRecord]:
    """The runs of a point that came to their end."""
    return [r for r in group.records() if r.status.state in MEASURED and r.result is not None]


def first_samples(group: Group) -> list[RunRecord]:
    """Of each seed or trial one run that came to its end: repeats give the same result."""
    found: dict[tuple[str, int], RunRecord] = {}
    for record in complete(group):
        found.setdefault((record.spec.case, record.spec.seed), record)
    return [found[key] for key in sorted(found)]


def point(group: Group, trials: int) -> Point:
    """The point of a group, without errors.

    Args:
        group: Its runs.
        trials: Number of scenes that make one sample: the trials of an experiment, else one.
    """
    first = group.runs[0]
    done, samples = complete(group), first_samples(group)
    state, detail = _state(group, seeds=len(samples) if trials == 1 else 0)
    steps = _steps(group, samples)[:trials]
    loop = _loop(done, trials)
    return Point(
        engine=first.spec.engine,
        variant=group.variant,
        label=first.spec.label(),
        value=group.value.text,
        rank=group.value.rank,
        dt=max(run.settings.dt for run in group.runs),
        settings=first.spec.settings,
        law=first.spec.law,
        precision=first.spec.precision,
        device=first.spec.device,
        cores=first.spec.cores,
        state=state,
        detail=detail,
        runs=tuple(run.spec.name() for run in group.runs if run.directory.status() is not None),
        seeds=len(samples) // trials,
        loop=loop,
        core_seconds=loop.median * first.spec.cores if loop else None,
        steps=sum(made for made, _ in steps) if steps else None,
        passes=sum(passed for _, passed in steps) if steps else None,
        contended=any(record.status.contended for record in done),
        order=first.engine.order(first.scene, first.settings),
    )


def _state(group: Group, seeds: int) -> tuple[State, str]:
    """State of a point and why, from those of the first samples of its runs.

    An ensemble that lacks some seeds, as they were not run, is a smaller ensemble.
    """
    states = [_of_run(run) for run in group.runs if run.spec.repeat == 1]
    found = min(states, key=lambda s: WORST.index(s[0]))
    if found[0] == "not run" and seeds:
        return "ok", f"{seeds} of {len(states)} seeds, the others were not run"
    return cast(State, found[0]), found[1]


def _of_run(run: PlannedRun) -> tuple[str, str]:
    status = run.directory.status()
    if status is None:
        return "not run", "the command ended before"
    if status.state in MEASURED:
        return "ok", ""
    state = status.state if status.state in WORST else "interrupted"
    return state, "; ".join(text for text in (status.reason, status.detail) if text)


def _loop(done: Sequence[RunRecord], trials: int) -> Loop | None:
    """Times of the stepping loop; those of the trials of one sample are added."""
    samples: dict[tuple[int, int], list[dict[str, Any]]] = {}
    for record in done:
        assert record.result is not None
        samples.setdefault((record.spec.seed, record.spec.repeat), []).append(record.result.timing)
    whole = [own for own in samples.values() if len(own) == trials and all(t.get("loop") is not None for t in own)]
    if not whole:
        return None
    loops = sorted((sum(t["loop"] for t in own), _outside(own)) for own in whole)
    middle = statistics.median(loop for loop, _ in loops)
    return Loop(median=middle, low=loops[0][0], high=loops[-1][0], count=len(loops), outside=loops[len(loops) // 2][1])


def _outside(timings: Sequence[dict[str, Any]]) -> float:
    return sum(float(t.get(part) or 0.0) for t in timings for part in ("set_up", "compile", "output"))


def _steps(group: Group, samples: Sequence[RunRecord]) -> list[tuple[int, float]]:
    """Steps and passes over the contacts of each sample."""
    found = []
    for record in samples:
        assert record.result is not None
        engine = registry.engine(record.spec.engine)
        steps = round(record.spec.duration / float(record.spec.settings["dt"]))
        found.append((steps, engine.passes(steps, record.spec.settings, record.result.counters)))
    return found
