"""VTK XML files: point clouds as PolyData (.vtp) or UnstructuredGrid (.vtu). Format: VTK File Formats, "XML".

Arrays are text, base64 or appended bytes; blocks may be compressed with zlib or LZMA.
"""

from __future__ import annotations

import base64
import binascii
import lzma
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from dembench.initial.formats.base import Format
from dembench.initial.formats.columns import state_from
from dembench.initial.formats.state import State
from dembench.initial.formats.vtk_points import arrays_of
from dembench.initial.rows import CoordinatesError

TYPES = {
    f"{kind}{8 * size}": f"{letter}{size}" for kind, letter in (("Int", "i"), ("UInt", "u")) for size in (1, 2, 4, 8)
}
TYPES |= {"Float32": "f4", "Float64": "f8"}
UNPACKED: dict[str, Callable[[bytes], bytes]] = {
    "vtkZLibDataCompressor": zlib.decompress,
    "vtkLZMADataCompressor": lzma.decompress,
}
DATA_SETS = ("PolyData", "UnstructuredGrid")
_VERTEX = 1


def recognises(head: bytes) -> bool:
    """Whether it is an XML file of VTK."""
    return b"<VTKFile" in head


@dataclass(frozen=True)
class _File:
    """What decoding an array needs: byte order, type of sizes, decompression, and the appended bytes."""

    order: str
    header: np.dtype
    unpack: Callable[[bytes], bytes] | None
    appended: bytes
    encoded: bool


