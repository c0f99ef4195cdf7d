"""Records of the walls that kernels take; everything is float64, whatever the precision of the solver."""

# Annotations are read by Warp when a record is made, so they must be types and not strings here.

from dataclasses import dataclass

import warp as wp

PLANE, MANTLE = 0, 1
"""Shapes of features."""


@dataclass(frozen=True)
class WallOptions:
    """What of the walls is compiled in.

    Attributes:
        present: There are walls.
        curved: Some wall is a mantle of revolution.
        moving: The surface of some wall moves.
        timed: Some wall changes its place or its speed with time, so that poses are evaluated in every step.
    """

    present: bool = False
    curved: bool = False
    moving: bool = False
    timed: bool = False


@wp.struct
class Feature:
    """One feature of a wall, in the place that it has at t = 0 [scene units].

    shape: see above; kind: index of the material among those of walls; motion: index of the motion, -1 at rest.
    point, axis: a point and the normal of a plane, or start and direction of the axis of a mantle, with its length,
    the radii of its ends, and whether the void is outside.
    """

    shape: wp.int32
    kind: wp.int32
    motion: wp.int32
    outside: wp.int32
    point: wp.vec3d
    axis: wp.vec3d
    length: wp.float64
    r0: wp.float64
    r1: wp.float64


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
class Walls:
    """All walls: features, motions, and the poses, of which every thread has `motions` of its own."""

    features: wp.array(dtype=Feature)
    motions: wp.array(dtype=WallMotion)
    poses: wp.array(dtype=Pose)
