"""Scenes in MUSEN's text format: grains, walls of triangles, materials and pairs, one line each, every value tagged.

Every property and every pair is stated: what is left out gets the program's own default (rolling friction 0.05, say).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dembench.engines.scene_queries import materials_of
from dembench.scene import Box, Cylinder, Frustum, Motion, Plane, Scene, Sdf, Sink
from dembench.scene.walls import WallShape

FOR_EVER = "1e+300"
UNUSED_PAIR = (1.0, 0.0)
"""Restitution and friction of materials that cannot touch, two walls for instance."""


@dataclass(frozen=True)
class Geometry:
    """A wall as the program has it: triangles under one name that move together.

    Attributes:
        name, material: Names.
        triangles: Vertices [m], shape (n, 3, 3); the void is on the side of (v2 - v1) x (v3 - v1).
        motion: Velocity [m/s], angular velocity [rad/s] and centre [m]; empty for a wall at rest.
    """

    name: str
    material: str
    triangles: np.ndarray
    motion: tuple[float, ...]


def geometries(scene: Scene, segments: int) -> list[Geometry]:
    """The walls of a scene; those without a face are left out.

    An infinite plane, and so every closed face of a box, is a square that no grain in the domain can look beyond.
    A round wall is a polygon of `segments` sides that does not reach into the void, so that no grain that touches
    the round wall overlaps it.
    """
    found = []
    for wall in scene.walls:
        triangles = _triangles(scene, wall, segments)
        if len(triangles):
            motion = _numbers(wall.motion) if wall.motion else ()
            found.append(Geometry(wall.name, wall.material, triangles, motion))
    return found


def _triangles(scene: Scene, wall: WallShape, segments: int) -> np.ndarray:
    if isinstance(wall, Plane):
        return wall.triangulate(_reach(scene, wall))
    if isinstance(wall, Box):
        faces = [plane.triangulate(_reach(scene, plane)) for plane in wall.planes()]
        return np.concatenate(faces) if faces else np.empty((0, 3, 3))
    if isinstance(wall, Cylinder | Frustum):
        widening = 1 if wall.outside else 1 / math.cos(math.pi / segments)
        radii = {f: widening * getattr(wall, f) for f in ("radius", "radius_start", "radius_end") if hasattr(wall, f)}
        return wall.model_copy(update=radii).triangulate(segments)
    return wall.triangulate()


def _reach(scene: Scene, plane: Plane) -> float:
    """Half-width of a square about the plane's point that covers the domain at all times [m]."""
    low, high = np.array(scene.domain.lower), np.array(scene.domain.upper)
    reach = float(np.linalg.norm(high - low) + np.linalg.norm((low + high) / 2 - plane.point))
    if plane.motion is not None:
        reach += scene.duration * math.hypot(*plane.motion.velocity)
        reach += 2 * float(np.linalg.norm(np.subtract(plane.motion.centre, plane.point)))
    return reach


def _numbers(motion: Motion) -> tuple[float, ...]:
    """The numbers of a motion in the order of the job script; empty where it does not move."""
    numbers = (*motion.velocity, *motion.angular_velocity, *motion.centre)
    return numbers if any(numbers[:6]) else ()


def refused(scene: Scene) -> Iterator[str]:
    """Walls, motions and sinks that the text scene cannot hold, one line each."""
    for wall in scene.walls:
        if isinstance(wall, Sdf):
            yield f"wall {wall.name}: a signed distance on a grid"
        motion = wall.motion
        if motion is not None:
            both = any(motion.velocity) and any(motion.angular_velocity)
            if both or motion.surface or (motion.frequency and any(motion.amplitude)):
                yield f"motion of wall {wall.name}: either a rotation or a translation of the whole wall"
    for sink in scene.sinks:
        if len(_bounds(sink)) != 1:
            yield f"sink {sink.name}: it must be all that lies beyond one level, as z <= -0.1 m"
    low, high = domain(scene)
    early = ((scene.bodies.position < low) | (scene.bodies.position > high)).any(axis=1).sum()
    if early:
        yield f"{early} bodies that start in a sink or outside the domain"


