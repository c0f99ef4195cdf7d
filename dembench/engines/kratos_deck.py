"""The deck of Kratos: its parameters, and the script that drives the solver; `kratos_model.py` has the rest."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from dembench.engines.kratos_model import bodies_part, damping_of, materials, walls_part
from dembench.engines.kratos_walls import Built, built
from dembench.engines.scene_queries import clipped, observed_walls
from dembench.engines.script_runs import DECK, rendered, sampling, within
from dembench.scene import Scene, features

BODIES, WALLS = "sceneDEM.mdpa", "sceneDEM_FEM_boundary.mdpa"
MATERIALS, PARAMETERS = "materials.json", "parameters.json"
"""Files of the deck; the program finds those of the model by the problem's name `scene`."""
ROOM = 4.0
"""Length of the periodic cell along an axis that is not periodic, in lengths of the domain: no image is met there."""


def write_deck(scene: Scene, settings: Any, command: str, directory: Path) -> None:
    """Writes all files of a deck.

    Args:
        scene: The scene.
        settings: KratosSettings of the run.
        command: Command line of the run, for the reader of the script.
        directory: Where they go.
    """
    walls = built(scene, settings.segments)
    (directory / BODIES).write_text(bodies_part(scene))
    if walls:
        (directory / WALLS).write_text(walls_part(walls))
    (directory / MATERIALS).write_text(_json(materials(scene, walls)))
    (directory / PARAMETERS).write_text(_json(_parameters(scene, settings)))
    script = rendered("kratos_simulate.py.j2", _values(scene, settings, walls), command=command)
    (directory / DECK).write_text(script)


def _values(scene: Scene, settings: Any, walls: list[Built]) -> dict[str, Any]:
    return {
        "scene": scene,
        "count": len(scene.bodies),
        "dt": settings.dt,
        "skin": settings.skin,
        "damping": damping_of(scene) if clipped(scene) else {},
        "periodic": [axis for axis in range(3) if scene.domain.periodic[axis]],
        "walls": walls,
        "moving": any(wall.moves for wall in walls),
        "carried": [wall for wall in walls if wall.carries],
        "observed": observed_walls(scene),
        "sinks": [within(sink.region) for sink in scene.sinks],
        "removal": max(1, round(settings.sink_interval / settings.dt)),
        **sampling(scene, settings.dt),
    }


# ---- parameters


def _parameters(scene: Scene, settings: Any) -> dict[str, Any]:
    given: dict[str, Any] = {
        "problem_name": "scene",
        "MaxTimeStep": settings.dt,
        "FinalTime": scene.duration,
        **{f"Gravity{axis}": g for axis, g in zip("XYZ", scene.gravity, strict=True)},
        "TranslationalIntegrationScheme": "Velocity_Verlet",
        "RotationalIntegrationScheme": "Direct_Integration",
        "RotationOption": turning(scene),
        "NeighbourSearchFrequency": 2**30,
        "SearchTolerance": settings.skin,
        "search_tolerance_against_walls": settings.skin,
        "do_print_results_option": False,
        "dem_inlet_option": False,
        "solver_settings": {
            "strategy": "sphere_strategy",
            "model_import_settings": {"input_type": "mdpa", "input_filename": "scene"},
            "material_import_settings": {"materials_filename": MATERIALS},
        },
    }
    if any(scene.domain.periodic):
        given["PeriodicDomainOption"] = given["BoundingBoxOption"] = True
        for side, corner in zip(("Min", "Max"), _cell(scene), strict=True):
            given.update({f"BoundingBox{side}{axis}": float(c) for axis, c in zip("XYZ", corner, strict=True)})
    return given


def _cell(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner of the periodic cell [m], which leaves room along axes that are not periodic."""
    lower, upper = np.array(scene.domain.lower), np.array(scene.domain.upper)
    room = np.where(scene.domain.periodic, 0.0, (ROOM - 1) / 2 * (upper - lower))
    return lower - room, upper + room


def turning(scene: Scene) -> bool:
    """Whether spins are computed: without friction and without spins at the start there are none."""
    return features(scene).friction or bool(scene.bodies.angular_velocity.any())


def _json(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=2) + "\n"
