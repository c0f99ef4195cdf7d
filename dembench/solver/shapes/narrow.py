"""Narrow phase: contact points of the listed pairs and wall candidates, with what they remember.

Contacts stand in two halves of one array: a step reads its memory from one half and writes the other. The lists keep,
in the slot of a pair or of a wall candidate, where its contacts stand; so a rebuild of the lists carries the memory.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.shapes.geometry import A_IN_B, B_IN_A, SPHERES, WALL, centre_of, ends_pair, touch_function
from dembench.solver.shapes.records import Contact, Shapes
from dembench.solver.shapes.rotation import spin_of
from dembench.solver.types import types
from dembench.solver.walls.distance import wall_functions
from dembench.solver.walls.records import WallOptions, Walls

Bodies: Any = types("float64").Bodies
Lists: Any = types("float64").Lists


@wp.func
def velocity_at(b: Bodies, i: int, lever: wp.vec3d):
    """Velocity of the point of a body at a lever from its centre of mass."""
    k = b.kin[i]
    return wp.vec3d(k[3], k[4], k[5]) + wp.cross(spin_of(b, i), lever)


@wp.func
def speed_bound(b: Bodies, i: int):
    """Bound of the speed of every point of a body."""
    k = b.kin[i]
    return wp.length(wp.vec3d(k[3], k[4], k[5])) + k[6] * wp.length(spin_of(b, i))


@wp.func
def immovable(b: Bodies, i: int):
    """Whether no impulse changes the motion of a body."""
    return b.inv_m[i] == wp.float64(0.0) and b.inv_i[i] == wp.float64(0.0)


@wp.func
def rank(kind: int, p: int, s: int):
    """Contacts of a pair or wall candidate are found in ascending order of this number."""
    return (wp.int64(kind) * wp.int64(16777216) + wp.int64(p)) * wp.int64(16777216) + wp.int64(s)


@wp.func
def rank_of(contacts: wp.array(dtype=Contact), at: int):
    """Rank of a contact."""
    return rank(contacts[at].kind, contacts[at].p, contacts[at].s)


@wp.func
def may_touch(
    shapes: Shapes, b: Bodies, owner: int, other: int, p: int, turn: wp.quatd, shift: wp.vec3d, reach: wp.float64
):
    """Whether probe p of a body comes near the field of another; turn and shift take it into the frame of the field."""
    v = shapes.probes[shapes.table[b.kind[other]].first + p]
    y = wp.quat_rotate(turn, wp.vec3d(v[0], v[1], v[2])) + shift
    bound = b.kin[owner][6] + v[3] + reach
    if wp.dot(y, y) > bound * bound:
        return False
    f = shapes.fields[shapes.table[b.kind[owner]].field]
    last = f.length * wp.vec3d(wp.float64(f.size[0] - 1), wp.float64(f.size[1] - 1), wp.float64(f.size[2] - 1))
    return wp.min(y - f.point) >= wp.float64(0.0) and wp.min(last - (y - f.point)) > wp.float64(0.0)


@cache
def narrow_functions(options: WallOptions) -> Any:
    """Warp functions `find`, `commit` and `relative`.

    find(...) writes the contacts that close within dt or come nearer than `margin` and returns their number, which may
    be more than there is room for; commit(...) tells the lists where the contacts stand; relative(...) is the velocity
    of a against b, or against the wall, at a contact.
    """
    touch = touch_function(options)
    of_wall = wall_functions(options)
    within, velocity_of = of_wall.near, of_wall.velocity
    present = options.present

    @wp.func
    def relative(b: Bodies, walls: Walls, c: Contact):
        v = velocity_at(b, c.a, c.ra)
        if c.b >= 0:
            v = v - velocity_at(b, c.b, c.rb)
        elif wp.static(present):
            v = v - velocity_of(walls, c.feature, 0, centre_of(b, c.a) + c.ra)
        return v

    @wp.func
    def points(
        shapes: Shapes,
        b: Bodies,
        ids: wp.array(dtype=wp.int32),
        walls: Walls,
        i: int,
        j: int,
        feature: int,
        slot: int,
        memory: wp.vec4d,
        old: int,
        new: int,
        room: int,
        dt: wp.float64,
        margin: wp.float64,
        reach: wp.float64,
        contacts: wp.array(dtype=Contact),
    ):
        """Writes the contacts of one pair or wall candidate from `new` on, up to `room`; returns their number."""
        found = int(0)
        cursor = old + int(wp.max(wp.abs(memory[0]) - wp.float64(1.0), wp.float64(0.0)))
        last = cursor + int(wp.abs(memory[1]))
        kind = int(0)
        while kind < 4:
            many_p, many_s = int(0), int(0)
            if (kind == wp.static(WALL)) == (j < 0):
                field_i, field_j = shapes.table[b.kind[i]].field + 0, int(-1)
                count_i, count_j = shapes.table[b.kind[i]].count + 0, int(1)
                if j >= 0:
                    field_j, count_j = shapes.table[b.kind[j]].field + 0, shapes.table[b.kind[j]].count + 0
                if kind == wp.static(WALL) or (kind == wp.static(A_IN_B) and field_j >= 0):
                    many_p, many_s = count_i, int(1)
                elif kind == wp.static(B_IN_A) and field_i >= 0:
                    many_p, many_s = int(1), count_j
                elif kind == wp.static(SPHERES) and field_i < 0 and field_j < 0:
                    many_p, many_s = count_i, count_j
            owner, other = i, j
            if kind == wp.static(A_IN_B):
                owner, other = j, i
            turn, shift = wp.quatd(), wp.vec3d()
            if many_p > 0 and (kind == wp.static(A_IN_B) or kind == wp.static(B_IN_A)):
                turn = wp.quat_inverse(shapes.turn[ids[owner]]) * shapes.turn[ids[other]]
                shift = wp.quat_rotate_inv(shapes.turn[ids[owner]], centre_of(b, other) - centre_of(b, owner))
            for p in range(many_p):
                for s in range(many_s):
                    # most probes are far from the surface of the other body; of p and s one is the probe, one is 0
                    if kind == wp.static(A_IN_B) or kind == wp.static(B_IN_A):
                        if not may_touch(shapes, b, owner, other, p + s, turn, shift, reach):
                            continue
                    gap, n, point = touch(shapes, b, ids, walls, i, j, feature, kind, p, s)
                    if gap < reach:
                        c = Contact()
                        c.a = i
                        c.b = j
                        c.feature = feature
                        c.kind = kind
                        c.p = p
                        c.s = s
                        c.slot = slot
                        c.gap = gap
                        c.n = n
                        c.ra = point - centre_of(b, i)
                        if j >= 0:
                            c.rb = point - centre_of(b, j)
                        approach = wp.min(wp.dot(relative(b, walls, c), n), wp.float64(0.0))
                        if gap + approach * dt < margin:
                            if found < room:
                                key = rank(kind, p, s)
                                while cursor < last and rank_of(contacts, cursor) < key:
                                    cursor += 1
                                if cursor < last and rank_of(contacts, cursor) == key:
                                    c.memory = contacts[cursor].memory
                                contacts[new + found] = c
                            found += 1
            kind += 1
        return found

    @wp.func
    def find(
        shapes: Shapes,
        b: Bodies,
        ids: wp.array(dtype=wp.int32),
        walls: Walls,
        lists: Lists,
        pairs: int,
        candidates: int,
        side: int,
        capacity: int,
        dt: wp.float64,
        margin: wp.float64,
        contacts: wp.array(dtype=Contact),
    ):
        found = int(0)
        old, new = side * capacity, (1 - side) * capacity
        for k in range(pairs + candidates):
            i, j, feature, slot = int(0), int(-1), int(-1), int(k)
            near = int(0)
            reach = wp.float64(0.0)
            memory = wp.vec4d()
            if k < pairs:
                # the lower index in the scene comes first, so that the order does not change with the lists
                swapped = ids[lists.i[k]] > ids[lists.j[k]]
                i = wp.where(swapped, lists.j[k], lists.i[k])
                j = wp.where(swapped, lists.i[k], lists.j[k])
                memory = wp.vec4d(lists.memory[k])
                reach = margin + dt * (speed_bound(b, i) + speed_bound(b, j))
                if not (immovable(b, i) and immovable(b, j)):
                    d = wp.length(centre_of(b, i) - centre_of(b, j))
                    if d < b.kin[i][6] + b.kin[j][6] + reach:
                        near = 1
            elif wp.static(present):
                slot = k - pairs
                i = lists.wall_i[slot] + 0
                feature = lists.wall_f[slot] + 0
                memory = wp.vec4d(lists.wall_memory[slot])
                x = centre_of(b, i)
                distance = within(walls, feature, 0, x, b.kin[i][6])
                reach = margin + dt * (speed_bound(b, i) + wp.length(velocity_of(walls, feature, 0, x)))
                if distance < b.kin[i][6] + reach and not immovable(b, i):
                    near = 1
            if near == 1:
                room = capacity - found
                found += points(
                    shapes, b, ids, walls, i, j, feature, slot, memory, old, new + found, room, dt, margin, reach,
                    contacts,
                )  # fmt: skip
        return found

    @wp.func
    def commit(
        lists: Lists,
        pairs: int,
        candidates: int,
        contacts: wp.array(dtype=Contact),
        first: int,
        count: int,
    ):
        for k in range(pairs):
            lists.memory[k] = wp.vec4d()
        for k in range(candidates):
            lists.wall_memory[k] = wp.vec4d()
        one = wp.float64(1.0)
        begin = int(0)
        for q in range(count):
            c = contacts[first + q]
            if ends_pair(contacts, first + q, first + count):
                place = wp.vec4d(wp.float64(begin + 1), wp.float64(q + 1 - begin), wp.float64(0.0), one)
                if c.b >= 0:
                    lists.memory[c.slot] = place
                else:
                    lists.wall_memory[c.slot] = place
                begin = q + 1
        return begin

    return SimpleNamespace(find=find, commit=commit, relative=relative)
