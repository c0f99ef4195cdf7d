"""What the launches of a LIGGGHTS run write: binary dumps, one file per frame and one for all tracks, wall forces.

A run that was interrupted goes on in a new launch from a checkpoint. Frames have one name for all launches; everything
else has files of its own for each launch, and what an earlier launch wrote after the start of the next does not count.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from dembench.engines.base import CHECKPOINTS, FRAMES, Frame, FrameFiles, Tracks
from dembench.engines.liggghts_axes import as_given, renamed_by
from dembench.engines.scene_queries import in_sink, observed_walls, steps_of
from dembench.scene import Scene

HEADER = struct.Struct("<qqi6i6dii")
"""Step, number of bodies, triclinic flag, 6 boundary flags, 6 bounds, values per body, number of chunks."""
FRAME_COLUMNS = 10
TRACK_COLUMNS = 7
FIRST_FORCES = "forces.first.txt"
"""Forces on walls after the first step."""


@dataclass(frozen=True)
class Launch:
    """One start of the program, at step 0 or at that of a checkpoint, and the names of its files."""

    start: int = 0

    @property
    def deck(self) -> str:
        """Its script."""
        return self._named("in", "liggghts")

    @property
    def log(self) -> str:
        """Its log."""
        return self._named("log", "liggghts")

    @property
    def tracks(self) -> str:
        """Its record of the tracked bodies."""
        return self._named("tracks", "bin")

    @property
    def forces(self) -> str:
        """Its record of the forces on walls."""
        return self._named("forces", "txt")

    @property
    def checkpoint(self) -> str:
        """The checkpoint that it starts from."""
        return f"{CHECKPOINTS}/{self.start}.restart"

    def _named(self, name: str, kind: str) -> str:
        return f"{name}.{self.start}.{kind}" if self.start else f"{name}.{kind}"


def launches(directory: Path) -> list[tuple[Launch, int | None]]:
    """The launches of a deck directory in their order, each with the step at which the next one took over, or None."""
    found = (re.fullmatch(r"in\.(\d+)\.liggghts", path.name) for path in directory.glob("in.*.liggghts"))
    starts = [0, *sorted(int(match[1]) for match in found if match)]
    return [(Launch(start), end) for start, end in zip(starts, [*starts[1:], None], strict=True)]


# ---- frames


def read_frames(scene: Scene, dt: float, directory: Path) -> FrameFiles:
    """The frames of a scene that are completely written so far."""
    observed = observed_walls(scene)
    forces = _read_forces(directory) if observed else {}
    known = []
    for step, time in zip(steps_of(scene.frame_times(), dt), scene.frame_times(), strict=True):
        path = directory / FRAMES / f"{step}.bin"
        if not _complete(path) or (observed and len(forces.get(step, ())) != 3 * len(observed)):
            break
        known.append((step, float(time), path))
    return FrameFiles(known, partial(_load_frame, scene, renamed_by(scene), observed, forces))


def _load_frame(
    scene: Scene, places: int, observed: list[str], forces: dict[int, np.ndarray], step: int, time: float, path: Path
) -> Frame:
    _, table = next(_records(path.read_bytes(), FRAME_COLUMNS))
    vectors = as_given(table[:, 1:].reshape(-1, 3, 3), places)
    left = ~in_sink(scene, vectors[:, 0])
    present, vectors = table[left, 0].astype(np.intp) - 1, vectors[left]
    by_wall = dict(zip(observed, as_given(forces[step].reshape(-1, 3), places), strict=True)) if observed else {}
    return Frame(step, time, present, vectors[:, 0], vectors[:, 1], vectors[:, 2], by_wall)


def remove_frames(directory: Path, after: int) -> None:
    """Removes the frames after a step."""
    for path in (directory / FRAMES).glob("*.bin"):
        if int(path.stem) > after:
            path.unlink()


def _complete(path: Path) -> bool:
    """Whether the first record of a dump file is there to its last byte."""
    try:
        size = path.stat().st_size
        with open(path, "rb") as stream:
            start = stream.read(HEADER.size)
    except OSError:
        return False
    if len(start) < HEADER.size:
        return False
    header = HEADER.unpack(start)
    count, columns, chunks = header[1], header[-2], header[-1]
    return size >= HEADER.size + 4 * chunks + 8 * columns * count


def _records(data: bytes, columns: int) -> Iterator[tuple[int, np.ndarray]]:
    """The complete records of a binary dump: step, and the values of the bodies sorted by id, shape (n, columns)."""
    offset = 0
    while offset + HEADER.size <= len(data):
        header = HEADER.unpack_from(data, offset)
        step, count, chunks = header[0], header[1], header[-1]
        offset += HEADER.size
        parts = []
        for _ in range(chunks):
            if offset + 4 > len(data):
                return
            (values,) = struct.unpack_from("<i", data, offset)
            offset += 4
            if offset + 8 * values > len(data):
                return
            parts.append(np.frombuffer(data, "<f8", values, offset))
            offset += 8 * values
        table = np.concatenate(parts).reshape(count, columns)
        yield step, table[np.argsort(table[:, 0], kind="stable")]


# ---- records of every launch


def _read_forces(directory: Path) -> dict[int, np.ndarray]:
    """Forces on the observed walls [N] by step, in the order of the observables: x, y, z of each wall.

    The program knows the forces on triangles only after a step: those at t = 0 are those after the first one.
    """
    found = {step - 1: values for step, values in _rows(directory / FIRST_FORCES) if step == 1}
    for launch, end in launches(directory):
        rows = _rows(directory / launch.forces)
        found |= {step: values for step, values in rows if step > launch.start and (end is None or step <= end)}
    return found


def _rows(path: Path) -> Iterator[tuple[int, np.ndarray]]:
    """Step and values of the complete rows of a text file."""
    for line in path.read_text().split("\n")[:-1] if path.exists() else []:
        if not line.startswith("#"):
            step, *values = line.split()
            yield int(step), np.array(values, float)


def read_tracks(scene: Scene, dt: float, directory: Path) -> tuple[Tracks | None, str]:
    """The tracks written so far, None where the scene tracks no body; and which tracked body is gone, if one is."""
    bodies = scene.tracked_bodies()
    if not bodies:
        return None, ""
    places = renamed_by(scene)
    wanted = dict(zip(steps_of(scene.track_times(), dt), scene.track_times(), strict=True))
    steps: list[int] = []
    rows: list[np.ndarray] = []
    lost = ""
    for launch, end in launches(directory):
        path = directory / launch.tracks
        for step, table in _records(path.read_bytes() if path.exists() else b"", TRACK_COLUMNS):
            counts = (end is None or step <= end) and (step > launch.start or launch.start == 0)
            if not counts or step not in wanted or lost:
                continue
            vectors = as_given(table[:, 1:].reshape(-1, 2, 3), places)
            left = table[~in_sink(scene, vectors[:, 0]), 0].astype(int) - 1
            if len(left) < len(bodies):
                lost = f"tracked body {min(set(bodies) - set(left.tolist()))} is gone by t = {wanted[step]:g} s"
            else:
                steps.append(step)
                rows.append(vectors)
    values = np.array(rows).reshape(len(rows), len(bodies), 2, 3)
    times = np.array([wanted[step] for step in steps], dtype=np.float64)
    tracks = Tracks(np.array(steps, dtype=np.int64), times, values[:, :, 0], values[:, :, 1])
    return tracks, lost
