"""peclet-dem: the package of that name, driven by a script of its own; not the in-tree engines.

E. A. J. F. Peters, peclet-dem, doi 10.5281/zenodo.21132441. Measured with 1.1.0.

It has two solvers. `solver=hertz`, for scenes under the Hertz-Mindlin law, is its soft-sphere solver: Hertz with the
dashpots of the reference law, tension kept; a shear spring that is projected on the tangent plane, and the radius less
half the overlap as lever, as in the reference. It differs in one thing, told by `law`: friction, spring and dashpot
together, is bound by the normal spring's force alone, and while it slides the spring is wound back to what is left.
Step by step these formulas give the program's two-body velocities to single precision.

`solver=impulse` has rigid contacts: Newton's restitution and Coulomb friction by sweeps over impulses, then overlaps
are taken away by moving bodies. Without gravity it has another method, whose friction at walls goes beyond Coulomb's
bound and which knows no tangential restitution (a grain at .3 and -.2 m/s, mu = .2, e = .4, went on along the wall at
.214 m/s instead of .244); therefore scenes without gravity are given one of 1e-12 m/s^2.

With both solvers a body that meets two walls at once has a contact with each.

What to know of it, measured:

- Everything is in single precision. A body at x with a speed v stands still where v dt is less than 3e-8 x: one of 3
  mm/s at .1 m in steps of 1 us did not move. Restitution of two equal spheres (e = .5, +-.5 m/s, dt = 1 us): .49949 for
  E = 1e7, .49917 for E = 1e9; in double precision the same sums give .49986 and .50257.
- Steps are those of symplectic Euler with soft spheres: velocities are those of half a step before, and a body in free
  fall is ahead by g t dt / 2.
- Soft spheres know four walls and no periodic domain; neither solver tells the forces on walls.
- Sweeps carry a weight through few layers: with 12 and 8 a column of 10 spheres rests, one of 20 that starts without
  impulses gets into itself by 4 % of a diameter; with 30 and 10 it rests. `stabilization` changed nothing there. A bed
  of 40 layers collapses with 12 and 8; with 30 and 10 it keeps its places, and its speeds grow as if it fell.
- Bodies that rest keep speeds of some g dt.
- The unit of length matters: with shapes that are not scaled by the grains' size, that of 10 does not rest, either.
- Bodies at rest never sleep here: by default they do.

Bodies that leave through a sink are put to places of their own outside the domain, fixed, since the program can take
none away without forgetting all contacts. Runs write no checkpoints: one that was interrupted begins anew.
"""

from __future__ import annotations

import importlib.util
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from dembench.engines.base import (
    FRAMES,
    Division,
    EngineSettings,
    Phase,
    Probe,
    SettingsError,
)
from dembench.engines.peclet_dem_deck import deck, tangential_restitutions
from dembench.engines.peclet_dem_walls import (
    MOST_OF_SOFT_SPHERES,
    default_fine,
    grids,
    refused,
    surfaces,
    write_grids,
)
from dembench.engines.scene_queries import beyond_hertzian_spheres, materials_of, observed_walls, pairs_of
from dembench.engines.script_runs import DECK, ScriptEngine, write_bodies
from dembench.scene import HertzMindlin, Rigid, Scene, features
from dembench.scene.base import Positive

INSTALL = "pip install 'dembench[peclet-dem]', or name an interpreter that has the package: DEMBENCH_PECLET_DEM=PYTHON"
ASK = """
import hashlib, pathlib
from peclet import dem
digest = hashlib.sha256(pathlib.Path(dem._dem.__file__).read_bytes()).hexdigest()
print("peclet-dem", dem.__version__, dem.execution_space, digest)
"""
"""What an interpreter is asked."""
ON_PROCESSORS = ("OpenMP", "Serial", "Threads")
MOST_MATERIALS = 8
PARTICLE_STEPS_PER_SECOND = {"hertz": 2.0e6, "impulse": 4e4}
"""Throughput of one thread on which run-time estimates are based."""
SLOWEST_STEP = 0.004
"""Step of the impulse solver in units of sqrt(d/g) [-]: about that of its authors' benchmarks."""
TRAVEL = 0.02
"""Way in a step of the impulse solver at the start in diameters [-]: levers end as much too short in a hit."""
VARIANTS = ("reference", "rescaled", "no-tension")


