"""The program of the in-tree engines: `python -m dembench.engines.in_tree_program DECK [CHECKPOINT]`.

It simulates the scene of a deck, from its start or from a checkpoint in it, and writes what `in_tree.py` reads. Every
few minutes of wall time, and when it is asked to end by SIGTERM, it writes a checkpoint.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from dembench.engines import in_tree_checkpoints as checkpoints
from dembench.engines.base import CHECKPOINTS, FRAMES
from dembench.engines.in_tree import (
    CHECKPOINT_INTERVAL,
    CLOCK,
    FAILURE,
    TIMING,
    TRACKS,
    forces_of,
)
from dembench.engines.scene_queries import observed_walls
from dembench.scene import Scene, load_scene

CHECKPOINT_SHARE = 0.01
"""Largest share of the wall time that goes into checkpoints [-]."""
LOOK_INTERVAL = 0.25
"""Wall time between two records from which on there are looks in between, at the cost of shorter launches [s]."""
CLOCK_INTERVAL = 2.0
"""Wall time between two rows of the clock where nothing is recorded [s]."""


PARTS = ("set_up", "compile", "loop", "output")


class Stopwatch:
    """Wall time by part of the run and CPU time of the loop, `loop_cpu` [s], earlier attempts included."""

    def __init__(self, spent: dict[str, float] | None = None) -> None:
        """Starts, on top of what was spent up to a checkpoint."""
        self.spent = dict.fromkeys((*PARTS, "loop_cpu"), 0.0) | (spent or {})
        self._last, self._last_cpu = time.perf_counter(), time.process_time()

    def lap(self, part: str) -> float:
        """Adds the time since the last call to a part, and returns it [s]."""
        now, cpu = time.perf_counter(), time.process_time()
        passed, self._last = now - self._last, now
        self.spent[part] += passed
        if part == "loop":
            self.spent["loop_cpu"] += cpu - self._last_cpu
        self._last_cpu = cpu
        return passed

    def wall(self) -> float:
        """Wall time of all parts together [s]."""
        return sum(self.spent[part] for part in PARTS)


class Recorder:
    """Writes what a run produces.

    Args:
        deck: Deck directory.
        scene: Its scene.
        dt: Time step [s].
        watch: Keeps the time.
        interval: Wall time between checkpoints [s].

    Attributes:
        asked_to_end: The next look writes a checkpoint and ends the program.
    """

    def __init__(self, deck: Path, scene: Scene, dt: float, watch: Stopwatch, interval: float) -> None:
        self.deck, self.dt, self.watch, self.interval = deck, dt, watch, interval
        self.walls = observed_walls(scene)
        self.low, self.high = np.array(scene.domain.lower), np.array(scene.domain.upper)
        self.asked_to_end = False
        (deck / FRAMES).mkdir(exist_ok=True)
        self._unflushed: list[Path] = []
        self._pace = math.inf
        self._next_clock = 0.0
        self._next_checkpoint = time.perf_counter() + interval

    def frame(self, step: int, simulation: Any) -> list[int]:
        """Writes all bodies and, where observed, the forces on walls; returns the ids of bodies outside the domain."""
        path = self.deck / FRAMES / f"{step}.npy"
        if self.walls:
            np.save(forces_of(path), [simulation.wall_force(wall) for wall in self.walls])
            self._unflushed.append(forces_of(path))
        with open(path.with_suffix(".tmp"), "wb") as stream:
            form = {"descr": "<f8", "fortran_order": False, "shape": (len(simulation.ids), 10)}
            np.lib.format.write_array_header_1_0(stream, form)
            lost: list[int] = []
            for table in simulation.table():
                stream.write(table.tobytes())
                away = ((table[:, 1:4] < self.low) | (table[:, 1:4] > self.high)).any(axis=1)
                lost += table[away, 0].astype(int).tolist()
        os.replace(path.with_suffix(".tmp"), path)
        self._unflushed.append(path)
        return lost

    def track(self, step: int, moment: float, motion: tuple[np.ndarray, np.ndarray]) -> None:
        """Appends the tracked bodies, their positions and velocities."""
        self._append(TRACKS, [step, moment, *np.hstack(motion).ravel()])

    def clock(self, step: int, moment: float) -> None:
        """Appends how far the run is."""
        self._append(CLOCK, [step, moment, self.watch.wall()])
        self._next_clock = time.perf_counter() + CLOCK_INTERVAL

    def advance(self, simulation: Any, n: int) -> None:
        """Makes n steps, with looks at the clock on the way where they take long."""
        begin = time.perf_counter()
        if n * self._pace < LOOK_INTERVAL:
            simulation.step(n)
            self._look(simulation)
        else:
            simulation.step(n, lambda _made: self._look(simulation))
        self.watch.lap("loop")
        self._pace = (time.perf_counter() - begin) / max(1, n)

    def _look(self, simulation: Any) -> None:
        """Writes the clock and a checkpoint where they are due, and ends the program where that was asked for."""
        self.watch.lap("loop")
        now = time.perf_counter()
        if now >= self._next_clock:
            self.clock(simulation.steps, simulation.steps * self.dt)
        if self.asked_to_end or now >= self._next_checkpoint:
            self._checkpoint(simulation)
        if self.asked_to_end:
            sys.exit(128 + signal.SIGTERM)

    def json(self, name: str, data: dict[str, Any]) -> None:
        """Writes a small file."""
        (self.deck / name).write_text(json.dumps(data, indent=1))

    def _append(self, name: str, row: list[float]) -> None:
        with open(self.deck / name, "ab", buffering=0) as stream:
            stream.write(np.array(row, dtype=np.float64).tobytes())

    def _checkpoint(self, simulation: Any) -> None:
        tables = [self.deck / name for name in (TRACKS, CLOCK) if (self.deck / name).exists()]
        for path in (*self._unflushed, *tables):
            checkpoints.flush(path)
        self._unflushed.clear()
        step = simulation.steps
        checkpoints.write(self.deck, simulation.save, step, step * self.dt, self.watch.spent)
        cost = self.watch.lap("output")
        self._next_checkpoint = time.perf_counter() + max(self.interval, cost / CHECKPOINT_SHARE)


def simulate(
    deck: Path,
    make: Callable[[Scene, dict[str, Any]], Any],
    settings: dict[str, Any],
    interval: float = CHECKPOINT_INTERVAL,
    start: Path | None = None,
) -> None:
    """Runs the scene of a deck and records it; a failure of the solver ends the program with status 1.

    Args:
        deck: Deck directory.
        make: Makes the simulation of a scene with settings.
        settings: Settings of the engine.
        interval: Wall time between checkpoints [s].
        start: Directory of the checkpoint from which it goes on.
    """
    from dembench.solver import Simulation, SolverError

    if start is None:
        _clear(deck)
    watch = Stopwatch(json.loads((start / checkpoints.RECORD).read_text())["spent"] if start else None)
    scene = load_scene(deck / "scene.json")
    recorder = Recorder(deck, scene, settings["dt"], watch, interval)
    try:
        simulation = Simulation.load(start / checkpoints.STATE) if start else make(scene, settings)
        watch.lap("set_up")
        watch.spent["set_up"] -= simulation.compile_seconds
        watch.spent["compile"] += simulation.compile_seconds
        _loop(scene, settings["dt"], simulation, recorder)
    except SolverError as error:
        recorder.json(FAILURE, {"reason": error.reason, "detail": str(error)})
        sys.exit(f"error: {error}")
    recorder.json(TIMING, {**watch.spent, "source": "engine", "counters": simulation.counters()})


def _clear(deck: Path) -> None:
    """Removes what an earlier run of the program has left in a deck."""
    for name in (FRAMES, CHECKPOINTS):
        shutil.rmtree(deck / name, ignore_errors=True)
    for name in (TRACKS, CLOCK, TIMING, FAILURE):
        (deck / name).unlink(missing_ok=True)


def _loop(scene: Scene, dt: float, simulation: Any, recorder: Recorder) -> None:
    """Steps from record to record; at the step of a checkpoint nothing was recorded yet."""
    from dembench.solver import SolverError

    frames = {round(t / dt): float(t) for t in scene.frame_times()}
    tracks = {round(t / dt): float(t) for t in scene.track_times()}
    tracked = scene.tracked_bodies()
    first, last = simulation.steps, round(scene.duration / dt)
    signal.signal(signal.SIGTERM, lambda *_: setattr(recorder, "asked_to_end", True))
    for step in (s for s in sorted({*frames, *tracks, last}) if s >= first):
        recorder.advance(simulation, step - simulation.steps)
        moment = frames.get(step, tracks.get(step, scene.duration))
        try:
            motion = simulation.motion(tracked)
        except SolverError as error:
            raise SolverError(f"tracked {error} by t = {moment:g} s", reason=error.reason) from error
        if step in tracks:
            recorder.track(step, moment, motion)
        if step in frames:
            lost = recorder.frame(step, simulation)
            if lost:
                text = f"{len(lost)} particles have left the domain by t = {moment:g} s, the first is {lost[0]}"
                raise SolverError(text, reason="lost particles")
        recorder.watch.lap("output")
        recorder.clock(step, moment)


def main() -> None:
    """Entry of the child process."""
    import warp

    from dembench.engines.registry import engine

    warp.config.log_level = warp.LOG_ERROR
    deck, *start = (Path(argument) for argument in sys.argv[1:])
    record = json.loads((deck / "settings.json").read_text())
    adapter: Any = engine(record["engine"])
    simulate(deck, adapter.simulation, record["settings"], record["checkpoint"], deck / start[0] if start else None)


if __name__ == "__main__":
    main()
