"""CSV: a header line with names and SI units, a row per sphere."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from dembench.initial.formats.base import Format
from dembench.initial.formats.columns import field_of, state_from
from dembench.initial.formats.state import State
from dembench.initial.rows import CoordinatesError, text_lines


def recognises(head: bytes) -> bool:
    """Whether the first line has commas and names a coordinate."""
    titles = head.split(b"\n", 1)[0].decode("ascii", "replace").replace('"', "").split(",")
    try:
        return len(titles) > 1 and any((field_of(title) or ("",))[0] == "position" for title in titles)
    except ValueError:
        return True


def read(path: Path, frame: int = 0) -> State:
    """Reads a table; it has one frame."""
    rows = list(csv.reader(text_lines(path)))
    if not rows:
        raise CoordinatesError(f"{path}: empty; accepted is a header line with columns x, y, z")
    titles = rows[0]
    table = np.empty((len(rows) - 1, len(titles)))
    for k, row in enumerate(rows[1:]):
        if len(row) != len(titles):
            raise CoordinatesError(f"{path}:{k + 2}: {len(row)} fields; the header has {len(titles)}")
        for column, text in enumerate(row):
            try:
                table[k, column] = float(text)
            except ValueError:
                raise CoordinatesError(
                    f"{path}:{k + 2}: {titles[column].strip()} is {text.strip()[:60]!r}; accepted is a number"
                ) from None
    return state_from(dict(zip(titles, table.T, strict=True)))


def write(state: State, path: Path) -> None:
    """Writes a table with the columns that the state knows."""
    columns = {"id": state.id}
    columns |= {f"{axis} [m]": state.position[:, k] for k, axis in enumerate("xyz")}
    for name, unit in (("radius", "m"), ("density", "kg/m3")):
        if getattr(state, name) is not None:
            columns[f"{name} [{unit}]"] = getattr(state, name)
    for name, unit in (("velocity", "m/s"), ("angular_velocity", "rad/s")):
        if getattr(state, name) is not None:
            columns |= {f"{name}_{axis} [{unit}]": getattr(state, name)[:, k] for k, axis in enumerate("xyz")}
    if state.species is not None:
        columns["species"] = state.species
    with open(path, "w", newline="", encoding="ascii") as stream:
        table = csv.writer(stream)
        table.writerow(columns)
        table.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))


FORMAT = Format("csv", "table with a header line", (".csv",), recognises, read, write)