class PecletDemSettings(EngineSettings):
    """Settings of a peclet-dem run.

    Attributes:
        solver: `hertz`: soft spheres; `impulse`: rigid contacts. By default that of the scene's law.
        position_iterations, velocity_iterations: Largest numbers of sweeps of the impulse solver in a step: those
            that take overlaps away, those that find the impulses. The defaults are those of its authors' sanity checks;
            their bulk benchmarks have 12 and 8.
        stabilization: What its impulse solver adds where matter is at rest.
        threads: OpenMP threads.
        skin: Distance within which soft spheres are neighbours before they touch [m].
        grid: Distance of the nodes of the grids of round walls [m].
        sink_interval: Simulated time between two removals of the bodies in sinks [s].
    """

    solver: Literal["hertz", "impulse"]
    position_iterations: Annotated[int, Field(ge=0)] = 30
    velocity_iterations: Annotated[int, Field(ge=1)] = 10
    stabilization: Literal["onesided", "multilevel", "off"] = "onesided"
    threads: Annotated[int, Field(ge=1)] = 1
    skin: Positive
    grid: Positive
    sink_interval: Positive = 5e-3

    def cores(self) -> int:
        """See `EngineSettings.cores`."""
        return self.threads

    def precision(self) -> str:
        """See `EngineSettings.precision`."""
        return "float32"


