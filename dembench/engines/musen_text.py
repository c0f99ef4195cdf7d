"""Reads MUSEN's text format: exported results, and the scenes that are written for it.

An object is one line that holds all its frames: identity, material and time of leaving, then for each frame `2 t` and
tagged values. Lines are taken one by one into arrays that are made beforehand, so that the size of a file does not
matter. Of the formats that the program can export, those with all constant values (id, type, geometry, material,
activity) are read, with any choice of the values that change in time.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

COORDINATE, VELOCITY, ANGULAR_VELOCITY, FORCE, VERTICES = 12, 15, 16, 20, 44
WIDTHS = {COORDINATE: 3, VELOCITY: 3, ANGULAR_VELOCITY: 3, 18: 1, FORCE: 3, 31: 4, 36: 9, 37: 1, 42: 3, VERTICES: 9}
"""Number of values that follow a tag of a frame."""
_SPHERE, _WALL = b"1", b"14"


class TextError(ValueError):
    """A file that is not in the format, or was cut off."""


@dataclass
class Objects:
    """Objects of one type.

    Attributes:
        id: Their numbers, shape (n,), in the order of the file.
        material: Keys of their materials.
        radius: [m], shape (n,); NaN for walls.
        left: Time at which they left the domain [s], shape (n,); infinity while they are there.
        time: Times of the frames that were kept [s], shape (t,), as in the file.
        values: Values of these frames by tag, shape (t, n, width).
        tracked_time: Times of all frames of the tracked objects [s], shape (s,).
        tracks: Position and velocity of the tracked objects at all times, shape (s, 6), by number.
        exits: Place at which an object stood when it had left [m], shape (3,), by number.
    """

    id: np.ndarray
    material: list[str]
    radius: np.ndarray
    left: np.ndarray
    time: np.ndarray = field(default_factory=lambda: np.empty(0))
    values: dict[int, np.ndarray] = field(default_factory=dict)
    tracked_time: np.ndarray = field(default_factory=lambda: np.empty(0))
    tracks: dict[int, np.ndarray] = field(default_factory=dict)
    exits: dict[int, np.ndarray] = field(default_factory=dict)


@dataclass
class Text:
    """What a file holds.

    Attributes:
        grains, walls: Spheres and triangles.
        domain: Corners [m], shape (6,); empty where the file has none.
        geometries: Numbers of the walls by name of the geometry.
        motions: Velocity [m/s], angular velocity [rad/s] and centre [m] of each interval of each moving geometry.
        materials: Properties of each material by tag.
        pairs: Properties of each pair of materials, `A-B` in alphabetical order, by tag.
    """

    grains: Objects
    walls: Objects
    domain: np.ndarray = field(default_factory=lambda: np.empty(0))
    geometries: dict[str, list[int]] = field(default_factory=dict)
    motions: dict[str, list[tuple[float, ...]]] = field(default_factory=dict)
    materials: dict[str, dict[int, float]] = field(default_factory=dict)
    pairs: dict[str, dict[int, float]] = field(default_factory=dict)


def read_text(path: Path, keep: Callable[[np.ndarray], np.ndarray] | None = None, tracked: Sequence[int] = ()) -> Text:
    """Reads a file.

    Args:
        path: The file.
        keep: Given the times of the frames [s], the indices of those that are kept; None keeps all.
        tracked: Numbers of the objects of which all frames are kept.

    Raises:
        TextError: Not in the format: which line, and what is wrong with it.
    """
    spheres, triangles = _count(path)
    found = Text(_blank(spheres), _blank(triangles))
    grains, walls = _Rows(found.grains, keep, tracked), _Rows(found.walls, keep, ())
    name = ""
    with open(path, "rb") as stream, warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # numpy's word for a text that is no number
        for number, line in enumerate(stream, 1):
            try:
                if line.startswith(b"0 "):
                    (grains if _type(line) == _SPHERE else walls).add(line)
                else:
                    name = _scene_line(found, line.decode().split(), name)
            except (ValueError, IndexError, DeprecationWarning) as error:
                raise TextError(f"{path.name}, line {number}: {error or 'cut off'}") from None
    return found


def _type(line: bytes) -> bytes:
    return line[:60].split(None, 4)[3]


def _count(path: Path) -> tuple[int, int]:
    """Numbers of spheres and of walls."""
    with open(path, "rb") as stream:
        kinds = [line[:60].split(None, 4)[3:4] for line in stream if line.startswith(b"0 ")]
    return kinds.count([_SPHERE]), kinds.count([_WALL])


def _blank(count: int) -> Objects:
    return Objects(np.zeros(count, np.int64), [""] * count, np.full(count, np.nan), np.full(count, np.inf))


class _Rows:
    """Takes the lines of the objects of one type."""

    def __init__(self, objects: Objects, keep: Callable[[np.ndarray], np.ndarray] | None, tracked: Sequence[int]):
        self._objects, self._keep, self._tracked = objects, keep, set(tracked)
        self._row = 0
        self._times = np.empty(0)
        self._kept = np.empty(0, np.intp)
        self._layout: dict[int, int] = {}
        self._width = 0

    def add(self, line: bytes) -> None:
        """Takes one line."""
        objects, row = self._objects, self._row
        sphere = _type(line) == _SPHERE
        head = line.split(None, 12 if sphere else 10)
        tags = (0, 2, 4, 7, 9) if sphere else (0, 2, 4, 5, 7)
        if [head[k] for k in tags] != [b"0", b"1", b"5", b"23", b"24"]:
            raise ValueError(f"object {head[1].decode()} is not followed by type, geometry, material and activity")
        objects.id[row] = int(head[1])
        objects.material[row] = head[8 if sphere else 6].decode()
        if sphere:
            objects.radius[row] = float(head[5])
        left = float(head[11 if sphere else 9])
        objects.left[row] = left if left < 1e299 else np.inf
        table = self._table(np.fromstring(head[12 if sphere else 10], sep=" "))
        for tag, column in self._layout.items():
            objects.values[tag][:, row] = table[self._kept, column : column + WIDTHS[tag]]
        self._record(int(head[1]), table, left)
        self._row += 1

    def _table(self, values: np.ndarray) -> np.ndarray:
        """The values of a line, one row for each frame: `2 t`, then tags with their values."""
        if not self._width:
            self._find_layout(values)
        if len(values) % self._width:
            raise ValueError(f"{len(values)} values are no multiple of the {self._width} of a frame")
        table = values.reshape(-1, self._width)
        for tag, column in ((2, 1), *self._layout.items()):
            if not (table[:, column - 1] == tag).all():
                raise ValueError(f"tag {tag} is not at its place in every frame")
        if not len(self._times):
            self._begin(table[:, 1])
        if not np.array_equal(table[:, 1], self._times):
            raise ValueError("the frames are not those of the first object")
        return table

    def _find_layout(self, values: np.ndarray) -> None:
        """Column of the first value of each tag, from the first frame."""
        k = 2
        while k < len(values) and values[k] != 2:
            if values[k] not in WIDTHS:
                raise ValueError(f"{values[k]:g} is no tag of a frame")
            tag = int(values[k])
            self._layout[tag] = k + 1
            k += 1 + WIDTHS[tag]
        self._width = k

    def _begin(self, times: np.ndarray) -> None:
        """Makes the arrays."""
        self._times = times.copy()
        self._kept = np.arange(len(times)) if self._keep is None else self._keep(self._times)
        objects = self._objects
        objects.time = self._times[self._kept]
        objects.tracked_time = self._times
        for tag in self._layout:
            objects.values[tag] = np.full((len(self._kept), len(objects.id), WIDTHS[tag]), np.nan)

    def _record(self, number: int, table: np.ndarray, left: float) -> None:
        """Keeps the track of a tracked object and the place where one has left."""
        place, speed = self._layout.get(COORDINATE), self._layout.get(VELOCITY)
        if place is None:
            return
        if number in self._tracked and speed is not None:
            self._objects.tracks[number] = np.hstack([table[:, place : place + 3], table[:, speed : speed + 3]])
        gone = int(np.searchsorted(self._times, left))
        if gone < len(self._times) and (gone > 0 or self._times[0] == left):
            self._objects.exits[number] = table[gone, place : place + 3].copy()


def _scene_line(found: Text, words: list[str], name: str) -> str:
    """Takes a line that is no object; returns the name of the geometry to which the next lines belong."""
    match words:
        case ["22", *numbers]:
            found.domain = np.array(numbers, dtype=np.float64)
        case ["25", name, *_]:
            found.geometries[name] = []
        case ["26", "1", count, *numbers]:
            rows = np.array(numbers, dtype=np.float64).reshape(int(count), 11)
            found.motions[name] = [tuple(row[[2, 3, 4, 8, 9, 10, 5, 6, 7]].tolist()) for row in rows]
        case ["27", _, *ids]:
            found.geometries[name] = [int(i) for i in ids]
        case ["32", key, _, *properties]:
            found.materials[key] = _properties(properties)
        case ["33", a, b, *properties]:
            found.pairs["-".join(sorted((a, b)))] = _properties(properties)
    return name


def _properties(words: list[str]) -> dict[int, float]:
    return {int(tag): float(value) for tag, value in zip(words[::2], words[1::2], strict=True)}
