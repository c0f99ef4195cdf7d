"""Errors of sweeps over one scene without a closed form: paths against converged runs, up to where they diverge."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dembench.results import Result
from dembench.runs.directory import RunRecord
from dembench.scoring import errors as scoring
from dembench.verification.precision.planning import Group
from dembench.verification.precision.points import first_samples
from dembench.verification.precision.store import Error, Measure
from dembench.verification.rows import MEASURED

NAME = "path"
SETTLED = 1e-3
"""Distance of the two finest points of a variant, in diameters, below which its limit counts as settled [-]."""


@dataclass(frozen=True)
class Paths:
    """Positions of a run [m], shape (t, n, 3), at times [s], and diameters of the bodies [m], shape (n,)."""

    time: np.ndarray
    position: np.ndarray
    diameter: np.ndarray


@dataclass(frozen=True)
class Limits:
    """What stands for the truth of paths.

    Attributes:
        finest: Rank and paths of the finest point of each variant that came to its end.
        horizon: Time at which paths diverge [s]; infinite where it is not reached.
        moved: Distance of the two finest points of each variant that has two, in diameters [-].
    """

    finest: dict[str, tuple[int, Paths]]
    horizon: float
    moved: dict[str, float]

    @property
    def converged(self) -> dict[str, bool | None]:
        """Whether the limit of each variant has settled; None with one point."""
        return {v: self.moved[v] <= SETTLED if v in self.moved else None for v in self.finest}


def measures(references: Sequence[str]) -> tuple[Measure, ...]:
    """What the errors are of."""
    return (
        Measure(
            name=NAME,
            title="Paths, root mean square",
            kind="path",
            unit="diameters",
            scale="a diameter",
            source=f"finest runs of {', '.join(references)} but those of the engine itself",
        ),
    )


def paths(result: Result) -> Paths:
    """All recorded positions: the snapshot with most times, else the trajectories of single bodies."""
    radii = result.scene.radii()
    if result.snapshots:
        seen = max(result.snapshots.values(), key=lambda s: len(s.time))
        return Paths(seen.time, seen.position, 2 * radii)
    tracked = [o for o in result.scene.observables if o.kind == "trajectory"]
    series = [result.observables[f"{o.name}_position"] for o in tracked]
    shared = min(series, key=lambda s: len(s.time)).time
    rows = [np.isin(np.round(s.time, 12), np.round(shared, 12)) for s in series]
    position = np.stack([s.value[kept] for s, kept in zip(series, rows, strict=True)], axis=1)
    return Paths(shared, position, 2 * radii[[o.body for o in tracked]])


def limits(groups: Sequence[Group]) -> Limits:
    """The finest points, whether they have settled, and the horizon: the shortest that a variant shows."""
    finest: dict[str, tuple[int, Paths]] = {}
    before: dict[str, Paths] = {}
    for group in sorted(groups, key=lambda g: g.value.rank):
        if seen := _paths(group):
            if group.variant in finest:
                before[group.variant] = finest[group.variant][1]
            finest[group.variant] = group.value.rank, seen
    horizon = min(
        (_horizon(group, *finest[group.variant]) for group in groups if group.variant in finest), default=math.inf
    )
    moved = {variant: _error(seen, finest[variant][1], horizon) for variant, seen in before.items()}
    return Limits(finest, horizon, moved)


def errors(groups: Sequence[Group], known: Limits, references: Sequence[str]) -> list[tuple[Error, ...]]:
    """The errors of each point: total against the limits of the other references, own against that of its variant.

    Codes with the same method and the same finest step have the same error there, which no comparison shows: the band
    is what the references themselves still move.
    """
    made: list[tuple[Error, ...]] = []
    for group in groups:
        seen = _paths(group)
        if seen is None:
            made.append(())
            continue
        others = [r for r in references if r in known.finest and not _same(r, group)]
        totals = [_error(seen, known.finest[r][1], known.horizon) for r in others]
        band = max((known.moved.get(r, 0.0) for r in others), default=0.0)
        rank, limit = known.finest[group.variant]
        own = _error(seen, limit, known.horizon) if rank != group.value.rank else None
        total = float(np.mean(totals)) if totals else None
        low, high = (min(totals), max(totals)) if len(totals) > 1 else (None, None)
        made.append((Error(measure=NAME, total=total, own=own, low=low, high=high, band=band),))
    return made


def _same(variant: str, group: Group) -> bool:
    """Whether a variant is of the same engine: its fine run is no truth for itself."""
    return variant.partition("[")[0] == group.choice.engine


def _paths(group: Group) -> Paths | None:
    found = first_samples(group)
    return paths(found[0].result) if found and found[0].result is not None else None


def _error(one: Paths, other: Paths, until: float) -> float:
    return scoring.trajectory(one.time, one.position, other.position, one.diameter, until).rms


def _horizon(group: Group, rank: int, seen: Paths) -> float:
    """Time at which the finest run and its shifted companion part; infinite without them."""
    if rank != group.value.rank or not group.shifted or group.shifted[0].directory.status() is None:
        return math.inf
    record = RunRecord(group.shifted[0].directory.path)
    if record.status.state not in MEASURED or record.result is None:
        return math.inf
    other = paths(record.result)
    return scoring.horizon(seen.time, seen.position, other.position, seen.diameter)