class PecletDem(ScriptEngine):
    """The package peclet-dem."""

    name: ClassVar[str] = "peclet-dem"
    title: ClassVar[str] = "peclet-dem (upstream): soft-sphere and impulse, single precision, OpenMP"
    colour: ClassVar[str] = "#c2378e"
    settings_type: ClassVar[type[EngineSettings]] = PecletDemSettings
    cores_setting: ClassVar[str | None] = "threads"

    def probe(self) -> Probe:
        """See `Engine.probe`: the interpreter of DEMBENCH_PECLET_DEM, or this one if it has the package."""
        wanted = _wanted()
        if wanted is None:
            return Probe(available=False, reason="no package peclet-dem was found", install=INSTALL)
        path = shutil.which(wanted)
        if path is None:
            return Probe(available=False, reason=f"no program '{wanted}' was found", install=INSTALL)
        try:
            ended = subprocess.run((path, "-c", ASK), capture_output=True, text=True, timeout=60, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            return Probe(available=False, path=path, reason=f"{path} does not start: {error}", install=INSTALL)
        said = next((line.split() for line in ended.stdout.splitlines() if line.startswith("peclet-dem ")), [])
        if ended.returncode or len(said) != 4:
            last = (ended.stderr.strip().splitlines() or ["it says nothing"])[-1]
            return Probe(available=False, path=path, reason=f"{path} has no peclet-dem: {last}", install=INSTALL)
        _, version, space, digest = said
        if space not in ON_PROCESSORS:
            reason = f"peclet-dem of {path} is built for {space}; accepted are {', '.join(ON_PROCESSORS)}"
            return Probe(available=False, version=version, path=path, reason=reason, install=INSTALL)
        return Probe(available=True, version=version, path=path, facts={"execution space": space, "sha256": digest})

    def unsupported(self, scene: Scene) -> list[str]:
        """See `Engine.unsupported`; scenes under the Hertz-Mindlin law are held to what its soft spheres can do."""
        if not len(scene.bodies):
            return ["a scene without bodies"]
        rigid = isinstance(scene.law, Rigid)
        faults = _of_impulses(scene) if rigid else beyond_hertzian_spheres(scene, VARIANTS)
        if not rigid and any(scene.domain.periodic):
            faults.append("a periodic domain with soft spheres")
        if not rigid and surfaces(scene) > MOST_OF_SOFT_SPHERES:
            faults.append(f"{surfaces(scene)} walls: accepted are {MOST_OF_SOFT_SPHERES}, opposite faces counted once")
        if len(materials_of(scene)) > MOST_MATERIALS:
            faults.append(f"{len(materials_of(scene))} materials: accepted are {MOST_MATERIALS}")
        faults += ["kinematic bodies"] * any(c.kind == "kinematic" for c in scene.constraints)
        faults += ["the force on a wall, which is not told"] * bool(observed_walls(scene))
        return [*faults, *refused(scene)]

    def law(self, scene: Scene, settings: PecletDemSettings) -> str:
        """See `Engine.law`; soft spheres without friction or without dashpots follow the scene's law, tension kept."""
        if settings.solver == "impulse":
            return "" if isinstance(scene.law, Rigid) else "rigid contacts with restitution and Coulomb friction"
        own = []
        variant = scene.law.variant if isinstance(scene.law, HertzMindlin) else "reference"
        used = pairs_of(scene)
        if variant == "no-tension" and any(pair.restitution < 1 for pair in used):
            own.append("tension kept")
        if any(pair.friction > 0 and pair.restitution < 1 for pair in used):
            own.append("friction, dashpot included, bound by the normal spring's force")
        if features(scene).friction and variant == "rescaled":
            own.append("arm of friction reduced by half the overlap")
        return "; ".join(own)

    def defaults(self, scene: Scene, division: Division) -> dict[str, Any]:
        """See `Engine.defaults`: the solver of the scene's law; in the open division a tenth of the Rayleigh time.

        The impulse solver has a step of its own in both divisions, see `_step`.
        """
        found: dict[str, Any] = {
            "solver": "impulse" if isinstance(scene.law, Rigid) else "hertz",
            "skin": float(f"{0.3 * scene.extreme_radii()[0]:.6g}"),
            "grid": default_fine(scene),
        }
        if found["solver"] == "impulse":
            return {**found, "dt": _step(scene)}
        return {
            **found,
            "dt": scene.closed_step() if division == "closed" else scene.fitted_step(0.1 * scene.rayleigh_time()),
        }

    def settings(self, scene: Scene, division: Division, overrides: dict[str, str] | None = None) -> Any:
        """See `Engine.settings`; an impulse solver that is asked for brings its step with it.

        Raises:
            SettingsError: Also for soft spheres in a scene with a rigid law, and for sweeps of soft spheres.
        """
        asked = dict(overrides or {})
        if asked.get("solver") == "impulse":
            asked = {"dt": repr(_step(scene)), **asked}
        made: PecletDemSettings = super().settings(scene, division, asked)
        if made.solver == "impulse":
            faults = [] if isinstance(scene.law, Rigid) else _of_impulses(scene)  # the others `unsupported` tells
            if faults:
                raise SettingsError(f"{self.name}[solver]: impulse cannot do this scene: {'; '.join(faults)}")
            return made
        if isinstance(scene.law, Rigid):
            raise SettingsError(f"{self.name}[solver]: a rigid law has no stiffness; accepted is impulse, not hertz")
        for key in ("position_iterations", "velocity_iterations", "stabilization"):
            if key in asked:
                text = f"soft spheres have none; write solver=impulse,{key}={asked[key]}"
                raise SettingsError(f"{self.name}[{key}]: {text}")
        return made

    # ---- writing

    def write(self, scene: Scene, settings: PecletDemSettings, directory: Path) -> list[Phase]:
        """See `Engine.write`: simulate.py, bodies.txt, grids of walls, an empty directory for frames."""
        walls = grids(scene, settings.grid)
        write_bodies(scene, directory / "bodies.txt")
        write_grids(walls, directory)
        (directory / FRAMES).mkdir(exist_ok=True)
        wanted = _wanted() or "python"
        program = shutil.which(wanted) or wanted
        environment = {"OMP_NUM_THREADS": str(settings.threads), "OMP_PROC_BIND": "false"}
        shown = " ".join([*(f"{key}={value}" for key, value in environment.items()), "python", DECK])
        (directory / DECK).write_text(deck(scene, settings, walls, shown))
        return [Phase(name="simulate", command=(program, DECK), environment=environment)]

    # ---- what it computes

    def order(self, scene: Scene, settings: PecletDemSettings) -> float:
        """See `Engine.order`: symplectic Euler, and impulses at the ends of steps."""
        return 1.0

    def passes(self, steps: int, settings: Mapping[str, Any], counters: Mapping[str, float]) -> float:
        """See `Engine.passes`: with impulses as many sweeps as there are at most."""
        if settings["solver"] == "hertz":
            return float(steps)
        return float(steps) * (float(settings["position_iterations"]) + float(settings["velocity_iterations"]))

    def estimate(self, scene: Scene, settings: PecletDemSettings) -> float:
        """See `Engine.estimate`."""
        rate = PARTICLE_STEPS_PER_SECOND[settings.solver] * settings.threads
        return 3 + scene.duration / settings.dt * max(len(scene.bodies), 20) / rate


def _of_impulses(scene: Scene) -> list[str]:
    """What the impulse solver cannot do in a scene with a rigid law, one line each."""
    present = features(scene)
    faults = ["rolling friction"] * present.rolling_friction
    faults += ["particles that are no spheres"] * present.shapes
    if len(tangential_restitutions(scene)) > 1:
        faults.append("different tangential restitutions: accepted is one for all pairs")
    faults += ["a sink in a periodic domain"] * bool(scene.sinks and any(scene.domain.periodic))
    return faults


def _step(scene: Scene) -> float:
    """Step of the impulse solver [s]: TRAVEL diameters and SLOWEST_STEP sqrt(d/g), d the smallest diameter."""
    diameter, limits = 2 * scene.extreme_radii()[0], [scene.duration]
    speed = float(np.linalg.norm(scene.bodies.velocity, axis=1).max(initial=0))
    if speed:
        limits.append(TRAVEL * diameter / speed)
    if any(scene.gravity):
        limits.append(SLOWEST_STEP * math.sqrt(diameter / math.hypot(*scene.gravity)))
    return min(limits)


def _wanted() -> str | None:
    """The interpreter that has the package, or None where none is known."""
    if named := os.environ.get("DEMBENCH_PECLET_DEM"):
        return named
    try:
        found = importlib.util.find_spec("peclet.dem")
    except ModuleNotFoundError:
        return None
    return sys.executable if found else None
