"""Records of the walls that kernels take; everything is float64, whatever the precision of the solver."""

# Annotations are read by Warp when a record is made, so they must be types and not strings here.

from dataclasses import dataclass

import warp as wp

PLANE, MANTLE, GRID, FACE, EDGE, VERTEX = 0, 1, 2, 3, 4, 5
"""Shapes of features; those from FACE on are parts of meshes."""


@dataclass(frozen=True)
class WallOptions:
    """What of the walls is compiled in.

    Attributes:
        present: There are walls.
        curved: Some wall is a mantle of revolution.
        grids: Some wall is a signed distance on a grid.
        meshes: Some wall is a mesh of triangles.
        shapes: Bodies touch walls with points away from their centres.
        moving: The surface of some wall moves.
        loads: Forces and torques on walls and their work are summed.
        timed: Some wall changes its place or its speed with time, so that poses are evaluated in every step.
    """

    present: bool = False
    curved: bool = False
    grids: bool = False
    meshes: bool = False
    shapes: bool = False
    moving: bool = False
    timed: bool = False
    loads: bool = False


@wp.struct
class Feature:
    """One feature of a wall, in the place that it has at t = 0 [scene units].

    shape: see above; owner: index of the wall; kind: index of the material among those of walls; motion: index of the
    motion, -1 at rest.
    point, axis: a point and the normal of a plane, or start and direction of the axis of a mantle, with its length,
    the radii of its ends, and whether the void is outside. A grid: its first node, the distance `length` between nodes,
    the nodes per axis `size`, and where they begin among all nodes. A part of a mesh: the reference of the mesh, from
    which its other positions count, `base` on the part, the normal of a face or the direction of an edge, and where the
    half-spaces of its region begin, size[0] in number.
    """

    shape: wp.int32
    owner: wp.int32
    kind: wp.int32
    motion: wp.int32
    outside: wp.int32
    point: wp.vec3d
    axis: wp.vec3d
    length: wp.float64
    r0: wp.float64
    r1: wp.float64
    first: wp.int32
    size: wp.vec3i
    base: wp.vec3d


@wp.struct
class WallMotion:
    """Motion of a wall: velocity, oscillation with amplitude and angular frequency `rate`, rotation about the centre.

    stays: The surface moves, but the wall stays where it is.
    """

    velocity: wp.vec3d
    amplitude: wp.vec3d
    rate: wp.float64
    spin: wp.vec3d
    centre: wp.vec3d
    stays: wp.int32


@wp.struct
class Pose:
    """Where a motion has taken its walls: x -> centre + turn (x - start); and how fast they move there."""

    start: wp.vec3d
    centre: wp.vec3d
    turn: wp.quatd
    velocity: wp.vec3d
    spin: wp.vec3d
    stays: wp.int32


@wp.struct
class MeshCells:
    """Grid over the features of a mesh, in the frame of its reference: see `mesh.BoxGrid`.

    motion: index of the motion of the mesh; start: where its cells begin in Walls.mesh_start.
    """

    motion: wp.int32
    reference: wp.vec3d
    origin: wp.vec3d
    inverse: wp.float64
    cells: wp.vec3i
    start: wp.int32


@wp.struct
class Walls:
    """All walls: features, motions, and the poses, of which every thread has as many as there are motions.

    plain: features that are no parts of meshes; they come first. nodes: gradient (0-2) and signed distance (3) at the
    nodes of all grids, the last axis fastest. spaces: point and normal of half-space h at 2h and 2h + 1. meshes: grids
    over the features of meshes; cell c of all holds the features mesh_part[mesh_start[c]] up to mesh_start[c + 1];
    mesh_lowest: lowest cell that a feature reaches into, from feature `plain` on. loads: sums of each thread for each
    wall, see `loads.py`.
    """

    features: wp.array(dtype=Feature)
    motions: wp.array(dtype=WallMotion)
    poses: wp.array(dtype=Pose)
    plain: wp.int32
    nodes: wp.array(dtype=wp.vec4d)
    spaces: wp.array(dtype=wp.vec3d)
    meshes: wp.array(dtype=MeshCells)
    mesh_start: wp.array(dtype=wp.int32)
    mesh_part: wp.array(dtype=wp.int32)
    mesh_lowest: wp.array(dtype=wp.vec3i)
    loads: wp.array3d(dtype=wp.float64)
