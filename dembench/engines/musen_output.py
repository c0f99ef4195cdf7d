"""What MUSEN has computed, as frames and tracks: exported in parts, each read once and kept as arrays.

The program saves all grains at one cadence and exports time ranges as text. The text of a part is bounded, so that
neither its reading nor the arrays made of it need much memory, and is removed when it has been read. A part begins
with the last frame of the one before: a grain that left in between is only then in the export, with the place where it
went out.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dembench.engines.base import FRAMES, Frame, FrameFiles, Tracks
from dembench.engines.musen_scene import Geometry, domain, sink_faces
from dembench.engines.musen_text import (
    ANGULAR_VELOCITY,
    COORDINATE,
    FORCE,
    VELOCITY,
    VERTICES,
    Objects,
    Text,
    TextError,
    read_text,
)
from dembench.engines.scene_queries import observed_walls
from dembench.scene import Scene

PART_BYTES = 300e6
"""Size of the text of a part, about."""
BINARY_BYTES = 250
"""Size of one grain in one frame of the program's own result file, about."""
SHORT = 1e-5
"""Relative accuracy of values that the program prints with six digits."""


@dataclass(frozen=True)
class Saving:
    """When the program saves.

    Attributes:
        step: Time steps from one saved frame to the next.
        interval: The same as time [s].
        count: Number of saved frames after the initial one.
        frames: Of these, the frames of the scene, as numbers of saved frames, ascending from 0.
        tracks: The same for the tracks of the scene; empty where it tracks no body.
    """

    step: int
    interval: float
    count: int
    frames: np.ndarray
    tracks: np.ndarray


