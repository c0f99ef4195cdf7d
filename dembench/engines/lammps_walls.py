"""Walls and contact constants in LAMMPS: planes and cylinders as primitives or regions, one fix for each kind of grain.

A region acts on bodies whose centres are inside it, with the stiffness that the curvature of its surface gives:
`R* = r R' / (r + R')` with R' = -2 R inside a cylinder of radius R. The scene's law has the body's radius at every
wall, so that the stiffnesses of a mantle are lowered by sqrt(1 - r/(2 R)), for each radius of the bodies by itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dembench.engines.liggghts_walls import AXES, ranges
from dembench.engines.round_walls import axis_of, is_primitive
from dembench.engines.scene_queries import materials_of
from dembench.scene import Box, Cylinder, Frustum, Material, Mesh, Motion, PairLaw, Plane, Scene
from dembench.scene.walls import WallShape

MOST_RADII = 8
"""Number of different radii up to which round walls are exact: a fix for each of them."""


@dataclass(frozen=True)
class Part:
    """A fix of a wall.

    Attributes:
        id: Its name.
        group: Bodies that it acts on.
        law: Contact law as arguments.
    """

    id: str
    group: str
    law: str


@dataclass(frozen=True)
class Feature:
    """A plane or a mantle.

    Attributes:
        id: Name of its region; names of its fixes begin with it.
        wall: Name of the scene's wall.
        region: Arguments of its region; empty for a primitive plane.
        place: Arguments of its fixes that say where it is.
        variables: Variables that its motion needs, as arguments.
        parts: Its fixes.
    """

    id: str
    wall: str
    region: str
    place: str
    variables: list[str]
    parts: list[Part]


def law_of(pair: PairLaw | None, a: Material, b: Material, history: bool, softer: float = 1.0) -> str:
    """The law of a pair of materials as arguments; without a pair law, that of materials that never touch.

    Args:
        pair: The pair law.
        a, b: The materials.
        history: Whether there is friction in the scene.
        softer: Factor of the stiffnesses.
    """
    normal = softer * 4 / 3 / ((1 - a.poisson**2) / a.young + (1 - b.poisson**2) / b.young)
    shear = softer * 8 / sum(2 * (2 - m.poisson) * (1 + m.poisson) / m.young for m in (a, b))
    restitution = pair.restitution if pair else 1.0
    friction = pair.friction if pair else 0.0
    tangential = (
        f"mindlin {shear!r} {math.sqrt(shear / (1.5 * normal))!r} {friction!r}" if history else "linear_nohistory 0 0"
    )
    return f"hertz {normal!r} {restitution!r} tangential {tangential} damping coeff_restitution"


def refused(scene: Scene) -> list[str]:
    """Walls that the adapter does not write, one line each."""
    faults = []
    for wall in scene.walls:
        if isinstance(wall, Frustum):
            faults.append(f"wall {wall.name}: a cone, which acts only on bodies whose centres are between its ends")
        elif isinstance(wall, Mesh):
            faults.append(f"wall {wall.name}: a mesh")
        elif not isinstance(wall, Plane | Box | Cylinder):
            faults.append(f"wall {wall.name}: a signed distance on a grid")
        elif wall.motion is not None and wall.motion.surface:
            faults.append(f"motion of wall {wall.name}: a surface that moves while the wall stays")
        elif isinstance(wall, Cylinder) and not is_primitive(wall, scene):
            faults.append(
                f"wall {wall.name}: a cylinder must lie along an axis, hold the bodies inside, end closed or at the "
                "domain's end, and turn about itself if it moves"
            )
    return faults


def approximated(scene: Scene) -> bool:
    """Whether the curvature of round walls changes their stiffness: there are too many radii to make up for it."""
    return any(isinstance(w, Cylinder) for w in scene.walls) and len(np.unique(scene.radii())) > MOST_RADII


def groups(scene: Scene) -> dict[str, list[str]]:
    """Bodies [numbers from 1, as ranges a:b] by the name of the group, for walls that meet them by kind or radius."""
    kinds, sizes = _kinds(scene), _sizes(scene)
    found = {f"kind{k}": (kinds == k) for k in np.unique(kinds)} if len(np.unique(kinds)) > 1 else {}
    if any(isinstance(w, Cylinder) for w in scene.walls) and not approximated(scene) and len(np.unique(sizes)) > 1:
        for k in np.unique(kinds):
            found |= {f"kind{k}_size{s}": (kinds == k) & (sizes == s) for s in np.unique(sizes[kinds == k])}
    return {name: ranges(np.flatnonzero(members) + 1) for name, members in found.items()}


def features_of(scene: Scene, materials: list[Material], history: bool) -> list[Feature]:
    """Every wall as planes and mantles.

    Args:
        scene: The scene.
        materials: Its materials in the order of their types.
        history: Whether there is friction in the scene.
    """
    made = []
    for k, wall in enumerate(scene.walls, 1):
        if isinstance(wall, Cylinder):
            made.append(_mantle(wall, f"w{k}", scene, materials, history))
        for part, plane in enumerate(_planes(wall), 1):
            made.append(_plane(plane, f"w{k}_{part}", scene, materials, history))
    return made


def _planes(wall: WallShape) -> list[Plane]:
    """The planes of a wall: itself, the closed faces of a box, the closed ends of a cylinder."""
    if isinstance(wall, Plane):
        return [wall]
    if isinstance(wall, Box):
        return wall.planes()
    assert isinstance(wall, Cylinder), "other walls are refused"
    made = []
    for closed, here, there in (
        (wall.closed_start, wall.start, wall.end),
        (wall.closed_end, wall.end, wall.start),
    ):
        if closed:
            normal = tuple(np.subtract(there, here) / np.linalg.norm(np.subtract(there, here)))
            made.append(Plane(name=wall.name, material=wall.material, motion=wall.motion, point=here, normal=normal))
    return made


def _plane(wall: Plane, id: str, scene: Scene, materials: list[Material], history: bool) -> Feature:
    axis = axis_of(wall.normal)
    parts = _parts(wall.material, id, scene, materials, history, None)
    if wall.motion is None and axis is not None:
        sides = f"{wall.point[axis]!r} NULL" if wall.normal[axis] > 0 else f"NULL {wall.point[axis]!r}"
        return Feature(id, wall.name, "", f"{AXES[axis]}plane {sides}", [], parts)
    shape = f"plane {_numbers(wall.point)} {_numbers(wall.normal)}"
    variables, moved = _motion(wall.motion, id)
    return Feature(id, wall.name, f"{shape} side in units box{moved}", f"region {id}", variables, parts)


def _mantle(wall: Cylinder, id: str, scene: Scene, materials: list[Material], history: bool) -> Feature:
    axis = axis_of(np.subtract(wall.end, wall.start))
    assert axis is not None, "cylinders across the axes are refused"
    b, c = [k for k in range(3) if k != axis]
    low, high = sorted((wall.start[axis], wall.end[axis]))
    shape = f"cylinder {AXES[axis]} {wall.start[b]!r} {wall.start[c]!r} {wall.radius!r} {low!r} {high!r}"
    variables, moved = _motion(wall.motion, id)
    parts = _parts(wall.material, id, scene, materials, history, None if approximated(scene) else wall.radius)
    region = f"{shape} side in units box open 1 open 2{moved}"
    return Feature(id, wall.name, region, f"region {id}", variables, parts)


def _parts(
    material: str, id: str, scene: Scene, materials: list[Material], history: bool, mantle: float | None
) -> list[Part]:
    """The fixes of a feature: one for each material of bodies, at a mantle of this radius [m] for each size, too."""
    kinds, sizes = _kinds(scene), _sizes(scene)
    several, sized = len(np.unique(kinds)) > 1, mantle is not None and len(np.unique(sizes)) > 1
    made = []
    for k in np.unique(kinds):
        own = materials[k - 1]
        pair = scene.pair_law(own.name, material)
        for s in np.unique(sizes[kinds == k]) if sized else [sizes[kinds == k][0]]:
            radius = float(scene.radii()[(kinds == k) & (sizes == s)][0])
            softer = math.sqrt(1 - radius / (2 * mantle)) if mantle else 1.0
            name = f"kind{k}_size{s}" if sized else f"kind{k}" if several else "all"
            end = name.removeprefix("kind") if name != "all" else ""
            law = law_of(pair, own, scene.material(material), history, softer)
            made.append(Part(f"{id}_k{end}" if end else id, name, law))
    return made


def _motion(motion: Motion | None, id: str) -> tuple[list[str], str]:
    """Variables that move a region, and the arguments of the region that name them."""
    if motion is None:
        return [], ""
    variables, moved = [], ""
    shaken = motion.frequency > 0 and any(motion.amplitude)
    if any(motion.velocity) or shaken:
        for axis, velocity, amplitude in zip(AXES, motion.velocity, motion.amplitude, strict=True):
            way = f"{velocity!r}*time"
            if shaken:
                way += f"+({amplitude!r})*sin({2 * math.pi * motion.frequency!r}*time)"
            variables.append(f"{id}_{axis} equal {way}")
        moved += f" move v_{id}_x v_{id}_y v_{id}_z"
    if any(motion.angular_velocity):
        rate = math.hypot(*motion.angular_velocity)
        # its length multiplies the speed
        direction = tuple(component / rate for component in motion.angular_velocity)
        variables.append(f"{id}_turn equal {rate!r}*time")
        moved += f" rotate v_{id}_turn {_numbers(motion.centre)} {_numbers(direction)}"
    return variables, moved


def _kinds(scene: Scene) -> np.ndarray:
    """Type of every body: the place of its material among those in use, from 1; shape (n,)."""
    order = [m.name for m in materials_of(scene)]
    return np.array([1 + order.index(s.material) for s in scene.species])[scene.bodies.species]


def _sizes(scene: Scene) -> np.ndarray:
    """Place of every body's radius among the different ones, from 1; shape (n,)."""
    return 1 + np.unique(scene.radii(), return_inverse=True)[1]


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(repr(float(value)) for value in values)
