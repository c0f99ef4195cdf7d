"""The deck of peclet-dem: everything that the script's template needs."""

from __future__ import annotations

from typing import Any

import numpy as np

from dembench.engines.peclet_dem_walls import Grid
from dembench.engines.scene_queries import materials_of, pairs_of, steps_of
from dembench.engines.script_runs import IDS_PER_LINE, rendered, sampling, within
from dembench.scene import Scene

BEAT = 4e5
"""Particle-steps of soft spheres between two looks at the state; those of impulses are a tenth of it."""
WEIGHTLESS = (0.0, 0.0, -1e-12)
"""Gravity of scenes without it for the impulse solver, which has another method for none [m/s^2]."""
FEW = 20
"""Bodies below which a step takes no less time."""


def deck(scene: Scene, settings: Any, walls: list[Grid], command: str) -> str:
    """The script of a run.

    Args:
        scene: The scene.
        settings: PecletDemSettings of the run.
        walls: The grids of its walls.
        command: Command line of the run, for the reader of the script.
    """
    return rendered("peclet_dem_simulate.py.j2", _values(scene, settings), walls=walls, command=command)


def tangential_restitutions(scene: Scene) -> set[float]:
    """The different tangential restitutions of the pairs in use [-]."""
    return {pair.tangential_restitution or 0.0 for pair in pairs_of(scene)}


def _values(scene: Scene, settings: Any) -> dict[str, Any]:
    materials = materials_of(scene)
    number = {m.name: k for k, m in enumerate(materials)}
    soft = settings.solver == "hertz"
    steps = steps_of(np.array([scene.duration]), settings.dt)[0]
    beat = BEAT * (1 if soft else 0.1) / max(len(scene.bodies), FEW)
    held = {
        kind: sorted({body for c in scene.constraints if c.kind in kinds for body in c.bodies})
        for kind, kinds in {"fixed": ("fixed",), "unturned": ("fixed", "rotation-locked")}.items()
    }
    return {
        "scene": scene,
        "settings": settings,
        "soft": soft,
        "count": len(scene.bodies),
        "gravity": scene.gravity if soft or any(scene.gravity) else WEIGHTLESS,
        "beat": min(max(1, round(beat)), steps),
        "smallest": scene.extreme_radii()[0],
        "materials": materials,
        "number": number,
        "densities": [m.density for m in materials],
        "pairs": pairs_of(scene),
        "tangential": max(tangential_restitutions(scene), key=abs, default=0.0),
        "held": {
            kind: [bodies[k : k + IDS_PER_LINE] for k in range(0, len(bodies), IDS_PER_LINE)]
            for kind, bodies in held.items()
        },
        "wrapped": [axis for axis in range(3) if scene.domain.periodic[axis]],
        "kept": [axis for axis in range(3) if not scene.domain.periodic[axis]],
        "sinks": [within(sink.region) for sink in scene.sinks],
        "removal": max(1, round(settings.sink_interval / settings.dt)),
        **sampling(scene, settings.dt),
    }
