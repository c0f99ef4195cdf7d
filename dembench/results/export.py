"""Exports of a result for other programs."""

from __future__ import annotations

from pathlib import Path

from dembench.results.read import Result


def export_csv(result: Result, directory: Path) -> list[Path]:
    """Writes every observable to `<name>.csv` with the unit in the column titles; returns the files."""
    directory.mkdir(parents=True, exist_ok=True)
    written = []
    for name, observed in result.observables.items():
        table = result.frame(name)
        titles = {column: f"{column} [{observed.unit}]" for column in table.columns if column not in ("step", "time")}
        path = directory / f"{name}.csv"
        table.rename(columns={"time": "time [s]", **titles}).to_csv(path, index=False)
        written.append(path)
    return written
