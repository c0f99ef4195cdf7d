"""Figures of sweeps: error against run time, against work and against the time step; performance profiles."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dembench.reports.figures import DASHES, MARKERS
from dembench.reports.looks import look
from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.scoring.precision import front, profiles
from dembench.verification.precision import knobs
from dembench.verification.precision.levels import BAND, LEVELS, costs
from dembench.verification.precision.store import Class, Measure, Point, Sweep

KINDS: dict[Class, tuple[str, str]] = {
    "closed form": ("Relative error against run time", "Relative error"),
    "path": ("Error of paths against run time", "Distance in diameters"),
    "distance": ("Distance of ensembles against run time", "Distance D in spreads of the seeds"),
    "number": ("Bias of ensembles against run time", "Relative bias"),
    "cycle": ("Errors of cycles against run time", "Error"),
}
"""Title and vertical axis of the diagram of each kind of error."""
LOST = ("failed", "timeout", "interrupted")
"""States of points that stand at the top: runs that were started and gave no result."""
TOP = 3.0
"""Height at which runs without a result stand, over the largest error."""
SEEDS, REFERENCES = "what the seeds alone make", "how far the references still move"
"""What the grey band is: of ensembles, and of paths."""
Axis = Callable[[Point], float | None]


def plots(sweep: Sweep, name: str) -> list[Plot]:
    """The figures of a sweep: one diagram for each kind of error, against time, passes and the time step.

    Args:
        sweep: The sweep.
        name: Beginning of the names of its figures.
    """
    found = []
    for kind, (title, label) in KINDS.items():
        own = [m for m in sweep.measures if m.kind == kind and _values(sweep, m)]
        if not own:
            continue
        slug = f"{name}-{kind.replace(' ', '-')}"
        found.append(_diagram(sweep, own, label, f"{slug}-time", title, "Time of the stepping loop [s]", _time, True))
        work = title.replace("run time", "work")
        found.append(_diagram(sweep, own, label, f"{slug}-work", work, "Passes over the contacts", _passes, False))
        if sweep.knob == knobs.DT:
            steps = title.replace("run time", "the time step")
            found.append(_diagram(sweep, own, label, f"{slug}-step", steps, "Time step [s]", _step, False))
    return found


def _time(point: Point) -> float | None:
    return point.loop.median if point.loop else None


def _passes(point: Point) -> float | None:
    return point.passes


def _step(point: Point) -> float | None:
    return point.dt


def _diagram(
    sweep: Sweep, measures: Sequence[Measure], label: str, name: str, title: str, x_label: str, axis: Axis, front: bool
) -> Plot:
    """One row per measure: the total error and, beside it, the distance to the engine's own limit."""
    panels = []
    for measure in measures:
        panels.append(_panel(sweep, measure, label, axis, total=True, envelope=front))
        panels.append(_panel(sweep, measure, label, axis, total=False, envelope=False))
    bands = any(e.band for p in sweep.points for e in p.errors if e.measure in {m.name for m in measures})
    return Plot(
        name=name,
        title=title,
        caption=" ".join(
            [
                f"{sweep.problem.title}; one line per engine through its values of {sweep.knob}, coarse to fine.",
                "Own limit: distance to the engine's own finest run, which says nothing about the law.",
                "Triangles at the top: no result." if any(p.state in LOST for p in sweep.points) else "",
                "Dotted line: what no other point beats in both." if front else "",
                f"Grey band: {_band_words(measures[0])}; nothing is ranked in it." if bands else "",
            ]
        ).strip(),
        x_label=x_label,
        panels=tuple(p for p in panels if p.lines),
        command=sweep.command,
        log_x=True,
        columns=2,
    )


def _values(sweep: Sweep, measure: Measure) -> list[float]:
    """Errors of a measure that a logarithmic axis can show."""
    errors = [e for p in sweep.points if (e := p.error(measure.name)) is not None]
    return [v for e in errors for v in (e.total, e.own) if v]


