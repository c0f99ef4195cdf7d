"""Baselines: what metrics are expected to be, in a JSON file that people read, review and edit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from dembench.atomic import write_text
from dembench.regression import RegressionError
from dembench.regression.metrics import Key, Kind, Tolerance, Worse
from dembench.scene.base import Finite, Model, NotNegative


class Expectation(Model):
    """What one metric is expected to be.

    Attributes:
        problem, engine, name, processor: See `dembench.regression.metrics.Key`.
        title, unit, kind: As of the metric.
        value: Expected value, in `unit`.
        spread: Standard deviation of the values that it was taken from; 0 for a single one.
        n: Number of these values.
        worse: Which change is a regression: `higher`, `lower` or `either`.
        tolerance: Largest change that does not matter: `"2%"` of the value, or a number in `unit`.
        target: Exact value; null where none is known.
        state: `ok`, or `inaccurate` where the value was outside what is accepted when it was blessed.
        blessing: Number of the blessing that set the value, from 0.
    """

    problem: str
    engine: str = ""
    name: str
    processor: str = ""
    title: str
    unit: str
    kind: Kind
    value: Finite
    spread: NotNegative = 0.0
    n: Annotated[int, Field(ge=1)] = 1
    worse: Worse = "either"
    tolerance: Tolerance
    target: Finite | None = None
    state: Literal["ok", "inaccurate"] = "ok"
    blessing: Annotated[int, Field(ge=0)] = 0

    @property
    def key(self) -> Key:
        """What the metric is of."""
        return Key(self.problem, self.engine, self.name, self.processor)


class Change(Model):
    """What a blessing did to one metric.

    Attributes:
        problem, engine, name, processor: See `dembench.regression.metrics.Key`.
        unit: Of the metric.
        before, after: Expected values; null where it was added or removed.
        state: State after it; empty where it was removed.
    """

    problem: str
    engine: str = ""
    name: str
    processor: str = ""
    unit: str
    before: Finite | None = None
    after: Finite | None = None
    state: Literal["ok", "inaccurate", ""] = "ok"

    @property
    def key(self) -> Key:
        """What the metric is of."""
        return Key(self.problem, self.engine, self.name, self.processor)

    @property
    def word(self) -> Literal["added", "removed", "changed"]:
        """What was done."""
        return "added" if self.before is None else "removed" if self.after is None else "changed"

    def text(self) -> str:
        """The change in one line."""
        before, after = (None if value is None else f"{value:.6g}" for value in (self.before, self.after))
        values = " -> ".join(text for text in (before, after) if text is not None)
        share = ""
        if self.before and self.after is not None:
            share = f" ({100 * (self.after / self.before - 1):+.2g}%)"
        state = ", inaccurate" if self.state == "inaccurate" else ""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.word} {self.key}: {values}{unit}{share}{state}"


class Blessing(Model):
    """One change of a baseline.

    Attributes:
        date: Time in ISO 8601 with time zone.
        reason: Why the values are right, in the words of who blessed them.
        versions: Versions of dembench, of its commit, of the engines and of the packages that matter.
        processor: Processor of the runs.
        runs: Digest of the set of runs, as in a history.
        changes: The metrics that were added, changed or removed.
    """

    date: str
    reason: str
    versions: dict[str, str] = {}
    processor: str = ""
    runs: str = ""
    changes: tuple[Change, ...] = ()


class Baseline(Model):
    """Expected metrics with the history of their reasons.

    Attributes:
        version: Version of the format.
        metrics: One expectation for each metric.
        blessings: All changes, the first one first.
    """

    version: Literal[1] = 1
    metrics: tuple[Expectation, ...] = ()
    blessings: tuple[Blessing, ...] = ()

    def by_key(self) -> dict[Key, Expectation]:
        """The expectations by what they are of."""
        return {expected.key: expected for expected in self.metrics}


def load(path: Path) -> Baseline:
    """The baseline in a file.

    Raises:
        RegressionError: There is no such file, it is no baseline, or it names a metric twice.
    """
    try:
        found = Baseline.model_validate_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RegressionError(f"{path}: {error.strerror}; `dembench bless` writes a baseline") from None
    except UnicodeDecodeError:
        raise RegressionError(f"{path}: no text in UTF-8; `dembench bless` writes a baseline") from None
    except ValidationError as error:
        faults = [f"{'.'.join(map(str, f['loc'])) or 'the file'}: {f['msg']}" for f in error.errors()[:5]]
        raise RegressionError(f"{path} is no baseline of version 1: " + "; ".join(faults)) from None
    keys = [expected.key for expected in found.metrics]
    if twice := sorted({str(key) for key in keys if keys.count(key) > 1}):
        raise RegressionError(f"{path} has {twice[0]} more than once")
    return found


def save(baseline: Baseline, path: Path) -> None:
    """Writes a baseline, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, baseline.model_dump_json(indent=1) + "\n")