def saving(scene: Scene, dt: float) -> Saving:
    """The coarsest saving that meets every frame and track of a scene."""
    frames, tracks = (np.round(t / dt).astype(np.int64) for t in (scene.frame_times(), scene.track_times()))
    last = round(scene.duration / dt)
    step = math.gcd(*frames.tolist(), *tracks.tolist()) or last
    return Saving(step, step * dt, last // step, frames // step, tracks // step)


@dataclass(frozen=True)
class Part:
    """A range of saved frames that is exported into one file.

    Attributes:
        number: From 0.
        first, last: Numbers of its saved frames; the first is the last of the part before.
        file: Where its text goes.
        interval: Times between which the export takes frames [s].
    """

    number: int
    first: int
    last: int
    file: str
    interval: tuple[float, float]

    def new(self) -> range:
        """Its saved frames that no part before has."""
        return range(self.first + (self.number > 0), self.last + 1)


def frame_bytes(bodies: int, digits: int) -> int:
    """Size of the exported text of one frame, about: nine values of a grain and the time, with their tags."""
    return bodies * (10 * (digits + 5) + 12)


def parts(bodies: int, saved: Saving, digits: int) -> list[Part]:
    """The parts of the export of a run."""
    size = max(1, int(PART_BYTES / frame_bytes(bodies, digits)))
    found = []
    for k, first in enumerate(range(0, saved.count, size) if saved.count else [0]):
        last = min(first + size, saved.count)
        between = (max(0.0, (first - 0.5) * saved.interval), (last + 0.5) * saved.interval)
        found.append(Part(k, first, last, f"{FRAMES}/export_{k:04d}.txt", between))
    return found


# ---- one part


class Reader:
    """Makes frames and tracks of a run from its exported parts."""

    def __init__(self, scene: Scene, walls: list[Geometry], dt: float, digits: int, directory: Path):
        """The run of a scene with these walls in that deck."""
        self._scene, self._walls, self._dt, self._digits = scene, walls, dt, digits
        self._directory = directory
        self._saved = saving(scene, dt)
        self._parts = parts(len(scene.bodies), self._saved, digits)

    def read(self, exported: int) -> tuple[FrameFiles, Tracks | None, tuple[str, str] | None]:
        """Frames and tracks of the first `exported` parts, and the reason and detail of the first fault in them."""
        known: list[tuple[int, float, Path]] = []
        tables = []
        fault = None
        for part in self._parts[:exported]:
            fault = self._take(part)
            if fault is not None:
                break
            for k in self._kept(part):
                path = self._path(k)
                known.append((k * self._saved.step, float(k * self._saved.interval), path))
            if self._scene.tracked_bodies():
                tables.append(np.load(self._directory / f"tracks_{part.number:04d}.npy"))
        return FrameFiles(known, self._load), self._tracks(tables), fault

    def _path(self, saved: int) -> Path:
        return self._directory / FRAMES / f"{saved * self._saved.step}.npy"

    def _kept(self, part: Part) -> list[int]:
        """Saved frames of a part that are frames of the scene and were in the export."""
        frames = [k for k in self._saved.frames.tolist() if k in part.new()]
        return [k for k in frames if self._path(k).exists()]

    def _load(self, step: int, time: float, path: Path) -> Frame:
        table = np.load(path)
        names = observed_walls(self._scene)
        forces = np.load(path.with_suffix(".walls.npy")) if names else []
        state = (table[:, 1:4], table[:, 4:7], table[:, 7:10])
        return Frame(step, time, table[:, 0].astype(np.intp), *state, dict(zip(names, forces, strict=True)))

    def _tracks(self, tables: list[np.ndarray]) -> Tracks | None:
        bodies = len(self._scene.tracked_bodies())
        if not bodies:
            return None
        rows = np.concatenate([np.empty((0, 1 + 6 * bodies)), *tables])
        number, state = rows[:, 0].astype(np.int64), rows[:, 1:].reshape(-1, bodies, 6)
        return Tracks(number * self._saved.step, number * self._saved.interval, state[:, :, :3], state[:, :, 3:])

    def _take(self, part: Part) -> tuple[str, str] | None:
        """Reads a part where this has not been done; returns the reason and detail of what is wrong with it."""
        done = self._directory / FRAMES / f"part_{part.number:04d}.json"
        if not done.exists():
            try:
                fault = self._convert(part)
            except (OSError, TextError) as error:
                fault = ("no output", str(error))
            done.write_text(json.dumps(fault))
            if fault is None:
                (self._directory / part.file).unlink()
        found = json.loads(done.read_text())
        return None if found is None else (found[0], found[1])

    def _convert(self, part: Part) -> tuple[str, str] | None:
        frames = np.intersect1d(self._saved.frames, part.new())
        text = read_text(
            self._directory / part.file, lambda times: self._find(times, frames), self._scene.tracked_bodies()
        )
        grains = text.grains
        wanted = {COORDINATE, VELOCITY, ANGULAR_VELOCITY}
        if not wanted <= grains.values.keys():
            raise TextError(f"{part.file} has not the tags {', '.join(map(str, sorted(wanted)))} of every grain")
        if part.number == 0:
            written = read_text(self._directory / "scene.txt")
            motions = {wall.name: wall.motion for wall in self._walls if wall.motion}
            if fault := difference(written, text, motions, self._digits):
                return "engine error", fault
        names = observed_walls(self._scene)
        for row, time in enumerate(grains.time):
            k = round(time / self._saved.interval)
            there = np.flatnonzero(grains.left > time)
            state = [grains.values[tag][row, there] for tag in (COORDINATE, VELOCITY, ANGULAR_VELOCITY)]
            if names:
                np.save(self._path(k).with_suffix(".walls.npy"), self._forces(text, names, row))
            np.save(self._path(k), np.column_stack([grains.id[there], *state]))
        if self._scene.tracked_bodies():
            np.save(self._directory / f"tracks_{part.number:04d}.npy", self._track_table(grains, part))
        return self._lost(grains)

    def _find(self, times: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Indices of saved frames among times [s]; of two with the same number the first counts."""
        numbers = np.round(times / self._saved.interval).astype(np.int64)
        on_time = np.abs(times - numbers * self._saved.interval) < 1.5 * self._dt
        _, first = np.unique(numbers, return_index=True)
        return np.array([k for k in first if on_time[k] and numbers[k] in wanted], dtype=np.intp)

    def _forces(self, text: Text, names: list[str], row: int) -> np.ndarray:
        """Force on each of the named walls in a frame [N], shape (n, 3): the sum over its triangles."""
        force = text.walls.values[FORCE][row]
        return np.array([force[np.isin(text.walls.id, text.geometries.get(name, []))].sum(axis=0) for name in names])

    def _track_table(self, grains: Objects, part: Part) -> np.ndarray:
        """Number of the saved frame and state of the tracked bodies, one row for each track time up to their exit."""
        bodies = self._scene.tracked_bodies()
        if any(body not in grains.tracks for body in bodies):
            return np.empty((0, 1 + 6 * len(bodies)))
        times = grains.tracked_time
        rows = self._find(times, np.intersect1d(self._saved.tracks, part.new()))
        rows = rows[times[rows] < grains.left[np.isin(grains.id, bodies)].min()]
        numbers = np.round(times[rows] / self._saved.interval)
        return np.column_stack([numbers, *(grains.tracks[body][rows] for body in bodies)])

    def _lost(self, grains: Objects) -> tuple[str, str] | None:
        """The grains that left the domain of a scene with sinks through a face behind which there is none."""
        if not self._scene.sinks:
            return None  # every grain that is missing in a frame is lost
        low, high = domain(self._scene)
        for body, place in grains.exits.items():
            beyond = np.array([low - place, place - high])
            side, axis = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
            if (int(side), int(axis)) not in sink_faces(self._scene):
                where = ", ".join(f"{x:g}" for x in place)
                return "lost particles", f"body {body} left the domain at ({where}) m, where no sink is"
        return None


# ---- what was exported against what was written


def difference(written: Text, found: Text, motions: dict[str, tuple[float, ...]], digits: int) -> str:
    """The first difference between a written scene and an export of its run, or nothing.

    The program reports next to nothing about an input that it does not understand: it stops reading, or takes defaults.

    Args:
        written: The scene as it was written.
        found: An export that begins with the initial state.
        motions: Velocity [m/s], angular velocity [rad/s] and centre [m] of the moving geometries.
        digits: Significant digits of the export.
    """
    for kind, a, b in (("grains", written.grains, found.grains), ("walls", written.walls, found.walls)):
        if fault := _different_objects(kind, a, b) or _different_start(kind, a, b, digits):
            return fault
    if not np.allclose(found.domain, written.domain, rtol=SHORT, atol=0):
        return f"the domain is {found.domain.tolist()}, written was {written.domain.tolist()}"
    if found.geometries != written.geometries:
        names = [n for n, ids in written.geometries.items() if found.geometries.get(n) != ids] or [*found.geometries]
        return f"geometry {names[0]} is not as it was written"
    for name in written.geometries:
        have, want = found.motions.get(name, []), [motions[name]] if name in motions else []
        if np.shape(have) != np.shape(want) or not np.allclose(have, want, rtol=SHORT, atol=0):
            return f"geometry {name} moves by {have}, written was {want}"
    return _different_properties(written, found)


def _different_objects(kind: str, written: Objects, found: Objects) -> str:
    missing = np.setdiff1d(written.id, found.id)
    if len(missing):
        return f"{len(missing)} of {len(written.id)} {kind} are missing in the export, the first is {missing[0]}"
    if not np.array_equal(found.id, written.id):
        return f"the export has {len(found.id)} {kind}, written were {len(written.id)}"
    if found.material != written.material:
        return f"the materials of the {kind} are not as they were written"
    if not np.allclose(found.radius, written.radius, rtol=SHORT, atol=0, equal_nan=True):
        return "the radii are not as they were written"
    return ""


def _different_start(kind: str, written: Objects, found: Objects, digits: int) -> str:
    if not len(written.id):
        return ""
    if not len(found.time) or found.time[0] != 0:
        return f"the initial state of the {kind} is missing in the export"
    gone = np.flatnonzero(found.left == 0)
    if len(gone):
        return f"{len(gone)} of {len(written.id)} {kind} are gone at the start, the first is {found.id[gone[0]]}"
    for tag in found.values.keys() & written.values.keys() & {COORDINATE, VELOCITY, ANGULAR_VELOCITY, VERTICES}:
        close = np.isclose(found.values[tag][0], written.values[tag][0], rtol=10.0 ** (1 - digits), atol=0)
        if not close.all():
            number = written.id[np.argmin(close.all(axis=1))]
            return f"the initial state of {kind} is not as it was written, the first is number {number}"
    return ""


def _different_properties(written: Text, found: Text) -> str:
    for wanted, have in ((written.materials, found.materials), (written.pairs, found.pairs)):
        for name, properties in wanted.items():
            for tag, value in properties.items():
                read = have.get(name, {}).get(tag, math.nan)
                if not math.isclose(read, value, rel_tol=SHORT):
                    return f"property {tag} of {name} is {read:g}, written was {value:g}"
    return ""
