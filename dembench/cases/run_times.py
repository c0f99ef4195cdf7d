"""Run times that others have published, with their hardware: `data/published/run-times.toml`."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from typing import Any

from dembench.share import share


@dataclass(frozen=True)
class RunTime:
    """A published wall time of a whole run.

    Attributes:
        code: Program and version, as published.
        device: What it ran on: device and precision, or ranks; empty where that is not stated.
        low, high: Wall time [s]; equal unless only a range is known.
        marks: Letters: `a` approximate, `c` contended, `x` extrapolated.
        note: What else to know of it.
        hardware: Machine.
        source: Where it was published.
    """

    code: str
    device: str
    low: float
    high: float
    marks: str
    note: str
    hardware: str
    source: str


def published_run_times(case: str, parameters: Any) -> list[RunTime]:
    """The published run times of a case with these parameters, in the order of the file.

    An entry holds where every parameter that it names has the value that it names.
    """
    table = _table()
    return [
        RunTime(
            code=entry["code"],
            device=entry.get("device", ""),
            low=float(entry.get("low", entry.get("seconds"))),
            high=float(entry.get("high", entry.get("seconds"))),
            marks=entry.get("marks", ""),
            note=entry.get("note", ""),
            hardware=table["hardware"][entry["hardware"]],
            source=table["sources"][entry["source"]],
        )
        for entry in table["run_times"]
        if entry["case"] == case
        and all(getattr(parameters, name, None) == value for name, value in entry.get("parameters", {}).items())
    ]


@cache
def _table() -> dict[str, Any]:
    return tomllib.loads(share("data", "published", "run-times.toml").read_text(encoding="utf-8"))
