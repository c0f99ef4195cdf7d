"""The reference workload: fixed work that no solver takes part in, timed beside runs.

The speed of a run is its CPU time over that of this work on the same cores, so that a slower or busier machine is no
slower program. As a program, `python -m dembench.runs.workload CORES` pins itself, works and prints its CPU times.

The work is three kinds of what a discrete-element step does, in libraries that are compiled apart from the solvers:
arithmetic on arrays that fit a cache, scattered reads and sums in arrays that do not, and a search for neighbours with
its branches. CPU times are compared, not wall times: waiting for a core is no work. What other programs do then slows
memory and shared caches only, and always makes times longer, so the fastest of several passes is the least disturbed.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

VERSION = 1
"""Version of the work: ratios to different versions are not compared."""
PASSES = 4
"""Times that each part is done before a run, and again after it."""
RECORD = "workload"
"""Name under which the resources of a run hold the passes."""
_LENGTH = 1 << 16
_SCATTERED = 1 << 20
_POINTS = 24000

Passes = dict[str, list[float]]
"""CPU times of the passes of each part [s]."""


def parts() -> dict[str, Callable[[], Any]]:
    """The parts of the work by name; the same numbers every time."""
    from scipy.spatial import cKDTree

    rng = np.random.default_rng(20240817)
    small, large = rng.random(_LENGTH), rng.random(_SCATTERED)
    places = rng.integers(0, _SCATTERED, _SCATTERED // 2)
    points = rng.random((_POINTS, 3))
    reach = 1.5 * _POINTS ** (-1 / 3)

    def arithmetic() -> None:
        x = small
        for _ in range(150):
            x = np.sqrt(1.7 * x + 0.3) / (x + 0.5)

    def scatter() -> None:
        for _ in range(2):
            np.bincount(places, weights=large[places], minlength=_SCATTERED)

    def search() -> None:
        cKDTree(points).query_pairs(reach, output_type="ndarray")

    return {"arithmetic": arithmetic, "scatter": scatter, "search": search}


class Workload:
    """The work, ready to be done again and again in this process."""

    def __init__(self) -> None:
        """Makes the data and does every part once, so that memory is there."""
        self._parts = parts()
        for part in self._parts.values():
            part()

    def measure(self, passes: int = 1) -> Passes:
        """CPU times of every part [s], the parts taking turns."""
        found: Passes = {name: [] for name in self._parts}
        for _ in range(passes):
            for name, part in self._parts.items():
                begin = time.process_time()
                part()
                found[name].append(time.process_time() - begin)
        return found


def measure_on(cores: Sequence[int]) -> dict[str, Any]:
    """The passes of a program of its own that is pinned to some cores, with the version of the work.

    Raises:
        OSError, subprocess.SubprocessError, ValueError: The program did not do its work.
    """
    command = [sys.executable, "-m", "dembench.runs.workload", ",".join(map(str, cores))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return {"version": VERSION, "passes": json.loads(done.stdout)}


def added(before: Mapping[str, Any], found: Mapping[str, Any]) -> dict[str, Any]:
    """The records of two times as one; the first is empty or of the same version."""
    passes = {name: [*before.get("passes", {}).get(name, []), *times] for name, times in found["passes"].items()}
    return {**found, "passes": passes}


def cpu_time(timing: Mapping[str, Any], resources: Mapping[str, Any]) -> float | None:
    """CPU time of a run that is compared with the work [s]: of its stepping loop, else of its timed phases."""
    found = timing.get("loop_cpu") or resources.get("cpu")
    return float(found) if found else None


def reference_time(measured: Iterable[Mapping[str, Sequence[float]]]) -> float:
    """CPU time of the work where it was least disturbed [s]: the geometric mean of the fastest passes of the parts.

    Args:
        measured: Passes of one or several times.

    Raises:
        ValueError: There is none.
    """
    fastest: dict[str, float] = {}
    for passes in measured:
        for name, times in passes.items():
            fastest[name] = min([fastest.get(name, math.inf), *times])
    if not fastest or not all(0 < value < math.inf for value in fastest.values()):
        raise ValueError("the reference workload was not measured")
    return math.exp(sum(map(math.log, fastest.values())) / len(fastest))


def main() -> None:
    """Entry of the program."""
    cores = [int(core) for core in sys.argv[1].split(",") if core]
    if cores and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, cores)
    print(json.dumps(Workload().measure(PASSES)))


if __name__ == "__main__":
    main()
