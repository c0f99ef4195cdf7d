"""The in-tree solver as an engine: its deck, what its program writes, and how a run is carried on.

The deck holds `scene.json`, `settings.json` and, where there are many bodies, `scene.npz`. The program
(`in_tree_program.py`) writes `frames/<step>.npy` (id, position, velocity, angular velocity: n x 10 float64), the tables
`tracks.bin` (step, time, position and velocity of every tracked body) and `clock.bin` (step, simulated and wall time),
rows of float64, checkpoints (`in_tree_checkpoints.py`) and at the end `timing.json`; on failure `failure.json`. A frame
has its final name only when it is complete.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from abc import abstractmethod
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

import dembench
from dembench.engines import in_tree_checkpoints as checkpoints
from dembench.engines.base import (
    FRAMES,
    Checkpoint,
    Division,
    Engine,
    Frame,
    FrameFiles,
    Phase,
    Probe,
    Series,
    SettingsError,
    Timing,
    Tracks,
)
from dembench.engines.scene_queries import observed_walls
from dembench.scene import FORCEABLE, Scene, features, save_scene

TRACKS, CLOCK, TIMING, FAILURE = "tracks.bin", "clock.bin", "timing.json", "failure.json"
CLOCK_COLUMNS = 3
CHECKPOINT_INTERVAL = 120.0
"""Wall time between two checkpoints [s], as written into a deck; longer where writing one takes over 1 % of it."""


class InTree(Engine):
    """An engine whose simulations are `dembench.solver.Simulation`, stepped in a child process."""

    cores_setting: ClassVar[str | None] = "threads"
    imported: ClassVar[bool] = False

    @abstractmethod
    def simulation(self, scene: Scene, settings: dict[str, Any]) -> Any:
        """The simulation that the child process steps."""

    def probe(self) -> Probe:
        """See `Engine.probe`; the version has a digest of the solver's sources."""
        try:
            import warp
        except ImportError as error:
            reason = f"warp-lang cannot be imported: {error}"
            return Probe(available=False, reason=reason, install="pip install warp-lang")
        digest = hashlib.sha256()
        folder = Path(dembench.__file__).parent / "solver"
        for source in sorted(folder.rglob("*.py")):
            digest.update(source.relative_to(folder).as_posix().encode() + source.read_bytes())
        version = f"{dembench.__version__}+{digest.hexdigest()[:10]}"
        return Probe(available=True, version=version, path=str(folder), facts={"warp-lang": warp.__version__})

    def settings(self, scene: Scene, division: Division, overrides: dict[str, str] | None = None) -> Any:
        """See `Engine.settings`; bodies that are no spheres have one thread."""
        made = super().settings(scene, division, overrides)
        if made.threads > 1 and features(scene).shapes:
            raise SettingsError(f"{self.name}[threads]: bodies that are no spheres have one (given: {made.threads})")
        return made

    def forceable(self, scene: Scene, settings: Any) -> list[str]:
        """See `Engine.forceable`; bodies that are no spheres have one set of kernels."""
        if features(scene).shapes:
            return []
        return [name for name in features(scene).absent() if name in FORCEABLE]

    def write(self, scene: Scene, settings: Any, directory: Path) -> list[Phase]:
        """See `Engine.write`."""
        save_scene(scene, directory / "scene.json")
        record = {"engine": self.name, "settings": settings.model_dump(), "checkpoint": CHECKPOINT_INTERVAL}
        (directory / "settings.json").write_text(json.dumps(record, indent=1))
        return [_phase()]

    def read(self, scene: Scene, settings: Any, directory: Path) -> Series:
        """See `Engine.read`."""
        timing, counters, failure = Timing(), {}, {}
        if (directory / TIMING).exists():
            record = json.loads((directory / TIMING).read_text())
            counters = record.pop("counters")
            timing = Timing(**record)
        if (directory / FAILURE).exists():
            failure = json.loads((directory / FAILURE).read_text())
        clock = _rows(directory / CLOCK, CLOCK_COLUMNS)
        return Series(
            frames=_frames(scene, settings.dt, directory / FRAMES),
            tracks=_tracks(scene, directory),
            timing=timing,
            time=float(clock[-1, 1]) if len(clock) else 0.0,
            failure=failure.get("reason"),
            detail=failure.get("detail", ""),
            counters=counters,
        )

    def reached(self, settings: Any, directory: Path) -> float | None:
        """See `Engine.reached`."""
        path, row = directory / CLOCK, 8 * CLOCK_COLUMNS
        rows = path.stat().st_size // row if path.exists() else 0
        return float(np.fromfile(path, count=CLOCK_COLUMNS, offset=(rows - 1) * row)[1]) if rows else None

    def checkpoint(self, scene: Scene, settings: Any, directory: Path) -> Checkpoint | None:
        """See `Engine.checkpoint`."""
        found, damaged = checkpoints.latest(directory)
        if found is None:
            return None
        times = ", ".join(f"t = {step * settings.dt:.6g} s" for step in damaged)
        return Checkpoint(step=found.step, time=found.time, note=f"damaged: checkpoint at {times}" if damaged else "")

    def resume(self, scene: Scene, settings: Any, directory: Path) -> list[Phase] | None:
        """See `Engine.resume`."""
        found, _damaged = checkpoints.latest(directory)
        if found is None:
            return None
        checkpoints.remove_after(directory, found.step)
        _cut(directory / TRACKS, track_columns(scene), found.step)
        _cut(directory / CLOCK, CLOCK_COLUMNS, found.step)
        for path in (directory / FRAMES).iterdir():
            if not path.stem.removeprefix("walls").isdecimal() or _step_of(path) >= found.step:
                path.unlink()
        for name in (TIMING, FAILURE):
            (directory / name).unlink(missing_ok=True)
        return [_phase(str(found.path.relative_to(directory)))]


