"""What compiled code needs of the machine: a barrier between the threads of a step, and prefetching."""

from types import SimpleNamespace
from typing import Any

import warp as wp

from dembench.solver.types import vec8d

# Spins briefly, then yields the core: a waiting thread must not keep a core from the one that it waits for.
_BARRIER = """
    int sched_yield() __asm__("sched_yield");
    int generation = __atomic_load_n(&state.data[1], __ATOMIC_ACQUIRE);
    if (__atomic_add_fetch(&state.data[0], 1, __ATOMIC_ACQ_REL) == threads) {
        __atomic_store_n(&state.data[0], 0, __ATOMIC_RELAXED);
        __atomic_store_n(&state.data[1], generation + 1, __ATOMIC_RELEASE);
    } else {
        int spins = 0;
        while (__atomic_load_n(&state.data[1], __ATOMIC_ACQUIRE) == generation) {
            if (++spins > 20000) sched_yield();
        }
    }
"""


@wp.func_native(_BARRIER)
def barrier(state: wp.array(dtype=wp.int32), threads: int): ...


def row_functions(record: Any, rows: Any, pairs: Any, memory: Any, rotation: bool) -> Any:
    """Direct access to the rows of the arrays that the pair loop lives on, as Warp functions.

    The generated access allows negative indices and any stride, which doubles the instructions of a pair; here both are
    known. prefetch(bodies, i) asks for what a contact reads of body i before it is needed: neighbours stand in no order
    that the hardware foresees.

    Args:
        record: The record Bodies.
        rows: Type of a row of `load`.
        pairs: The record Lists.
        memory: Type of a row of contact memory.
        rotation: Whether bodies turn: `load` is then added to, else `force`.
    """

    @wp.func_native("return b.kin.data[i];")
    def kin(b: record, i: int) -> vec8d: ...

    @wp.func_native("return b.spin.data[i];")
    def spin(b: record, i: int) -> memory: ...

    @wp.func_native(
        "for (int k = 0; k < 8; ++k) b.load.data[i].c[k] += row.c[k];"
        if rotation
        else "for (int k = 0; k < 4; ++k) b.force.data[i].c[k] += row.c[k];"
    )
    def add_load(b: record, i: int, row: rows): ...

    @wp.func_native("return lists.memory.data[k];")
    def memory_of(lists: pairs, k: int) -> memory: ...

    @wp.func_native("lists.memory.data[k] = m;")
    def set_memory(lists: pairs, k: int, m: memory): ...

    @wp.func_native("return values.data[k];")
    def entry(values: wp.array(dtype=wp.int32), k: int) -> int: ...

    @wp.func_native("values.data[k] = value;")
    def set_entry(values: wp.array(dtype=wp.int32), k: int, value: int): ...

    @wp.func_native(
        "__builtin_prefetch(&b.kin.data[i]);"
        + (
            "__builtin_prefetch(&b.spin.data[i]);__builtin_prefetch(&b.load.data[i], 1);"
            if rotation
            else "__builtin_prefetch(&b.force.data[i], 1);"
        )
    )
    def prefetch(b: record, i: int): ...

    return SimpleNamespace(
        kin=kin,
        spin=spin,
        add_load=add_load,
        memory_of=memory_of,
        set_memory=set_memory,
        entry=entry,
        set_entry=set_entry,
        prefetch=prefetch,
    )
