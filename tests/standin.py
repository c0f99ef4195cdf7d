"""A stand-in engine for tests: free flight, computed while the deck is written and released by a small program.

As a program, `standin.py ARGUMENTS` is the command `dembench` with the stand-in engines added.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from dembench.engines import registry
from dembench.engines.base import (
    Checkpoint,
    Engine,
    EngineSettings,
    Frame,
    FrameFiles,
    Phase,
    Probe,
    Series,
    Timing,
    Tracks,
)
from dembench.scene import Scene

PROGRAM = Path(__file__).with_name("standin_program.py")
ARRAYS = ("present", "position", "velocity", "angular_velocity")


class StandInSettings(EngineSettings):
    threads: int = 1
    spoil: str = ""

    def cores(self) -> int:
        return self.threads


class StandIn(Engine):
    name: ClassVar[str] = "standin"
    title: ClassVar[str] = "Stand-in for tests"
    colour: ClassVar[str] = "#123456"
    settings_type: ClassVar[type[EngineSettings]] = StandInSettings
    step: ClassVar[float] = 1e-5

    def probe(self) -> Probe:
        return Probe(available=True, version="1.0", path=str(PROGRAM))

    def unsupported(self, scene: Scene) -> list[str]:
        return []

    def defaults(self, scene: Scene, division: str) -> dict[str, Any]:
        return {"dt": self.step}

    def estimate(self, scene: Scene, settings: Any) -> float | None:
        return 3.0

    def write(self, scene: Scene, settings: Any, directory: Path) -> list[Phase]:
        for name in ("prepared", "frames"):
            (directory / name).mkdir()
        fine = scene.track_times()
        for k, t in enumerate(scene.frame_times()):
            fields = _flight(scene, t)
            if settings.spoil == "nan" and k == 3:
                fields["velocity"][1, 0] = np.nan
            if settings.spoil == "lost" and k >= 3:
                fields = {name: np.delete(a, 1, axis=0) for name, a in fields.items()}
            before = scene.frame_times()[k - 1] if k else -1.0
            own = fine[(fine > before + 1e-12) & (fine <= t + 1e-12)]
            bodies = list(scene.tracked_bodies())
            np.savez(
                directory / "prepared" / f"{k:04d}.npz",
                time=t,
                step=round(t / settings.dt),
                track_time=own,
                track=np.array([_flight(scene, s)["position"][bodies] for s in own]).reshape(len(own), len(bodies), 3),
                **fields,
            )
        (directory / "deck.txt").write_text("the text of the deck\n")
        return self._phases()

    def checkpoint(self, scene: Scene, settings: Any, directory: Path) -> Checkpoint | None:
        """Every second frame is one: the last one with an even number."""
        files = sorted((directory / "frames").glob("*.npz"))[::2]
        if not files:
            return None
        with np.load(files[-1]) as last:
            return Checkpoint(step=int(last["step"]), time=float(last["time"]))

    def resume(self, scene: Scene, settings: Any, directory: Path) -> list[Phase] | None:
        files = sorted((directory / "frames").glob("*.npz"))
        for later in files[2 * ((len(files) - 1) // 2) + 1 :]:
            later.rename(directory / "prepared" / later.name)
        return self._phases()

    def _phases(self) -> list[Phase]:
        return [Phase(name="simulate", command=(sys.executable, "-S", str(PROGRAM), self.name))]

    def read(self, scene: Scene, settings: Any, directory: Path) -> Series:
        files = sorted((directory / "frames").glob("*.npz"))
        stored = [np.load(f) for f in files]
        known = [(int(s["step"]), float(s["time"]), f) for s, f in zip(stored, files, strict=True)]
        frames = FrameFiles(known, _load)
        track_time = np.concatenate([s["track_time"] for s in stored]) if stored else np.empty(0)
        bodies = len(scene.tracked_bodies())
        track = np.concatenate([s["track"] for s in stored]) if stored else np.empty((0, bodies, 3))
        said = directory / "failure"
        return Series(
            frames=frames,
            tracks=Tracks(np.round(track_time / settings.dt).astype(int), track_time, track, np.zeros_like(track)),
            timing=Timing(loop=0.5, source="engine"),
            time=float(stored[-1]["time"]) if stored else 0.0,
            failure=said.read_text() if said.exists() else None,
            detail="the stand-in says so" if said.exists() else "",
            counters={"files": float(len(files))},
        )


class Coarse(StandIn):
    name: ClassVar[str] = "standin-coarse"
    step: ClassVar[float] = 1e-4


class Absent(StandIn):
    name: ClassVar[str] = "standin-absent"

    def probe(self) -> Probe:
        return Probe(available=False, reason="the program standin is not on the path", install="apt install standin")


class Picky(StandIn):
    name: ClassVar[str] = "standin-picky"

    def unsupported(self, scene: Scene) -> list[str]:
        return ["polydisperse: all radii must be equal"]


class Forgetful(StandIn):
    name: ClassVar[str] = "standin-forgetful"

    def resume(self, scene: Scene, settings: Any, directory: Path) -> list[Phase] | None:
        raise ValueError("the checkpoint is of another world")


class Wordless(StandIn):
    name: ClassVar[str] = "standin-wordless"

    def write(self, scene: Scene, settings: Any, directory: Path) -> list[Phase]:
        raise OSError("no ink left")


ENGINES = {c.name: f"standin:{c.__name__}" for c in (StandIn, Coarse, Absent, Picky, Forgetful, Wordless)}


def _load(step: int, time: float, path: Path) -> Frame:
    with np.load(path) as stored:
        return Frame(step, time, *(stored[name] for name in ARRAYS))


def _flight(scene: Scene, t: float) -> dict[str, np.ndarray]:
    start, gravity = scene.bodies, np.array(scene.gravity)
    return {
        "present": np.arange(len(start)),
        "position": start.position + start.velocity * t + 0.5 * gravity * t**2,
        "velocity": start.velocity + gravity * t,
        "angular_velocity": start.angular_velocity.copy(),
    }


if __name__ == "__main__":
    registry.BUILT_IN.update(ENGINES)
    from dembench.cli import main

    main()
