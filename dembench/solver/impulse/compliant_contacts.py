"""What the compliant rows of the last substep say of the contacts: force, overlap, elastic energy."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp

from dembench.solver.impulse.compliant_rows import FAR, A, B, C, CompliantOptions, compliant_types
from dembench.solver.inspection import Touching
from dembench.solver.lanes import LANES
from dembench.solver.laws import surface_functions
from dembench.solver.pairs import radius_function
from dembench.solver.periodic import image_functions
from dembench.solver.state import State
from dembench.solver.types import types
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import Walls

SMALL, AT_WALL, LARGE = 0, 1, 2
"""Kinds of rows: of two small bodies, of one at a wall, of a large one."""


@dataclass(frozen=True)
class Segment:
    """Blocks begin..end, from `other` on those of walls or, in the bridge, of large bodies; see `compliant_types`.

    Attributes:
        begin, other, end: See above.
        own: Whether it is the segment of a thread.
        constants: The block of c that belongs to `other`.
    """

    begin: int
    other: int
    end: int
    own: bool
    constants: int


def count_open(segments: list[Segment], rows: Any) -> int:
    """Number of the rows that were open in the last substep."""
    return sum(int(np.count_nonzero(_open(segment, rows))) for segment in segments)


def open_rows(segments: list[Segment], rows: Any) -> np.ndarray:
    """Places of the rows that were open in the last substep."""
    return np.concatenate([s.begin * LANES + np.flatnonzero(_open(s, rows)) for s in segments])


def _open(s: Segment, rows: Any) -> np.ndarray:
    """Whether the rows of a segment were open, shape (blocks, LANES)."""
    slot, a = rows.slot.numpy().reshape(-1, LANES), rows.a.numpy().reshape(-1, A, LANES)
    return (slot[s.begin : s.end] >= 0) & (a[s.begin : s.end, 3] > -FAR)


@cache
def contact_kernel(o: CompliantOptions) -> Any:
    """A kernel that measures the contacts of the rows of a segment: the normal with the overlap at present, the energy.

    The energy is (2/5) kn d^(5/2) + kt sqrt(d) xi^2/2, in a linear law kn d^2/2 + kt xi^2/2; 0 where the two are apart.
    block: that of c for each row.
    """
    t = types(o.law.precision)
    real, vec3, vec4 = t.real, t.vec3, t.vec4
    Bodies, Lists = t.Bodies, t.Lists
    Rows = compliant_types(o.law.precision)
    separation = image_functions(o.law.precision, o.periodic).separation
    surface = surface_functions(o.law)
    arm_of, spring_of = surface.arm, surface.spring
    of_feature = wall_functions(o.walls)
    distance_of, velocity_of = of_feature.distance, of_feature.velocity
    radius = radius_function(o.law.precision, o.radii)
    friction, linear, lanes = o.law.friction, o.law.linear, wp.constant(LANES)

    @wp.func
    def energy_of(overlap: real, xi: vec3, kn: real, kt: real):
        energy = real(0.0)
        if overlap > real(0.0):
            root = real(1.0)
            share = real(0.5)
            if wp.static(not linear):
                root = wp.sqrt(overlap)
                share = real(0.4)
            energy = share * kn * overlap * overlap * root + real(0.5) * kt * root * wp.dot(xi, xi)
        return energy

    @wp.func
    def spin(b: Bodies, i: int):
        w = b.spin[i]
        return vec3(w[0], w[1], w[2])

    @wp.kernel(enable_backward=False, module="unique")
    def measure(
        # inputs
        used: wp.array(dtype=wp.int32),
        kind: wp.array(dtype=wp.int32),
        block: wp.array(dtype=wp.int32),
        made: real,
        b: Bodies,
        lists: Lists,
        rows: Rows,
        walls: Walls,
        # outputs
        place: wp.array(dtype=vec4),
        energy: wp.array(dtype=real),
    ):
        for q in range(used.shape[0]):
            r = used[q]
            i, j, slot = rows.i[r], rows.j[r], rows.slot[r]
            ki = b.kin[i]
            x = wp.vec3d(ki[0], ki[1], ki[2])
            v = wp.vec3d(ki[3], ki[4], ki[5])
            n, s = wp.vec3d(), vec3()
            overlap = wp.float64(0.0)
            memory = vec4()
            if kind[q] != wp.static(AT_WALL):
                kj = b.kin[j]
                apart = separation(b, ki, kj)
                d = wp.vec3d(apart[0], apart[1], apart[2])
                n = wp.normalize(d)
                v = wp.vec3d(apart[3], apart[4], apart[5])
                ri, rj = radius(b, ki), radius(b, kj)
                overlap = ri + rj - wp.length(d)
                if wp.static(friction):
                    s = arm_of(ri, real(overlap)) * spin(b, i) + arm_of(rj, real(overlap)) * spin(b, j)
                    if kind[q] == wp.static(SMALL):
                        memory = lists.memory[slot]
                    else:
                        memory = lists.big_memory[slot]
            else:
                f = lists.wall_f[slot]
                distance, normal = distance_of(walls, f, 0, x)
                n = normal
                arm = radius(b, ki)
                overlap = arm - distance
                v = v - velocity_of(walls, f, 0, x - wp.float64(arm_of(arm, real(overlap))) * normal)
                if wp.static(friction):
                    s = arm_of(arm, real(overlap)) * spin(b, i)
                    memory = lists.wall_memory[slot]
            at = block[q] * wp.static(C) * lanes + r % lanes
            m = vec3(real(n[0]), real(n[1]), real(n[2]))
            xi = vec3()
            if wp.static(friction):
                g = vec3(real(v[0]), real(v[1]), real(v[2])) + wp.cross(m, s)
                xi = spring_of(memory, m, g - wp.dot(g, m) * m, real(0.5) * made)
            place[q] = vec4(m[0], m[1], m[2], real(overlap))
            energy[q] = energy_of(real(overlap), xi, rows.c[at], rows.c[at + lanes])

    return measure


def touching(o: CompliantOptions, segments: list[Segment], state: State, rows: Any, made: float) -> Touching:
    """The contacts that the rows of the last substep have left.

    Args:
        o: Options of the kernel that made the rows.
        segments: Where the rows stand.
        state: The bodies, the lists that the rows refer to, and the walls.
        rows: The rows.
        made: The last substep [scene units].
    """
    used, t = open_rows(segments, rows), types(o.law.precision)
    kind, constants = np.full(len(used), SMALL), used // LANES * (not o.shared)
    for s in segments:
        others = (used >= s.other * LANES) & (used < s.end * LANES)
        kind[others] = AT_WALL if s.own else LARGE
        constants[others] = s.constants + used[others] // LANES - s.other
    place = wp.zeros(len(used), dtype=t.vec4, device="cpu")
    energy = wp.zeros(len(used), dtype=t.real, device="cpu")
    inputs = [wp.array(x, dtype=wp.int32, device="cpu") for x in (used, kind, constants)]
    inputs += [made, state.bodies, state.lists, rows, state.walls.record]
    wp.launch(contact_kernel(o), dim=1, device="cpu", inputs=inputs, outputs=[place, energy])
    normal, overlap = np.split(place.numpy().astype(float), [3], axis=1)
    touch = overlap[:, 0] > 0
    kept, at_wall = used[touch], kind[touch] == AT_WALL
    i, j = rows.i.numpy()[kept], rows.j.numpy()[kept]
    feature = np.full(len(kept), -1, np.int32)
    feature[at_wall] = state.lists.wall_f.numpy()[rows.slot.numpy()[kept[at_wall]]]
    block, lane = np.divmod(kept, LANES)
    impulse = rows.b.numpy().reshape(-1, B, LANES)[block, 4:7, lane].astype(float)
    n = rows.a.numpy().reshape(-1, A, LANES)[block, :3, lane].astype(float)
    force = impulse / made if made else impulse
    along = (force * n).sum(axis=1)
    return Touching(
        i=i,
        j=np.where(at_wall, -1, j),
        feature=feature,
        normal=normal[touch],
        overlap=overlap[touch, 0],
        normal_force=along,
        tangential_force=force - along[:, None] * n,
        energy=energy.numpy()[touch].astype(float),
    )
