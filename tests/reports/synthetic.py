"""Run directories with made-up results: every run state, three stand-in engines, names and logs that mean harm."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from dembench.engines import registry
from dembench.engines.base import Engine, EngineSettings
from dembench.results import Observed, Result, SnapshotSeries, channels, write
from dembench.runs.directory import RunDirectory
from dembench.runs.spec import RunSpec
from dembench.runs.states import Status
from dembench.scene import (
    Bodies,
    Box,
    Domain,
    Energy,
    Material,
    Overlap,
    PairLaw,
    Scene,
    Species,
    Trajectory,
)

HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(2)>\x1b[31m & \"quotes\" 'too' {{ 7 * 7 }}"
COMMAND = "dembench run 'case3' --engines 'alpha,beta[sweeps=8],gamma' --preset published"


class _StandIn(Engine):
    settings_type = EngineSettings

    def probe(self) -> Any:
        raise NotImplementedError

    def unsupported(self, scene: Scene) -> list[str]:
        return []

    def defaults(self, scene: Scene, division: Any) -> dict[str, Any]:
        return {"dt": 1e-6}

    def write(self, scene: Scene, settings: Any, directory: Path) -> list[Any]:
        raise NotImplementedError

    def read(self, scene: Scene, settings: Any, directory: Path) -> Any:
        raise NotImplementedError


class Alpha(_StandIn):
    """A stand-in with a solid line."""

    name: ClassVar[str] = "alpha"
    title: ClassVar[str] = "First stand-in"
    colour: ClassVar[str] = "#e34948"


class Beta(_StandIn):
    """Another one."""

    name: ClassVar[str] = "beta"
    title: ClassVar[str] = "Second stand-in"
    colour: ClassVar[str] = "#2a78d6"


class Gamma(_StandIn):
    """One with dashed lines and a dark colour."""

    name: ClassVar[str] = "gamma"
    title: ClassVar[str] = "Third stand-in"
    colour: ClassVar[str] = "#4a3aa7"
    dashed: ClassVar[bool] = True


STAND_INS = {c.name: f"{__name__}:{c.__name__}" for c in (Alpha, Beta, Gamma)}


@contextmanager
def registered() -> Iterator[None]:
    """The stand-ins are the only engines within it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "BUILT_IN", dict(STAND_INS))
        registry.engine.cache_clear()
        yield
    registry.engine.cache_clear()


def impact(duration: float = 0.06) -> Scene:
    """A ball above four grains in a box, with the observables of the particle impact."""
    grains = np.array([[0, 0, -0.0583], [0.01, 0, -0.088], [-0.01, 0, -0.088], [0, 0.01, -0.088]])
    n = len(grains)
    return Scene(
        name="case3_25k_published",
        materials=(
            Material(name="M1", density=2500, young=1e9, poisson=0.2),
            Material(name="steel", density=7200, young=210e9, poisson=0.2),
        ),
        pair_laws=(
            PairLaw(a="M1", b="M1", restitution=0.5, friction=0.3),
            PairLaw(a="M1", b="steel", restitution=0.4, friction=0.2),
            PairLaw(a="steel", b="steel", restitution=0.6, friction=0.5),
        ),
        species=(
            Species(name="grain", material="M1", radius=0.001),
            Species(name="ball", material="steel", radius=0.01),
        ),
        walls=(
            Box(
                name="box",
                material="steel",
                lower=(-0.049, -0.03, -0.0902431),
                upper=(0.049, 0.03, 0.107757),
                open_faces=("z+",),
            ),
        ),
        bodies=Bodies(
            position=np.vstack([grains, [0, 0, 0.06]]),
            species=[0] * n + [1],
            velocity=[[0, 0, 0]] * n + [[0, 0, -5.0]],
        ),
        domain=Domain(lower=(-0.06, -0.04, -0.1), upper=(0.06, 0.04, 0.4)),
        duration=duration,
        time_step=5e-7,
        observables=(
            Trajectory(name="ball", body=n, interval=1e-3, track_interval=5e-5),
            Energy(name="energy", interval=1e-3),
            Overlap(name="overlap", interval=1e-3),
        ),
    )


def path(time: np.ndarray, deepest: float, rebound: float) -> tuple[np.ndarray, np.ndarray]:
    """Displacement [m] and velocity [m/s]: free fall to 21 ms, a power law to `deepest` at 31 ms, a rebound."""
    contact, speed = -5 * 0.021 - 0.5 * 9.81 * 0.021**2, -5 - 9.81 * 0.021
    power = speed * 0.01 / (deepest - contact)
    left = np.clip((0.031 - time) / 0.01, 0, 1)
    after = np.clip(time - 0.031, 0, None)
    away = rebound * (after - 0.002 * (1 - np.exp(-after / 0.002)))
    depth = np.where(time < 0.021, -5 * time - 0.5 * 9.81 * time**2, deepest + (contact - deepest) * left**power + away)
    slowing = -power * (contact - deepest) / 0.01 * left ** (power - 1)
    velocity = np.where(time < 0.021, -5 - 9.81 * time, slowing + rebound * (1 - np.exp(-after / 0.002)))
    return depth, velocity


def bump(time: np.ndarray, centre: float, width: float) -> np.ndarray:
    """A bell curve of height 1."""
    return np.exp(-(((time - centre) / width) ** 2))


