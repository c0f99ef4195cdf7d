"""Errors of sweeps over chaotic cases: ensembles of seeds against ensembles, never single runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dembench.cases.base import Case
from dembench.scoring import cycles
from dembench.scoring.ensembles import (
    MARGINS,
    Ensemble,
    bias,
    distance,
    distance_limit,
    equivalent,
)
from dembench.verification.precision.planning import Group
from dembench.verification.precision.points import first_samples
from dembench.verification.precision.store import Error, Measure

CURVE = "curve"
CYCLES = {
    "period": "Period",
    "phase": "Phase lag, in periods",
    "amplitude": "Amplitude of the cycles",
    "decay": "Decay, per period",
}


@dataclass(frozen=True)
class Sample:
    """An ensemble of runs.

    Attributes:
        seeds: Seeds in the order of the ensembles.
        time: Times of the curves [s], shape (t,); empty without a curve.
        curve: The curves, shape (k, t); None without one.
        numbers: Quantities that every seed has, by name.
    """

    seeds: tuple[int, ...]
    time: np.ndarray
    curve: Ensemble | None
    numbers: dict[str, Ensemble]

    @property
    def mean_curve(self) -> np.ndarray:
        """Mean of the curves, shape (t,)."""
        assert self.curve is not None
        return self.curve.mean


@dataclass(frozen=True)
class Limits:
    """What stands for the truth of ensembles: rank and sample of the finest point of each variant, and its verdict."""

    finest: dict[str, tuple[int, Sample]]
    converged: dict[str, bool | None]


def measures(case: Case, references: Sequence[str]) -> tuple[Measure, ...]:
    """What the errors are of."""
    what = case.statistics()
    source = f"ensembles of the finest runs of {', '.join(references)} but those of the engine itself"
    found = []
    if what.curve:
        found.append(
            Measure(
                name=CURVE,
                title=f"Distance D of the mean curves of {what.curve}",
                kind="distance",
                unit="spreads of the seeds",
                scale="the spread between the seeds of the reference",
                source=source,
            )
        )
    for name, kind in what.numbers.items():
        margin = MARGINS[kind]
        found.append(
            Measure(
                name=name,
                title=f"Bias of {name.replace('_', ' ')}",
                kind="number",
                unit="relative",
                scale="the mean of the reference",
                source=f"{source}; margin {margin.text()}",
                accepted=margin.value if margin.relative else None,
            )
        )
    if what.curve and what.cycles:
        for name, title in CYCLES.items():
            found.append(
                Measure(
                    name=name, title=title, kind="cycle", unit="relative", scale="that of the reference", source=source
                )
            )
    return tuple(found)


def sample(case: Case, group: Group) -> Sample | None:
    """The ensemble of a point; None where no run came to its end."""
    records = first_samples(group)
    if not records:
        return None
    results = [r.result for r in records if r.result is not None]
    quantities = [{q.name: q.value for q in case.quantities(r.scene, r)} for r in results]
    numbers = {
        name: Ensemble([own[name] for own in quantities])
        for name in case.statistics().numbers
        if all(name in own and math.isfinite(own[name]) for own in quantities)
    }
    time, curve = np.empty(0), None
    observable, _, component = case.statistics().curve.partition(".")
    if observable and all(observable in r.observables for r in results):
        series = [r.observables[observable] for r in results]
        rows = min(len(o.time) for o in series)
        time = series[0].time[:rows]
        values = [o.value[:, o.components.index(component)] if component else o.value for o in series]
        curve = Ensemble([v[:rows] for v in values])
    return Sample(tuple(r.spec.seed for r in records), time, curve, numbers)


def limits(case: Case, groups: Sequence[Group]) -> tuple[list[Sample | None], Limits]:
    """The ensemble of each point, and the finest ones: settled where they are as near to the next as seeds scatter."""
    samples = [sample(case, group) for group in groups]
    finest: dict[str, tuple[int, Sample]] = {}
    before: dict[str, Sample] = {}
    for group, own in sorted(zip(groups, samples, strict=True), key=lambda pair: pair[0].value.rank):
        if own is None:
            continue
        if group.variant in finest:
            before[group.variant] = finest[group.variant][1]
        finest[group.variant] = group.value.rank, own
    converged = {v: _settled(before.get(v), own) for v, (_, own) in finest.items()}
    return samples, Limits(finest, converged)


def _settled(coarser: Sample | None, finest: Sample) -> bool | None:
    if coarser is None or coarser.curve is None or finest.curve is None or len(finest.seeds) < 2:
        return None
    return distance(*_common(coarser, finest)).indistinguishable


def errors(
    case: Case, groups: Sequence[Group], samples: Sequence[Sample | None], known: Limits, references: Sequence[str]
) -> list[tuple[Error, ...]]:
    """The errors of each point: total against the pooled limits of the other engines, own against its own limit."""
    made: list[tuple[Error, ...]] = []
    for group, own in zip(groups, samples, strict=True):
        if own is None:
            made.append(())
            continue
        others = [
            known.finest[r][1] for r in references if r in known.finest and r.partition("[")[0] != group.choice.engine
        ]
        rank, limit = known.finest[group.variant]
        numerical = _compare(case, own, limit) if rank != group.value.rank else {}
        total = _compare(case, own, pooled(others)) if others else {}
        names = list(dict.fromkeys([*total, *numerical]))
        made.append(tuple(_merged(name, total.get(name), numerical.get(name)) for name in names))
    return made


def pooled(samples: Sequence[Sample]) -> Sample:
    """Several ensembles as one, whose spread holds that between codes, too."""
    if len(samples) == 1:
        return samples[0]
    rows = min(len(s.time) for s in samples)
    curves = [s.curve.values[:, :rows] for s in samples if s.curve is not None]
    names = set.intersection(*(set(s.numbers) for s in samples))
    return Sample(
        seeds=tuple(seed for s in samples for seed in s.seeds),
        time=samples[0].time[:rows],
        curve=Ensemble(np.concatenate(curves)) if len(curves) == len(samples) else None,
        numbers={name: Ensemble(np.concatenate([s.numbers[name].values for s in samples])) for name in sorted(names)},
    )


def _merged(name: str, total: Error | None, own: Error | None) -> Error:
    base = total or Error(measure=name, band=own.band if own else 0.0)
    return base.model_copy(update={"own": own.total if own else None})


def _common(one: Sample, other: Sample) -> tuple[Ensemble, Ensemble, np.ndarray]:
    """The curves of two samples over the times that both have."""
    assert one.curve is not None and other.curve is not None
    rows = min(len(one.time), len(other.time))
    return Ensemble(one.curve.values[:, :rows]), Ensemble(other.curve.values[:, :rows]), one.time[:rows]


def _compare(case: Case, test: Sample, reference: Sample) -> dict[str, Error]:
    """Errors of one ensemble against another, by measure."""
    found: dict[str, Error] = {}
    scatter = distance_limit(len(test.seeds), len(reference.seeds))
    if test.curve is not None and reference.curve is not None and len(reference.seeds) > 1:
        apart = distance(*_common(test, reference))
        if math.isfinite(apart.value):
            found[CURVE] = Error(measure=CURVE, total=apart.value, band=apart.limit)
    for name, kind in case.statistics().numbers.items():
        if name in test.numbers and name in reference.numbers:
            found[name] = _number(name, kind, test.numbers[name], reference.numbers[name], scatter)
    if case.statistics().cycles and test.curve is not None and reference.curve is not None:
        found |= _cycles(test, reference, scatter)
    return found


def _number(name: str, kind: str, test: Ensemble, reference: Ensemble, scatter: float) -> Error:
    off = bias(test, reference)
    ends: tuple[float | None, float | None] = (None, None)
    if math.isfinite(off.low):
        crossing = off.low <= 0 <= off.high
        sizes = sorted((abs(off.low), abs(off.high)))
        ends = (0.0 if crossing else sizes[0], sizes[1])
    deviation = float(reference.deviation / abs(reference.mean)) if len(reference) > 1 else 0.0
    verdict = equivalent(test, reference, MARGINS[kind]).verdict
    return Error(
        measure=name, total=abs(off.value), low=ends[0], high=ends[1], band=scatter * deviation, verdict=verdict
    )


def _cycles(test: Sample, reference: Sample, scatter: float) -> dict[str, Error]:
    """Errors of the mean curve; the seeds of the reference against their own mean give the band."""
    one, other, time = _common(test, reference)
    try:
        found = cycles.compare(time, one.mean, other.mean)
        alone = [cycles.compare(time, curve, other.mean) for curve in other.values] if len(other) > 1 else []
    except cycles.NoCycles:
        return {}
    made = {}
    for name in CYCLES:
        spread = float(np.sqrt(np.mean([getattr(c, name) ** 2 for c in alone]))) if alone else 0.0
        made[name] = Error(measure=name, total=abs(getattr(found, name)), band=scatter * spread)
    return made