def domain(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the program's domain [m]: the scene's, cut by its sinks."""
    corners = np.array([scene.domain.lower, scene.domain.upper])
    for side, axis, level in _levels(scene):
        corners[side, axis] = max(corners[0, axis], level) if side == 0 else min(corners[1, axis], level)
    return corners[0], corners[1]


def sink_faces(scene: Scene) -> set[tuple[int, int]]:
    """Faces of the domain, as side (0 lower, 1 upper) and axis, behind which a sink lies."""
    corners = domain(scene)
    return {(side, axis) for side, axis, level in _levels(scene) if corners[side][axis] == level}


def _levels(scene: Scene) -> list[tuple[int, int, float]]:
    """Side, axis and level [m] of each sink that is all that lies beyond one level."""
    return [_bounds(sink)[0] for sink in scene.sinks if len(_bounds(sink)) == 1]


def _bounds(sink: Sink) -> list[tuple[int, int, float]]:
    """Side of the domain that a bound of a sink's region faces, axis and level [m] of each bound."""
    return [
        (side, axis, level)
        for side, levels in ((1, sink.region.lower), (0, sink.region.upper))
        for axis, level in enumerate(levels)
        if level is not None
    ]


def write_scene(scene: Scene, walls: list[Geometry], path: Path) -> None:
    """Writes a text scene; grain k has the id k, the triangles follow in the order of the walls."""
    with open(path, "w") as stream:
        stream.writelines(line + "\n" for line in itertools.chain(_grains(scene), _wall_lines(scene, walls)))
        low, high = domain(scene)
        stream.write(f"22 {_text([*low, *high])}\n28 0 0 0 0 0 0 0 0 0 0\n29 0\n30 0\n")
        first = len(scene.bodies)
        for wall in walls:
            ids = range(first, first + len(wall.triangles))
            first = ids.stop
            stream.write(f"25 {wall.name} {wall.name} 0 0 0 0 0\n26 0 0\n")
            stream.write(f"27 {len(ids)} {' '.join(map(str, ids))}\n")
        materials = materials_of(scene)
        for m in materials:
            stream.write(f"32 {m.name} {m.name} 0 {m.density!r} 7 {m.young!r} 10 {m.poisson!r}\n")
        laws = {frozenset((p.a, p.b)): (p.restitution, p.friction) for p in scene.pair_laws}
        for a, b in itertools.combinations_with_replacement([m.name for m in materials], 2):
            restitution, friction = laws.get(frozenset((a, b)), UNUSED_PAIR)
            stream.write(f"33 {a} {b} 200 {restitution!r} 201 {friction!r} 202 0\n")


def _grains(scene: Scene) -> Iterator[str]:
    bodies, names = scene.bodies, [s.material for s in scene.species]
    columns = (scene.radii(), bodies.species, bodies.position, bodies.velocity, bodies.angular_velocity)
    for k, (radius, species, *state) in enumerate(zip(*(c.tolist() for c in columns), strict=True)):
        position, velocity, spin = map(_text, state)
        yield (
            f"0 {k} 1 1 5 {radius!r} {radius!r} 23 {names[species]} 24 0 {FOR_EVER} "
            f"2 0 12 {position} 15 {velocity} 16 {spin} 31 1 0 0 0"
        )


def _wall_lines(scene: Scene, walls: list[Geometry]) -> Iterator[str]:
    triangles = ((wall.material, t) for wall in walls for t in wall.triangles)
    for k, (material, vertices) in enumerate(triangles, len(scene.bodies)):
        yield f"0 {k} 1 14 5 23 {material} 24 0 {FOR_EVER} 2 0 44 {_text(vertices.ravel())} 15 0 0 0"


def _text(numbers: np.ndarray | list[float]) -> str:
    """Numbers as the shortest text that reads back as the same doubles."""
    return " ".join(repr(float(x)) for x in numbers)
