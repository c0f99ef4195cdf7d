"""A history of metrics: a directory with a CSV table, one line for each metric of each set of runs."""

from __future__ import annotations

import csv
import fcntl
import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple, dataclass, fields
from datetime import datetime
from pathlib import Path
from typing import Any

from dembench.atomic import write_text
from dembench.regression import RegressionError
from dembench.regression.gather import Gathered
from dembench.regression.intervals import Kind
from dembench.regression.metrics import Key

FILE = "history.csv"


@dataclass(frozen=True)
class Line:
    """One metric of one set of runs.

    Attributes:
        hash: Digest of the set: of the runs and when each was made.
        date: When the last of them was made, in ISO 8601 with time zone.
        commit: Commit of the checkout that made them, or the version of dembench.
        problem, engine, name, processor: See `dembench.regression.metrics.Key`.
        title, unit, kind: As of the metric.
        value, spread, n: As of the metric; see `dembench.regression.intervals`.
        state: `ok` or `inaccurate`.
    """

    hash: str
    date: str
    commit: str
    problem: str
    engine: str
    name: str
    processor: str
    title: str
    unit: str
    kind: Kind
    value: float
    spread: float
    n: int
    state: str

    @property
    def key(self) -> Key:
        """What the metric is of."""
        return Key(self.problem, self.engine, self.name, self.processor)

    @property
    def moment(self) -> datetime:
        """When it was measured."""
        return datetime.fromisoformat(self.date)


COLUMNS = tuple(field.name for field in fields(Line))


def lines_of(found: Gathered, date: str) -> list[Line]:
    """The lines of a set of runs; metrics without a value are left out.

    Args:
        found: What the runs gave.
        date: When it was measured where the runs do not say it.
    """
    ended = sorted(record.status.ended for record in found.runs if record.status.ended)
    when = ended[-1] if ended else date
    versions = found.versions or {}
    commit = versions.get("commit") or versions.get("dembench", "")
    return [
        Line(
            found.digest(),
            datetime.fromisoformat(when).isoformat(),
            commit,
            *metric.key,
            metric.title,
            metric.unit,
            metric.kind,
            metric.value,
            metric.spread,
            len(metric.values),
            metric.state,
        )
        for metric in found.metrics
        if metric.values
    ]


def add(directory: Path, lines: Sequence[Line]) -> int:
    """Appends lines to the history in a directory, but sets of runs that it has; the number of those appended.

    Raises:
        RegressionError: The directory holds something else.
    """
    directory.mkdir(parents=True, exist_ok=True)
    with _alone(directory):
        before = read(directory)
        known = {line.hash for line in before}
        new = [line for line in lines if line.hash not in known]
        if new:
            text = io.StringIO()
            writer = csv.writer(text, lineterminator="\n")
            writer.writerows([COLUMNS, *(astuple(line) for line in (*before, *new))])
            write_text(directory / FILE, text.getvalue())
    return len(new)


def read(directory: Path) -> list[Line]:
    """The lines of the history in a directory, the oldest first; none where it has no history yet.

    Raises:
        RegressionError: Its table has other columns, or a line that is none.
    """
    path = directory / FILE
    if not path.exists():
        return []
    try:
        with open(path, newline="", encoding="utf-8") as stream:
            head, *rows = csv.reader(stream)
        if tuple(head) != COLUMNS:
            raise ValueError(f"the columns are {', '.join(head)}; they must be {', '.join(COLUMNS)}")
        found = [_line(row) for row in rows]
    except (OSError, ValueError, TypeError, UnicodeDecodeError, csv.Error) as error:
        raise RegressionError(f"{path} is no history: {error}") from None
    return sorted(found, key=lambda line: line.moment)


def _line(row: Sequence[str]) -> Line:
    *texts, value, spread, n, state = row
    values: list[Any] = [*texts, float(value), float(spread), int(n), state]
    line = Line(*values)
    datetime.fromisoformat(line.date)
    return line


@contextmanager
def _alone(directory: Path) -> Iterator[None]:
    """One process at a time changes a history."""
    with open(directory / ".lock", "w") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        yield
