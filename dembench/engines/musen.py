"""MUSEN: job scripts, text scene, and reading what it exported.

M. Dosta, V. Skorych: MUSEN: An open-source framework for GPU-accelerated DEM simulations, SoftwareX 12 (2020) 100618,
doi 10.1016/j.softx.2020.100618. It is in no package registry: who wants it builds it from its public repository.

Deviations from the reference law, found in its sources and in recorded runs (1.74.2), and told by `law`:

- The shear history is projected on the tangent plane and rescaled to its old length; the arm of the shear force is the
  full radius.
- The spring force of a wall is multiplied by |cos| of the angle between the triangle's normal and the direction from
  the contact point to the centre, and acts along the normal: contacts at edges are weaker.
- Velocities that it writes are those half a step later, and motion begins half a step early: free fall from rest is
  deeper by g t dt. Moving walls are one step ahead.

A run is three phases: import of the text scene, simulation, export; the simulation alone is timed. Its loop is timed
between the two messages that the program prints about it, which its own figure in whole seconds must confirm. Results
come with the export, at the end; a run that was interrupted after the simulation goes on with the export.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import jinja2
from pydantic import Field

from dembench.engines import musen_launch
from dembench.engines.base import FRAMES, Checkpoint, Division, Engine, EngineSettings, Phase, Probe, Series, Timing
from dembench.engines.musen_output import (
    BINARY_BYTES,
    Reader,
    frame_bytes,
    parts,
    saving,
)
from dembench.engines.musen_scene import geometries, refused, write_scene
from dembench.engines.scene_queries import beyond_hertzian_spheres, observed_walls
from dembench.scene import HertzMindlin, Scene, features

PHASES = ("import", "simulate", "export")
MODELS = ("ModelPPHertzMindlin", "ModelPWHertzMindlin")
INSTALL = (
    "Build MUSEN from its public repository (msolids/musen; doi 10.1016/j.softx.2020.100618) and put CMUSEN on PATH, "
    "or name it: DEMBENCH_MUSEN=PROGRAM"
)
PROBE_SECONDS = 30
SEGMENTS = 100
CONFIRMED = 1.5
"""Largest difference of a time to one in whole seconds that confirms it [s]."""
PARTICLE_STEPS_PER_SECOND = {"cpu": 1.2e6, "gpu": 8.2e7}
"""Throughput on which run-time estimates are based: of a core, and of a workstation's GPU (impact of 25k grains)."""


class MusenSettings(EngineSettings):
    """Settings of a MUSEN run.

    Attributes:
        hardware: Simulator: `cpu` or `gpu`.
        threads: Threads, one core each.
        digits: Significant digits of exported positions and velocities.
        segments: Sides of the polygon that stands for a round wall.
    """

    hardware: Literal["cpu", "gpu"] = "cpu"
    threads: Annotated[int, Field(ge=1)] = 1
    digits: Annotated[int, Field(ge=6, le=17)] = 12
    segments: Annotated[int, Field(ge=8)] = SEGMENTS

    def cores(self) -> int:
        """See `EngineSettings.cores`."""
        return self.threads

    def device(self) -> str:
        """See `EngineSettings.device`."""
        return self.hardware


