"""A LIGGGHTS run that goes on from its checkpoint is, on one rank, the uninterrupted run to the last bit."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
from launching import installed
from test_liggghts_walls import drum_as_mesh, scene

from dembench.engines.base import Engine, Phase, Series
from dembench.runs.tidy import remove_bulk
from dembench.scene import Scene

CHECKPOINT = {"checkpoint": "0.023", "sink_interval": "0.001"}
"""Wall time for 55 000 body-steps at the assumed throughput: a checkpoint after every 800 of 4000 steps."""


def everything() -> Scene:
    """A bed in a turning mesh under a plane, over a floor that counts, with a fixed and a tracked body and a sink."""
    floor = {"kind": "plane", "name": "floor", "material": "steel", "point": (0, 0, -0.0195), "normal": (0, 0, 1)}
    lid = {
        "kind": "box",
        "name": "sides",
        "material": "steel",
        "lower": (-0.02, -0.01, -0.02),
        "upper": (0.02, 0.01, 0.02),
    }
    return scene(
        (drum_as_mesh(), floor, lid),
        sinks=({"name": "out", "region": {"lower": (0.011, None, None)}},),
        constraints=({"kind": "fixed", "bodies": (0,)},),
        observables=(
            {"kind": "wall-force", "name": "drum", "wall": "drum", "interval": 1e-3},
            {"kind": "wall-force", "name": "floor", "wall": "floor", "interval": 1e-3},
            {"kind": "trajectory", "name": "track", "body": 1, "interval": 1e-3, "track_interval": 2.5e-4},
        ),
    )


def launch(phases: list[Phase] | None, directory: Path) -> None:
    """Runs phases to their end."""
    assert phases, "nothing to launch"
    for phase in phases:
        environment = {**os.environ, **phase.environment}
        subprocess.run(phase.command, cwd=directory, env=environment, capture_output=True, timeout=120, check=True)


def held(series: Series) -> list[tuple[Any, ...]]:
    """All that the frames of a series say."""
    return [
        (f.step, f.present, f.position, f.velocity, f.angular_velocity, *f.wall_forces.values()) for f in series.frames
    ]


def begun(engine: Engine, made: Scene, directory: Path, **overrides: str) -> tuple[Any, Series]:
    """Settings and result of an uninterrupted run."""
    settings = engine.settings(made, "closed", {**CHECKPOINT, **overrides})
    launch(engine.write(made, settings, directory), directory)
    return settings, engine.read(made, settings, directory)


def test_a_resumed_run_is_the_uninterrupted_one(tmp_path: Path) -> None:
    """The run is cut off two times 400 steps after a checkpoint, once with half a frame and half a track written.

    Shear springs of pairs, plane and mesh, the phase of the mesh and the order of the bodies must all come back: the
    frames are compared bit by bit, forces to the six digits that the program writes.
    """
    engine, made = installed("liggghts"), everything()
    settings, whole = begun(engine, made, tmp_path)
    expected, tracks = held(whole), whole.tracks
    assert whole.failure is None and tracks is not None
    assert len(expected[-1][1]) < len(made.bodies), "nothing has left through the sink"
    assert all(max(np.abs(frame[k]).max() for frame in expected) > 0 for k in (5, 6)), "a wall was never touched"
    checkpoint = engine.checkpoint(made, settings, tmp_path)
    assert checkpoint is not None and 0 < checkpoint.step < 4000
    cut_off(tmp_path, checkpoint.step + 400)
    part = engine.read(made, settings, tmp_path)
    assert part.failure is None and part.timing.loop is None and len(part.frames) < len(expected)
    launch(engine.resume(made, settings, tmp_path), tmp_path)
    again = engine.read(made, settings, tmp_path)
    assert (again.failure, again.detail, again.time) == (None, "", whole.time)
    for one, other in zip(expected, held(again), strict=True):
        for a, b in zip(one, other, strict=True):
            assert np.array_equal(a, b)
    assert again.tracks is not None
    assert np.array_equal(again.tracks.step, tracks.step) and np.array_equal(again.tracks.position, tracks.position)
    assert again.timing.loop is not None and again.counters["neighbour_builds"] > 0
    remove_bulk(tmp_path)
    assert not list(tmp_path.rglob("*restart*")), "a run that ended well keeps checkpoints"


def cut_off(directory: Path, step: int) -> None:
    """Makes the files those of a run that was killed at a step: no later frames, and half of what was being written."""
    frames = sorted((directory / "frames").iterdir(), key=lambda p: int(p.stem))
    for path in frames:
        if int(path.stem) > step:
            path.unlink()
    last = [p for p in frames if p.exists()][-1]
    last.write_bytes(last.read_bytes()[:-100])
    tracks = directory / "tracks.bin"
    tracks.write_bytes(tracks.read_bytes()[: -tracks.stat().st_size // 10])
    log = directory / "log.liggghts"
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(lines[: next(k for k, line in enumerate(lines) if line.strip().startswith(f"{step} "))]))
