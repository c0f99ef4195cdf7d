"""What LIGGGHTS writes: binary dumps, one file per frame and one for all tracks, and its log."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dembench.engines.base import Frame, FrameFiles, Tracks
from dembench.scene import Scene

HEADER = struct.Struct("<qqi6i6dii")
"""Step, number of bodies, triclinic flag, 6 boundary flags, 6 bounds, values per body, number of chunks."""
FRAME_COLUMNS = 10
TRACK_COLUMNS = 7


def steps_of(times: np.ndarray, dt: float) -> list[int]:
    """Step numbers of times [s] that are multiples of the time step [s]."""
    return [round(t / dt) for t in times]


def every_of(steps: list[int], last: int) -> int:
    """The largest dump interval that meets all steps; `last` where there is nothing but step 0."""
    return math.gcd(*steps) or last


def read_frames(scene: Scene, dt: float, directory: Path) -> FrameFiles:
    """The frames of a scene that are completely written so far."""
    known = []
    for step, time in zip(steps_of(scene.frame_times(), dt), scene.frame_times(), strict=True):
        path = directory / f"{step}.bin"
        if not _complete(path):
            break
        known.append((step, float(time), path))
    return FrameFiles(known, _load_frame)


def _load_frame(step: int, time: float, path: Path) -> Frame:
    _, table = next(_records(path.read_bytes(), FRAME_COLUMNS))
    return Frame(step, time, table[:, 0].astype(np.intp) - 1, table[:, 1:4], table[:, 4:7], table[:, 7:10])


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


def read_tracks(scene: Scene, dt: float, path: Path) -> Tracks | None:
    """The tracks written so far; None where the scene tracks no body."""
    bodies = scene.tracked_bodies()
    if not bodies:
        return None
    wanted = dict(zip(steps_of(scene.track_times(), dt), scene.track_times(), strict=True))
    data = path.read_bytes() if path.exists() else b""
    rows = [(step, table) for step, table in _records(data, TRACK_COLUMNS) if step in wanted]
    values = np.array([table[:, 1:] for _, table in rows]).reshape(len(rows), len(bodies), 6)
    return Tracks(
        np.array([step for step, _ in rows], dtype=np.int64),
        np.array([wanted[step] for step, _ in rows], dtype=np.float64),
        values[:, :, :3],
        values[:, :, 3:],
    )


# ---- the log


def failure_in(log: str) -> tuple[str | None, str]:
    """Reason (one of `FAILURES`) and detail of a failure that a log tells of, or (None, "")."""
    error = re.search(r"^ERROR[^\n]*", log, re.M)
    if error:
        detail = error[0].strip()
        for sign, reason in (("Lost atoms", "lost particles"), ("Non-numeric", "nan"), ("allocate", "memory")):
            if sign in detail:
                return reason, detail
        return "engine error", detail
    unknown = re.search(r"^ +(\d+) +\d+ +-?nan *$", log, re.M)
    if unknown:
        return "nan", f"the kinetic energy is not a number at step {unknown[1]}"
    return None, ""


def last_step(log: str) -> int:
    """The last step that a log reports."""
    return max((int(step) for step in re.findall(r"^ +(\d+) +\d+ +\S+ *$", log, re.M)), default=0)


def loop_time(log: str) -> float | None:
    """The program's own time of the stepping loop, output included [s]; None while it runs."""
    found = re.search(r"^Loop time of (\S+) on", log, re.M)
    return float(found[1]) if found else None


def counters_in(log: str) -> dict[str, float]:
    """The program's own figures: time by kind of work [s], neighbour lists."""
    found = re.findall(r"^(Pair|Neigh|Comm|Outpt|Other)\s+time \(%\) = (\S+)", log, re.M)
    counters = {f"{kind.lower()}_s": float(seconds) for kind, seconds in found}
    for name, label in (
        ("neighbour_builds", "Neighbor list builds"),
        ("dangerous_builds", "Dangerous builds"),
        ("neighbours_per_body", "Ave neighs/atom"),
    ):
        if value := re.search(rf"^{label} = (\S+)", log, re.M):
            counters[name] = float(value[1])
    return counters