class Musen(Engine):
    """MUSEN."""

    name: ClassVar[str] = "musen"
    title: ClassVar[str] = "MUSEN: soft-sphere, double precision, CPU or GPU"
    colour: ClassVar[str] = "#4a3aa7"
    settings_type: ClassVar[type[EngineSettings]] = MusenSettings
    cores_setting: ClassVar[str | None] = "threads"

    def probe(self) -> Probe:
        """See `Engine.probe`. The environment variable DEMBENCH_MUSEN names a program other than that on PATH."""
        path = _program()
        if path is None:
            wanted = os.environ.get("DEMBENCH_MUSEN", "CMUSEN")
            return Probe(available=False, reason=f"no program '{wanted}' was found", install=INSTALL)
        try:
            version, models = _output_of(path, "-v"), _output_of(path, "-m")
            digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
        except (OSError, subprocess.TimeoutExpired) as error:
            return Probe(available=False, path=path, reason=f"{path} does not start: {error}", install=INSTALL)
        found = re.search(r"^Version: (\S+)", version, re.M)
        if found is None:
            return Probe(available=False, path=path, reason=f"{path} prints no version of MUSEN", install=INSTALL)
        absent = [model for model in MODELS if not re.search(rf"\b{model}\b", models)]
        if absent:
            reason = f"{path} does not list the contact model {absent[0]}: its folder of models is missing"
            return Probe(available=False, version=found[1], path=path, reason=reason, install=INSTALL)
        facts = {
            "sha256": digest,
            "known_deviation": "velocities of half a step later, free fall deeper by g t dt, moving walls a step ahead",
        }
        if build := re.search(r"^Build: (\S+)", version, re.M):
            facts["build"] = build[1]
        return Probe(available=True, version=found[1], path=path, facts=facts)

    def unsupported(self, scene: Scene) -> list[str]:
        """See `Engine.unsupported`."""
        faults = [] if len(scene.bodies) else ["a scene without bodies"]
        faults += beyond_hertzian_spheres(scene, ("reference", "rescaled"))
        faults += ["periodic boundaries"] * features(scene).periodic
        faults += [f"constraint {kind}" for kind in sorted({c.kind for c in scene.constraints})]
        return [*faults, *refused(scene)]

    def defaults(self, scene: Scene, division: Division) -> dict[str, Any]:
        """See `Engine.defaults`: in the open division a tenth of the Rayleigh time."""
        if division == "closed":
            return {"dt": scene.closed_step()}
        return {"dt": scene.fitted_step(0.1 * scene.rayleigh_time())}

    def law(self, scene: Scene, settings: MusenSettings) -> str:
        """See `Engine.law`; contacts of grains without friction are those of the scene's own law."""
        present = features(scene)
        own = []
        if present.tangential_history and isinstance(scene.law, HertzMindlin) and scene.law.variant == "reference":
            own.append("shear history rescaled to its old length, arm the full radius")
        if present.walls:
            own.append("spring force of walls times |cos| between triangle and contact")
        if present.curved_walls:
            own.append(f"round walls as polygons of {settings.segments} sides")
        return "; ".join(own)

    def estimate(self, scene: Scene, settings: MusenSettings) -> float:
        """See `Engine.estimate`."""
        rate = PARTICLE_STEPS_PER_SECOND[settings.hardware]
        if settings.hardware == "cpu":
            rate *= settings.threads
        return 2 + scene.duration / settings.dt * len(scene.bodies) / rate

    # ---- writing

    def write(self, scene: Scene, settings: MusenSettings, directory: Path) -> list[Phase]:
        """See `Engine.write`: scene.txt, one job script for each phase, an empty directory `frames`.

        Raises:
            ValueError: Bodies are missing, or the results would not fit on the disk.
        """
        if not len(scene.bodies):
            raise ValueError("a scene without bodies: the program would not end")
        saved = saving(scene, settings.dt)
        _check_space(len(scene.bodies) * (saved.count + 1), settings.digits, directory)
        walls = geometries(scene, settings.segments)
        write_scene(scene, walls, directory / "scene.txt")
        (directory / FRAMES).mkdir(exist_ok=True)
        end = scene.duration + saved.interval
        deck = {
            "device": settings.hardware,
            "dt": settings.dt,
            "saving": saved.interval,
            "duration": scene.duration,
            "gravity": scene.gravity,
            "motions": {w.name: (0.0, end, *w.motion) for w in walls if w.motion},
            "walls": walls,
            "parts": parts(len(scene.bodies), saved, settings.digits),
            "digits": settings.digits,
            "forces": observed_walls(scene),
        }
        environment = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
        for phase in PHASES:
            template = files("dembench.engines").joinpath(f"musen_{phase}.txt.j2").read_text()
            (directory / f"{phase}.txt").write_text(environment.from_string(template).render(deck).lstrip("\n"))
        triangles = sum(len(w.triangles) for w in walls)
        return [self._phase(name, len(scene.bodies), triangles, settings.threads) for name in PHASES]

    def _phase(self, name: str, grains: int, triangles: int, threads: int) -> Phase:
        launch = (sys.executable, "-I", "-S", musen_launch.__file__, f"{name}.txt", str(grains), str(triangles))
        program = (_program() or "CMUSEN", f"-s={name}.txt", f"-t={threads}")
        return Phase(name=name, command=(*launch, *program), timed=name == "simulate")

    def checkpoint(self, scene: Scene, settings: MusenSettings, directory: Path) -> Checkpoint | None:
        """See `Engine.checkpoint`: the end of the simulation, where only the export was cut off."""
        log = _text(directory / "simulate.log")
        if f"{musen_launch.ENDED}done" not in log:
            return None
        return Checkpoint(step=round(scene.duration / settings.dt), time=scene.duration)

    def resume(self, scene: Scene, settings: MusenSettings, directory: Path) -> list[Phase] | None:
        """See `Engine.resume`: exports anew."""
        if self.checkpoint(scene, settings, directory) is None:
            return None
        (directory / "export.log").unlink(missing_ok=True)
        for path in (directory / FRAMES).iterdir():
            if path.suffix != ".mdem":
                path.unlink()
        triangles = sum(len(w.triangles) for w in geometries(scene, settings.segments))
        return [self._phase("export", len(scene.bodies), triangles, settings.threads)]

    # ---- reading

    def read(self, scene: Scene, settings: MusenSettings, directory: Path) -> Series:
        """See `Engine.read`: the exported frames and tracks, how far the simulation is, errors of all phases."""
        logs = {phase: _text(directory / f"{phase}.log") for phase in PHASES}
        exported = logs["export"].count(musen_launch.DONE["EXPORT_TO_TEXT"])
        walls = geometries(scene, settings.segments)
        reader = Reader(scene, walls, settings.dt, settings.digits, directory)
        frames, tracks, fault = reader.read(exported)
        for phase, log in logs.items():
            said = re.search(rf"^{musen_launch.ENDED}(.*)$", log, re.M)
            if said and said[1] != "done":
                fault = ("engine error", f"{phase}: {said[1]}")
                break
        simulated = logs["simulate"]
        finished = musen_launch.DONE["SIMULATOR"] in simulated
        reached = [float(t) for t in re.findall(r"^Current time \[s\]: (\S+)$", simulated, re.M)]
        time = scene.duration if finished else max(reached, default=0.0)
        reason, detail = fault or (None, "")
        return Series(frames, tracks, _timing(simulated), time, reason, detail)


