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

`neighbor multi` silently finds no neighbours. `pair_style hybrid`, which would leave the useless ball-ball cutoff out,
lets all pairs share one shear history. Neither is used.

Known deviation, written into the probe's facts: when a contact opens, its shear spring is kept until the next rebuild
of the neighbour list, so that a pair that touches again before starts with it. A sphere that bounced twice on another
showed it: with a rebuild in between it ended as a run started afresh, without one 0.1 % off in tangential velocity.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
import shutil
import subprocess
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, ClassVar

import jinja2
import numpy as np
from pydantic import Field

from dembench.engines.base import Division, Engine, EngineSettings, Phase, Probe, Series, Timing
from dembench.engines.liggghts_output import (
    counters_in,
    every_of,
    failure_in,
    last_step,
    loop_time,
    read_frames,
    read_tracks,
    steps_of,
)
from dembench.engines.liggghts_walls import AXES, materials_of, motion_of, type_of, walls, write_stl
from dembench.scene import HertzMindlin, Scene, Sdf, WallForce, features
from dembench.scene.base import Positive

DECK = "in.liggghts"
LOG = "log.liggghts"
"""Where the program writes its log without being asked."""
SOFT_YOUNG, HARD_YOUNG = 5e6, 1e9
LOWEST_RESTITUTION = 0.05
IDS_PER_LINE = 1000
SEGMENTS = 100
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
    """

    ranks: Annotated[int, Field(ge=1)] = 1
    skin: Positive
    bin_size: Positive | None = None
    sort_size: Positive | None = None
    segments: Annotated[int, Field(ge=8)] = SEGMENTS

    def cores(self) -> int:
        """See `EngineSettings.cores`."""
        return self.ranks


class Liggghts(Engine):
    """LIGGGHTS-PUBLIC."""

    name: ClassVar[str] = "liggghts"
    title: ClassVar[str] = "LIGGGHTS-PUBLIC: soft-sphere, double precision, MPI"
    colour: ClassVar[str] = "#e34948"
    settings_type: ClassVar[type[EngineSettings]] = LiggghtsSettings

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
        if launcher := shutil.which("mpirun"):
            facts["mpirun"] = launcher
        return Probe(available=True, version=found[1], path=path, facts=facts)

    def unsupported(self, scene: Scene) -> list[str]:
        """See `Engine.unsupported`."""
        law = scene.law
        faults = [] if len(scene.bodies) else ["a scene without bodies"]
        if not isinstance(law, HertzMindlin):
            faults.append(f"contact law {law.kind}")
        elif law.variant != "reference":
            faults.append(f"variant {law.variant} of the contact law")
        for pair in scene.pair_laws:
            if not LOWEST_RESTITUTION < pair.restitution <= 1:
                faults.append(f"restitution {pair.restitution:g} of {pair.a}-{pair.b}: accepted is 0.05 < e <= 1")
        for material in materials_of(scene):
            if material.poisson < 0:
                faults.append(f"Poisson's ratio {material.poisson:g} of {material.name}: it must not be negative")
        present = features(scene)
        faults += ["rolling friction"] * present.rolling_friction + ["sinks"] * present.sinks
        faults += ["particles that are no spheres"] * present.shapes
        faults += [f"constraint {kind}" for kind in sorted({c.kind for c in scene.constraints} - {"fixed"})]
        faults += [f"wall force (observable {o.name})" for o in scene.observables if isinstance(o, WallForce)]
        for wall in scene.walls:
            if wall.motion is not None and motion_of(wall.motion) is None:
                faults.append(f"motion of wall {wall.name}: either a rotation or a translation of the whole wall")
            if isinstance(wall, Sdf):
                faults.append(f"wall {wall.name}: a signed distance on a grid")
        for surface in walls(scene, SEGMENTS)[1]:
            low, high = surface.triangles.min(axis=(0, 1)), surface.triangles.max(axis=(0, 1))
            if (low < scene.domain.lower).any() or (high > scene.domain.upper).any():
                faults.append(f"triangles of {surface.id} reach out of the domain")
        return faults

    def defaults(self, scene: Scene, division: Division) -> dict[str, Any]:
        """See `Engine.defaults`: in the open division a tenth of the Rayleigh time; neighbour settings as measured."""
        step = scene.closed_step() if division == "closed" else scene.fitted_step(0.1 * scene.rayleigh_time())
        smallest, largest = float(scene.radii().min()), float(scene.radii().max())
        if largest > LARGE_RATIO * smallest:
            factors = {"skin": 0.8, "bin_size": 4.0, "sort_size": 2.5}
        else:
            factors = {"skin": 0.4}
        return {"dt": step} | {key: float(f"{factor * smallest:.6g}") for key, factor in factors.items()}

    # ---- writing

    def write(self, scene: Scene, settings: LiggghtsSettings, directory: Path) -> list[Phase]:
        """See `Engine.write`: in.liggghts, bodies.data, one STL file per mesh wall, an empty directory `frames`."""
        primitives, surfaces = walls(scene, settings.segments)
        for surface in surfaces:
            write_stl(directory / f"{surface.id}.stl", surface.triangles)
        _write_bodies(scene, directory / "bodies.data")
        (directory / "frames").mkdir(exist_ok=True)
        program = shutil.which(_wanted()) or "liggghts"
        command = [program, "-in", DECK]
        environment: dict[str, str] = {}
        if settings.ranks > 1:
            command = ["mpirun", "--bind-to", "none", "--oversubscribe", "-n", str(settings.ranks), *command]
            environment |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
        template = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True).from_string(
            files("dembench.engines").joinpath("liggghts.in.j2").read_text()
        )
        shown = " ".join(Path(part).name if part == program else part for part in command)
        text = template.render(_deck(scene, settings), primitives=primitives, meshes=surfaces, launch=shown)
        (directory / DECK).write_text(text)
        return [Phase(name="simulate", command=tuple(command), environment=environment)]

    # ---- reading

    def read(self, scene: Scene, settings: LiggghtsSettings, directory: Path) -> Series:
        """See `Engine.read`: complete frames and tracks so far, the program's own timing, its errors."""
        log = directory / LOG
        text = log.read_text(errors="replace") if log.exists() else ""
        frames = read_frames(scene, settings.dt, directory / "frames")
        tracks = read_tracks(scene, settings.dt, directory / "tracks.bin")
        failure, detail = failure_in(text)
        loop = loop_time(text)
        if failure is None and loop is not None and len(frames) < len(scene.frame_times()):
            failure, detail = "no output", f"{len(frames)} of {len(scene.frame_times())} frames were written"
        timing = Timing() if loop is None else Timing(loop=loop, source="engine")
        time = last_step(text) * settings.dt
        return Series(frames, tracks, timing, time, failure, detail, counters_in(text))

    def estimate(self, scene: Scene, settings: LiggghtsSettings) -> float:
        """See `Engine.estimate`."""
        steps = scene.duration / settings.dt
        return 2 + steps * len(scene.bodies) / PARTICLE_STEPS_PER_SECOND / settings.ranks


