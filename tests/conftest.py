"""Small scenes and frames that many tests share."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from dembench.engines.base import Frame, Tracks
from dembench.scene import (
    Bodies,
    Box,
    CentreOfMass,
    Count,
    Domain,
    Energy,
    Material,
    Overlap,
    PairLaw,
    Region,
    Scene,
    Snapshot,
    Species,
    Trajectory,
    ZoneCount,
)


@pytest.fixture(scope="session")
def small_scene() -> Callable[..., Scene]:
    """A builder of a scene of three grains and one ball of ten times their radius, falling for 10 ms."""

    def build(**changes: Any) -> Scene:
        fields: dict[str, Any] = {
            "name": "small",
            "materials": (Material(name="glass", density=2500, young=1e7, poisson=0.25),),
            "pair_laws": (PairLaw(a="glass", b="glass", restitution=0.8, friction=0.3),),
            "species": (
                Species(name="grain", material="glass", radius=0.002),
                Species(name="ball", material="glass", radius=0.02),
            ),
            "walls": (Box(name="box", material="glass", lower=(-0.1, -0.1, 0), upper=(0.1, 0.1, 0.4)),),
            "bodies": Bodies(
                position=[[0, 0, 0.05], [0.01, 0, 0.05], [-0.01, 0, 0.06], [0, 0, 0.1]],
                species=[0, 0, 0, 1],
                velocity=[[0, 0, 0], [0, 0, 0], [0.1, 0, 0], [0, 0, -1.0]],
                angular_velocity=[[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 20.0, 0]],
            ),
            "domain": Domain(lower=(-0.1, -0.1, 0), upper=(0.1, 0.1, 0.4)),
            "duration": 0.01,
            "time_step": 1e-5,
            "observables": (
                Trajectory(name="ball", body=3, interval=1e-3, track_interval=2e-4),
                Energy(name="energy", interval=2e-3),
                Overlap(name="overlap", interval=2e-3),
                Count(name="low", interval=1e-3, region=Region(upper=(None, None, 0.055))),
                ZoneCount(
                    name="sides",
                    interval=5e-3,
                    zones={"left": Region(upper=(0.0, None, None)), "right": Region(lower=(0.0, None, None))},
                ),
                CentreOfMass(name="centre", interval=5e-3),
                Snapshot(name="ends", times=(0.0, 0.01)),
            ),
        }
        return Scene(**{**fields, **changes})

    return build


def falling_frame(scene: Scene, time: float, step: int) -> Frame:
    """All bodies of a scene in free flight: x0 + v0 t + g t^2/2."""
    start, gravity = scene.bodies, np.array(scene.gravity)
    return Frame(
        step=step,
        time=time,
        present=np.arange(len(start)),
        position=start.position + start.velocity * time + 0.5 * gravity * time**2,
        velocity=start.velocity + gravity * time,
        angular_velocity=start.angular_velocity.copy(),
    )


def falling_frames(scene: Scene, dt: float) -> list[Frame]:
    """Frames of free flight at the frame times of a scene, as an engine of step `dt` [s] would number them."""
    return [falling_frame(scene, t, round(t / dt)) for t in scene.frame_times()]


def falling_tracks(scene: Scene, dt: float) -> Tracks:
    """Tracks of free flight at the track times of a scene."""
    frames = [falling_frame(scene, t, round(t / dt)) for t in scene.track_times()]
    tracked = list(scene.tracked_bodies())
    return Tracks(
        step=np.array([f.step for f in frames]),
        time=np.array([f.time for f in frames]),
        position=np.array([f.position[tracked] for f in frames]),
        velocity=np.array([f.velocity[tracked] for f in frames]),
    )


@pytest.fixture
def standin(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Registers the stand-in engines; call it with what each does, as `standin={"standin": ["hang", 4]}`."""
    from standin import ENGINES

    from dembench.engines import registry

    registry.engine.cache_clear()
    monkeypatch.setattr(registry, "BUILT_IN", dict(ENGINES))

    def behave(**modes: list[Any]) -> None:
        monkeypatch.setenv("STANDIN", json.dumps({name.replace("_", "-"): mode for name, mode in modes.items()}))

    yield behave
    registry.engine.cache_clear()


@pytest.fixture
def start_run(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts `dembench run` on a scene file as a process; `modes` says what each stand-in engine does."""
    root = Path(__file__).parents[1]
    started = []

    def start(scene: str, *options: str, modes: dict[str, list[Any]] | None = None) -> subprocess.Popen[str]:
        program = [sys.executable, root / "tests" / "standin.py", "run", scene]
        child = subprocess.Popen(
            [*program, "--no-report", "--checkpoint", "0.2", *options],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(root), "STANDIN": json.dumps(modes or {})},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        started.append(child)
        return child

    yield start
    for child in started:
        child.kill()
        child.communicate()


def gone(pid: int) -> bool:
    """Whether a process has ended."""
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def wait_for(condition: Callable[[], Any], seconds: float = 30.0) -> Any:
    """Waits until a condition holds and returns its value; fails after a time that no healthy run needs."""
    deadline = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < deadline, "the awaited condition did not come about"
        time.sleep(0.02)
    return value
