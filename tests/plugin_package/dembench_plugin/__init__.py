"""A third party's engine, case and suite: one body that drifts in a straight line."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from dembench.cases.base import Case, Curve, Preset, Quantity, Recorded, Reference
from dembench.engines.base import (
    FRAMES,
    Division,
    Engine,
    EngineSettings,
    Frame,
    FrameFiles,
    Phase,
    Probe,
    Series,
    Timing,
)
from dembench.initial.progress import Progress
from dembench.results import Result
from dembench.scene import CentreOfMass, HertzMindlin, Scene, scene_from_arrays
from dembench.scene.base import Model
from dembench.verification.checks import Check, Suite, on_one_scene

SPEED, DURATION = 2.0, 0.01
PROGRAM = """
import json, os, time
import numpy as np
deck, begin = json.load(open("deck.json")), time.perf_counter()
x, v = np.array(deck["position"]), np.array(deck["velocity"])
for step, t in deck["frames"]:
    np.savez("part.npz", step=step, time=t, position=x + t * v, velocity=v)
    os.replace("part.npz", f"frames/{step:08d}.npz")
json.dump(time.perf_counter() - begin, open("loop.json", "w"))
"""


class Weightless(Engine):
    """Straight lines without contacts."""

    name: ClassVar[str] = "weightless"
    title: ClassVar[str] = "Straight lines, from another package"
    colour: ClassVar[str] = "#7a5195"
    settings_type: ClassVar[type[EngineSettings]] = EngineSettings

    def probe(self) -> Probe:
        return Probe(available=True, version="0.1.0")

    def unsupported(self, scene: Scene) -> list[str]:
        return ["gravity"] if any(scene.gravity) else []

    def defaults(self, scene: Scene, division: Division) -> dict[str, Any]:
        return {"dt": scene.closed_step()}

    def write(self, scene: Scene, settings: EngineSettings, directory: Path) -> list[Phase]:
        times = scene.frame_times()
        deck = {
            "position": scene.bodies.position.tolist(),
            "velocity": scene.bodies.velocity.tolist(),
            "frames": [[round(t / settings.dt), t] for t in times.tolist()],
        }
        (directory / "deck.json").write_text(json.dumps(deck))
        (directory / FRAMES).mkdir()
        return [Phase(name="simulate", command=(sys.executable, "-c", PROGRAM))]

    def read(self, scene: Scene, settings: EngineSettings, directory: Path) -> Series:
        known = []
        for path in sorted((directory / FRAMES).glob("*.npz")):
            with np.load(path) as stored:
                known.append((int(stored["step"]), float(stored["time"]), path))
        loop = directory / "loop.json"
        timing = Timing(loop=json.loads(loop.read_text()), source="engine") if loop.exists() else Timing()
        return Series(FrameFiles(known, _frame), None, timing, known[-1][1] if known else 0.0)


def _frame(step: int, time: float, path: Path) -> Frame:
    with np.load(path) as stored:
        position, velocity = stored["position"], stored["velocity"]
    return Frame(step, time, np.arange(len(position)), position, velocity, np.zeros_like(position))


def drift() -> Scene:
    """One body that drifts along x."""
    scene = scene_from_arrays(
        [[0.0, 0.0, 0.0]],
        1e-3,
        velocity=[[SPEED, 0.0, 0.0]],
        gravity=(0.0, 0.0, 0.0),
        law=HertzMindlin(),
        duration=DURATION,
        observables=[CentreOfMass(name="centre", interval=1e-3)],
        name="drift",
    )
    return scene.model_copy(update={"time_step": 1e-4})


def way(result: Recorded) -> float:
    """How far the body came along x [m]."""
    return float(np.asarray(result.observables["centre"].value).reshape(-1, 3)[-1, 0])


class Drifting(Case):
    """The way of one body."""

    name: ClassVar[str] = "drifting"
    title: ClassVar[str] = "A body that drifts"
    source: ClassVar[str] = "Newton's first law"
    parameters: ClassVar[type[Model]] = Model
    presets: ClassVar[tuple[Preset, ...]] = ("quick",)

    def scene(
        self,
        parameters: Any,
        preset: Preset,
        initial: Path | None = None,
        seed: int = 0,
        progress: Progress | None = None,
    ) -> Scene:
        return drift()

    def quantities(self, scene: Scene, result: Recorded) -> list[Quantity]:
        return [Quantity("way", "Way", way(result), "m")]

    def references(self, scene: Scene, parameters: Any, preset: Preset) -> list[Reference]:
        exact = SPEED * DURATION
        return [Reference("way", exact, 0.999 * exact, 1.001 * exact, "m", "v t", "closed form")]

    def reference_curves(self, scene: Scene, parameters: Any, preset: Preset) -> list[Curve]:
        return []


def suite() -> Suite:
    """One check: the way."""
    check = Check(
        id="W1", title="Way of a body that drifts", unit="m", expected=SPEED * DURATION, tolerance=1e-9, source="v t"
    )

    def measure(result: Result) -> dict[str, float]:
        return {"W1": way(result)}

    experiments = (on_one_scene("drift", "A body that drifts", drift, measure, (check,)),)
    return Suite("drift", "Drift", "A suite from another package.", "Newton's first law", experiments)
