"""Errors of sweeps over experiments with closed forms."""

from __future__ import annotations

import math
from collections.abc import Sequence

from dembench.results import Result
from dembench.scoring.errors import relative
from dembench.verification.precision.planning import Group
from dembench.verification.precision.points import first_samples
from dembench.verification.precision.store import Error, Measure
from dembench.verification.precision.targets import Target, scale_of
from dembench.verification.rows import measured


def measures(target: Target) -> tuple[Measure, ...]:
    """What the errors are of: the checks that have exact values."""
    return tuple(
        Measure(
            name=check.id,
            title=check.title,
            kind="closed form",
            unit="relative",
            scale=f"{scale_of(check):.4g} {'' if check.unit == '1' else check.unit}".strip(),
            source=check.source,
            accepted=check.tolerance / scale_of(check),
        )
        for check in target.checks()
    )


def errors(target: Target, groups: Sequence[Group]) -> list[tuple[Error, ...]]:
    """The errors of each point: total against the closed form, own against the finest point of the same variant."""
    found = [_values(target, group) for group in groups]
    limits: dict[str, tuple[int, dict[str, float]]] = {}
    for group, values in zip(groups, found, strict=True):
        if values and group.value.rank >= limits.get(group.variant, (-1, {}))[0]:
            limits[group.variant] = group.value.rank, values
    made = []
    for group, values in zip(groups, found, strict=True):
        rank, limit = limits.get(group.variant, (-1, {}))
        own = []
        for check in target.checks() if values else ():
            scale, value = scale_of(check), values[check.id]
            total = relative(value, check.expected, scale)
            apart = relative(value, limit[check.id], scale) if rank != group.value.rank else math.nan
            own.append(Error(measure=check.id, total=_known(total), own=_known(apart)))
        made.append(tuple(own))
    return made


def _values(target: Target, group: Group) -> dict[str, float]:
    """What was measured; empty unless every trial came to its end."""
    results: dict[str, Result] = {r.spec.case: r.result for r in first_samples(group) if r.result is not None}
    if target.experiment is None or len(results) < len(target.scenes):
        return {}
    return measured(target.experiment, results)[0]


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
