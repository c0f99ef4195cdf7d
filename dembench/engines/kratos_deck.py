"""The deck of Kratos: its parameters, and the script that drives the solver; `kratos_model.py` has the rest."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from dembench.engines.kratos_model import bodies_part, damping_of, materials, walls_part
from dembench.engines.kratos_walls import Built, built
from dembench.engines.scene_queries import clipped, every_of, observed_walls, steps_of
from dembench.engines.script_runs import DECK, schedule
from dembench.scene import Region, Scene, features

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
    template = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True).from_string(
        files("dembench.engines").joinpath("kratos_simulate.py.j2").read_text()
    )
    (directory / DECK).write_text(template.render(_values(scene, settings, walls), command=command))


def _values(scene: Scene, settings: Any, walls: list[Built]) -> dict[str, Any]:
    steps = steps_of(np.array([scene.duration]), settings.dt)[0]
    frames, tracks = (steps_of(times, settings.dt) for times in (scene.frame_times(), scene.track_times()))
    tracked = list(scene.tracked_bodies())
    if not tracked:
        tracks = []
    return {
        "scene": scene,
        "count": len(scene.bodies),
        "dt": settings.dt,
        "steps": steps,
        "skin": settings.skin,
        "damping": damping_of(scene) if clipped(scene) else {},
        "periodic": [axis for axis in range(3) if scene.domain.periodic[axis]],
        "walls": walls,
        "moving": any(wall.moves for wall in walls),
        "carried": [wall for wall in walls if wall.carries],
        "observed": observed_walls(scene),
        "sinks": [_within(sink.region) for sink in scene.sinks],
        "removal": max(1, round(settings.sink_interval / settings.dt)),
        "frames": schedule(frames),
        "tracks": schedule(tracks),
        "tracked": tracked,
        "every": every_of(sorted({*frames, *tracks}), steps),
    }


def _within(region: Region) -> str:
    """Which of the arrays x, y, z lie in a region, as a Python expression."""
    terms = [
        f"({bound!r} <= {axis})" if side == 0 else f"({axis} <= {bound!r})"
        for side, bounds in enumerate((region.lower, region.upper))
        for axis, bound in zip("xyz", bounds, strict=True)
        if bound is not None
    ]
    return f"({' & '.join(terms) or 'np.isfinite(x)'})"


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
