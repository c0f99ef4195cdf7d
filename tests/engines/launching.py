"""Runs an engine as the supervisor does: write, each phase in a child process, read."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from dembench.engines import registry
from dembench.engines.base import Engine, Series
from dembench.scene import Scene


def installed(name: str) -> Engine:
    """The engine of that name; skips the test where it is not on this machine."""
    engine = registry.engine(name)
    probe = engine.probe()
    if not probe.available:
        pytest.skip(f"{name}: {probe.reason}")
    return engine


def run(engine: Engine, scene: Scene, directory: Path, **overrides: str) -> Series:
    """What an engine makes of a scene in the closed division."""
    assert engine.unsupported(scene) == []
    settings = engine.settings(scene, "closed", overrides)
    directory.mkdir(exist_ok=True)
    for phase in engine.write(scene, settings, directory):
        environment = {**os.environ, **phase.environment}
        subprocess.run(phase.command, cwd=directory, env=environment, capture_output=True, timeout=120, check=False)
    return engine.read(scene, settings, directory)


def meets_the_times(series: Series, scene: Scene, tracked: int) -> None:
    """Whether a run without fault has frames and tracks at the scene's times, from the initial state on.

    Args:
        series: What the engine produced.
        scene: What it was asked for; one body is tracked.
        tracked: That body.
    """
    assert (series.failure, series.detail) == (None, "")
    assert [f.time for f in series.frames] == pytest.approx(scene.frame_times())
    assert np.array_equal(series.frames[0].position, scene.bodies.position)
    assert series.tracks is not None
    assert series.tracks.time == pytest.approx(scene.track_times())
    for frame in series.frames:
        at = np.flatnonzero(series.tracks.step == frame.step)
        if len(at):
            assert np.array_equal(series.tracks.position[at[0], 0], frame.position[tracked])