def _phase(*start: str) -> Phase:
    """The program on a deck, from the start or from a checkpoint."""
    return Phase(name="simulate", command=(sys.executable, "-m", "dembench.engines.in_tree_program", ".", *start))


# ---- frames


def forces_of(frame: Path) -> Path:
    """The file with the forces on the observed walls that belongs to a frame."""
    return frame.with_name(f"walls{frame.name}")


def _step_of(path: Path) -> int:
    return int(path.stem.removeprefix("walls"))


def _frames(scene: Scene, dt: float, directory: Path) -> FrameFiles:
    """The frames written so far."""
    known = []
    for moment in scene.frame_times():
        step = round(moment / dt)
        path = directory / f"{step}.npy"
        if not path.exists():
            break
        known.append((step, float(moment), path))
    return FrameFiles(known, partial(_load_frame, observed_walls(scene)))


def _load_frame(walls: list[str], step: int, moment: float, path: Path) -> Frame:
    table = np.load(path)
    present, state = table[:, 0].astype(int), (table[:, 1:4], table[:, 4:7], table[:, 7:10])
    forces = np.load(forces_of(path)) if walls else []
    return Frame(step, moment, present, *state, dict(zip(walls, forces, strict=True)))


# ---- tables


def track_columns(scene: Scene) -> int:
    """Numbers in a row of tracks."""
    return 2 + 6 * len(scene.tracked_bodies())


def _tracks(scene: Scene, directory: Path) -> Tracks | None:
    bodies = scene.tracked_bodies()
    if not bodies:
        return None
    rows = _rows(directory / TRACKS, track_columns(scene))
    values = rows[:, 2:].reshape(len(rows), len(bodies), 6)
    return Tracks(rows[:, 0].astype(np.int64), rows[:, 1], values[:, :, :3], values[:, :, 3:])


def _rows(path: Path, columns: int) -> np.ndarray:
    """Complete rows of a table, shape (n, columns); a row that is still being written is left out."""
    values = np.fromfile(path) if path.exists() else np.empty(0)
    return values[: len(values) // columns * columns].reshape(-1, columns)


def _cut(path: Path, columns: int, step: int) -> None:
    """Removes the rows of a table from a step on."""
    if path.exists():
        rows = _rows(path, columns)
        os.truncate(path, 8 * columns * int(np.searchsorted(rows[:, 0], step)))
