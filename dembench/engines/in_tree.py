"""The in-tree solver as a program: `python -m dembench.engines.in_tree DECK` simulates the scene of a deck.

The deck holds `scene.json`, `settings.json` and, where there are many bodies, `scene.npz`. The program writes
`frames/<step>.npy` (id, position, velocity, angular velocity: n x 10 float64), `tracks.csv`, `clock.csv` (step,
simulated and wall time at every record) and at the end `timing.json`; on failure `failure.json`. A frame has its final
name only when it is complete.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import dembench
from dembench.engines.base import EngineSettings, Frame, FrameFiles, Phase, Probe, Series, Timing, Tracks
from dembench.scene import Scene, WallForce, load_scene, save_scene

FRAMES = "frames"


def probe_solver() -> Probe:
    """Version of the package with a digest of the solver's sources, and the versions that it is built on."""
    try:
        import warp
    except ImportError as error:
        return Probe(available=False, reason=f"warp-lang cannot be imported: {error}", install="pip install warp-lang")
    digest = hashlib.sha256()
    folder = Path(dembench.__file__).parent / "solver"
    for source in sorted(folder.rglob("*.py")):
        digest.update(source.relative_to(folder).as_posix().encode() + source.read_bytes())
    version = f"{dembench.__version__}+{digest.hexdigest()[:10]}"
    return Probe(available=True, version=version, path=str(folder), facts={"warp-lang": warp.__version__})


def write_deck(engine: str, scene: Scene, settings: EngineSettings, directory: Path) -> list[Phase]:
    """Writes the deck of an in-tree engine and says how to launch it."""
    save_scene(scene, directory / "scene.json")
    text = json.dumps({"engine": engine, "settings": settings.model_dump()}, indent=1)
    (directory / "settings.json").write_text(text)
    return [Phase(name="simulate", command=(sys.executable, "-m", "dembench.engines.in_tree", "."))]


def _frames(scene: Scene, dt: float, directory: Path) -> FrameFiles:
    """The frames written so far."""
    known = []
    for moment in scene.frame_times():
        step = round(moment / dt)
        path = directory / f"{step}.npy"
        if not path.exists():
            break
        known.append((step, float(moment), path))
    return FrameFiles(known, partial(_load_frame, _observed_walls(scene)))


def _observed_walls(scene: Scene) -> list[str]:
    """Names of the walls whose force is observed, each once."""
    return list(dict.fromkeys(o.wall for o in scene.observables if isinstance(o, WallForce)))


def _load_frame(walls: list[str], step: int, moment: float, path: Path) -> Frame:
    table = np.load(path)
    present, state = table[:, 0].astype(int), (table[:, 1:4], table[:, 4:7], table[:, 7:10])
    forces = np.load(_forces_of(path)) if walls else []
    return Frame(step, moment, present, *state, dict(zip(walls, forces, strict=True)))


def _forces_of(frame: Path) -> Path:
    """The file with the forces on the observed walls that belongs to a frame."""
    return frame.with_name(f"walls{frame.name}")


def read_series(scene: Scene, settings: EngineSettings, directory: Path) -> Series:
    """What an in-tree engine has written so far."""
    timing, failure = Timing(), {}
    counters: dict[str, float] = {}
    if (directory / "timing.json").exists():
        record = json.loads((directory / "timing.json").read_text())
        counters = record.pop("counters")
        timing = Timing(**record)
    if (directory / "failure.json").exists():
        failure = json.loads((directory / "failure.json").read_text())
    clock = _rows(directory / "clock.csv")
    return Series(
        frames=_frames(scene, settings.dt, directory / FRAMES),
        tracks=_tracks(scene, directory),
        timing=timing,
        time=float(clock[-1, 1]) if len(clock) else 0.0,
        failure=failure.get("reason"),
        detail=failure.get("detail", ""),
        counters=counters,
    )


def _tracks(scene: Scene, directory: Path) -> Tracks | None:
    bodies = scene.tracked_bodies()
    if not bodies:
        return None
    rows = _rows(directory / "tracks.csv")
    width = 2 + 6 * len(bodies)
    values = (rows[:, 2:] if rows.size else np.empty((0, width - 2))).reshape(len(rows), len(bodies), 6)
    steps = rows[:, 0].astype(np.int64) if rows.size else np.empty(0, np.int64)
    times = rows[:, 1] if rows.size else np.empty(0)
    return Tracks(step=steps, time=times, position=values[:, :, :3], velocity=values[:, :, 3:])


def _rows(path: Path) -> np.ndarray:
    """Complete rows of a file of numbers, shape (n, columns); a row that is still being written is left out."""
    if not path.exists():
        return np.empty((0, 0))
    lines = path.read_text().split("\n")[:-1]
    return np.array([[float(x) for x in line.split(",")] for line in lines]) if lines else np.empty((0, 0))


