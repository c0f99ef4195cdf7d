"""Time series of other programs as they come: named columns in a CSV, npz or HDF5 file."""

from __future__ import annotations

import csv
import hashlib
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

_TITLE = re.compile(r"#?\s*(?P<name>[^\[\]()]*?)\s*([\[(](?P<unit>[^\[\]()]*)[\])])?\s*")
_DELIMITERS = (",", ";", "\t")


class ForeignError(ValueError):
    """A file of another program that cannot be used: names the file, the place, the value and what is accepted."""


@dataclass(frozen=True)
class Foreign:
    """What a file holds.

    Attributes:
        path: The file.
        format: `csv`, `npz` or `hdf5`.
        sha256: Checksum of the file.
        columns: Arrays of one dimension by name, in lower case.
        units: Units that the file states, by name.
        scalars: Single numbers by name.
    """

    path: Path
    format: str
    sha256: str
    columns: dict[str, np.ndarray]
    units: dict[str, str]
    scalars: dict[str, float]


def read_foreign(path: Path) -> Foreign:
    """The columns of a file; its ending says the format.

    Raises:
        ForeignError: It cannot be read, or a value is no number.
    """
    readers = {".csv": _csv, ".txt": _csv, ".dat": _csv, ".npz": _npz, ".h5": _hdf5, ".hdf5": _hdf5}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise ForeignError(f"{path}: the ending is '{path.suffix}'; accepted are {', '.join(readers)}")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ForeignError(f"{path}: {error.strerror}") from None
    found: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for title, array in reader(path).items():
        match = _TITLE.fullmatch(title)
        name = (match["name"] if match else title).strip().lower()
        if name in found:
            raise ForeignError(f"{path}: two columns are called '{name}'; accepted is one")
        found[name] = array
        if match and match["unit"]:
            units[name] = match["unit"].strip()
    return Foreign(
        path=path,
        format=reader.__name__.strip("_"),
        sha256=hashlib.sha256(data).hexdigest(),
        columns={name: array for name, array in found.items() if array.ndim == 1},
        units=units,
        scalars={name: float(array) for name, array in found.items() if array.ndim == 0},
    )


def _csv(path: Path) -> dict[str, np.ndarray]:
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise ForeignError(f"{path}: not a text file") from None
    if not lines:
        raise ForeignError(f"{path}: empty; accepted is a header line with the names of the columns, then numbers")
    delimiter = next((d for d in _DELIMITERS if d in lines[0]), None)
    rows = list(csv.reader(lines, delimiter=delimiter)) if delimiter else [line.split() for line in lines]
    titles, table = rows[0], []
    if twice := [title for title in titles if titles.count(title) > 1]:
        raise ForeignError(f"{path}: two columns are called '{twice[0].strip()}'; accepted is one")
    for number, row in enumerate(rows[1:], 2):
        if not any(field.strip() for field in row):
            continue
        if len(row) != len(titles):
            raise ForeignError(f"{path}:{number}: {len(row)} fields; the header has {len(titles)}")
        try:
            table.append([float(field) for field in row])
        except ValueError as error:
            raise ForeignError(f"{path}:{number}: {error}; accepted are numbers") from None
    return dict(zip(titles, np.array(table).reshape(-1, len(titles)).T, strict=True))


def _npz(path: Path) -> dict[str, np.ndarray]:
    found = {}
    try:
        with np.load(path, allow_pickle=False) as stored:
            for name in stored.files:
                try:
                    array = stored[name]
                except ValueError:  # an object, which no series is
                    continue
                if np.issubdtype(array.dtype, np.number):
                    found[name] = array.astype(np.float64)
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise ForeignError(f"{path}: no readable npz file: {error}") from None
    return found


def _hdf5(path: Path) -> dict[str, np.ndarray]:
    """Datasets of numbers by the last part of their names, with the unit that an attribute states."""
    found: dict[str, np.ndarray] = {}

    def visit(place: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and np.issubdtype(item.dtype, np.number):
            unit = item.attrs.get("unit", item.attrs.get("units", ""))
            title = place.rsplit("/", 1)[-1] + (f" [{unit}]" if unit else "")
            if title in found:
                raise ForeignError(f"{path}: two datasets are called '{title}'; accepted is one")
            found[title] = item[()].astype(np.float64)

    try:
        with h5py.File(path, "r") as file:
            if "dembench" in file:
                raise ForeignError(f"{path}: is a result of this program; put its run directory among the runs")
            file.visititems(visit)
    except (OSError, RuntimeError):
        raise ForeignError(
            f"{path}: no readable HDF5 file: it is damaged or cut off; give one that its program has closed"
        ) from None
    return found
