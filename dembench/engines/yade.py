"""Yade: a script of its own in Python, walls, and reading what it wrote.

V. Smilauer et al., Yade documentation, 3rd ed. 2021, doi 10.5281/zenodo.5705394.

`Ip2_FrictMat_FrictMat_MindlinPhys` with restitution and angle of friction of each pair from match makers,
`Law2_ScGeom_MindlinPhys_Mindlin`, and velocities of half a step, which the script brings to the steps
(`yade_simulate.py.j2`).

Deviations from the reference law, found in its sources, in two-body runs, and told by `law`:

- The normal force is never below 0. The dashpots make up for it by the fit of Thornton et al. 2013, doi
  10.1016/j.powtec.2012.08.012, also across the normal: e = .5 gives .500, .9 gives .8999, .98 gives .9724.
- The shear force is what is remembered; it grows by its stiffness times the slip of a step. It is turned with the
  contact, spin about the normal included.

The scene's variant `no-tension` gets its own dashpots instead (.5503 for e = .5), as damping ratios.

Chosen so that nothing else differs: `avoidGranularRatcheting=False`, which takes the slip at the point where the force
acts, the radius less half the overlap; `hertzian=True`, without which the radius at a wall would be half the body's;
triangles for planes (a `wall` has the radius less the whole overlap as lever).

Among the named laws of the passport it is `thornton`, at a distance of .004; that to the scene's law is .24.

Restitution of two equal spheres (e = .5, +-.5 m/s, dt = 1 us): .500017 for E = 1e7, .502119 for E = 1e9.

A cell of the program is periodic along all axes: along those that are not periodic in the scene it is four times as
long as the domain.

Runs write no checkpoints: one that was interrupted begins anew.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
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
from dembench.engines.round_walls import FEWEST_SIDES, sides_for
from dembench.engines.scene_queries import beyond_hertzian_spheres, clipped
from dembench.engines.script_runs import DECK, ScriptEngine, write_bodies
from dembench.engines.yade_deck import deck, write_triangles
from dembench.engines.yade_walls import built, refused
from dembench.scene import HertzMindlin, Scene, features
from dembench.scene.base import Positive

INSTALL = "apt-get install yade, or name a program: DEMBENCH_YADE=PROGRAM"
PARTICLE_STEPS_PER_SECOND = 5.7e5
"""Throughput of one thread on which run-time estimates are based."""


class YadeSettings(EngineSettings):
    """Settings of a Yade run.

    Attributes:
        threads: OpenMP threads.
        skin: Distance by which the boxes of bodies are larger than they: pairs are not sought in every step [m].
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


class Yade(ScriptEngine):
    """Yade."""

    name: ClassVar[str] = "yade"
    title: ClassVar[str] = "Yade: soft-sphere, double precision, threads"
    colour: ClassVar[str] = "#6b8e23"
    settings_type: ClassVar[type[EngineSettings]] = YadeSettings
    cores_setting: ClassVar[str | None] = "threads"

    def probe(self) -> Probe:
        """See `Engine.probe`. The program is that of DEMBENCH_YADE or `yade` on PATH."""
        wanted = _wanted()
        path = shutil.which(wanted)
        if path is None:
            return Probe(available=False, reason=f"no program '{wanted}' was found", install=INSTALL)
        try:
            said = subprocess.run((path, "--version"), capture_output=True, text=True, timeout=30, check=False).stdout
            digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
        except (OSError, subprocess.TimeoutExpired) as error:
            return Probe(available=False, path=path, reason=f"{path} does not start: {error}", install=INSTALL)
        found = re.search(r"^Yade version: *(\S+)", said, re.M)
        if found is None:
            return Probe(available=False, path=path, reason=f"{path} prints no version of Yade", install=INSTALL)
        return Probe(available=True, version=found[1], path=path, facts={"sha256": digest})

    def unsupported(self, scene: Scene) -> list[str]:
        """See `Engine.unsupported`."""
        if not len(scene.bodies):
            return ["a scene without bodies"]
        faults = beyond_hertzian_spheres(scene, ("reference", "rescaled", "no-tension"))
        return [*faults, *_narrow(scene), *refused(scene)]

    def law(self, scene: Scene, settings: YadeSettings) -> str:
        """See `Engine.law`; elastic contacts without friction are those of every variant of the scene's law."""
        own = []
        if not clipped(scene) and any(pair.restitution < 1 for pair in scene.pair_laws):
            own.append("tension clipped and damping by Thornton's fit")
        if features(scene).tangential_history and isinstance(scene.law, HertzMindlin):
            own.append("the shear force remembered instead of its way")
            if scene.law.variant == "rescaled":
                own.append("arm of friction reduced by half the overlap")
        if names := meshed(scene):
            own.append(f"{', '.join(names)} of triangles with contacts of their own")
        return "; ".join(own)

    def defaults(self, scene: Scene, division: Division) -> dict[str, Any]:
        """See `Engine.defaults`: in the open division a tenth of the Rayleigh time."""
        step = scene.closed_step() if division == "closed" else scene.fitted_step(0.1 * scene.rayleigh_time())
        return {"dt": step, "skin": _skin(scene), "segments": sides_for(scene)}

    # ---- writing

    def write(self, scene: Scene, settings: YadeSettings, directory: Path) -> list[Phase]:
        """See `Engine.write`: simulate.py, bodies.txt, triangles of walls, an empty directory for frames."""
        write_bodies(scene, directory / "bodies.txt")
        write_triangles(built(scene, settings.segments), directory)
        (directory / FRAMES).mkdir(exist_ok=True)
        program = shutil.which(_wanted()) or _wanted()
        command = [program, "-n", "-x", f"-j{settings.threads}", DECK]
        shown = " ".join(Path(part).name if os.sep in part else part for part in command)
        (directory / DECK).write_text(deck(scene, settings, shown))
        return [Phase(name="simulate", command=tuple(command))]

    # ---- what it computes

    def order(self, scene: Scene, settings: YadeSettings) -> float:
        """See `Engine.order`."""
        return order_of_contacts(scene, lagging=True)

    def estimate(self, scene: Scene, settings: YadeSettings) -> float:
        """See `Engine.estimate`."""
        steps = scene.duration / settings.dt
        return 3 + steps * len(scene.bodies) / PARTICLE_STEPS_PER_SECOND / settings.threads


def _narrow(scene: Scene) -> list[str]:
    """Periodic axes on which a body's box is longer than half the period, one line each."""
    least = 4 * (scene.extreme_radii()[1] + _skin(scene))
    lengths = np.subtract(scene.domain.upper, scene.domain.lower)
    return [
        f"a period of {length:g} m along {axis}: at least {least:g} m are accepted, four radii and skins"
        for axis, length, periodic in zip("xyz", lengths, scene.domain.periodic, strict=True)
        if periodic and length < least
    ]


def _skin(scene: Scene) -> float:
    return float(f"{0.5 * scene.extreme_radii()[0]:.6g}")


def _wanted() -> str:
    return os.environ.get("DEMBENCH_YADE", "yade")
