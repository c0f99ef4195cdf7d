"""The deck of Kratos: bodies and walls as model parts, materials, parameters, and the script that runs it."""

from __future__ import annotations

import json
from importlib.resources import files
from io import StringIO
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from dembench.engines.kratos_walls import Built, built
from dembench.engines.scene_queries import (
    clipped,
    damping_ratio,
    every_of,
    materials_of,
    observed_walls,
    pairs_of,
    steps_of,
)
from dembench.engines.script_runs import DECK, schedule
from dembench.scene import Region, Scene, features

LAW = "DEM_D_Hertz_viscous_Coulomb"
BODIES, WALLS, MATERIALS, PARAMETERS = (
    "sceneDEM.mdpa",
    "sceneDEM_FEM_boundary.mdpa",
    "materials.json",
    "parameters.json",
)
"""Files of the deck; the program finds those of the model by the problem's name `scene`."""
MOVED = ("fixed", "kinematic")
"""Kinds of constraints that leave a body its velocities, of which it has none where it is fixed."""
ROOM = 4.0
"""Length of the periodic cell along an axis that is not periodic, in lengths of the domain: no image is met there."""
SAME = 1e-12
"""Distance of corners that are one, in the largest coordinate of a wall."""
FOREVER = 1e12
"""A time that no run reaches [s]."""


def write_deck(scene: Scene, settings: Any, command: str, directory: Path) -> None:
    """Writes all files of a deck.

    Args:
        scene: The scene.
        settings: KratosSettings of the run.
        command: Command line of the run, for the reader of the script.
        directory: Where they go.
    """
    walls = built(scene, settings.segments)
    (directory / BODIES).write_text(_bodies(scene))
    if walls:
        (directory / WALLS).write_text(_walls(walls))
    (directory / MATERIALS).write_text(_json(_materials(scene, walls)))
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
        "damping": _damping(scene) if clipped(scene) else {},
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


# ---- materials and parameters


def _damping(scene: Scene) -> dict[tuple[int, int], float]:
    """Ratio sqrt(5/6) b of the scene's own dashpots, by the numbers of both materials, in both orders."""
    found = {}
    numbers = _numbers(scene)
    for pair in pairs_of(scene):
        both = numbers[pair.a], numbers[pair.b]
        found[both] = found[both[::-1]] = damping_ratio(pair.restitution)
    return found


def _numbers(scene: Scene) -> dict[str, int]:
    """Numbers of the materials, from 1 on."""
    return {m.name: number for number, m in enumerate(materials_of(scene), 1)}


def _materials(scene: Scene, walls: list[Built]) -> dict[str, Any]:
    """What the program reads of materials, of pairs of them, and of which part of the model is made of which."""
    numbers = _numbers(scene)
    parts = [(f"SpheresPart.{name}", name) for name in _by_material(scene)]
    parts += [(f"RigidFacePart.{wall.name}", wall.material) for wall in walls]
    return {
        "materials": [
            {
                "material_name": m.name,
                "material_id": numbers[m.name],
                "Variables": {"PARTICLE_DENSITY": m.density, "YOUNG_MODULUS": m.young, "POISSON_RATIO": m.poisson},
            }
            for m in materials_of(scene)
        ],
        "material_relations": [
            {
                "material_names_list": [pair.a, pair.b],
                "material_ids_list": [numbers[pair.a], numbers[pair.b]],
                "Variables": {
                    "COEFFICIENT_OF_RESTITUTION": pair.restitution,
                    "STATIC_FRICTION": pair.friction,
                    "DYNAMIC_FRICTION": pair.friction,
                    "FRICTION_DECAY": 0.0,
                    "ROLLING_FRICTION": 0.0,
                    "ROLLING_FRICTION_WITH_WALLS": 0.0,
                    "DEM_ROLLING_FRICTION_MODEL_NAME": "DEMRollingFrictionModelBounded",
                    "DEM_DISCONTINUUM_CONSTITUTIVE_LAW_NAME": LAW,
                },
            }
            for pair in pairs_of(scene)
        ],
        "material_assignation_table": [list(part) for part in parts],
    }


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


# ---- model parts


def _by_material(scene: Scene) -> dict[str, np.ndarray]:
    """Numbers of the bodies of each material, from 1 on."""
    materials = np.array([s.material for s in scene.species])[scene.bodies.species]
    names = [m.name for m in materials_of(scene)]
    found = {name: 1 + np.flatnonzero(materials == name) for name in names}
    return {name: bodies for name, bodies in found.items() if len(bodies)}


