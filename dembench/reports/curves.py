"""Which figures a group of runs gets: every recorded series that is worth a curve, with what is known of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence

import numpy as np

from dembench.reports.comparisons import comparable
from dembench.reports.entries import common_times
from dembench.reports.groups import Group, Member
from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.reports.svg import MUTED
from dembench.reports.units import labelled, measure, shown_in
from dembench.results import Observed
from dembench.scene import Energy, Scene, Trajectory

MOST_PANELS = 6
MOST_PAIRS = 6
MOST_POINTS = 2000
LEAST_SEEDS = 3
"""Smallest number of seeds that are drawn as one line with a band."""


def plots(group: Group, command: str, without: Collection[str] = ()) -> list[Plot]:
    """The figures of a group's series, in the order of the scene's observables, `without` those shown elsewhere."""
    if group.first.scene is None:
        return []
    found = []
    hidden = _hidden(group.first.scene) | set(without)
    for name in _names(group):
        if name not in hidden:
            found.append(_plot(group, name, command))
        if name in _displacements(group.first.scene) and (apart := _distance_plot(group, name, command)):
            found.append(apart)
    return found


# ---- seeds


def bundles(group: Group, has: Callable[[Member], bool]) -> list[tuple[Member, ...]]:
    """What is drawn as one curve each: three or more complete seeds of an engine together, other members alone.

    Args:
        group: The group.
        has: Whether a member has something to draw.
    """
    found: list[tuple[Member, ...]] = []
    for ensemble in group.ensembles:
        able = [m for m in ensemble.members if has(m)]
        together = [m for m in able if m in ensemble.ended]
        if len(together) < LEAST_SEEDS:
            together = []
        found += [tuple(together)] if together else []
        found += [(m,) for m in able if m not in together]
    return found


def label_of(members: Sequence[Member]) -> str:
    """Text of the legend for members that are drawn as one curve."""
    name = members[0].label
    return name if len(members) == 1 else f"{name.partition(', seed ')[0]}, {len(members)} seeds"


def merged(values: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Median, lowest and highest of curves over the same places, shape (n,); one curve has no range."""
    if len(values) == 1:
        return values[0], None, None
    stacked = np.array(values)
    return np.median(stacked, axis=0), stacked.min(axis=0), stacked.max(axis=0)


# ---- series


def _displacements(scene: Scene) -> list[str]:
    return [f"{o.name}_displacement" for o in scene.observables if isinstance(o, Trajectory)]


def _distance_plot(group: Group, name: str, command: str) -> Plot | None:
    """How far each two complete runs are apart over time; None where there are no two, or too many to draw."""
    pairs = comparable(group, name)
    if not 0 < len(pairs) <= MOST_PAIRS:
        return None
    series = []
    for a, b in pairs:
        first, second = a.shown.observables[name], b.shown.observables[name]
        rows, other = common_times(first, second)
        series.append((first.time[rows], np.abs(first.value[rows] - second.value[other])))
    factor, time_unit = shown_in("s", *(time for time, _ in series))
    scale, unit = shown_in("m", *(apart for _, apart in series))
    lines = tuple(
        Line(
            f"{a.label}, {b.label}",
            time * factor,
            apart * scale,
            MUTED if len(pairs) == 1 else b.shown.look.colour,
            style,
        )
        for style, ((a, b), (time, apart)) in enumerate(zip(pairs, series, strict=True))
    )
    title = f"Distance between runs: {pairs[0][0].shown.observables[name].title.lower()}"
    return Plot(
        name=f"{group.name}-{name}-distance".replace("_", "-"),
        title=title,
        caption="Absolute difference of each two runs at the same time. Runs of a chaotic system part in the end; "
        "how early and how far is what the figure shows.",
        x_label=labelled("Time", time_unit),
        panels=(Panel(labelled("Distance", unit), lines),),
        command=command,
        tag=group.tag,
    )


def _names(group: Group) -> list[str]:
    names: dict[str, None] = {}
    for member in group.members:
        names.update(dict.fromkeys(member.shown.observables))
    return list(names)


def _hidden(scene: Scene) -> set[str]:
    """Series that the figure of another one says better: what belongs to a trajectory beside its displacement."""
    tracked = [o.name for o in scene.observables if isinstance(o, Trajectory)]
    return {f"{name}_{part}" for name in tracked for part in ("minimum", "position", "velocity")}


