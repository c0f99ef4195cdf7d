"""Legacy VTK files: points with data, as text or binary. Format: VTK File Formats, "Simple Legacy Formats"."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dembench.initial.formats.base import Format
from dembench.initial.formats.columns import state_from
from dembench.initial.formats.state import State
from dembench.initial.formats.vtk_points import arrays_of
from dembench.initial.rows import CoordinatesError

TYPES = {
    "double": ">f8",
    "float": ">f4",
    "char": ">i1",
    "unsigned_char": ">u1",
    "short": ">i2",
    "unsigned_short": ">u2",
    "int": ">i4",
    "unsigned_int": ">u4",
    "long": ">i8",
    "unsigned_long": ">u8",
    "vtkIdType": ">i4",
    "vtktypeint64": ">i8",
    "vtktypeuint64": ">u8",
}
"""Types of values in binary files, big endian."""
CELLS = ("CELLS", "VERTICES", "LINES", "POLYGONS", "TRIANGLE_STRIPS")


def recognises(head: bytes) -> bool:
    """Whether the first line is that of the format."""
    return head.startswith(b"# vtk DataFile")


class _Reader:
    """A file read from its beginning: lines, and arrays of text or binary values."""

    def __init__(self, path: Path) -> None:
        try:
            self._data = path.read_bytes()
        except OSError as error:
            raise CoordinatesError(f"{path}: {error.strerror}") from None
        self._path, self._at, self.binary, self.line_number = path, 0, False, 0

    def line(self) -> str | None:
        """The next line that is not empty; None at the end."""
        while self._at < len(self._data):
            end = self._data.find(b"\n", self._at)
            end = len(self._data) if end < 0 else end
            text = self._data[self._at : end].decode("latin-1").strip()
            self._at = end + 1
            self.line_number += 1
            if text:
                return text
        return None

    def next_word(self) -> bytes:
        """The word that comes next, without passing it; what it is in binary values means nothing."""
        return (self._data[self._at : self._at + 20].split(None, 1) or [b""])[0]

    def skip_block(self) -> None:
        """Passes over the lines up to the next empty one."""
        end = self._data.find(b"\n\n", self._at)
        self._at = len(self._data) if end < 0 else end + 2

    def error(self, text: str) -> CoordinatesError:
        """An error with the place."""
        return CoordinatesError(f"{self._path}:{self.line_number}: {text}")

    def values(self, kind: str, count: int) -> np.ndarray:
        """The next `count` values."""
        if kind not in TYPES:
            raise self.error(f"values of type '{kind}'; accepted are {', '.join(TYPES)}")
        if self.binary:
            dtype = np.dtype(TYPES[kind])
            raw = self._data[self._at : self._at + count * dtype.itemsize]
            if len(raw) < count * dtype.itemsize:
                raise self.error(f"the file ends within {count} values of type {kind}")
            self._at += len(raw)
            return np.frombuffer(raw, dtype).astype(dtype.newbyteorder("="))
        found: list[str] = []
        while len(found) < count:
            line = self.line()
            if line is None:
                raise self.error(f"the file ends after {len(found)} of {count} values")
            found += line.split()
        if len(found) > count:
            raise self.error(f"more values than the {count} expected")
        try:
            return np.array([float(value) for value in found])
        except ValueError as error:
            raise self.error(f"{error}; accepted are numbers") from None


def read(path: Path, frame: int = 0) -> State:
    """Reads the points of a data set PolyData or UnstructuredGrid; it has one frame."""
    file = _Reader(path)
    for _ in range(2):
        file.line()
    form = file.line()
    if form not in ("ASCII", "BINARY"):
        raise file.error(f"{form!r}; accepted are ASCII and BINARY")
    file.binary = form == "BINARY"
    points, at_points = np.empty((0, 3)), False
    data: dict[str, np.ndarray] = {}
    while (line := file.line()) is not None:
        words = line.split()
        try:
            if words[0] == "DATASET" and words[1] not in ("POLYDATA", "UNSTRUCTURED_GRID"):
                raise file.error(f"data set {words[1]}; accepted are POLYDATA and UNSTRUCTURED_GRID")
            if words[0] == "POINTS":
                points = file.values(words[2], 3 * int(words[1])).reshape(-1, 3)
            elif words[0] in CELLS:
                _skip_cells(file, int(words[1]), int(words[2]))
            elif words[0] == "CELL_TYPES":
                file.values("int", int(words[1]))
            elif words[0] == "POINT_DATA":
                at_points = True
            elif words[0] == "CELL_DATA":
                break
            elif words[0] in ("SCALARS", "VECTORS", "NORMALS", "FIELD"):
                found = _attribute(file, words, len(points))
                data |= found if at_points else {}
        except (IndexError, ValueError) as error:
            if isinstance(error, CoordinatesError):
                raise
            raise file.error(f"{line[:60]!r} is no line of this format") from None
    return state_from({"position": points, **data})


def _skip_cells(file: _Reader, count: int, size: int) -> None:
    """Passes over cells: numbers with their lengths, or since version 5.1 two arrays, offsets and points."""
    if file.next_word() != b"OFFSETS":
        file.values("int", size)
        return
    for length in (count, size):
        file.values((file.line() or "").split()[1], length)


def _attribute(file: _Reader, words: list[str], n: int) -> dict[str, np.ndarray]:
    if words[0] == "SCALARS":
        width = int(words[3]) if len(words) > 3 else 1
        file.line()
        return {words[1]: _shaped(file.values(words[2], n * width), width)}
    if words[0] in ("VECTORS", "NORMALS"):
        return {words[1]: _shaped(file.values(words[2], 3 * n), 3)}
    found = {}
    for _ in range(int(words[2])):
        while (words := (file.line() or "").split()) == ["METADATA"]:
            file.skip_block()
        name, components, rows, kind = words
        found[name] = _shaped(file.values(kind, int(components) * int(rows)), int(components))
    return found


def _shaped(values: np.ndarray, width: int) -> np.ndarray:
    return values.reshape(-1, width) if width > 1 else values


def write(state: State, path: Path) -> None:
    """Writes PolyData as binary double values: a vertex per sphere, with the data that the state knows."""
    n = len(state)
    parts = [b"# vtk DataFile Version 4.2\nspheres, SI units\nBINARY\nDATASET POLYDATA\n"]
    parts += [f"POINTS {n} double\n".encode(), state.position.astype(">f8").tobytes()]
    vertices = np.stack([np.ones(n), np.arange(n)], axis=1).astype(">i4")
    parts += [f"\nVERTICES {n} {2 * n}\n".encode(), vertices.tobytes()]
    arrays = arrays_of(state)
    parts.append(f"\nPOINT_DATA {n}\nFIELD FieldData {len(arrays)}\n".encode())
    for name, array in arrays.items():
        whole = array.dtype.kind == "i"
        kind, dtype = ("vtktypeint64", ">i8") if whole else ("double", ">f8")
        width = array.shape[1] if array.ndim > 1 else 1
        parts += [f"{name} {width} {n} {kind}\n".encode(), array.astype(dtype).tobytes(), b"\n"]
    path.write_bytes(b"".join(parts))


FORMAT = Format("vtk", "legacy VTK point cloud", (".vtk",), recognises, read, write)