def _wanted() -> str:
    return os.environ.get("DEMBENCH_LIGGGHTS", "liggghts")


def _output_of(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, timeout=30, check=False).stdout


def _package(path: str) -> str:
    """Debian package and version that a program belongs to, or nothing."""
    try:
        name = _output_of("dpkg-query", "-S", path).partition(":")[0]
        return _output_of("dpkg-query", "-W", "-f", "${Package} ${Version}", name).strip() if name else ""
    except (OSError, subprocess.TimeoutExpired):
        return ""


# ---- the deck


def _deck(scene: Scene, settings: LiggghtsSettings) -> dict[str, Any]:
    """Everything that the template needs apart from the walls."""
    materials = materials_of(scene)
    present = features(scene)
    laws = {frozenset((p.a, p.b)): p for p in scene.pair_laws}
    pairs = [laws.get(frozenset((a.name, b.name))) for a in materials for b in materials]
    steps = steps_of(np.array([scene.duration]), settings.dt)[0]
    held = sorted({b for c in scene.constraints for b in c.bodies})
    magnitude = math.hypot(*scene.gravity)
    tracks = steps_of(scene.track_times(), settings.dt)
    return {
        "scene": scene,
        "count": len(scene.bodies),
        "dt": settings.dt,
        "steps": steps,
        "skin": settings.skin,
        "bin_size": settings.bin_size,
        "sort_size": settings.sort_size,
        "boundary": " ".join("p" if p else "f" for p in scene.domain.periodic),
        "grid": _grid(scene, settings.ranks) if settings.ranks > 1 else None,
        "hard": any(m.young > HARD_YOUNG for m in materials),
        "soft": any(m.young < SOFT_YOUNG for m in materials),
        "materials": materials,
        "restitution": [p.restitution if p else 1.0 for p in pairs],  # None: two materials that never touch
        "friction": [p.friction if p else 0.0 for p in pairs],
        "history": present.tangential_history,
        "gravity": {"magnitude": magnitude, "direction": scene.gravity} if present.gravity else None,
        "fixed": [[b + 1 for b in held[k : k + IDS_PER_LINE]] for k in range(0, len(held), IDS_PER_LINE)],
        "thermo": max(1, steps // 200),
        "frame_every": every_of(steps_of(scene.frame_times(), settings.dt), steps),
        "tracked": [b + 1 for b in scene.tracked_bodies()],
        "track_every": every_of(tracks, steps),
    }


def _grid(scene: Scene, ranks: int) -> tuple[int, int, int]:
    """The division of the domain among ranks with the least cut surface through the bodies."""
    spread = np.std(scene.bodies.position, axis=0) + scene.radii().mean()  # not the extent: a single ball would set it
    faces = spread.prod() / spread
    grids = [
        (a, b, ranks // (a * b)) for a in range(1, ranks + 1) for b in range(1, ranks // a + 1) if ranks % (a * b) == 0
    ]
    return min(grids, key=lambda grid: (np.array(grid) - 1) @ faces)


def _write_bodies(scene: Scene, path: Path) -> None:
    bodies = scene.bodies
    n = len(bodies)
    still = np.isin(np.arange(n), [b for c in scene.constraints if c.kind == "fixed" for b in c.bodies])[:, None]
    number = np.arange(1, n + 1)
    types = np.array([type_of(scene, s.material) for s in scene.species])[bodies.species]
    atoms = np.column_stack([number, types, 2 * scene.radii(), scene.densities(), bodies.position])
    motion = np.column_stack([np.where(still, 0, bodies.velocity), np.where(still, 0, bodies.angular_velocity)])
    box = [f"{lo!r} {hi!r} {a}lo {a}hi" for lo, hi, a in zip(scene.domain.lower, scene.domain.upper, AXES, strict=True)]
    with open(path, "w") as stream:
        stream.write(f"Initial state of {scene.name}\n\n{n} atoms\n{len(materials_of(scene))} atom types\n\n")
        stream.write("\n".join(box) + "\n\nAtoms\n\n")
        np.savetxt(stream, atoms, fmt="%d %d" + 5 * " %.17g")
        stream.write("\nVelocities\n\n")
        np.savetxt(stream, np.column_stack([number, motion]), fmt="%d" + 6 * " %.17g")
