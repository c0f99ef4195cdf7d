"""A sweep from its runs to its table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from dembench.runs.directory import RunRecord, now
from dembench.runs.plan import RequestError
from dembench.verification.precision import bulk, closed_form, paths
from dembench.verification.precision.planning import Group
from dembench.verification.precision.points import point
from dembench.verification.precision.store import Error, Measure, Point, Sweep
from dembench.verification.precision.targets import Target

FEW_SEEDS = 5
"""Seeds of a tested point below which statements about ensembles are weak."""


def check_references(typed: Sequence[str], groups: Sequence[Group]) -> None:
    """RequestError where an engine that is to be a reference is not in the sweep."""
    names = list(dict.fromkeys(group.choice.engine for group in groups))
    for name in typed:
        if name not in names:
            raise RequestError(f"--reference {name}: the engines of this sweep are {', '.join(names)}")


def table(target: Target, knob: str, groups: Sequence[Group], command: str, typed: Sequence[str] = ()) -> Sweep:
    """The table of a sweep, from what its runs have left; measures that no run reaches are left out.

    Args:
        target: What it is about.
        knob: Name of the setting.
        groups: Its points.
        command: What reproduces it.
        typed: Engines whose limits stand for the truth; empty takes all that compute the scene's law.
    """
    references = _references(groups, typed)
    converged: dict[str, bool | None] = {}
    horizon = math.inf
    measures: tuple[Measure, ...]
    errors: Sequence[tuple[Error, ...]]
    if target.kind == "closed form":
        measures, errors = closed_form.measures(target), closed_form.errors(target, groups)
        references = []
    elif target.kind == "path":
        known = paths.limits(groups)
        measures, errors = paths.measures(references), paths.errors(groups, known, references)
        converged, horizon = known.converged, known.horizon
    else:
        assert target.case is not None
        samples, ends = bulk.limits(target.case, groups)
        measures = bulk.measures(target.case, references)
        errors = bulk.errors(target.case, groups, samples, ends, references)
        converged = ends.converged
    trials = len(target.scenes) if target.kind == "closed form" else 1
    points = tuple(
        point(group, trials).model_copy(update={"errors": own}) for group, own in zip(groups, errors, strict=True)
    )
    return Sweep(
        target=target.problem_name,
        kind=target.kind,
        knob=knob,
        problem=target.problem(),
        command=command,
        made=now(),
        machine=_machine(groups),
        references=tuple(references),
        converged=converged,
        horizon=horizon if math.isfinite(horizon) else None,
        notes=_notes(target, points, references, converged),
        measures=tuple(m for m in measures if any(p.error(m.name) for p in points)),
        points=points,
    )


def _references(groups: Sequence[Group], typed: Sequence[str]) -> list[str]:
    """Variants whose finest points are references: of the engines that were typed, or with the scene's own law."""
    taken = [g for g in groups if (g.choice.engine in typed if typed else not g.runs[0].spec.law)]
    return list(dict.fromkeys(g.variant for g in taken))


def _notes(
    target: Target, points: Sequence[Point], references: Sequence[str], converged: Mapping[str, bool | None]
) -> tuple[str, ...]:
    found = []
    if moving := [reference for reference in references if converged.get(reference) is False]:
        found.append(f"The limit of {', '.join(moving)} has not settled: it moves from the second finest point on.")
    engines = {reference.partition("[")[0] for reference in references}
    alone = [p.engine for p in points if target.kind != "closed form" and not engines - {p.engine}]
    if alone:
        found.append(
            f"{', '.join(dict.fromkeys(alone))}: no other engine gives a reference, so the total error is not known; "
            "an engine's own fine run is never its only reference."
        )
    seeds = [p.seeds for p in points if p.state == "ok"]
    if target.kind == "ensemble" and seeds and min(seeds) < FEW_SEEDS:
        found.append(
            f"Points have as few as {min(seeds)} seeds; {FEW_SEEDS} and more make a statement, ten a reference."
        )
    left = sum(point.state == "not run" for point in points)
    if left:
        found.append(f"{left} of {len(points)} points were not run: the budget was spent. The same command goes on.")
    return tuple(found)


def _machine(groups: Sequence[Group]) -> str:
    """Processor and number of cores, from the first run that has them."""
    for group in groups:
        for run in group.runs:
            if run.directory.status() is not None and (found := RunRecord(run.directory.path).environment):
                return f"{found.get('cpu', 'unknown processor')}, {found.get('cores', '?')} cores"
    return ""