def series(scene: Scene, deepest: float = -0.1384, rebound: float = 2.4, until: float = 1.0) -> dict[str, Observed]:
    """Observables of a fall, an arrest at `deepest` [m] at 31 ms and a rebound; the first share `until` of them."""
    found = {}
    for name, channel in channels(scene).items():
        time = channel.time[: max(1, round(len(channel.time) * until))]
        depth, speed = path(time, deepest, rebound)
        values = {
            "ball_displacement": depth,
            "ball_minimum": depth,
            "ball_position": np.column_stack([0 * time, 0 * time, 0.06 + depth]),
            "ball_velocity": np.column_stack([0 * time, 0 * time, speed]),
            "energy": np.column_stack([0.0151 * speed**2 + 1e-6, 2e-3 * bump(time, 0.030, 0.010), 0.296 * depth]),
            "overlap": 4e-6 * bump(time, 0.027, 0.006) + 2e-7,
        }
        steps = np.round(time / 5e-7).astype(np.int64)
        found[name] = Observed(steps, time, values[name], channel.unit, channel.components, channel.title)
    return found


def add_run(
    out: Path,
    scene: Scene,
    engine: str,
    state: str = "ok",
    *,
    observables: dict[str, Observed] | None = None,
    loop: float | None = None,
    source: str = "engine",
    case: str = "case3[bed=25k]",
    preset: str | None = "published",
    overrides: dict[str, str] | None = None,
    division: str = "closed",
    seed: int = 0,
    version: str = "1.0",
    repeat: int = 1,
    settings: dict[str, Any] | None = None,
    snapshots: dict[str, SnapshotSeries] | None = None,
    law: str = "",
    **status: Any,
) -> RunDirectory:
    """Writes the directory of one run; without observables it has no result."""
    spec = RunSpec(
        case=case,
        preset=preset,
        engine=engine,
        engine_version=version,
        overrides=overrides or {},
        settings={"dt": 5e-7, **(settings or {}), **(overrides or {})},
        division=division,
        seed=seed,
        repeat=repeat,
        scene_digest=scene.digest(),
        scene_name=scene.name,
        bodies=len(scene.bodies),
        duration=scene.duration,
        law=law,
        precision="float64",
    )
    run = RunDirectory(out / spec.name())
    run.claim(spec)
    environment = {
        "cpu": "Example CPU 3000",
        "cores": 2,
        "memory": 8 * 2**30,
        "gpu": [],
        "system": "Example OS 1",
        "python": "3.11",
        "packages": {"numpy": "2.0", "h5py": "3.1"},
        "dembench": "0.1.0",
        "commit": "0123456789ab",
        "pinned_to": [0],
        "load": 0.3,
        "busy_before": 0.02,
        "engine": {"version": version, "path": f"/usr/bin/{engine}", "facts": {"sha256": "feed" * 16}},
    }
    ended = Status(
        state=state,
        started="2026-11-01T12:00:00+0000",
        ended="2026-11-01T12:10:00+0000",
        wall=loop and loop + 3,  # type: ignore[arg-type]
        **status,
    )
    if observables is not None:
        write(
            Result(
                scene=scene,
                engine=engine,
                division="closed",
                settings=spec.settings,
                environment=environment,
                timing={"set_up": 1.0, "compile": None, "loop": loop, "output": 0.5, "source": source},
                resources={"wall": loop and loop + 2, "cpu": loop, "waited": 0.01, "peak_memory": 123_400_000},
                status=ended.plain(),
                provenance={"command": COMMAND},
                observables=observables,
                snapshots=snapshots or {},
            ),
            run.result,
        )
    if state not in ("missing", "skipped"):
        run.write_environment(environment)
    run.write_status(ended)
    return run


def every_state(out: Path) -> Path:
    """Runs of two problems in every state; returns the directory."""
    scene = impact()
    add_run(out, scene, "alpha", observables=series(scene, -0.1387), loop=1743.2, settings={"ranks": 1})
    for repeat, loop in enumerate((291.4, 288.0, 301.7), start=1):
        add_run(
            out,
            scene,
            "beta",
            observables=series(scene, -0.1385),
            loop=loop,
            repeat=repeat,
            contended=repeat == 3,
            settings={"threads": 1},
        )
    add_run(
        out,
        scene,
        "beta",
        observables=series(scene, -0.1416, 0.05),
        loop=30.25,
        overrides={"sweeps": "8"},
        source="wall",
    )
    add_run(
        out,
        scene,
        "gamma",
        "failed",
        observables=series(scene, -0.139, until=0.4),
        loop=88.0,
        reason="lost particles",
        detail="12 of 25001 missing at t = 0.0241 s: 1, 5, 9, ...",
        phase="simulate",
        exit_code=0,
        time=0.024,
        frames=24,
        frames_expected=61,
        log_tail="step 48000\nWARNING: 12 atoms lost\n" + HOSTILE,
    )
    add_run(
        out,
        scene,
        "gamma",
        "timeout",
        overrides={"dt": "1e-8"},
        reason="time limit",
        detail="stopped after 600 s",
        observables=series(scene, until=0.1),
        loop=600.0,
        time=0.006,
    )
    add_run(
        out, scene, "gamma", "interrupted", overrides={"dt": "2e-8"}, reason="supervisor gone", detail="stopped by hand"
    )
    add_run(
        out, scene, "gamma", "skipped", overrides={"law": "rigid"}, reason="unsupported", detail="tangential history"
    )
    add_run(
        out,
        scene,
        "gamma",
        "missing",
        overrides={"ranks": "2"},
        reason="not installed",
        detail="no program 'gamma'",
        install="apt install gamma",
    )
    other = impact(0.02).model_copy(update={"name": "my_scene"})
    add_run(out, other, "alpha", case="scene.json", preset=None, observables=series(other), loop=12.5)
    add_run(out, other, "beta", "running", case="scene.json", preset=None, observables=series(other, until=0.3))
    return out
