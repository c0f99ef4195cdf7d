"""The figures that a case asks for beside its time series: its measures on every run, drawn like all others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dembench.cases.base import Curve
from dembench.cases.views import CaseFigure, Trace, View
from dembench.reports.curves import bundles, label_of, merged
from dembench.reports.groups import Group, Member
from dembench.reports.plot import Known, Line, Panel, Plot


def case_plots(group: Group, command: str) -> list[Plot]:
    """The figures of the group's case that at least one run has something for."""
    plots = [_plot(group, figure, command) for figure in group.first.figures]
    return [plot for plot in plots if plot is not None]


def replaced(group: Group) -> set[str]:
    """Observables that these figures show."""
    return {name for figure in group.first.figures for name in figure.replaces}


def _plot(group: Group, figure: CaseFigure, command: str) -> Plot | None:
    panels, sources, bands = [], [], False
    shared = len({view.x for view in figure.views}) == 1 and not any(view.equal for view in figure.views)
    for view in figure.views:
        lines = _lines(group, view)
        if not lines:
            continue
        curves = [c for c in group.first.curves if view.known and _name(c) == view.known]
        sources += [f"{c.label[:1].upper()}{c.label[1:]}: {c.source}." for c in curves]
        bands |= any(line.low is not None for line in lines)
        panels.append(
            Panel(
                label=view.y,
                lines=tuple(lines),
                known=tuple(_known(c, view.scale, style) for style, c in enumerate(curves)),
                log_y=False,
                title=view.title,
                x_label="" if shared else view.x,
                equal=view.equal,
            )
        )
    if not panels:
        return None
    several = "Line and band: median and range of the seeds." if bands else ""
    return Plot(
        name=f"{group.name}-{figure.name}",
        title=figure.title,
        caption=" ".join(dict.fromkeys(text for text in (figure.caption, several, *sources) if text)),
        x_label=figure.views[0].x,
        panels=tuple(panels),
        command=command,
        columns=figure.columns,
        tag=group.tag,
    )


def _name(curve: Curve) -> str:
    return f"{curve.observable}.{curve.component}" if curve.component else curve.observable


def _known(curve: Curve, scale: float, style: int) -> Known:
    low, high = (None if v is None else v * scale for v in (curve.low, curve.high))
    return Known(curve.label, curve.time, curve.value * scale, low, high, curve.points, style)


def _lines(group: Group, view: View) -> list[Line]:
    """The curves of every engine; those of several seeds as one with a band where they share their places."""
    found = []
    measured = {id(m): _measured(m, view) for m in group.members}
    for members in bundles(group, lambda m: bool(measured[id(m)])):
        alike = _alike([measured[id(m)] for m in members])
        drawn = members if alike else members[:1]
        for k in range(len(measured[id(drawn[0])])):
            found.append(_line(drawn, [measured[id(m)][k] for m in drawn], k))
    return found


def _measured(member: Member, view: View) -> list[Trace]:
    entry = member.shown
    return view.measure(entry.scene, entry.record.result) if entry.scene is not None else []


def _alike(traces: Sequence[Sequence[Trace]]) -> bool:
    """Whether all seeds have the same curves over the same places."""
    first = traces[0]
    return all(
        len(own) == len(first) and all(np.array_equal(a.x, b.x) for a, b in zip(own, first, strict=True))
        for own in traces
    )


def _line(members: Sequence[Member], traces: Sequence[Trace], k: int) -> Line:
    shown, first = members[0], traces[0]
    label = label_of(members) + (f", {first.label}" if first.label else "")
    middle, low, high = merged([t.y for t in traces])
    return Line(
        label=label,
        x=first.x,
        y=middle,
        colour=shown.shown.look.colour,
        style=0 if first.points else shown.style + k,
        cut_short=len(members) == 1 and not shown.shown.complete and not first.points,
        points=first.points,
        low=low,
        high=high,
    )
