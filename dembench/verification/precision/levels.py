"""The cheapest setting of each engine that reaches a level of error."""

from __future__ import annotations

from dataclasses import dataclass

from dembench.scoring.precision import Order, cheapest, order
from dembench.verification.precision.store import Measure, Point, Sweep

LEVELS = {"1 %": 0.01, "5 %": 0.05}
"""Errors that are asked for [-]."""
BAND = "band"
"""Level of ensembles: no error beyond what the seeds alone make."""


@dataclass(frozen=True)
class Cheapest:
    """The cheapest point of a variant that reaches a level in every measure.

    Attributes:
        variant: The engine as typed, without the knob.
        level: `1 %`, `5 %` or `band`.
        label: The engine with the knob; empty where none reaches the level.
        value: Value of the knob; empty likewise.
        point: The point; None likewise.
        limit: Where it is not reached: the measure that fails by most at the best point.
    """

    variant: str
    level: str
    label: str
    value: str
    point: Point | None
    limit: str = ""

    def cost(self) -> str:
        """Time of its stepping loop in words."""
        return f"{self.point.loop.median:.3g} s" if self.point and self.point.loop else "-"


def levels(sweep: Sweep) -> list[str]:
    """The levels that a sweep can be asked for."""
    return [*LEVELS, BAND] if sweep.kind == "ensemble" else list(LEVELS)


def excess(sweep: Sweep, point: Point, level: str) -> tuple[float, str]:
    """Largest error of a point over what the level allows, and the measure that has it; at most 1 where it is reached.

    Distances D know only the band. Nothing below the band of the seeds can be told, so a level below it is not reached.
    """
    worst, where = 0.0, ""
    for measure in sweep.measures:
        found = point.error(measure.name)
        if measure.kind == "distance" and level != BAND:
            continue
        if found is None or found.total is None:
            return float("inf"), measure.title
        over = _over(measure, found.total, found.band, level)
        if over > worst:
            worst, where = over, measure.title
    return worst, where


def _over(measure: Measure, error: float, band: float, level: str) -> float:
    if level == BAND:
        return error / band if band else (float("inf") if error else 0.0)
    return max(error, band) / LEVELS[level]


def cheapest_settings(sweep: Sweep) -> list[Cheapest]:
    """For each variant and level the cheapest point."""
    found = []
    for variant in sweep.variants():
        points = [p for p in sweep.of(variant) if p.state == "ok" and p.loop is not None]
        for level in levels(sweep):
            over = [excess(sweep, p, level) for p in points]
            k = cheapest([p.loop.median for p in points if p.loop], [o for o, _ in over], 1.0)
            if k is not None:
                found.append(Cheapest(variant, level, points[k].label, points[k].value, points[k]))
            else:
                limit = min(over, default=(0.0, "no run came to its end"))[1]
                found.append(Cheapest(variant, level, "", "", None, limit))
    return found


def measured_order(points: list[Point], measure: str, own: bool = False) -> Order | None:
    """Order of accuracy of the points of a variant in one measure, above its band; None where none shows.

    Args:
        points: The points.
        measure: Name of the measure.
        own: Of the distance to the engine's own limit, which shows an order where another law hides it, and not of the
            total error.
    """
    errors = [(point.dt, point.error(measure)) for point in points]
    known = [(dt, e.own if own else e.total, 0.0 if own else e.band) for dt, e in errors if e is not None]
    shown = [(dt, e) for dt, e, band in known if e is not None and e > band]
    return order([dt for dt, _ in shown], [e for _, e in shown])


def costs(sweeps: list[Sweep], level: str) -> dict[str, dict[str, float]]:
    """Cost of reaching a level by variant and problem, for performance profiles; infinite where it is not reached.

    A variant that did not take part in a problem has not solved it.
    """
    found: dict[str, dict[str, float]] = {}
    for sweep in sweeps:
        problem = f"{sweep.target}, {sweep.knob}"
        for one in cheapest_settings(sweep):
            if one.level == level:
                loop = one.point.loop.median if one.point and one.point.loop else float("inf")
                found.setdefault(one.variant, {})[problem] = loop
    return found
