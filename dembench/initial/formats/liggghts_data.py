"""Data files of LIGGGHTS (`read_data`) with the atom style granular: number, type, diameter, density, x, y, z.

Format: LIGGGHTS-PUBLIC documentation, commands read_data and atom_style.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dembench.initial.formats.base import Format
from dembench.initial.formats.state import State, state_of
from dembench.initial.rows import CoordinatesError, numbers, text_lines

ATOM = "a row of Atoms has number, type, diameter, density, x, y, z, and may have three image flags"
VELOCITY = "a row of Velocities has number, vx, vy, vz, wx, wy, wz"
MARGIN = 1.0
"""Room between the outermost spheres and the box, in largest diameters [-]."""
_COUNT = re.compile(r"\s*(\d+)\s+atoms\s*")
_SECTION = re.compile(r"[A-Z][A-Za-z ]*")


def recognises(head: bytes) -> bool:
    """Whether the header counts atoms."""
    lines = head.decode("ascii", "replace").splitlines()[1:20]
    return any(_COUNT.fullmatch(line.split("#")[0]) for line in lines)


def read(path: Path, frame: int = 0) -> State:
    """Reads a data file; it has one frame."""
    count, sections = _sections(path)
    if "Atoms" not in sections:
        raise CoordinatesError(f"{path}: no section Atoms; there are {', '.join(sections) or 'none'}")
    atoms = _rows(path, sections["Atoms"], (7, 10), ATOM)
    if count is not None and len(atoms) != count:
        raise CoordinatesError(f"{path}: {len(atoms)} rows of Atoms; the header says {count}")
    fields = {"id": atoms[:, 0], "species": atoms[:, 1] - 1, "radius": 0.5 * atoms[:, 2], "density": atoms[:, 3]}
    if "Velocities" in sections:
        moving = _rows(path, sections["Velocities"], (7,), VELOCITY)
        row = {number: k for k, number in enumerate(moving[:, 0])}
        if len(row) != len(moving) or set(row) != set(atoms[:, 0]):
            raise CoordinatesError(f"{path}: the numbers of Velocities are not those of Atoms")
        moving = moving[[row[number] for number in atoms[:, 0]]]
        fields |= {"velocity": moving[:, 1:4], "angular_velocity": moving[:, 4:7]}
    return state_of(atoms[:, 4:7], **fields)


def _sections(path: Path) -> tuple[int | None, dict[str, list[tuple[int, str]]]]:
    """Number of atoms, and the numbered lines of each section that are not empty; the first line is a comment."""
    sections: dict[str, list[tuple[int, str]]] = {}
    count, current = None, None
    for number, line in enumerate(text_lines(path)[1:], 2):
        text = line.split("#")[0].strip()
        if not text:
            continue
        if _SECTION.fullmatch(text):
            current = sections.setdefault(text, [])
        elif current is not None:
            current.append((number, text))
        elif match := _COUNT.fullmatch(text):
            count = int(match[1])
    return count, sections


def _rows(path: Path, lines: list[tuple[int, str]], widths: tuple[int, ...], accepted: str) -> np.ndarray:
    rows = []
    for number, line in lines:
        row = numbers(path, number, line, accepted)
        if len(row) not in widths:
            raise CoordinatesError(f"{path}:{number}: {len(row)} fields; {accepted}")
        rows.append(row[: widths[0]])
    return np.array(rows).reshape(-1, widths[0])


def write(state: State, path: Path) -> None:
    """Writes a data file; the box is a diameter wider than the spheres reach."""
    assert state.radius is not None and state.density is not None
    kind = (np.zeros(len(state), int) if state.species is None else state.species) + 1
    margin = 2 * MARGIN * state.radius.max() + state.radius.max()
    lower, upper = (state.position.min(axis=0) - margin).tolist(), (state.position.max(axis=0) + margin).tolist()
    lines = ["Spheres, SI units, atom_style granular", "", f"{len(state)} atoms", f"{kind.max()} atom types", ""]
    lines += [f"{lower[k]!r} {upper[k]!r} {axis}lo {axis}hi" for k, axis in enumerate("xyz")]
    lines += ["", "Atoms", ""]
    rows = (state.id, kind, 2 * state.radius, state.density, *state.position.T)
    lines += [" ".join(map(repr, row)) for row in zip(*(column.tolist() for column in rows), strict=True)]
    if state.velocity is not None or state.angular_velocity is not None:
        still = np.zeros((len(state), 3))
        velocity = still if state.velocity is None else state.velocity
        spin = still if state.angular_velocity is None else state.angular_velocity
        lines += ["", "Velocities", ""]
        rows = (state.id, *velocity.T, *spin.T)
        lines += [" ".join(map(repr, row)) for row in zip(*(column.tolist() for column in rows), strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


FORMAT = Format(
    "liggghts-data",
    "LIGGGHTS data file, atom_style granular",
    (".data",),
    recognises,
    read,
    write,
    needs=("radius", "density"),
)
