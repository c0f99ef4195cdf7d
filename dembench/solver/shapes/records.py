"""Records of shapes and of their contacts that kernels take, and the shapes of a scene in scene units.

Everything is float64: a face rests on several contacts, and what they leave of each other's loads must not be rounding.
"""

# Annotations are read by Warp when a record is made, so they must be types and not strings here.

from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Clump, Grain, Scene, features
from dembench.solver.guard import SolverError
from dembench.solver.units import Units
from dembench.solver.walls.features import field_nodes
from dembench.solver.walls.records import GRID, Feature


@wp.struct
class Shape:
    """One species in its own frame, about its centre of mass [scene units].

    first, count: its probes; field: index of its field, -1 without; axes, moments: principal axes (columns) and moments
    of inertia; radius: radius of curvature of a field in the contact law; weight: share of a contact that a probe
    carries.
    """

    first: wp.int32
    count: wp.int32
    field: wp.int32
    axes: wp.mat33d
    moments: wp.vec3d
    radius: wp.float64
    weight: wp.float64


@wp.struct
class Shapes:
    """All species, and the orientations of the bodies.

    table: the species; probes: centre and radius; fields, nodes: signed distances on grids, as those of walls; turn:
    orientation of every body, by its id.
    """

    table: wp.array(dtype=Shape)
    probes: wp.array(dtype=wp.vec4d)
    fields: wp.array(dtype=Feature)
    nodes: wp.array(dtype=wp.vec4d)
    turn: wp.array(dtype=wp.quatd)


@wp.struct
class Contact:
    """One contact point.

    a, b: the bodies, b = -1 at a wall; feature: of the wall; kind, p, s: what touches what, see `geometry`; slot: pair
    or wall candidate of the list. gap; n: normal from b to a; ra, rb: levers from the centres of mass; memory: what the
    method keeps of the contact (spring and flag, or impulse and load of the position pass); force: on a; energy: stored
    in the springs.
    """

    a: wp.int32
    b: wp.int32
    feature: wp.int32
    kind: wp.int32
    p: wp.int32
    s: wp.int32
    slot: wp.int32
    gap: wp.float64
    n: wp.vec3d
    ra: wp.vec3d
    rb: wp.vec3d
    memory: wp.vec4d
    force: wp.vec3d
    energy: wp.float64


class ShapeSet:
    """The shapes of a scene on the CPU.

    Attributes:
        record: The record Shapes that kernels take.

    Raises:
        SolverError: The field of a grain does not reach as far as a probe that it can meet, or points without radius
            would meet the surface of a mesh, which has no inside.
    """

    def __init__(self, scene: Scene, units: Units):
        _check_reach(scene)
        _check_meshes(scene)
        table, probes, fields = [], [], []
        nodes: list[np.ndarray] = []
        for species in scene.species:
            shape = species.shape or Clump(spheres=((0.0, 0.0, 0.0, species.radius),))
            record = Shape()
            record.first, record.count = sum(map(len, probes)), len(shape.probes())
            probes.append(shape.probes() / units.length)
            density = scene.material(species.material).density
            record.moments = wp.vec3d(*(shape.solid.moments * density / (units.mass * units.length**2)))
            record.axes = wp.mat33d(*shape.solid.axes.ravel())
            record.field, record.weight = -1, 1.0
            if isinstance(shape, Grain):
                record.field, record.weight = len(fields), shape.weight
                record.radius = shape.contact_radius / units.length
                field = Feature()
                field.shape, field.length, field.first = GRID, shape.spacing / units.length, sum(map(len, nodes))
                field.point = wp.vec3d(*((np.array(shape.origin) - shape.solid.centre) / units.length))
                field.size = wp.vec3i(*shape.values.shape)
                fields.append(field)
                nodes.append(field_nodes(shape.values, shape.spacing, units))
            table.append(record)
        orientation = scene.bodies.orientation
        if orientation is None:
            orientation = np.tile([0.0, 0.0, 0.0, 1.0], (len(scene.bodies), 1))
        self.record = Shapes()
        self.record.table = wp.array(table, dtype=Shape, device="cpu")
        self.record.probes = wp.array(np.vstack(probes), dtype=wp.vec4d, device="cpu")
        self.record.fields = wp.array(fields or [Feature()], dtype=Feature, device="cpu")
        self.record.nodes = wp.array(np.concatenate([*nodes, np.zeros((1, 4))]), dtype=wp.vec4d, device="cpu")
        self.record.turn = wp.array(np.array(orientation), dtype=wp.quatd, device="cpu")

    @property
    def orientation(self) -> np.ndarray:
        """Unit quaternions (x, y, z, w) by id, shape (n, 4)."""
        return self.record.turn.numpy().copy()


def _check_reach(scene: Scene) -> None:
    """A field answers within its grid only, so it must reach beyond the surface by the largest probe."""
    present = [s for k, s in enumerate(scene.species) if (scene.bodies.species == k).any()]
    probes: list[tuple[Any, float]] = [(s, s.shape.probes()[:, 3].max() if s.shape else s.radius) for s in present]
    for grain in (s for s in present if isinstance(s.shape, Grain)):
        other, largest = max(probes, key=lambda pair: pair[1])
        if grain.shape.reach < largest:
            raise SolverError(
                f"species {grain.name}: its field reaches {grain.shape.reach:.3g} m beyond the surface; species "
                f"{other.name} has spheres of {largest:.3g} m and needs as much: give the grid a larger box"
            )


def _check_meshes(scene: Scene) -> None:
    """A point that has passed a triangle would be pushed out on the other side."""
    if features(scene).mesh_walls:
        for species in scene.species:
            if species.shape is not None and not species.shape.probes()[:, 3].all():
                raise SolverError(
                    f"species {species.name}: probes without a radius cannot meet walls of triangles; give all a radius"
                )
