"""Text dumps of LIGGGHTS (`dump custom`): frames of rows with named columns.

Format: LIGGGHTS-PUBLIC documentation, command dump.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dembench.initial.formats.base import Format
from dembench.initial.formats.columns import state_from
from dembench.initial.formats.state import State
from dembench.initial.rows import CoordinatesError, numbers, text_lines

START = "ITEM: TIMESTEP"
ROWS = "ITEM: ATOMS"


def recognises(head: bytes) -> bool:
    """Whether it begins with a frame."""
    return head.startswith(START.encode())


def read(path: Path, frame: int = -1) -> State:
    """Reads one frame of a dump. A column `density` or `mass` gives the density, `radius` or `diameter` the radius."""
    lines = text_lines(path)
    starts = [k for k, line in enumerate(lines) if line.strip() == START]
    if not starts:
        raise CoordinatesError(f"{path}:1: expected '{START}'")
    if not -len(starts) <= frame < len(starts):
        raise CoordinatesError(f"{path}: frame {frame} of {len(starts)}; accepted are 0 to {len(starts) - 1}, or -1")
    first = starts[frame]
    last = next((k for k in starts if k > first), len(lines))
    title = next((k for k in range(first, last) if lines[k].startswith(ROWS)), None)
    if title is None:
        raise CoordinatesError(f"{path}:{first + 1}: the frame has no line '{ROWS} ...'")
    columns = lines[title].split()[2:]
    accepted = f"a row has {len(columns)} numbers, {' '.join(columns)}"
    rows = [numbers(path, number, lines[number - 1], accepted) for number in range(title + 2, last + 1)]
    for number, row in enumerate(rows, title + 2):
        if len(row) != len(columns):
            raise CoordinatesError(f"{path}:{number}: {len(row)} fields; {accepted}")
    expected = _count(path, lines, first, title)
    if len(rows) != expected:
        raise CoordinatesError(f"{path}:{title + 1}: {len(rows)} rows follow; the frame says {expected}")
    table = np.array(rows).reshape(-1, len(columns))
    return state_from(dict(zip(columns, table.T, strict=True)))


def _count(path: Path, lines: list[str], first: int, title: int) -> int:
    for k in range(first, title - 1):
        if lines[k].strip() == "ITEM: NUMBER OF ATOMS":
            try:
                return int(lines[k + 1])
            except ValueError:
                break
    raise CoordinatesError(f"{path}:{first + 1}: the frame does not say its number of atoms")


def write(state: State, path: Path) -> None:
    """Writes one frame, that of step 0, with the columns that the state knows."""
    reach = state.radius.max() if state.radius is not None else 0.0
    columns = {"id": state.id}
    if state.species is not None:
        columns["type"] = state.species + 1
    columns |= {axis: state.position[:, k] for k, axis in enumerate("xyz")}
    for name, prefix in (("velocity", "v"), ("angular_velocity", "omega")):
        if getattr(state, name) is not None:
            columns |= {prefix + axis: getattr(state, name)[:, k] for k, axis in enumerate("xyz")}
    columns |= {name: array for name in ("radius", "density") if (array := getattr(state, name)) is not None}
    lines = [START, "0", "ITEM: NUMBER OF ATOMS", str(len(state)), "ITEM: BOX BOUNDS ff ff ff"]
    lines += [f"{float(x.min() - reach)!r} {float(x.max() + reach)!r}" for x in state.position.T]
    lines.append(f"{ROWS} {' '.join(columns)}")
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines += [" ".join(map(repr, row)) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


FORMAT = Format("liggghts-dump", "LIGGGHTS text dump, style custom", (".dump",), recognises, read, write)
