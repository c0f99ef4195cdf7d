"""Which figures a group of runs gets: every recorded series that is worth a curve, with what is known of it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable

import numpy as np

from dembench.reports.entries import Group, Member, common_times
from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.reports.svg import MUTED
from dembench.reports.units import labelled, measure, shown_in
from dembench.results import Observed
from dembench.scene import Energy, Scene, Trajectory

MOST_PANELS = 6
MOST_PAIRS = 6
MOST_POINTS = 2000


def plots(group: Group, command: str) -> list[Plot]:
    """The figures of a group, in the order of the scene's observables."""
    if group.first.scene is None:
        return []
    found = []
    hidden = _hidden(group.first.scene)
    for name in _names(group):
        if name not in hidden:
            found.append(_plot(group, name, command))
        if name in _displacements(group.first.scene) and (apart := _distance_plot(group, name, command)):
            found.append(apart)
    return found


def _displacements(scene: Scene) -> list[str]:
    return [f"{o.name}_displacement" for o in scene.observables if isinstance(o, Trajectory)]


def _distance_plot(group: Group, name: str, command: str) -> Plot | None:
    """How far each two complete runs are apart over time; None where there are no two, or too many to draw."""
    ended = [m for m in group.members if m.shown.complete and name in m.shown.observables]
    pairs = list(itertools.combinations(ended, 2))
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
    recorded = [(m, m.shown.observables[name]) for m in group.members if name in m.shown.observables]
    first = recorded[0][1]
    drawn = [(m, o) for m, o in recorded if (o.unit, o.components) == (first.unit, first.components)]
    every = max(1, math.ceil(max(len(o.time) for _, o in drawn) / MOST_POINTS))
    curves = [c for c in group.first.curves if c.observable == name]
    factor, time_unit = shown_in("s", *(o.time for _, o in drawn))
    shown = _components(group.first.scene, name, first)
    panels = []
    for column, label in shown:
        values = [_column(o, column) for _, o in drawn]
        known_values = [c.value for c in curves] if not first.components else []
        scale, unit = shown_in(first.unit, *values, *known_values)
        lines = tuple(
            _line(member, o.time[::every] * factor, y[::every] * scale)
            for (member, o), y in zip(drawn, values, strict=True)
        )
        known = tuple(
            Known(c.label, c.time * factor, c.value * scale, _scaled(c.low, scale), _scaled(c.high, scale))
            for c in (curves if not first.components else [])
        )
        panels.append(Panel(labelled(label, unit), lines, known))
    title = _title(group.first.scene, name, first)
    return Plot(
        name=f"{group.name}-{name}".replace("_", "-"),
        title=title,
        caption=_caption(drawn, [f"{c.label}: {c.source}" for c in curves], len(first.components) > len(shown), every),
        x_label=labelled("Time", time_unit),
        panels=tuple(panels),
        command=command,
    )


def _line(member: Member, x: np.ndarray, y: np.ndarray) -> Line:
    entry = member.shown
    return Line(member.label, x, y, entry.look.colour, member.style, cut_short=not entry.complete)


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


def _caption(drawn: Iterable[tuple[Member, Observed]], sources: list[str], shortened: bool, every: int) -> str:
    parts = []
    ended = [
        f"{m.label} ({m.shown.state}) at {measure(m.shown.reached, 's')}" for m, _ in drawn if not m.shown.complete
    ]
    repeated = [m.label for m, _ in drawn if len(m.entries) > 1]
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