def _panel(sweep: Sweep, measure: Measure, label: str, axis: Axis, *, total: bool, envelope: bool) -> Panel:
    values = _values(sweep, measure)
    low, high = min(values), max(values)
    lines: list[Line] = []
    shown: list[tuple[float, float]] = []
    for k, variant in enumerate(sweep.variants()):
        points = sweep.of(variant)
        colour, style = look(points[0].engine).colour, _style(sweep, k)
        known = [(at, e, p) for p in points if (at := axis(p)) and (e := _error(p, measure.name, total))]
        if known:
            x, y = np.array([at for at, _, _ in known]), np.array([e for _, e, _ in known])
            ends = [p.error(measure.name) for _, _, p in known]
            bars = total and all(e is not None and e.low is not None and e.high is not None for e in ends)
            floor = 0.3 * low
            below = np.array([max(e.low or 0.0, floor) for e in ends if e is not None]) if bars else None
            above = np.array([e.high or 0.0 for e in ends if e is not None]) if bars else None
            lines.append(Line(variant, x, y, colour, style, low=below, high=above))
            shown += zip(x.tolist(), y.tolist(), strict=True)
        lost = [p for p in points if p.state in LOST]
        if lost and total:
            places = np.array([_place(p, points, axis, sweep) for p in lost])
            lines.append(Line(f"{variant}: no result", places, np.full(len(lost), TOP * high), colour, 4, points=True))
    extra: list[Known] = []
    if shown:
        extra = _band(sweep, measure, shown, low) if total else []
        extra += _envelope(shown) if envelope else []
    title = f"{measure.title}" if total else f"{measure.title}: own limit"
    return Panel(label if total else f"{label}, own", tuple(lines), tuple(extra), log_y=True, title=title)


def _style(sweep: Sweep, k: int) -> int:
    """A marker for each variant, and another dash pattern for each of one engine."""
    variants = sweep.variants()
    engines = [variant.partition("[")[0] for variant in variants]
    before = engines[:k].count(engines[k])
    marker = 1 + k % (len(MARKERS) - 1)
    return len(DASHES) * marker + before % len(DASHES)


def _error(point: Point, measure: str, total: bool) -> float | None:
    found = point.error(measure)
    if found is None:
        return None
    return found.total if total else found.own


def _place(point: Point, points: Sequence[Point], axis: Axis, sweep: Sweep) -> float:
    """Where a run without a result stands: at the cost that others of its variant have per step."""
    if found := axis(point):
        return found
    per_step = [x * p.dt for p in points if (x := axis(p))]
    if per_step:
        return float(np.median(per_step)) / point.dt
    return min((x for p in sweep.points if (x := axis(p))), default=1.0)


def _band(sweep: Sweep, measure: Measure, shown: Sequence[tuple[float, float]], low: float) -> list[Known]:
    bands = [e.band for p in sweep.points if (e := p.error(measure.name)) is not None and e.band > 0]
    if not bands:
        return []
    x = np.geomspace(*_ends(shown), 21)
    edge = np.full(21, max(bands))
    return [Known(_band_words(measure), x, edge, 0.3 * np.minimum(low, edge), edge, points=False)]


def _band_words(measure: Measure) -> str:
    return REFERENCES if measure.kind == "path" else SEEDS


def _envelope(shown: Sequence[tuple[float, float]]) -> list[Known]:
    kept = front([x for x, _ in shown], [y for _, y in shown])
    if len(kept) < 2:
        return []
    x, y = (np.array([shown[k][i] for k in kept]) for i in (0, 1))
    return [Known("best of all", x, y, points=False, style=2)]


def _ends(shown: Sequence[tuple[float, float]]) -> tuple[float, float]:
    low, high = min(x for x, _ in shown), max(x for x, _ in shown)
    return (low, high) if high > low else (0.8 * low, 1.25 * low)


def profile_plot(sweeps: Sequence[Sweep], command: str) -> Plot | None:
    """Performance profiles over all sweeps, one panel per level; None where no level is reached."""
    panels = []
    for level in (*LEVELS, BAND):
        found = profiles(costs(list(sweeps), level))
        lines = []
        for k, (variant, profile) in enumerate(found.items()):
            ratio = np.append(profile.ratio, 2 * profile.ratio[-1])
            x = np.repeat(ratio, 2)[1:]
            y = np.repeat(np.append(profile.share, profile.share[-1]), 2)[:-1]
            same = [other.partition("[")[0] for other in found][:k].count(variant.partition("[")[0])
            lines.append(Line(variant, x, y, look(variant.partition("[")[0]).colour, same))
        if lines:
            panels.append(Panel("Share of the problems", tuple(lines), log_y=False, title=f"to {level}"))
    if not panels:
        return None
    return Plot(
        name="profile",
        title="Performance profile over all sweeps",
        caption="Share of the problems that an engine solves to the error above each panel, in every measure, within a "
        "factor of the time of the fastest engine on that problem (Dolan & Moré 2002). Left end: share of the problems "
        "on which it is the fastest; right end: share that it solves at all. Problems that no engine solves are "
        "left out.",
        x_label="Time over that of the fastest",
        panels=tuple(panels),
        command=command,
        log_x=True,
        columns=2,
    )
