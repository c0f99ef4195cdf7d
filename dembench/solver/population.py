"""Bodies that leave and come during a run: the arrays and the lists of a state under a new numbering."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from dembench.solver.workspace import blocks

if TYPE_CHECKING:
    from dembench.solver.state import State

GROWTH = 1.2
"""Room for bodies after an insertion that needs more than there is, in bodies."""


def drain(state: State) -> tuple[int, bool]:
    """Takes the bodies in a sink out of a state, whose lists are then due for a rebuild.

    Returns:
        How many left, and whether one of them was in contact with a body that stays.
    """
    if not state.sinks:
        return 0, False
    leaves, kin = np.zeros(state.total, dtype=bool), state.bodies.kin.numpy()
    for block in blocks(state.total):
        position = kin[block, :3] * state.units.length
        for k, region in enumerate(state.sinks):
            inside = region.contains(position) & ~leaves[block]
            state.drained[k] += np.count_nonzero(inside)
            leaves[block] |= inside
    return int(np.count_nonzero(leaves)), bool(leaves.any()) and remove(state, leaves)


def remove(state: State, leaves: np.ndarray) -> bool:
    """Takes bodies out of a state, whose lists are then due for a rebuild.

    Args:
        state: With half lists.
        leaves: Which bodies of the sorted arrays leave, shape (total,), bool.

    Returns:
        Whether one of them was in contact with a body that stays.
    """
    source = np.flatnonzero(~leaves).astype(np.int32)
    touched = any(
        bool(_in_contact(state, i, j, memory)[leaves[i] != leaves[j]].any())
        for i, j, memory in (*listed_pairs(state), *large_pairs(state))
    )
    renumber(state, source, int(np.count_nonzero(source < state.n)))
    return touched


def _in_contact(state: State, i: np.ndarray, j: np.ndarray, memory: np.ndarray) -> np.ndarray:
    """Which of the listed pairs touch, shape (k,): by their memory, or by their distance where they have none."""
    if state.needs.history:
        return memory[:, 3] != 0
    kin = state.bodies.kin.numpy()
    apart = kin[i, :3] - kin[j, :3]
    box = np.where(state.box > 0, state.box, np.inf)
    apart -= np.where(state.box > 0, state.box, 0.0) * np.round(apart / box)
    return (i != j) & (np.linalg.norm(apart, axis=1) < kin[i, 6] + kin[j, 6])


def insert(state: State, values: dict[str, np.ndarray], ids: np.ndarray) -> None:
    """Puts small bodies into a state, whose lists are then due for a rebuild.

    Args:
        state: With half lists.
        values: Columns of the new bodies by name of the array in `Bodies`, shape (k, ...) in scene units; what the
            state leaves out is not kept.
        ids: Their ids, shape (k,), above all ids that were ever given.
    """
    new = np.full(len(ids), -1)
    first, last = state.n, state.n + len(ids)
    renumber(state, np.concatenate([np.arange(first), new, np.arange(first, state.total)]), last)
    for name, columns in values.items():
        array = getattr(state.bodies, name)
        if len(array):
            array.numpy()[first:last] = columns
    state.identity.numpy()[first:last] = ids
    state.limit = int(ids[-1]) + 1
    state.reach = max(state.reach, 2 * float(values["kin"][:, 6].max()))


def renumber(state: State, source: np.ndarray, small: int) -> None:
    """Numbers the bodies anew: body k is that which was source[k], or a blank one where that is -1.

    The contact memory of the pairs that stay moves along; the lists are then due for a rebuild.

    Args:
        state: With half lists.
        source: Shape (new total,); the first `small` are small bodies, the others large ones.
        small: Number of small bodies.
    """
    old_n, old_total, rows = state.n, state.total, state.big_rows
    kept = source >= 0
    place = np.full(old_total, -1, dtype=np.int32)
    backwards = False
    for block in blocks(len(source)):
        of, at = source[block], np.arange(block.start, block.stop, dtype=np.int32)
        place[of[of >= 0]] = at[of >= 0]
        backwards |= bool((of < at).any())
    _renumber_lists(state, place)
    arrays = {name: getattr(state.bodies, name) for name in state.bodies._cls.vars}
    held = {name: a.numpy()[:old_total] for name, a in arrays.items() if isinstance(a, wp.array) and len(a)}
    identity = state.identity.numpy()[:old_total]
    memory = np.zeros((rows, old_total, 4))
    if state.needs.history:
        memory = state.lists.big_memory.numpy()[: rows * old_total].reshape(rows, old_total, 4)
    total, bigs = len(source), source[small:] - old_n
    moved = np.zeros((len(bigs), total, 4), dtype=memory.dtype)
    moved[:, kept] = memory[bigs][:, source[kept]]
    state.n, state.total = small, total
    remembers = state.needs.history
    if total > len(state.identity) or (remembers and len(bigs) * total > len(state.lists.big_memory)):
        room = int(GROWTH * total) + 64
        state.allocate(room)
        state.lists.big_memory = state.contact_memory(len(bigs) * room)
    state.divide()
    if remembers:
        state.lists.big_memory.numpy()[: moved.size // 4] = moved.reshape(-1, 4)
    for name, old in held.items():
        _move(old, getattr(state.bodies, name).numpy(), source, backwards)
    _move(identity, state.identity.numpy(), source, backwards)


def _move(old: np.ndarray, new: np.ndarray, source: np.ndarray, backwards: bool) -> None:
    """Makes row k of `new` that which was source[k] of `old`, 0 where that is -1; both may be the same array.

    `backwards`: some row comes from before its new place, where it would be written over before it is read.
    """
    if backwards:
        old = old.copy()
    for block in blocks(len(source)):
        of = source[block]
        rows = np.zeros((len(of), *old.shape[1:]), dtype=old.dtype)
        rows[of >= 0] = old[of[of >= 0]]
        new[block] = rows


def _renumber_lists(state: State, place: np.ndarray) -> None:
    for pairs in listed_pairs(state):
        for block in blocks(len(pairs[0])):
            i, j, memory = (array[block] for array in pairs)
            new_i, new_j = place[i], place[j]
            gone = (new_i < 0) | (new_j < 0)
            memory[gone[: len(memory)]] = 0
            i[:], j[:] = np.where(gone, 0, new_i), np.where(gone, 0, new_j)
    for body, memory in listed_at_walls(state):
        new = place[body]
        memory[(new < 0)[: len(memory)]] = 0
        body[:] = np.maximum(new, 0)


def listed_at_walls(state: State) -> list[tuple[Any, Any]]:
    """Bodies and memory of the listed candidates of walls, by thread; views of the arrays of the state."""
    found = []
    for part, count in enumerate(state.wall_count.numpy()):
        listed = slice(part * state.wall_capacity, part * state.wall_capacity + int(count))
        found.append((state.lists.wall_i.numpy()[listed], state.lists.wall_memory.numpy()[listed]))
    return found


def listed_pairs(state: State) -> list[tuple[Any, Any, Any]]:
    """Bodies and memory of the listed pairs of small bodies, by region; views of the arrays of the state."""
    base, lists = state.base.numpy(), state.lists
    found = []
    for region, count in enumerate(state.pair_count.numpy()):
        listed = slice(int(base[region]), int(base[region]) + int(count))
        found.append((lists.i.numpy()[listed], lists.j.numpy()[listed], lists.memory.numpy()[listed]))
    return found


def large_pairs(state: State) -> list[tuple[Any, Any, Any]]:
    """The same for all bodies with each large one."""
    memory = state.lists.big_memory.numpy()
    every = np.arange(state.total)
    return [
        (every, np.full(state.total, state.n + row), memory[row * state.total : (row + 1) * state.total])
        for row in range(state.big_rows)
    ]
