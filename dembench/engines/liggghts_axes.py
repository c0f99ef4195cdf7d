"""Axes in LIGGGHTS: a scene with a cylinder that turns about y is computed with cyclically renamed axes.

The program turns the surface of a primitive cylinder along x or z, but gives that of one along y a velocity field that
is a shear and no rotation (its radial vector comes with swapped components). Renamed axes make y the program's z, to
the last bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dembench.engines.round_walls import axis_of, is_primitive
from dembench.scene import Box, Cylinder, Mesh, Motion, Region, Scene
from dembench.scene.walls import WallShape

AXES = "xyz"


def renamed_by(scene: Scene) -> int:
    """Number of places by which the axes are moved on: 1 (x, y, z become y, z, x) or 0."""
    turning = [w for w in scene.walls if isinstance(w, Cylinder) and w.motion is not None and is_primitive(w, scene)]
    return int(any(axis_of(np.subtract(w.end, w.start)) == 1 for w in turning))


def renamed(scene: Scene) -> Scene:
    """The scene as the program computes it; observables are left as they are."""
    if not renamed_by(scene):
        return scene
    bodies = scene.bodies
    moved = {name: np.roll(getattr(bodies, name), 1, axis=1) for name in ("position", "velocity", "angular_velocity")}
    domain = scene.domain
    sides = {name: _on(getattr(domain, name)) for name in ("lower", "upper", "periodic")}
    return scene.model_copy(
        update={
            "bodies": bodies.model_copy(update=moved),
            "domain": domain.model_copy(update=sides),
            "gravity": _on(scene.gravity),
            "walls": tuple(_wall(wall) for wall in scene.walls),
            "sinks": tuple(sink.model_copy(update={"region": _region(sink.region)}) for sink in scene.sinks),
        }
    )


def as_given(vectors: np.ndarray, places: int) -> np.ndarray:
    """Vectors of the program, shape (..., 3), in the axes of the scene."""
    return np.roll(vectors, -places, axis=-1)


def _on(vector: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    return vector[2], vector[0], vector[1]


def _region(region: Region) -> Region:
    return region.model_copy(update={"lower": _on(region.lower), "upper": _on(region.upper)})


def _wall(wall: WallShape) -> WallShape:
    changes: dict[str, object] = {}
    for name in ("point", "normal", "lower", "upper", "start", "end"):
        if hasattr(wall, name):
            changes[name] = _on(getattr(wall, name))
    if isinstance(wall, Box):
        changes["open_faces"] = tuple(AXES[(AXES.index(face[0]) + 1) % 3] + face[1] for face in wall.open_faces)
    if isinstance(wall, Mesh):
        changes["triangles"] = np.roll(wall.triangles, 1, axis=2)
    if wall.motion is not None:
        changes["motion"] = _motion(wall.motion)
    return wall.model_copy(update=changes)


def _motion(motion: Motion) -> Motion:
    names = ("velocity", "angular_velocity", "centre", "amplitude")
    return motion.model_copy(update={name: _on(getattr(motion, name)) for name in names})
