"""The model of a Kratos deck: bodies and walls as model parts, and what they are made of.

A body that is held in its place or on its way has a mass all the same, which the program's dashpots take for it: a
grain that hit a fixed one came back with .60 of its speed for e = .5. Such bodies are made of materials of their own,
`HEAVY` times as dense.
"""

from __future__ import annotations

import math
from io import StringIO
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from dembench.engines.kratos_walls import Built
from dembench.engines.scene_queries import materials_of, pairs_of
from dembench.scene import Material, PairLaw, Scene

LAW = "DEM_D_Hertz_viscous_Coulomb"
HELD = ("fixed", "kinematic")
"""Kinds of constraints that leave a body its velocities, of which it has none where it is fixed."""
HEAVY = 1e12
"""Density of bodies that are held, in that of their material."""
FOREVER = 1e12
"""A time that no run reaches [s]."""
SAME = 1e-12
"""Distance of corners that are one, in the largest coordinate of a wall."""


class Kind(NamedTuple):
    """A material as the program knows it.

    Attributes:
        number: Its number, from 1 on.
        name: Its name, also of the part of the model that is made of it.
        material: The scene's material.
        density: [kg/m^3].
        bodies: Numbers of the bodies that are made of it, from 1 on.
    """

    number: int
    name: str
    material: Material
    density: float
    bodies: np.ndarray


def kinds_of(scene: Scene) -> list[Kind]:
    """The materials in use, after them those of bodies that are held."""
    of_bodies = np.array([s.material for s in scene.species])[scene.bodies.species]
    held = _bound(scene, *HELD)
    found: list[Kind] = []
    for prefix, factor, which in (("", 1.0, ~held), ("held-", HEAVY, held)):
        for material in materials_of(scene):
            bodies = 1 + np.flatnonzero((of_bodies == material.name) & which)
            if len(bodies) or not prefix:
                name, density = prefix + material.name, factor * material.density
                found.append(Kind(len(found) + 1, name, material, density, bodies))
    return found


def _bound(scene: Scene, *kinds: str) -> np.ndarray:
    """Which bodies have a constraint of some kinds."""
    bound = np.zeros(len(scene.bodies), dtype=bool)
    for constraint in scene.constraints:
        if constraint.kind in kinds:
            bound[list(constraint.bodies)] = True
    return bound


def _relations(scene: Scene) -> list[tuple[PairLaw, Kind, Kind]]:
    """The law of each pair of materials, those of bodies that are held among them."""
    kinds = kinds_of(scene)
    return [
        (pair, a, b)
        for pair in pairs_of(scene)
        for a, b in product(kinds, kinds)
        if (a.material.name, b.material.name) == (pair.a, pair.b) and (pair.a != pair.b or a.number <= b.number)
    ]


def damping_of(scene: Scene) -> dict[tuple[int, int], float]:
    """Ratios sqrt(5/6) b of the scene's own dashpots, by the numbers of both materials, in both orders."""
    found = {}
    for pair, a, b in _relations(scene):
        found[a.number, b.number] = found[b.number, a.number] = math.sqrt(5 / 6) * pair.damping_ratio()
    return found


def materials(scene: Scene, walls: list[Built]) -> dict[str, Any]:
    """What the program reads of materials, of pairs of them, and of which part of the model is made of which."""
    kinds = kinds_of(scene)
    parts = [(f"SpheresPart.{kind.name}", kind.name) for kind in kinds if len(kind.bodies)]
    parts += [(f"RigidFacePart.{wall.name}", wall.material) for wall in walls]
    return {
        "materials": [
            {
                "material_name": kind.name,
                "material_id": kind.number,
                "Variables": {
                    "PARTICLE_DENSITY": kind.density,
                    "YOUNG_MODULUS": kind.material.young,
                    "POISSON_RATIO": kind.material.poisson,
                },
            }
            for kind in kinds
        ],
        "material_relations": [
            {
                "material_names_list": [a.name, b.name],
                "material_ids_list": [a.number, b.number],
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
            for pair, a, b in _relations(scene)
        ],
        "material_assignation_table": [list(part) for part in parts],
    }


# ---- model parts


def bodies_part(scene: Scene) -> str:
    """The initial state of a scene, every number to its last bit; fixed bodies do not move."""
    bodies, count = scene.bodies, len(scene.bodies)
    numbers = np.arange(1, count + 1)
    held, still, locked = (_bound(scene, *kinds) for kinds in (HELD, ("fixed",), (*HELD, "rotation-locked")))
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
    for kind in kinds_of(scene):
        if len(kind.bodies):
            _part(text, kind.name, kind.bodies, "Elements", kind.bodies)
    return text.getvalue()


def walls_part(walls: list[Built]) -> str:
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
