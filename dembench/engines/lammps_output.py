"""What a LAMMPS run writes: binary dumps, one file per frame and one for all tracks, wall forces, the log."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from dembench.engines.base import FRAMES, Frame, FrameFiles, Tracks
from dembench.engines.scene_queries import in_sink, observed_walls, steps_of
from dembench.scene import Scene

DECK, LOG, TRACKS, FORCES = "in.lammps", "log.lammps", "tracks.bin", "forces.txt"
MAGIC = b"DUMPCUSTOM"
REVISION = 2
"""Revision of the binary dumps that are read."""
_PARTS = {"Pair": "pair_s", "Neigh": "neigh_s", "Comm": "comm_s", "Output": "output_s", "Modify": "modify_s"}
_COUNTED = {
    "Neighbor list builds": "neighbour_builds",
    "Dangerous builds": "dangerous_builds",
    "Ave neighs/atom": "neighbours_per_body",
}


class Truncated(Exception):
    """A dump that ends within a record."""


# ---- dumps


def records(data: bytes) -> Iterator[tuple[int, np.ndarray]]:
    """The complete records of a binary dump: step, and the values of the bodies sorted by id, shape (n, columns).

    Raises:
        ValueError: It is no dump of this kind.
    """
    at = 0
    while at < len(data):
        try:
            step, table, at = _record(data, at)
        except Truncated:
            return
        yield step, table[np.argsort(table[:, 0], kind="stable")]


def _record(data: bytes, at: int) -> tuple[int, np.ndarray, int]:
    """Step and values of the record at an offset, and the offset of the next one."""

    def take(form: str) -> tuple[int, ...]:
        nonlocal at
        size = struct.calcsize(form)
        if at + size > len(data):
            raise Truncated
        values = struct.unpack_from(form, data, at)
        at += size
        return values

    length, magic, _, revision = take("<q10sii")
    if (length, magic, revision) != (-len(MAGIC), MAGIC, REVISION):
        raise ValueError(f"no custom dump of revision {REVISION}: it begins with {magic!r}, revision {revision}")
    step, count, triclinic = take("<qqi")
    take("<6i6d" + ("3d" if triclinic else ""))
    columns, units = take("<ii")
    take(f"<{units}s")
    (timed,) = take("<b")
    take("<d" if timed else "<")
    (names,) = take("<i")
    take(f"<{names}s")
    (chunks,) = take("<i")
    parts = []
    for _ in range(chunks):
        (values,) = take("<i")
        if at + 8 * values > len(data):
            raise Truncated
        parts.append(np.frombuffer(data, "<f8", values, at))
        at += 8 * values
    return step, np.concatenate(parts).reshape(count, columns), at


def read_frames(scene: Scene, dt: float, directory: Path) -> FrameFiles:
    """The frames of a scene that are completely written so far."""
    observed = observed_walls(scene)
    forces = _read_forces(directory / FORCES) if observed else {}
    known = []
    for step, time in zip(steps_of(scene.frame_times(), dt), scene.frame_times(), strict=True):
        path = directory / FRAMES / f"{step}.bin"
        if not path.exists() or not _complete(path) or (observed and len(forces.get(step, ())) != 3 * len(observed)):
            break
        known.append((step, float(time), path))
    return FrameFiles(known, partial(_load_frame, scene, observed, forces))


def _complete(path: Path) -> bool:
    return next(records(path.read_bytes()), None) is not None


def _load_frame(
    scene: Scene, observed: list[str], forces: dict[int, np.ndarray], step: int, time: float, path: Path
) -> Frame:
    _, table = next(records(path.read_bytes()))
    table = table[~in_sink(scene, table[:, 1:4])]
    present = table[:, 0].astype(np.intp) - 1
    by_wall = dict(zip(observed, forces[step].reshape(-1, 3), strict=True)) if observed else {}
    return Frame(step, time, present, table[:, 1:4], table[:, 4:7], table[:, 7:10], by_wall)


def _read_forces(path: Path) -> dict[int, np.ndarray]:
    """Forces on the observed walls [N] by step, in the order of the observables: x, y, z of each wall."""
    lines = path.read_text().split("\n")[:-1] if path.exists() else []
    rows = (line.split() for line in lines if not line.startswith("#"))
    return {int(step): np.array(values, float) for step, *values in rows}


def read_tracks(scene: Scene, dt: float, directory: Path) -> tuple[Tracks | None, str]:
    """The tracks written so far, None where the scene tracks no body; and which tracked body is gone, if one is."""
    bodies = scene.tracked_bodies()
    if not bodies:
        return None, ""
    wanted = dict(zip(steps_of(scene.track_times(), dt), scene.track_times(), strict=True))
    steps: list[int] = []
    rows: list[np.ndarray] = []
    lost = ""
    path = directory / TRACKS
    for step, table in records(path.read_bytes() if path.exists() else b""):
        if step not in wanted:
            continue
        left = set((table[~in_sink(scene, table[:, 1:4]), 0].astype(int) - 1).tolist())
        if len(left) < len(bodies):
            lost = f"tracked body {min(set(bodies) - left)} is gone by t = {wanted[step]:g} s"
            break
        steps.append(step)
        rows.append(table[:, 1:])
    values = np.array(rows).reshape(len(rows), len(bodies), 2, 3)
    times = np.array([wanted[step] for step in steps], dtype=np.float64)
    return Tracks(np.array(steps, dtype=np.int64), times, values[:, :, 0], values[:, :, 1]), lost


# ---- log


def failure_in(log: str) -> tuple[str | None, str]:
    """Reason (one of `FAILURES`) and detail of a failure that a log tells of, or (None, "")."""
    if error := re.search(r"^ERROR[^\n]*", log, re.M):
        detail = error[0].strip()
        for sign, reason in (("Lost atoms", "lost particles"), ("Non-numeric", "nan"), ("allocate", "memory")):
            if sign in detail:
                return reason, detail
        return "engine error", detail
    if unknown := re.search(r"^ +(\d+) +\d+ +-?nan *$", log, re.M):
        return "nan", f"the kinetic energy is not a number at step {unknown[1]}"
    return None, ""


def last_step(log: str) -> int:
    """The last step that a log reports."""
    return max((int(step) for step in re.findall(r"^ +(\d+) +\d+ +\S+ *$", log, re.M)), default=0)


def timing_in(log: str) -> tuple[float | None, dict[str, float]]:
    """The program's own time of the stepping loops [s], output included, and its other figures.

    A run that is cut into parts, between which bodies in sinks are removed, tells the figures of each part; they are
    summed.
    """
    loops = [float(time) for time in re.findall(r"^Loop time of (\S+) on", log, re.M)]
    counters: dict[str, float] = {}
    for part, seconds in re.findall(r"^(\w+) +\| [^|]*\| (\S+) ", log, re.M):
        if part in _PARTS:
            counters[_PARTS[part]] = counters.get(_PARTS[part], 0.0) + float(seconds)
    for label, name in _COUNTED.items():
        found = [float(value) for value in re.findall(rf"^{label} = (\S+)", log, re.M)]
        if found:
            counters[name] = found[-1] if name == "neighbours_per_body" else sum(found)
    return (sum(loops) if loops else None), counters
