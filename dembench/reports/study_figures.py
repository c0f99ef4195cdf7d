"""Figures of a recipe: curves of its blocks beside the references, and what an error costs to avoid."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dembench.recipes import Page
from dembench.reports.case_figures import case_plots
from dembench.reports.curves import merged
from dembench.reports.curves import plots as series_plots
from dembench.reports.ensembles import seed_plot
from dembench.reports.groups import Group
from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.reports.units import labelled, shown_in
from dembench.reports.variants import Problem, Variant
from dembench.results import Observed


def figures(problem: Problem, page: Page, command: str) -> list[Plot]:
    """The figures of a problem that a page asks for; those that no run has anything for are left out."""
    found = [plot for group in problem.groups for plot in _common(group, page.figures, command)]
    drawn = [_curves(problem, name, page.start, command) for name in page.curves]
    return [*found, *(plot for plot in (*drawn, _costs(problem, page.costs, command)) if plot is not None)]


def _common(group: Group, names: Sequence[str], command: str) -> list[Plot]:
    """Figures of the common report, in the order of the names."""
    known = (*series_plots(group, command, set()), *case_plots(group, command), seed_plot(group, command))
    plots = {plot.name: plot for plot in known if plot is not None}
    wanted = [f"{group.name}-{name}".replace("_", "-") for name in names]
    return [plots[name] for name in wanted if name in plots]


def _curves(problem: Problem, name: str, start: float, command: str) -> Plot | None:
    """One panel per family, each with the range of the references as a band."""
    variants = problem.variants
    drawn = [v for v in variants if not v.block.reference and _series(v, name, start)]
    if not drawn:
        return None
    shown = [series for v in variants for series in _series(v, name, start)]
    factor, time_unit = shown_in("s", *(o.time for o in shown))
    scale, unit = shown_in(shown[0].unit, *(o.value for o in shown))
    band = _band([o for v in problem.references for o in _series(v, name, start)], factor, scale)
    panels = []
    for family in dict.fromkeys(v.family for v in drawn):
        own = [v for v in drawn if v.family == family]
        lines = [
            _line(v, _series(v, name, start), factor, scale, style)
            for style, v in enumerate(v for v in own if _series(v, name, start))
        ]
        label = labelled(shown[0].title.partition(" of ")[0].removeprefix("Vertical ").capitalize(), unit)
        panels.append(Panel(label, tuple(lines), band, log_y=False, title=own[0].title))
    return Plot(
        name=f"{problem.name}-{name}-curves".replace("_", "-").replace(".", "-"),
        title=shown[0].title,
        caption="One panel per kind of variant; of several seeds the median, with their range as a band."
        + (" Grey band and thin line: range and mean of the references." if band else ""),
        x_label=labelled("Time", time_unit),
        panels=tuple(panels),
        command=command,
        tag=problem.tag,
    )


def _line(variant: Variant, series: Sequence[Observed], factor: float, scale: float, style: int) -> Line:
    """The median of the seeds with their range, over the times that all of them have."""
    rows = min(len(o.time) for o in series)
    middle, low, high = merged([o.value[:rows] * scale for o in series])
    colour = variant.members[0].shown.look.colour
    return Line(_label(variant), series[0].time[:rows] * factor, middle, colour, style, low=low, high=high)


def _label(variant: Variant) -> str:
    return f"{variant.title}: {variant.short}" if variant.short else variant.title


def _series(variant: Variant, name: str, start: float) -> list[Observed]:
    """A series of every seed, from a time on [s]; of an observable with components the one that is named."""
    observable, _, component = name.partition(".")
    found = [m.shown.observables[observable] for m in variant.ended if observable in m.shown.observables]
    if component:
        found = [_component(o, component) for o in found if component in o.components]
    kept = [(o, o.time >= start * (1 - 1e-9)) for o in found if o.value.ndim == 1]
    return [replace(o, step=o.step[rows], time=o.time[rows], value=o.value[rows]) for o, rows in kept if rows.any()]


def _component(observed: Observed, name: str) -> Observed:
    title = f"{observed.title}: {name}"
    return replace(observed, title=title, value=observed.value[:, observed.components.index(name)], components=())


def _band(references: Sequence[Observed], factor: float, scale: float) -> tuple[Known, ...]:
    if not references:
        return ()
    time = references[0].time
    values = np.array([np.interp(time, o.time, o.value) for o in references]) * scale
    return (Known("references", time * factor, values.mean(axis=0), values.min(axis=0), values.max(axis=0)),)


def _costs(problem: Problem, names: Sequence[str], command: str) -> Plot | None:
    """Difference from the mean of the references against run time, one panel per quantity."""
    timed = [v for v in problem.variants if v.loop is not None]
    panels = [panel for name in names if (panel := _cost_panel(timed, name)) is not None]
    if not panels:
        return None
    return Plot(
        name=f"{problem.name}-costs",
        title="Error against run time",
        caption="Difference of each variant from the mean of the references, which are drawn too; the band is the "
        "range of the references. Numbers beside points are the settings that a kind of variant sweeps.",
        x_label="Time of the stepping loop [s]",
        panels=tuple(panels),
        command=command,
        log_x=True,
        tag=problem.tag,
    )


def _cost_panel(variants: Sequence[Variant], name: str) -> Panel | None:
    quantities = [q for v in variants for q in v.quantities.get(name, [])]
    references = [value for v in variants if v.block.reference for value in v.values(name)]
    if not quantities:
        return None
    centre = statistics.fmean(references) if references else 0.0
    factor, unit = shown_in(quantities[0].unit, [q.value - centre for q in quantities])
    lines = []
    for family in dict.fromkeys(v.family for v in variants):
        own = [v for v in variants if v.family == family and v.mean(name) is not None]
        if own:
            lines.append(
                Line(
                    own[0].title,
                    np.array([v.loop for v in own], dtype=float),
                    np.array([factor * ((v.mean(name) or 0.0) - centre) for v in own]),
                    own[0].members[0].shown.look.colour,
                    family,
                    points=True,
                    names=tuple(v.short for v in own),
                )
            )
    loops = [v.loop for v in variants if v.loop is not None]
    time = np.geomspace(min(loops), max(loops), 21)
    known: tuple[Known, ...] = ()
    if references and len(set(loops)) > 1:
        low, high = (factor * (bound - centre) + 0 * time for bound in (min(references), max(references)))
        known = (Known("references", time, 0 * time, low, high),)
    return Panel(labelled("Difference", unit), tuple(lines), known, log_y=False, title=quantities[0].title)
