"""Blessing: what runs gave becomes what is expected, for a stated reason."""

from __future__ import annotations

from collections.abc import Sequence

from dembench.regression import RegressionError
from dembench.regression.baseline import Baseline, Blessing, Change, Expectation
from dembench.regression.gather import Gathered
from dembench.regression.metrics import Key, Metric


def bless(found: Gathered, before: Baseline, reason: str, date: str) -> Baseline:
    """A baseline with the values of runs.

    What a person has set is kept: directions and tolerances of metrics that are there. Values that changed by less than
    their tolerance are kept, too, so that a baseline does not drift with what does not matter. Metrics that the runs do
    not give are removed, but speeds on other processors.

    Args:
        found: What the runs gave.
        before: The baseline before; an empty one makes a new one.
        reason: Why the values are right.
        date: Time in ISO 8601 with time zone.

    Raises:
        RegressionError: The reason is empty, a run failed, a metric has no value, or there is none.
    """
    if not reason.strip():
        raise RegressionError("a blessing needs a reason: --reason TEXT")
    if found.failed:
        listed = ", ".join(f"{record.name} ({record.status.label()})" for record in found.failed)
        raise RegressionError(f"runs that failed are not blessed: {listed}")
    if empty := [metric for metric in found.metrics if not metric.values]:
        listed = ", ".join(f"{metric.key} ({metric.state})" for metric in empty)
        raise RegressionError(f"what was not measured is not blessed: {listed}")
    if not found.metrics:
        raise RegressionError("the runs give nothing that could be expected of later ones")
    number, known = len(before.blessings), before.by_key()
    made = {metric.key: _expected(metric, known.get(metric.key), number) for metric in found.metrics}
    processors = {key.processor for key in made}
    kept = {k: e for k, e in known.items() if k not in made and k.processor and k.processor not in processors}
    changes = changes_of(known, made | kept)
    blessing = Blessing(
        date=date,
        reason=reason.strip(),
        versions=found.versions or {},
        processor=found.processor,
        runs=found.digest(),
        changes=tuple(changes),
    )
    metrics = tuple(expected for _, expected in sorted((made | kept).items()))
    return Baseline(metrics=metrics, blessings=(*before.blessings, blessing))


def changes_of(before: dict[Key, Expectation], after: dict[Key, Expectation]) -> list[Change]:
    """The metrics that are added, changed or removed."""
    found = []
    for key in sorted({**before, **after}):
        old, new = before.get(key), after.get(key)
        if old is not None and new is not None and (old.value, old.state) == (new.value, new.state):
            continue
        shown = new or old
        assert shown is not None
        values = {"before": old.value if old else None, "after": new.value if new else None}
        found.append(Change(**key._asdict(), unit=shown.unit, **values, state=new.state if new else ""))
    return found


def _expected(metric: Metric, before: Expectation | None, number: int) -> Expectation:
    worse = before.worse if before else metric.worse
    tolerance = before.tolerance if before else metric.margin
    if before and before.state == metric.state and abs(metric.value - before.value) <= tolerance.of(before.value):
        return before
    return Expectation(
        **metric.key._asdict(),
        title=metric.title,
        unit=metric.unit,
        kind=metric.kind,
        value=metric.value,
        spread=metric.spread,
        n=len(metric.values),
        worse=worse,
        tolerance=tolerance,
        target=metric.target,
        state="inaccurate" if metric.state == "inaccurate" else "ok",
        blessing=number,
    )


def summary(changes: Sequence[Change]) -> str:
    """How many metrics were added, changed and removed."""
    numbers = {word: sum(change.word == word for change in changes) for word in ("added", "changed", "removed")}
    return ", ".join(f"{n} {word}" for word, n in numbers.items() if n) or "nothing changed"
