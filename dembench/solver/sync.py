"""What compiled code needs of the machine: a barrier between the threads of a step, and prefetching."""

from typing import Any

import warp as wp

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


def prefetch_function(record: Any) -> Any:
    """A Warp function (bodies, i) that asks for what a contact reads of body i before it is needed.

    Neighbours stand in no order that the hardware foresees; without this a fifth of the time of a step is waiting.
    """

    @wp.func_native(
        "__builtin_prefetch(&b.kin.data[i]);__builtin_prefetch(&b.spin.data[i]);__builtin_prefetch(&b.load.data[i], 1);"
    )
    def prefetch(b: record, i: int): ...

    return prefetch
