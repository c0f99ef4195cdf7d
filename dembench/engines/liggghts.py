"""LIGGGHTS-PUBLIC 3.8: deck, walls, and reading what it wrote.

Reference law in double precision: `gran model hertz tangential history`
(Kloss et al. 2012, Prog. Comput. Fluid Dyn. 12, 140-152, doi 10.1504/PCFD.2012.047457).

Neighbour settings. The cells of the neighbour search follow the largest radius, so that one large ball among small
grains makes every rebuild slow. Measured with 25 000 grains of 2 mm and a ball of 20 mm at 3 m/s in the bed (dt 0.5 us,
one rank, steps per CPU second on a busy two-core machine; the same bed without the ball makes 2.2-2.5 million
particle-steps per second there):

    skin    cells, sorting       million particle-steps/s    time in rebuilds
    0.4 mm  as the program       1.63-1.84                   31-34 %
    0.8 mm  as the program       1.97                        14 %
    0.4 mm  4 mm, 2.5 mm         2.12-2.20                   30 %
    0.8 mm  4 mm, 2.5 mm         2.42-2.69                   16 %    default where radii differ by more than 3
    1.2 mm  4 mm, 2.5 mm         slower than 0.8 mm by a seventh

Otherwise the skin hardly matters: a collapsing bed of 25 000 grains of 2 mm made 3.0, 3.1 and 3.0 million
particle-steps per second with skins of 0.4, 0.2 and 0.1 mm (E 1e7, dt 8 us), the drum of 38 000 grains from rest 2.9
with its walls as primitives and 2.3 as the published mesh of 1200 triangles.

`neighbor multi` silently finds no neighbours. `pair_style hybrid`, which would leave the useless ball-ball cutoff out,
lets all pairs share one shear history. Neither is used.

Round walls are primitives where these are exact (`liggghts_round.py`), else polygons, which `law` names. Meshes are
`fix mesh/surface` with the program's own `curvature`, stated in the deck, or less where a triangle has a smaller angle:
it would refuse the mesh. Neighbouring triangles that differ by less than that are one face, and shear springs pass from
one to the next. Bodies in sinks are removed between parts of a run.

Edges of polygons. Where a body touches two sides at once, both push: a grain of 2 mm that hit an edge of 40 sides about
50 mm with e = 0.5 came back with 0.37 of its speed, and with 0.49 beside it. A `curvature` above the angle between the
sides leaves one of the two out, but only where the triangle that is touched first is also the earlier one in the file:
on one side of every edge 0.37 became 0.49, on the other it stayed. A drum would differ with the sense of its rotation,
so the option is left as the program has it.

Checkpoints. A run of more than some minutes is cut into parts, and a restart file is written after each. The program
sets up its lists and first forces anew at every start of a part, with the velocities of the whole step, and it does not
know the velocity of a moving wall in the first force after `read_restart`: moving walls are set up anew after every
checkpoint, so that a launch from it makes, on one rank, the run that was not interrupted to the last bit. Restart files
hold the shear springs of pairs, primitives and meshes and the places of triangles. The restart file that the program
writes by itself when it is terminated is not used: it does not lie at the end of a part.

Known deviation, written into the probe's facts: when a contact opens, its shear spring is kept until the next rebuild
of the neighbour list, so that a pair that touches again before starts with it. A sphere that bounced twice on another
showed it: with a rebuild in between it ended as a run started afresh, without one 0.1 % off in tangential velocity.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from dembench.engines.base import (
    CHECKPOINTS,
    FRAMES,
    Checkpoint,
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
from dembench.engines.liggghts_axes import renamed
from dembench.engines.liggghts_deck import box, deck, legs, write_bodies
from dembench.engines.liggghts_log import failure_in, last_step, timing_in
from dembench.engines.liggghts_output import Launch, launches, read_frames, read_tracks, remove_frames
from dembench.engines.liggghts_walls import Walls, motion_of, walls, write_stl
from dembench.engines.round_walls import sides_for
from dembench.engines.scene_queries import beyond_hertzian_spheres, materials_of, steps_of
from dembench.scene import Scene, Sdf, features
from dembench.scene.base import Positive

LOWEST_RESTITUTION = 0.05
EXCESS = 0.01
"""Share of the domain by which triangles may reach out of it [-]: a polygon about a round wall does."""
PARTICLE_STEPS_PER_SECOND = 2.4e6
"""Throughput of one rank on which run-time estimates are based."""
LARGE_RATIO = 3.0
"""Ratio of radii above which the neighbour settings for a large ball among small grains are the default."""


class LiggghtsSettings(EngineSettings):
    """Settings of a LIGGGHTS run.

    Attributes:
        ranks: MPI processes.
        skin: Distance beyond contact up to which pairs are listed [m].
        bin_size: Edge of the cells of the neighbour search [m]; None: half the largest cutoff.
        sort_size: Edge of the cells by which particles are sorted in memory [m]; None: as above.
        segments: Sides of the polygon that stands for a round wall where no exact primitive exists.
        sink_interval: Simulated time between two removals of the bodies in sinks [s].
        checkpoint: Wall time between two checkpoints, as far as it can be foreseen [s].
        force: `friction` or `rotation`: commands for it in a scene that lacks it.
    """

    ranks: Annotated[int, Field(ge=1)] = 1
    skin: Positive
    bin_size: Positive | None = None
    sort_size: Positive | None = None
    segments: Annotated[int, Field(ge=8)] = 100
    sink_interval: Positive = 5e-3
    checkpoint: Positive = 240.0
    force: Literal["friction", "rotation", "friction+rotation"] | None = None

    def cores(self) -> int:
        """See `EngineSettings.cores`."""
        return self.ranks


class Liggghts(Engine):
    """LIGGGHTS-PUBLIC."""

    name: ClassVar[str] = "liggghts"
    title: ClassVar[str] = "LIGGGHTS-PUBLIC: soft-sphere, double precision, MPI"
    colour: ClassVar[str] = "#e34948"
    settings_type: ClassVar[type[EngineSettings]] = LiggghtsSettings
    cores_setting: ClassVar[str | None] = "ranks"

    def probe(self) -> Probe:
        """See `Engine.probe`. The environment variable DEMBENCH_LIGGGHTS names a program other than that on PATH."""
        install = "apt-get install liggghts"
        path = shutil.which(_wanted())
        if path is None:
            return Probe(available=False, reason=f"no program '{_wanted()}' was found", install=install)
        try:
            banner = _output_of(path, "-log", "none", "-help")
        except (OSError, subprocess.TimeoutExpired) as error:
            return Probe(available=False, path=path, reason=f"{path} does not start: {error}", install=install)
        found = re.search(r"Version LIGGGHTS\S* (\S+?), compiled (\S+)", banner)
        if found is None:
            return Probe(available=False, path=path, reason=f"{path} prints no LIGGGHTS banner", install=install)
        facts = {
            "sha256": hashlib.sha256(Path(path).read_bytes()).hexdigest(),
            "compiled": found[2],
            "known_deviation": "shear spring of an opened contact kept until the neighbour list is rebuilt",
        }
        if package := _package(path):
            facts["package"] = package
        if launcher := _launcher(path):
            facts["mpirun"] = launcher
        return Probe(available=True, version=found[1], path=path, facts=facts)

    def unsupported(self, scene: Scene) -> list[str]:
        """See `Engine.unsupported`."""
        if not len(scene.bodies):
            return ["a scene without bodies"]
        faults = beyond_hertzian_spheres(scene, ("reference",), LOWEST_RESTITUTION)
        for material in materials_of(scene):
            if material.poisson < 0:
                faults.append(f"Poisson's ratio {material.poisson:g} of {material.name}: it must not be negative")
        faults += [f"constraint {kind}" for kind in sorted({c.kind for c in scene.constraints} - {"fixed"})]
        for wall in scene.walls:
            if wall.motion is not None and motion_of(wall.motion) is None:
                faults.append(f"motion of wall {wall.name}: either a rotation or a translation of the whole wall")
            if isinstance(wall, Sdf):
                faults.append(f"wall {wall.name}: a signed distance on a grid")
        for surface in walls(scene, sides_for(scene)).surfaces:
            low, high = surface.triangles.min(axis=(0, 1)), surface.triangles.max(axis=(0, 1))
            size = np.subtract(scene.domain.upper, scene.domain.lower)
            if (scene.domain.lower - low > EXCESS * size).any() or (high - scene.domain.upper > EXCESS * size).any():
                faults.append(f"wall {surface.wall} reaches out of the domain")
        return faults

    def law(self, scene: Scene, settings: LiggghtsSettings) -> str:
        """See `Engine.law`: names the round walls that are polygons."""
        polygons = walls(scene, settings.segments).polygons
        return f"{' and '.join(polygons)} with {settings.segments} flat sides" if polygons else ""

    def defaults(self, scene: Scene, division: Division) -> dict[str, Any]:
        """See `Engine.defaults`: in the open division a tenth of the Rayleigh time; neighbour settings as measured."""
        step = scene.closed_step() if division == "closed" else scene.fitted_step(0.1 * scene.rayleigh_time())
        smallest, largest = scene.extreme_radii()
        if largest > LARGE_RATIO * smallest:
            factors = {"skin": 0.8, "bin_size": 4.0, "sort_size": 2.5}
        else:
            factors = {"skin": 0.4}
        lengths = {key: float(f"{factor * smallest:.6g}") for key, factor in factors.items()}
        return {"dt": step, "segments": sides_for(scene), **lengths}

    # ---- writing

    def write(self, scene: Scene, settings: LiggghtsSettings, directory: Path) -> list[Phase]:
        """See `Engine.write`: in.liggghts, bodies.data, one STL file per mesh wall, empty directories for
        frames and checkpoints."""
        own = renamed(scene)
        parts = walls(own, settings.segments)
        for surface in parts.surfaces:
            write_stl(directory / f"{surface.id}.stl", surface.triangles)
        write_bodies(own, box(own, settings, parts), directory / "bodies.data")
        for name in (FRAMES, CHECKPOINTS):
            (directory / name).mkdir(exist_ok=True)
        return self._launch(own, settings, directory, parts, Launch())

    def checkpoint(self, scene: Scene, settings: LiggghtsSettings, directory: Path) -> Checkpoint | None:
        """See `Engine.checkpoint`: a checkpoint has its name only once it is whole."""
        steps = [int(path.stem) for path in (directory / CHECKPOINTS).glob("*.restart")]
        return Checkpoint(step=max(steps), time=max(steps) * settings.dt) if steps else None

    def resume(self, scene: Scene, settings: LiggghtsSettings, directory: Path) -> list[Phase] | None:
        """See `Engine.resume`: a new launch with a script, a log and records of its own."""
        found = self.checkpoint(scene, settings, directory)
        if found is None:
            return None
        remove_frames(directory, found.step)
        for forced in directory.glob("restart_forced_*"):
            forced.unlink()
        own = renamed(scene)
        return self._launch(own, settings, directory, walls(own, settings.segments), Launch(found.step))

    def _launch(
        self, scene: Scene, settings: LiggghtsSettings, directory: Path, parts: Walls, launch: Launch
    ) -> list[Phase]:
        """Writes the script of a launch and says how to start it."""
        program = shutil.which(_wanted()) or "liggghts"
        command = [program, "-in", launch.deck, "-log", launch.log]
        environment: dict[str, str] = {}
        if settings.ranks > 1:
            mpirun = _launcher(program) or "mpirun"
            command = [mpirun, "--bind-to", "none", "--oversubscribe", "-n", str(settings.ranks), *command]
            environment |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
            environment["OMPI_MCA_mpi_yield_when_idle"] = "1"  # a waiting rank must not hold a core that others need
        shown = " ".join(Path(part).name if os.path.isabs(part) else part for part in command)
        throughput = PARTICLE_STEPS_PER_SECOND * settings.ranks
        cut = legs(scene, settings, throughput, launch.start)
        (directory / launch.deck).write_text(deck(scene, settings, parts, cut, launch, shown))
        # some errors go to the output alone, which a program that aborts does not flush
        flushing = [stdbuf, "-oL"] if (stdbuf := shutil.which("stdbuf")) else []
        return [Phase(name="simulate", command=(*flushing, *command), environment=environment)]

    # ---- reading

    def read(self, scene: Scene, settings: LiggghtsSettings, directory: Path) -> Series:
        """See `Engine.read`: complete frames and tracks so far, the program's own timing, its errors."""
        frames = read_frames(scene, settings.dt, directory)
        tracks, gone = read_tracks(scene, settings.dt, directory)
        last = steps_of(np.array([scene.duration]), settings.dt)[0]
        loops: list[float | None] = []
        counters: dict[str, float] = {}
        text = ""
        for launch, end in launches(directory):
            path = directory / launch.log
            text = path.read_text(errors="replace") if path.exists() else ""
            loop, counted = timing_in(text, last if end is None else end)
            loops.append(loop)
            for name, value in counted.items():
                counters[name] = value + (0.0 if name == "neighbours_per_body" else counters.get(name, 0.0))
        failure, detail = ("lost particles", gone) if gone else failure_in(text)
        reached = last_step(text)
        ended = reached == last and loops[-1] is not None
        if failure is None and ended and len(frames) < len(scene.frame_times()):
            failure, detail = "no output", f"{len(frames)} of {len(scene.frame_times())} frames were written"
        timing = Timing(loop=sum(filter(None, loops)), source="engine") if ended else Timing()
        return Series(frames, tracks, timing, reached * settings.dt, failure, detail, counters)

    def reached(self, settings: LiggghtsSettings, directory: Path) -> float | None:
        """See `Engine.reached`."""
        launch, _end = launches(directory)[-1]
        return last_step(end_of(directory / launch.log)) * settings.dt or None

    def order(self, scene: Scene, settings: LiggghtsSettings) -> float:
        """See `Engine.order`."""
        return order_of_contacts(scene, lagging=True)

    def forceable(self, scene: Scene, settings: LiggghtsSettings) -> list[str]:
        """See `Engine.forceable`; what else is left out are commands, which act on nothing where a scene lacks them."""
        return [name for name in features(scene).absent() if name in ("friction", "rotation")]

    def estimate(self, scene: Scene, settings: LiggghtsSettings) -> float:
        """See `Engine.estimate`."""
        steps = scene.duration / settings.dt
        return 2 + steps * len(scene.bodies) / PARTICLE_STEPS_PER_SECOND / settings.ranks


def _wanted() -> str:
    return os.environ.get("DEMBENCH_LIGGGHTS", "liggghts")


def _launcher(program: str) -> str | None:
    """The launcher of MPI that lies beside a program, else the one on PATH, which may be of another MPI."""
    return shutil.which("mpirun", path=str(Path(program).parent)) or shutil.which("mpirun")


def _output_of(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, timeout=30, check=False).stdout


def _package(path: str) -> str:
    """Debian package and version that a program belongs to, or nothing."""
    try:
        name = _output_of("dpkg-query", "-S", path).partition(":")[0]
        return _output_of("dpkg-query", "-W", "-f", "${Package} ${Version}", name).strip() if name else ""
    except (OSError, subprocess.TimeoutExpired):
        return ""