def read(path: Path, frame: int = 0) -> State:
    """Reads the points of a file with one piece or several; it has one frame."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise CoordinatesError(f"{path}: {error.strerror}") from None
    text, appended = _parted(data)
    try:
        root = ElementTree.fromstring(text)
        return _read(root, appended)
    except (
        ElementTree.ParseError,
        ValueError,
        KeyError,
        IndexError,
        binascii.Error,
        zlib.error,
        lzma.LZMAError,
    ) as error:
        raise CoordinatesError(f"{path}: no readable VTK XML file: {error}") from None


def _parted(data: bytes) -> tuple[bytes, bytes]:
    """The XML text without the appended bytes, which may be no XML, and these bytes."""
    start = data.find(b"<AppendedData")
    if start < 0:
        return data, b""
    mark, end = data.find(b"_", data.find(b">", start)), data.rfind(b"</AppendedData>")
    return data[: mark + 1] + data[end:], data[mark + 1 : end]


def _read(root: ElementTree.Element, appended: bytes) -> State:
    kind = root.get("type", "")
    if kind not in DATA_SETS:
        raise ValueError(f"data set {kind}; accepted are {' and '.join(DATA_SETS)}")
    compressor = root.get("compressor")
    if compressor is not None and compressor not in UNPACKED:
        raise ValueError(f"compressor {compressor}; accepted are {', '.join(UNPACKED)} and none")
    order = ">" if root.get("byte_order") == "BigEndian" else "<"
    element = root.find("AppendedData")
    file = _File(
        order,
        np.dtype(order + ("u8" if root.get("header_type") == "UInt64" else "u4")),
        UNPACKED.get(compressor or ""),
        appended,
        element is not None and element.get("encoding") == "base64",
    )
    pieces = []
    for piece in root.iterfind(f"{kind}/Piece"):
        points = piece.find("Points/DataArray")
        if points is None or int(piece.get("NumberOfPoints", "0")) == 0:
            continue
        columns = {"position": _array(points, file).reshape(-1, 3)}
        for array in piece.iterfind("PointData/DataArray"):
            if array.get("type") in TYPES:
                columns[array.get("Name", "")] = _array(array, file)
        pieces.append(columns)
    if not pieces:
        raise ValueError("no points")
    return state_from({name: np.concatenate([p[name] for p in pieces]) for name in pieces[0]})


def _array(element: ElementTree.Element, file: _File) -> np.ndarray:
    dtype = np.dtype(file.order + TYPES[element.get("type", "")])
    form = element.get("format", "ascii")
    if form == "ascii":
        values = np.array([float(value) for value in (element.text or "").split()])
    else:
        if form == "appended":
            raw, encoded = file.appended[int(element.get("offset", "0")) :], file.encoded
        else:
            raw, encoded = (element.text or "").strip().encode(), True
        values = np.frombuffer(_bytes(raw, encoded, file), dtype).astype(dtype.newbyteorder("="))
    width = int(element.get("NumberOfComponents", "1"))
    return values.reshape(-1, width) if width > 1 else values


def _bytes(raw: bytes, encoded: bool, file: _File) -> bytes:
    """The bytes of an array: sizes, then values; compressed values come in blocks of known packed sizes."""
    size = file.header.itemsize
    if file.unpack is None:
        if not encoded:
            length = int(np.frombuffer(raw[:size], file.header)[0])
            return raw[size : size + length]
        length = int(np.frombuffer(_decoded(raw, size), file.header)[0])
        return _decoded(raw, size + length)[size:]
    blocks = int(np.frombuffer(_decoded(raw, size) if encoded else raw[:size], file.header)[0])
    length = (3 + blocks) * size
    header = np.frombuffer(_decoded(raw, length) if encoded else raw[:length], file.header)
    packed = [int(x) for x in header[3:]]
    start = -(-length // 3) * 4 if encoded else length
    body = _decoded(raw[start:], sum(packed)) if encoded else raw[start : start + sum(packed)]
    ends = np.cumsum([0, *packed])
    return b"".join(file.unpack(body[a:b]) for a, b in pairwise(ends))


def _decoded(raw: bytes, length: int) -> bytes:
    """The first `length` bytes of base64 text."""
    found = base64.b64decode(raw[: -(-length // 3) * 4])
    if len(found) < length:
        raise ValueError(f"an array ends after {len(found)} of {length} bytes")
    return found[:length]


def _write(state: State, path: Path, kind: str) -> None:
    n = len(state)
    root = ElementTree.Element("VTKFile", type=kind, version="1.0", byte_order="LittleEndian", header_type="UInt64")
    counts = {"NumberOfPoints": n, "NumberOfVerts" if kind == "PolyData" else "NumberOfCells": n}
    piece = ElementTree.SubElement(ElementTree.SubElement(root, kind), "Piece", {k: str(v) for k, v in counts.items()})
    data = ElementTree.SubElement(piece, "PointData")
    for name, array in arrays_of(state).items():
        _add(data, name, array)
    _add(ElementTree.SubElement(piece, "Points"), "Points", state.position)
    cells = ElementTree.SubElement(piece, "Verts" if kind == "PolyData" else "Cells")
    _add(cells, "connectivity", np.arange(n))
    _add(cells, "offsets", np.arange(1, n + 1))
    if kind == "UnstructuredGrid":
        _add(cells, "types", np.full(n, _VERTEX))
    path.write_bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))


def _add(parent: ElementTree.Element, name: str, array: np.ndarray) -> None:
    whole = array.dtype.kind == "i"
    values = array.astype("<i8" if whole else "<f8").tobytes()
    width = str(array.shape[1] if array.ndim > 1 else 1)
    element = ElementTree.SubElement(
        parent,
        "DataArray",
        type="Int64" if whole else "Float64",
        Name=name,
        NumberOfComponents=width,
        format="binary",
    )
    element.text = base64.b64encode(np.array([len(values)], "<u8").tobytes() + values).decode()


def write_polydata(state: State, path: Path) -> None:
    """Writes PolyData: a vertex per sphere, with the data that the state knows."""
    _write(state, path, "PolyData")


def write_grid(state: State, path: Path) -> None:
    """Writes an UnstructuredGrid: a vertex per sphere, with the data that the state knows."""
    _write(state, path, "UnstructuredGrid")


POLYDATA = Format(
    "vtp",
    "VTK XML point cloud, PolyData",
    (".vtp",),
    lambda head: recognises(head) and b"PolyData" in head,
    read,
    write_polydata,
)
GRID = Format(
    "vtu",
    "VTK XML point cloud, UnstructuredGrid",
    (".vtu",),
    lambda head: recognises(head) and b"UnstructuredGrid" in head,
    read,
    write_grid,
)