def _plot(group: Group, name: str, command: str) -> Plot:
    recorded = [m for m in group.members if name in m.shown.observables]
    first = recorded[0].shown.observables[name]
    kind = (first.unit, first.components)
    drawn = [m for m in recorded if (o := m.shown.observables[name]) and (o.unit, o.components) == kind]
    curves = [c for c in group.first.curves if c.observable == name]
    factor, time_unit = shown_in("s", *(m.shown.observables[name].time for m in drawn))
    every = max(1, math.ceil(max(len(m.shown.observables[name].time) for m in drawn) / MOST_POINTS))
    shown = _components(group.first.scene, name, first)
    together = bundles(group, lambda m: m in drawn)
    panels = []
    for column, label in shown:
        values = [_column(m.shown.observables[name], column) for m in drawn]
        own = [c for c in curves if c.component == ("" if column is None else first.components[column])]
        scale, unit = shown_in(first.unit, *values, *(c.value for c in own))
        lines = tuple(_line(members, name, column, factor, scale, every) for members in together)
        known = tuple(
            Known(
                c.label,
                c.time * factor,
                c.value * scale,
                _scaled(c.low, scale),
                _scaled(c.high, scale),
                c.points,
                style,
            )
            for style, c in enumerate(own)
        )
        panels.append(Panel(labelled(label, unit), lines, known))
    return Plot(
        name=f"{group.name}-{name}".replace("_", "-"),
        title=_title(group.first.scene, name, first),
        caption=_caption(
            together, [f"{c.label}: {c.source}" for c in curves], len(first.components) > len(shown), every
        ),
        x_label=labelled("Time", time_unit),
        panels=tuple(panels),
        command=command,
        tag=group.tag,
    )


def _line(members: Sequence[Member], name: str, column: int | None, factor: float, scale: float, every: int) -> Line:
    """One member's curve, or the median of several seeds with their range, over the times that all have."""
    series = [m.shown.observables[name] for m in members]
    rows = [np.arange(len(series[0].time))]
    for other in series[1:]:
        kept, own = common_times(series[0], other)
        at = np.flatnonzero(np.isin(rows[0], kept))
        rows = [r[at] for r in rows] + [own[np.isin(kept, rows[0][at])]]
    middle, low, high = merged([_column(o, column)[r][::every] * scale for o, r in zip(series, rows, strict=True)])
    entry = members[0].shown
    return Line(
        label=label_of(members),
        x=series[0].time[rows[0]][::every] * factor,
        y=middle,
        colour=entry.look.colour,
        style=members[0].style,
        cut_short=not entry.complete,
        low=low,
        high=high,
    )


def _is_energy(scene: Scene | None, name: str) -> bool:
    return scene is not None and any(isinstance(o, Energy) and o.name == name for o in scene.observables)


def _title(scene: Scene | None, name: str, observed: Observed) -> str:
    return "Kinetic energy of all particles" if _is_energy(scene, name) else observed.title


def _components(scene: Scene | None, name: str, observed: Observed) -> list[tuple[int | None, str]]:
    """Columns with their labels; of the energies the kinetic ones, since potential energy says little on a curve."""
    if not observed.components:
        return [(None, _short(observed.title))]
    kept = [(k, c) for k, c in enumerate(observed.components) if not (_is_energy(scene, name) and c == "potential")]
    return [(k, label.capitalize() if label.islower() else label) for k, label in kept[:MOST_PANELS]]


def _short(title: str) -> str:
    """A title as the label of an axis: without what follows the quantity's name."""
    for word in (" of ", " in "):
        title = title.split(word)[0]
    return title


def _column(observed: Observed, column: int | None) -> np.ndarray:
    return observed.value if column is None else observed.value[:, column]


def _scaled(values: np.ndarray | None, scale: float) -> np.ndarray | None:
    return None if values is None else values * scale


def _caption(drawn: Sequence[Sequence[Member]], sources: list[str], shortened: bool, every: int) -> str:
    parts = []
    single = [members[0] for members in drawn if len(members) == 1]
    ended = [f"{m.label} ({m.shown.state}) at {measure(m.shown.reached, 's')}" for m in single if not m.shown.complete]
    repeated = [m.label for m in single if len(m.entries) > 1]
    if len(single) < len(drawn):
        parts.append("Line and band: median and range of the seeds.")
    if ended:
        parts.append(f"Ended early: {', '.join(ended)}.")
    if repeated:
        parts.append(f"One of several repeats is drawn for {', '.join(repeated)}.")
    if every > 1:
        parts.append(f"One sample of {every} is drawn.")
    if shortened:
        parts.append("Further components are in the result files.")
    parts += [f"{source[:1].upper()}{source[1:]}." for source in sources]
    return " ".join(parts)
