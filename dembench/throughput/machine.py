"""What a machine can do at most, and what a step needs at least: the roofline of Williams, Waterman and Patterson.

The roofline (Commun. ACM 52, 65, 2009, doi 10.1145/1498765.1498785) bounds the speed of a program by the arithmetic of
the machine and by its memory bandwidth, whichever it meets first. Both are measured on the cores that runs have. As a
program, `python -m dembench.throughput.machine CORES` pins itself, measures and prints JSON; in a process of its own,
so that libraries take no other threads than it says.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

COPIED = 1 << 24
"""Numbers in float64 that each core copies, 128 MiB: more than caches hold."""
MATRIX = 768
"""Rows of the matrices that each core multiplies."""
PASSES, WHILE = 7, 1.5
"""The best of so many passes counts, or of as many as fit into that time [s]: what disturbs makes them slower."""

BODY_FLOPS = {"velocity": 9, "position": 6, "spin": 6}
"""Floating-point operations of a body in a step, every component counted: v += (F/m + g) dt, x += v dt, w += T/I dt."""
CONTACT_FLOPS = {
    "distance, normal and overlap": 15,
    "velocity at the contact, normal and tangential": 35,
    "spring and dashpot of the normal": 10,
    "shear spring turned, stretched and bounded by friction": 36,
    "forces and torques on both bodies": 33,
}
"""Those of a contact of two spheres with the Hertz-Mindlin law, friction and shear history, roots counted as one."""
BODY_BYTES = 2 * 9 * 8
"""Bytes that a step moves for a body [B]: position, velocity and spin in float64, read once and written once."""
CONTACT_BYTES = 2 * 3 * 8 + 2 * 4
"""Bytes that it moves for a contact [B]: the shear spring in float64, read and written, and two indices in 32 bits."""


@dataclass(frozen=True)
class Work:
    """The least that a step does for each body.

    Attributes:
        flops: Floating-point operations [-].
        moved: Bytes read and written [B].
    """

    flops: float
    moved: float

    @property
    def intensity(self) -> float:
        """Operations for each byte [1/B]."""
        return self.flops / self.moved


def least_work(touching: float) -> Work:
    """What a step of soft spheres does at least: contacts are evaluated once, lists of neighbours cost nothing.

    Args:
        touching: Pairs that touch, over the number of bodies [-].
    """
    return Work(
        sum(BODY_FLOPS.values()) + touching * sum(CONTACT_FLOPS.values()), BODY_BYTES + touching * CONTACT_BYTES
    )


@dataclass(frozen=True)
class Machine:
    """Measured limits of some cores.

    Attributes:
        cores: Number of cores.
        bandwidth: Bytes read and written per second by copies of large arrays [B/s].
        single, double: Floating-point operations per second in products of matrices [1/s], in both precisions.
        busy: CPU time over wall time and cores in the best pass, the least of the three [-]; below 1 where other
            programs held the cores, and the limits are understated.
    """

    cores: int
    bandwidth: float
    single: float
    double: float
    busy: float

    def attainable(self, work: Work) -> float:
        """Particle-steps per second that the roofline allows in float64 [1/s]."""
        return min(self.double / work.flops, self.bandwidth / work.moved)


def measured(cores: Sequence[int]) -> Machine:
    """The limits of some cores, from a process that is pinned to them.

    Args:
        cores: Numbers of the cores.

    Raises:
        RuntimeError: The program did not end well.
    """
    one_each = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [sys.executable, "-m", "dembench.throughput.machine", ",".join(map(str, cores))]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **one_each})
    if done.returncode:
        raise RuntimeError(f"the limits of the machine could not be measured: {done.stderr.strip()[-300:]}")
    return Machine(**json.loads(done.stdout))


def _best(cores: int, work: Callable[[int], None]) -> tuple[float, float]:
    """Shortest wall time in which all cores do their work at once [s], and the share of it that they worked."""
    passes: list[tuple[float, float]] = []
    end = time.perf_counter() + WHILE
    with ThreadPoolExecutor(cores) as pool:
        while len(passes) < PASSES or time.perf_counter() < end:
            begun, spent = time.perf_counter(), time.process_time()
            list(pool.map(work, range(cores)))
            wall = time.perf_counter() - begun
            passes.append((wall, (time.process_time() - spent) / (wall * cores)))
    return min(passes)


def _measure(cores: int) -> Machine:
    sources = [np.ones(COPIED) for _ in range(cores)]
    targets = [np.zeros(COPIED) for _ in range(cores)]
    copying, busy = _best(cores, lambda k: np.copyto(targets[k], sources[k]))
    rates, shares = [cores * 2 * sources[0].nbytes / copying], [busy]
    for kind in (np.float32, np.float64):
        factors = [np.ones((MATRIX, MATRIX), dtype=kind) for _ in range(cores)]
        products = [np.empty_like(factor) for factor in factors]

        def multiply(k: int, factors: list[np.ndarray] = factors, products: list[np.ndarray] = products) -> None:
            np.matmul(factors[k], factors[k], out=products[k])

        taken, busy = _best(cores, multiply)
        rates.append(cores * 2 * MATRIX**3 / taken)
        shares.append(busy)
    bandwidth, single, double = rates
    return Machine(cores, bandwidth, single, double, min(shares))


if __name__ == "__main__":
    pinned = [int(core) for core in sys.argv[1].split(",")]
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, pinned)
    print(json.dumps(vars(_measure(len(pinned)))))
