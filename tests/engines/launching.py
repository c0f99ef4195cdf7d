"""Runs an engine as the supervisor does: write, each phase in a child process, read."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

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