def _bodies(scene: Scene) -> str:
    """The initial state of a scene, every number to its last bit; fixed bodies do not move."""
    bodies, count = scene.bodies, len(scene.bodies)
    numbers = np.arange(1, count + 1)
    held, still, locked = (
        np.isin(numbers - 1, [b for c in scene.constraints if c.kind in kinds for b in c.bodies])
        for kinds in (MOVED, ("fixed",), (*MOVED, "rotation-locked"))
    )
    text = StringIO()
    text.write("Begin Properties 0\nEnd Properties\n")
    _block(text, "Nodes", "%d" + 3 * " %.17g", numbers, bodies.position)
    _block(text, "Elements SphericParticle3D", "%d 0 %d", numbers, numbers)
    _block(text, "NodalData RADIUS", "%d 0 %.17g", numbers, scene.radii())
    for name, values, kept in (
        ("VELOCITY", bodies.velocity, held),
        ("ANGULAR_VELOCITY", bodies.angular_velocity, locked),
    ):
        for axis, column in zip("XYZ", np.where(still[:, None], 0, values).T, strict=True):
            told = kept | (column != 0)
            if told.any():
                _block(text, f"NodalData {name}_{axis}", "%d %d %.17g", numbers[told], kept[told], column[told])
    for name, members in _by_material(scene).items():
        _part(text, name, members, "Elements", members)
    return text.getvalue()


def _walls(walls: list[Built]) -> str:
    """The triangles of walls, those of each wall with corners of their own."""
    nodes: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    corners_before = faces_before = 0
    parts = StringIO()
    for wall in walls:
        corners, corner_of = _shared(wall.triangles)
        nodes.append(corners)
        faces.append(1 + corners_before + corner_of)
        node_numbers = 1 + corners_before + np.arange(len(corners))
        face_numbers = 1 + faces_before + np.arange(len(wall.triangles))
        _part(parts, wall.name, node_numbers, "Conditions", face_numbers, _motion(wall) if wall.moves else "")
        corners_before, faces_before = corners_before + len(corners), faces_before + len(face_numbers)
    text = StringIO()
    text.write("Begin Properties 0\nEnd Properties\n")
    _block(text, "Nodes", "%d" + 3 * " %.17g", 1 + np.arange(corners_before), np.concatenate(nodes))
    _block(text, "Conditions RigidFace3D3N", "%d 0 %d %d %d", 1 + np.arange(faces_before), np.concatenate(faces))
    return text.getvalue() + parts.getvalue()


def _shared(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners of triangles [m], each once, shape (c, 3), and the numbers of those of each triangle, from 0 on.

    Corners are one where they differ by rounding only, as at the seam of a round wall.
    """
    points = triangles.reshape(-1, 3)
    grid = np.round(points / (SAME * np.abs(points).max()))
    _, first, corner_of = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    return points[first], corner_of.reshape(-1, 3)


def _motion(wall: Built) -> str:
    """The motion of a wall that changes its place, as data of its part of the model."""
    lines = [
        "RIGID_BODY_MOTION 1",
        "FREE_BODY_MOTION 0",
        "FIXED_MESH_OPTION 0",
        f"LINEAR_VELOCITY [3] ({_list(wall.velocity)})",
        f"VELOCITY_PERIOD {wall.period!r}",
        f"ANGULAR_VELOCITY [3] ({_list(wall.spin)})",
        "ANGULAR_VELOCITY_PERIOD 0.0",
        f"ROTATION_CENTER [3] ({_list(wall.centre)})",
        "VELOCITY_START_TIME 0.0",
        f"VELOCITY_STOP_TIME {FOREVER!r}",
        "ANGULAR_VELOCITY_START_TIME 0.0",
        f"ANGULAR_VELOCITY_STOP_TIME {FOREVER!r}",
    ]
    return "".join(f"    {line}\n" for line in lines)


def _list(values: tuple[float, ...]) -> str:
    return ", ".join(repr(float(value)) for value in values)


def _block(text: StringIO, title: str, form: str, *columns: np.ndarray) -> None:
    """A block with one line per row of the columns."""
    text.write(f"Begin {title}\n")
    np.savetxt(text, np.column_stack(columns), fmt=form)
    text.write(f"End {title.split()[0]}\n")


def _part(text: StringIO, name: str, nodes: np.ndarray, kind: str, members: np.ndarray, data: str = "") -> None:
    """A part of a model: its nodes, and its elements or conditions."""
    text.write(f"Begin SubModelPart {name}\n")
    if data:
        text.write(f"  Begin SubModelPartData\n{data}  End SubModelPartData\n")
    for what, numbers in (("Nodes", nodes), (kind, members)):
        text.write(f"  Begin SubModelPart{what}\n")
        np.savetxt(text, numbers, fmt="    %d")
        text.write(f"  End SubModelPart{what}\n")
    text.write("End SubModelPart\n")
