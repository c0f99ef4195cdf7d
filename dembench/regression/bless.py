"""Blessing: what runs gave becomes what is expected, for a stated reason."""

from __future__ import annotations

from collections.abc import Sequence

from dembench.regression import RegressionError
from dembench.regression.baseline import Baseline, Blessing, Expectation
from dembench.regression.gather import Gathered
from dembench.regression.metrics import Key, Metric, margin_text


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
        changes=tuple(changes),
    )
    metrics = tuple(expected for _, expected in sorted((made | kept).items()))
    return Baseline(metrics=metrics, blessings=(*before.blessings, blessing))


def changes_of(before: dict[Key, Expectation], after: dict[Key, Expectation]) -> list[str]:
    """One line for each metric that is added, changed or removed."""
    return [
        text
        for key in sorted({**before, **after})
        if (text := _change(key, before.get(key), after.get(key))) is not None
    ]


def _change(key: Key, before: Expectation | None, after: Expectation | None) -> str | None:
    if before is None and after is not None:
        return f"added {key}: {after.value:.6g} {after.unit} within {margin_text(after.tolerance)}"
    if before is not None and after is None:
        return f"removed {key}: {before.value:.6g} {before.unit}"
    assert before is not None and after is not None
    if (before.value, before.state) == (after.value, after.state):
        return None
    state = "" if before.state == after.state else f", {before.state} -> {after.state}"
    share = f" ({100 * (after.value / before.value - 1):+.2g}%)" if before.value else ""
    return f"changed {key}: {before.value:.6g} -> {after.value:.6g} {after.unit}{share}{state}"


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


def summary(changes: Sequence[str]) -> str:
    """How many metrics were added, changed and removed."""
    numbers = {word: sum(line.startswith(word) for line in changes) for word in ("added", "changed", "removed")}
    return ", ".join(f"{n} {word}" for word, n in numbers.items() if n) or "nothing changed"