# ---- the program


class _Recorder:
    """Writes what a run produces, and keeps the time that this takes."""

    def __init__(self, directory: Path, scene: Scene):
        self.directory, self.bodies = directory, list(scene.tracked_bodies())
        self.walls = _observed_walls(scene)
        self.seconds = 0.0
        (directory / FRAMES).mkdir(exist_ok=True)
        for name in ("tracks.csv", "clock.csv", "timing.json", "failure.json"):
            (directory / name).unlink(missing_ok=True)
        self._started = time.perf_counter()

    def frame(self, step: int, simulation: Any) -> np.ndarray:
        begin = time.perf_counter()
        columns = [simulation.ids[:, None], simulation.position, simulation.velocity, simulation.angular_velocity]
        table = np.hstack(columns)
        path = self.directory / FRAMES / f"{step}.npy"
        if self.walls:
            np.save(_forces_of(path), [simulation.wall_force(wall) for wall in self.walls])
        with open(path.with_suffix(".tmp"), "wb") as stream:
            np.save(stream, table)
        os.replace(path.with_suffix(".tmp"), path)
        self.seconds += time.perf_counter() - begin
        return table

    def track(self, step: int, moment: float, simulation: Any) -> None:
        begin = time.perf_counter()
        rows = np.searchsorted(simulation.ids, self.bodies)
        state = np.hstack([simulation.position[rows], simulation.velocity[rows]]).ravel()
        self._append("tracks.csv", [step, moment, *state])
        self.seconds += time.perf_counter() - begin

    def clock(self, step: int, moment: float) -> None:
        self._append("clock.csv", [step, moment, time.perf_counter() - self._started])

    def _append(self, name: str, values: list[float]) -> None:
        with open(self.directory / name, "a") as stream:
            stream.write(",".join(f"{v:.17g}" for v in values) + "\n")

    def write(self, name: str, data: dict[str, Any]) -> None:
        (self.directory / name).write_text(json.dumps(data, indent=1))


def simulate(directory: Path, make: Callable[[Scene, dict[str, Any]], Any], settings: dict[str, Any]) -> None:
    """Runs the scene of a deck and records it; a failure of the solver ends the program with status 1."""
    from dembench.solver import SolverError

    begin = time.perf_counter()
    scene = load_scene(directory / "scene.json")
    recorder = _Recorder(directory, scene)
    try:
        simulation = make(scene, settings)
        set_up = time.perf_counter() - begin
        loop = _loop(scene, settings["dt"], simulation, recorder)
    except SolverError as error:
        recorder.write("failure.json", {"reason": error.reason, "detail": str(error)})
        sys.exit(f"error: {error}")
    recorder.write(
        "timing.json",
        {
            "set_up": set_up - simulation.compile_seconds,
            "compile": simulation.compile_seconds,
            "loop": loop,
            "output": recorder.seconds,
            "source": "engine",
            "counters": simulation.counters(),
        },
    )


def _loop(scene: Scene, dt: float, simulation: Any, recorder: _Recorder) -> float:
    """Steps from record to record; returns the wall time of the stepping alone [s]."""
    from dembench.solver import SolverError

    frames = {round(t / dt): float(t) for t in scene.frame_times()}
    tracks = {round(t / dt): float(t) for t in scene.track_times()}
    low, high = np.array(scene.domain.lower), np.array(scene.domain.upper)
    loop, now = 0.0, 0
    last = round(scene.duration / dt)
    for step in sorted({*frames, *tracks, last}):
        begin = time.perf_counter()
        simulation.step(step - now)
        loop += time.perf_counter() - begin
        now = step
        moment = frames.get(step, tracks.get(step, scene.duration))
        left = np.setdiff1d(scene.tracked_bodies(), simulation.ids)
        if len(left):
            raise SolverError(f"tracked body {left[0]} is gone by t = {moment:g} s", reason="lost particles")
        if step in tracks:
            recorder.track(step, moment, simulation)
        if step in frames:
            table = recorder.frame(step, simulation)
            lost = table[((table[:, 1:4] < low) | (table[:, 1:4] > high)).any(axis=1), 0]
            if len(lost):
                text = f"{len(lost)} particles have left the domain by t = {moment:g} s, the first is {lost[0]:.0f}"
                raise SolverError(text, reason="lost particles")
        recorder.clock(step, moment)
    return loop


def main() -> None:
    """Entry of the child process."""
    import warp

    from dembench.engines.registry import engine

    warp.config.log_level = warp.LOG_ERROR
    directory = Path(sys.argv[1])
    record = json.loads((directory / "settings.json").read_text())
    adapter: Any = engine(record["engine"])
    simulate(directory, adapter.simulation, record["settings"])


if __name__ == "__main__":
    main()