def _program() -> str | None:
    """Path of the program."""
    wanted = os.environ.get("DEMBENCH_MUSEN")
    found = (shutil.which(name) for name in ([wanted] if wanted else ["CMUSEN", "cmusen"]))
    return next((path for path in found if path), None)


def _output_of(*command: str) -> str:
    ended = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=PROBE_SECONDS, check=False)
    return (ended.stdout + ended.stderr).decode(errors="replace")


def _check_space(grains_saved: int, digits: int, directory: Path) -> None:
    """Refuses a run whose results would not fit.

    Raises:
        ValueError: What is needed and what is there.
    """
    needed = grains_saved * (BINARY_BYTES + frame_bytes(1, digits))
    free = shutil.disk_usage(directory).free
    if needed > free:
        raise ValueError(
            f"the results need about {needed / 1e9:.0f} GB and {free / 1e9:.0f} GB are free: the program saves all "
            "bodies at the interval of the finest record; a coarser track_interval or fewer digits make it less"
        )


def _timing(log: str) -> Timing:
    """Time between the messages about a simulation where the program's whole seconds confirm it, else these."""
    found = re.search(r"^Elapsed time \[d:h:m:s\]: (\d+):(\d+):(\d+):(\d+)", log, re.M)
    if found is None:
        return Timing()
    days, hours, minutes, seconds = map(int, found.groups())
    elapsed = float(86400 * days + 3600 * hours + 60 * minutes + seconds)
    took = re.search(rf"^{re.escape(musen_launch.TOOK)}(\S+)$", log, re.M)
    if took is not None and abs(float(took[1]) - elapsed) < CONFIRMED:
        return Timing(loop=float(took[1]), source="wall")
    return Timing(loop=elapsed, source="engine")


def _text(path: Path) -> str:
    return path.read_text(errors="replace") if path.exists() else ""
