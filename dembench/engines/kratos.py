"""Kratos DEM: model parts, materials and parameters, a script that drives the solver, and reading what it wrote.

P. Dadvand, R. Rossi, E. Onate, Arch. Comput. Methods Eng. 17, 2010, doi 10.1007/s11831-010-9045-2.

`DEM_D_Hertz_viscous_Coulomb` with restitution and friction of each pair as material relations, and velocity Verlet for
motion and spin, whose forces see the velocities of half a step before.

Deviations from the reference law, found in its sources, in runs of one contact, and told by `law`:

- The normal force is never below 0. The dashpots make up for it by the fit of Thornton et al. 2013, doi
  10.1016/j.powtec.2012.08.012, also across the normal. Restitution beyond .999 is taken as 1 and refused here.
- The shear force is what is remembered: it grows by its stiffness times the slip of a step, and where the overlap
  becomes less it does so as the root of the overlap. It is turned with the normal, without the spin about it.
- Spring and dashpot of the shear are bounded together. Beyond the bound the dashpot gives way first, unless it acts
  against the spring and is the larger of the two: then the spring stays as it is.
- Levers at walls are the radius less the whole overlap; between bodies the softer of them is the one that is indented.

The scene's variant `no-tension` gets its own dashpots instead (.5503 for e = .5): the script sets their ratios.

Among the named laws of the passport it is `thornton-sum`, at a distance of .003; that to the scene's law is .174.

Restitution of two equal spheres (e = .5, +-.5 m/s, dt = 1 us): .500019 for E = 1e7, .502142 for E = 1e9.

Neighbours: the program seeks them every so many steps, by default 50, and finds contacts late where bodies have moved
by more than its `SearchTolerance` since then. The script lets it seek whenever two bodies may have come nearer by that
(`skin`), so that no contact is late, and a step takes half to a third of the time that it takes with a search in each.
What is left of a shear force when two bodies part is met again when they touch before the next search: in bounces of a
grain that changed its velocity by 1e-7 of it.

Bodies that are held have masses for the program's dashpots; they are made 1e12 times as dense (`kratos_model.py`).

A cell of the program is periodic along all axes: along those that are not periodic in the scene it is four times as
long as the domain.

Runs write no checkpoints: one that was interrupted begins anew.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field

from dembench.engines.base import (
    FRAMES,
    Division,
    EngineSettings,
    Phase,
    Probe,
    order_of_contacts,
)
from dembench.engines.flat_walls import meshed
from dembench.engines.kratos_deck import write_deck
from dembench.engines.kratos_walls import refused
from dembench.engines.round_walls import FEWEST_SIDES, sides_for
from dembench.engines.scene_queries import beyond_hertzian_spheres, clipped
from dembench.engines.script_runs import DECK, ScriptEngine
from dembench.scene import Scene, features
from dembench.scene.base import Positive

INSTALL = "pip install 'dembench[kratos]', or name an interpreter that has KratosDEMApplication: DEMBENCH_KRATOS=PYTHON"
PARTICLE_STEPS_PER_SECOND = 3e5
"""Throughput of one thread on which run-time estimates are based."""
LEAST, MOST = 1e-3, 0.999
"""Bounds of the restitution in the program; above them it has no dashpots."""
ASKED = """
import json
from importlib import metadata
import numpy
found = metadata.distribution("KratosDEMApplication")
(library,) = (str(found.locate_file(f)) for f in found.files if "KratosDEMCore" in f.name)
print(json.dumps([found.version, metadata.version("KratosMultiphysics"), library]))
"""
"""What an interpreter is asked: the versions of the program and the file of its library."""


class KratosSettings(EngineSettings):
    """Settings of a Kratos run.

    Attributes:
        threads: OpenMP threads.
        skin: Distance within which bodies are neighbours; they are sought anew before one may have come by it [m].
        segments: Sides of round walls, which are polygons.
        sink_interval: Simulated time between two removals of the bodies in sinks [s].
    """

    threads: Annotated[int, Field(ge=1)] = 1
    skin: Positive
    segments: Annotated[int, Field(ge=FEWEST_SIDES)]
    sink_interval: Positive = 5e-3

    def cores(self) -> int:
        """See `EngineSettings.cores`."""
        return self.threads


class Kratos(ScriptEngine):
    """Kratos DEM."""

    name: ClassVar[str] = "kratos"
    title: ClassVar[str] = "Kratos DEM: soft-sphere, double precision, threads"
    colour: ClassVar[str] = "#138d90"
    settings_type: ClassVar[type[EngineSettings]] = KratosSettings
    cores_setting: ClassVar[str | None] = "threads"

    def probe(self) -> Probe:
        """See `Engine.probe`. The interpreter is that of DEMBENCH_KRATOS, or this one where it has the program."""
        wanted = os.environ.get("DEMBENCH_KRATOS")
        if wanted is None and find_spec("KratosMultiphysics") is None:
            return Probe(available=False, reason="no module 'KratosMultiphysics' was found", install=INSTALL)
        path = shutil.which(wanted or sys.executable)
        if path is None:
            return Probe(available=False, reason=f"no interpreter '{wanted}' was found", install=INSTALL)
        try:
            said = subprocess.run((path, "-c", ASKED), capture_output=True, text=True, timeout=60, check=False)
            version, core, library = json.loads(said.stdout)
            digest = hashlib.sha256(Path(library).read_bytes()).hexdigest()
        except (OSError, subprocess.TimeoutExpired) as error:
            return Probe(available=False, path=path, reason=f"{path} does not start: {error}", install=INSTALL)
        except ValueError:
            last = (said.stderr.strip().splitlines() or ["it said nothing"])[-1]
            lacking = f"{path} has no KratosDEMApplication: {last}"
            return Probe(available=False, path=path, reason=lacking, install=INSTALL)
        return Probe(available=True, version=version, path=path, facts={"KratosMultiphysics": core, "sha256": digest})

    def unsupported(self, scene: Scene) -> list[str]:
        """See `Engine.unsupported`."""
        if not len(scene.bodies):
            return ["a scene without bodies"]
        faults = beyond_hertzian_spheres(scene, ("reference", "rescaled", "no-tension"), LEAST)
        faults += [
            f"restitution {pair.restitution!r} of {pair.a}-{pair.b}: accepted are at most {MOST}, and 1"
            for pair in scene.pair_laws
            if MOST < pair.restitution < 1 and not clipped(scene)
        ]
        return [*faults, *refused(scene)]

    def law(self, scene: Scene, settings: KratosSettings) -> str:
        """See `Engine.law`; elastic contacts without friction are those of every variant of the scene's law."""
        own = []
        if not clipped(scene) and any(pair.restitution < 1 for pair in scene.pair_laws):
            own.append("tension clipped and damping by Thornton's fit")
        if features(scene).tangential_history:
            own.append("the shear force remembered, less in unloading, and bounded together with its dashpot")
            own += ["levers at walls less the whole overlap"] * bool(scene.walls)
        if names := meshed(scene):
            own.append(f"{', '.join(names)} of triangles, shear forces do not pass from one to the next")
        return "; ".join(own)

    def defaults(self, scene: Scene, division: Division) -> dict[str, Any]:
        """See `Engine.defaults`: in the open division a tenth of the Rayleigh time."""
        step = scene.closed_step() if division == "closed" else scene.fitted_step(0.1 * scene.rayleigh_time())
        skin = float(f"{0.2 * scene.extreme_radii()[0]:.6g}")
        return {"dt": step, "skin": skin, "segments": sides_for(scene)}

    # ---- writing

    def write(self, scene: Scene, settings: KratosSettings, directory: Path) -> list[Phase]:
        """See `Engine.write`: simulate.py, the model's parts, materials, parameters, an empty directory for frames."""
        (directory / FRAMES).mkdir(exist_ok=True)
        wanted = os.environ.get("DEMBENCH_KRATOS", sys.executable)
        write_deck(scene, settings, f"OMP_NUM_THREADS={settings.threads} python {DECK}", directory)
        command = (shutil.which(wanted) or wanted, DECK)
        return [Phase(name="simulate", command=command, environment={"OMP_NUM_THREADS": str(settings.threads)})]

    # ---- what it computes

    def order(self, scene: Scene, settings: KratosSettings) -> float:
        """See `Engine.order`."""
        return order_of_contacts(scene, lagging=True)

    def estimate(self, scene: Scene, settings: KratosSettings) -> float:
        """See `Engine.estimate`."""
        steps = scene.duration / settings.dt
        return 3 + steps * len(scene.bodies) / PARTICLE_STEPS_PER_SECOND / settings.threads
