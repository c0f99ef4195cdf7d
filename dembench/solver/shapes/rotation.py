"""Rotation of rigid bodies: inertia in space, and the motion of a body that no torque acts on.

The free motion is split into rotations about the three principal axes (Dullweber, Leimkuhler & McLachlan 1997, J. Chem.
Phys. 107, 5840): each is exact, so the angular momentum is kept to rounding, the energy and the precession to the
second order of the step without drift, and the motion can be reversed.
"""

from typing import Any

import warp as wp

from dembench.solver.shapes.records import Shape, Shapes
from dembench.solver.types import types

Bodies: Any = types("float64").Bodies


@wp.func
def spin_of(b: Bodies, i: int):
    """Angular velocity of a body."""
    w = b.spin[i]
    return wp.vec3d(w[0], w[1], w[2])


@wp.func
def inverse_inertia(shapes: Shapes, b: Bodies, ids: wp.array(dtype=wp.int32), i: int):
    """Inverse inertia tensor of a body in space; zero where its rotation is prescribed."""
    inverse = wp.mat33d()
    if b.inv_i[i] > wp.float64(0.0):
        k = b.kind[i]
        m = shapes.table[k].moments
        to_space = wp.quat_to_matrix(shapes.turn[ids[i]]) * shapes.table[k].axes
        one = wp.float64(1.0)
        inverse = to_space * wp.diag(wp.vec3d(one / m[0], one / m[1], one / m[2])) * wp.transpose(to_space)
    return inverse


@wp.func
def turned_about(s: Shape, q: wp.quatd, m: wp.vec3d, axis: int, dt: wp.float64):
    """Orientation and angular momentum about the principal axes after a rotation about one of them for a time dt."""
    angle = dt * m[axis] / s.moments[axis]
    sine, cosine = wp.sin(angle), wp.cos(angle)
    j = (axis + 1) % 3
    k = (axis + 2) % 3
    after = wp.vec3d(m[0], m[1], m[2])
    after[j] = cosine * m[j] + sine * m[k]
    after[k] = cosine * m[k] - sine * m[j]
    half = wp.float64(0.5) * angle
    u = wp.sin(half) * wp.vec3d(s.axes[0, axis], s.axes[1, axis], s.axes[2, axis])
    return q * wp.quatd(u[0], u[1], u[2], wp.cos(half)), after


@wp.func
def turned_by(q: wp.quatd, angle: wp.vec3d):
    """Orientation after a rotation in space by a vector [rad]."""
    size = wp.length(angle)
    turn = wp.quatd(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0), wp.float64(1.0))
    if size > wp.float64(0.0):
        turn = wp.quat_from_axis_angle(angle / size, size)
    return wp.normalize(turn * q)


@wp.func
def turn_freely(shapes: Shapes, b: Bodies, ids: wp.array(dtype=wp.int32), i: int, dt: wp.float64):
    """Turns a body for a time dt without torque; one with a prescribed rotation keeps its angular velocity."""
    at = ids[i]
    w = spin_of(b, i)
    if b.inv_i[i] == wp.float64(0.0):
        shapes.turn[at] = turned_by(shapes.turn[at], w * dt)
    else:
        s = shapes.table[b.kind[i]]
        q = wp.quatd(shapes.turn[at])
        m = wp.cw_mul(wp.transpose(s.axes) * wp.quat_rotate_inv(q, w), s.moments)
        half = wp.float64(0.5) * dt
        q, m = turned_about(s, q, m, 0, half)
        q, m = turned_about(s, q, m, 1, half)
        q, m = turned_about(s, q, m, 2, dt)
        q, m = turned_about(s, q, m, 1, half)
        q, m = turned_about(s, q, m, 0, half)
        q = wp.normalize(q)
        shapes.turn[at] = q
        w = wp.quat_rotate(q, s.axes * wp.cw_div(m, s.moments))
        b.spin[i] = wp.vec4d(w[0], w[1], w[2], wp.float64(0.0))
