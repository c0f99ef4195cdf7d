"""What a step costs by the number of bodies, their contacts and the cores: a model that is fitted to measured rates.

    t(N, z, p) = (a + b z + c m(N))/p + d (1 - 1/p) + e/N,      m(N) = max(0, 1 - L/(q N)),      M(N) = M0 + q N

t is the wall time of a step for each of N bodies with z touching pairs each, on p cores; a and b are the work of a body
and of a pair, c what is added where the data of the bodies, q bytes each, do not fit into the last cache of L bytes, d
what more cores do not shorten (Amdahl's law), and e what a step takes however few bodies there are. None is negative:
least squares of relative deviations by Lawson and Hanson (Solving Least Squares Problems, 1974). M is the memory of the
processes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from dembench.throughput.rates import Rate

LEAST_ROWS = 3
"""Rates of an engine from which a model is made."""
ALIKE = 0.1
"""Pairs of bodies that differ by less over all scenes do not tell apart the work of bodies and of pairs [-]."""


@dataclass(frozen=True)
class Model:
    """A fitted model of one engine; a term that the rates do not tell is 0.

    Attributes:
        engine: The engine with its settings as typed.
        body, pair, beyond, serial, step: a, b, c, d and e of the model [s].
        terms: Names of those that the rates tell.
        memory: M0 and q of the model [B], or None where all rates are of about one size.
        cache: The last cache L [B], or None where it is not known.
        deviation: Largest relative deviation of a rate from the model [-].
        rates: Number of rates.
        divided: Whether the engine divides a scene among processes, which may stand on several machines.
    """

    engine: str
    body: float
    pair: float
    beyond: float
    serial: float
    step: float
    terms: tuple[str, ...]
    memory: tuple[float, float] | None
    cache: float | None
    deviation: float
    rates: int
    divided: bool

    def time(self, bodies: float, touching: float, cores: int) -> float:
        """Wall time of a step for each body [s]."""
        work = self.body + self.pair * touching + self.beyond * _outside(bodies, self.memory, self.cache)
        return work / cores + self.serial * (1 - 1 / cores) + self.step / bodies

    def limit(self, memory: float) -> float | None:
        """Number of bodies for which a memory suffices [B]."""
        return None if self.memory is None else max(0.0, (memory - self.memory[0]) / self.memory[1])

    def gain(self, bodies: float, touching: float) -> float | None:
        """What any number of cores gains over one at most [-]; None where it is not known."""
        return self.time(bodies, touching, 1) / self.serial if self.serial else None


def fitted(rows: Sequence[Rate], cache: float | None) -> list[Model]:
    """A model of each engine with rates enough.

    Args:
        rows: Rates of scenes in any number.
        cache: Size of the last cache [B], or None where it is not known.
    """
    own: dict[str, list[Rate]] = {}
    for row in rows:
        if row.particle_steps_per_second is not None and not row.law:
            own.setdefault(row.engine, []).append(row)
    return [_fit(engine, found, cache) for engine, found in own.items() if len(found) >= LEAST_ROWS]


def _fit(engine: str, rows: Sequence[Rate], cache: float | None) -> Model:
    memory = _memory(rows)
    n, z, p = (np.array([getattr(row, name) for row in rows], float) for name in ("bodies", "touching", "cores"))
    time = np.array([1 / row.particle_steps_per_second for row in rows if row.particle_steps_per_second])
    outside = np.array([_outside(bodies, memory, cache) for bodies in n])
    columns = {"body": 1 / p, "pair": z / p, "beyond": outside / p, "serial": 1 - 1 / p, "step": 1 / n}
    told = ["body"]
    told += ["pair"] if np.ptp(z) > ALIKE * z.max() else []
    told += ["beyond"] if np.ptp(outside) > 0 else []
    told += ["serial"] if np.ptp(p) > 0 else []
    told += ["step"] if n.max() > 2 * n.min() else []
    # relative deviations: every equation is divided by its time
    matrix = np.stack([columns[name] / time for name in told], axis=1)
    scale = np.linalg.norm(matrix, axis=0)
    found, _ = nnls(matrix / scale, np.ones(len(rows)))
    values = dict.fromkeys(columns, 0.0) | dict(zip(told, (found / scale).tolist(), strict=True))
    return Model(
        engine,
        **values,
        terms=tuple(told),
        memory=memory,
        cache=cache,
        deviation=float(np.abs(matrix @ (found / scale) - 1).max()),
        rates=len(rows),
        divided="ranks" in rows[0].settings,
    )


def _memory(rows: Sequence[Rate]) -> tuple[float, float] | None:
    """Memory without bodies and of each body [B], from the rates with the fewest cores."""
    least = min(row.cores for row in rows)
    known = [(row.bodies, row.peak_memory) for row in rows if row.cores == least and row.peak_memory]
    if not known or max(b for b, _ in known) < 2 * min(b for b, _ in known):
        return None
    bodies, used = np.array(known, float).T
    slope, base = np.polyfit(bodies, used, 1)
    return (float(base), float(slope)) if slope > 0 else None


def _outside(bodies: float, memory: tuple[float, float] | None, cache: float | None) -> float:
    """Share of the data of the bodies that has no place in the cache [-]."""
    if memory is None or cache is None:
        return 0.0
    return max(0.0, 1 - cache / (memory[1] * max(bodies, math.ulp(1.0))))
