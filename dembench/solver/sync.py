"""A barrier between the threads of a step."""

import warp as wp

# Spins briefly, then yields the core: a waiting thread must not keep a core from the one that it waits for.
_BARRIER = """
    int sched_yield(void) __asm__("sched_yield");
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
