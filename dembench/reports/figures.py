"""Figures drawn: one matplotlib drawing gives the page's SVG, the phone's SVG and the paper's PDF."""

from __future__ import annotations

import base64
import io
import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.reports.svg import GRID, INK, MUTED, SURFACE, themed

WIDE, NARROW = 7.0, 3.5
"""Widths [in]: two columns and one column of a journal page."""
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.2, 1.5)), (0, (6, 2, 1.2, 2)), (0, (3, 1.2)), (0, (8, 2, 1, 2)))
MARKERS = (None, "o", "s", "^", "D", "v", "P")
KNOWN_MARKERS = ("D", "s", "^", "o", "v", "P")
LOG_RANGE = 300.0
"""A panel whose positive values span more than this ratio gets a logarithmic axis."""
LEAST_RANGE = 1e-6
"""Range of a vertical axis, relative to its values, below which they are taken for equal."""
WIDEST, THINNEST = 3.2, 1.2
"""Largest and smallest width of a line [pt]: earlier lines are wider, so that all stay visible where they coincide."""
CHARACTERS_PER_INCH, LABEL_CHARACTERS = 14, 26
"""Titles of panels are broken where they would be wider than the panel, labels of axes where they would be higher."""
FEW_POINTS = 12
_ROUND_STEPS = (1, 2, 2.5, 5, 10)
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

_STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "dembench",
    "pdf.fonttype": 42,
    "text.parse_math": False,
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.formatter.use_mathtext": False,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "ytick.minor.width": 0.4,
    "text.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "lines.linewidth": 1.4,
}


@dataclass(frozen=True)
class Drawing:
    """A drawn figure: markup for the page, bytes for the paper, data for the reader.

    Attributes:
        plot: What it shows.
        wide, narrow: `<svg>` elements.
        pdf: Content of a PDF file, base64.
        data: Values, axes' places and limits; JSON.
        colours: Colours in use.
    """

    plot: Plot
    wide: str
    narrow: str
    pdf: str
    data: dict[str, Any]
    colours: set[str] = field(default_factory=set)


def draw(plot: Plot) -> Drawing:
    """Draws a figure in two widths."""
    with matplotlib.rc_context(_STYLE):
        wide_figure, wide_axes = _drawn(plot, WIDE)
        narrow_figure, narrow_axes = _drawn(plot, NARROW)
        wide, first = themed(_svg(wide_figure), f"{plot.name}-w", plot.title)
        narrow, second = themed(_svg(narrow_figure), f"{plot.name}-n", plot.title)
        pdf = _pdf(wide_figure, plot.title)
    data = {
        "name": plot.name,
        "x_label": plot.x_label,
        "shared": plot.shared,
        "axes": {"wide": wide_axes, "narrow": narrow_axes},
        "panels": [_values(panel) for panel in plot.panels],
    }
    return Drawing(plot, wide, narrow, pdf, data, first | second)


def _drawn(plot: Plot, width: float) -> tuple[Figure, list[dict[str, float]]]:
    columns = min(plot.columns, len(plot.panels)) if width == WIDE else 1
    rows = math.ceil(len(plot.panels) / columns)
    labels = _legend_entries(plot)
    across = _columns(labels, width)
    legend_height = 0.17 * math.ceil(len(labels) / across) + 0.1
    height = legend_height + 0.25 + _height(plot, width, columns) * rows
    figure = Figure(figsize=(width, height), layout="constrained", facecolor="none")
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, sharex=plot.shared, squeeze=False)
    axes = list(grid.ravel())
    for empty in axes[len(plot.panels) :]:
        empty.remove()
    axes = axes[: len(plot.panels)]
    for k, (panel, ax) in enumerate(zip(plot.panels, axes, strict=True)):
        _fill(ax, panel, width / columns, plot.log_x)
        if panel.x_label or k + columns >= len(axes):
            ax.set_xlabel(panel.x_label or plot.x_label)
            ax.tick_params(labelbottom=True)
            if plot.x_names:
                ax.set_xticks(range(len(plot.x_names)), plot.x_names)
    for panel, ax in zip(plot.panels, axes, strict=True):
        if not panel.equal:
            _limit(ax, plot.panels if plot.shared else (panel,), plot.log_x)
    figure.legend(handles=labels, loc="outside upper left", ncols=across, handlelength=3.2, columnspacing=1.4)
    for column in range(columns):
        figure.align_ylabels(axes[column::columns])
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    return figure, [_place(ax) for ax in axes]


def _height(plot: Plot, width: float, columns: int) -> float:
    """Height of a row of panels [in]."""
    if any(panel.equal for panel in plot.panels):
        return 0.8 * width / columns
    if len(plot.panels) == 1:
        return 2.7 if width == WIDE else 2.3
    each = (2.1 if columns > 1 else 1.55) if width == WIDE else 1.5
    return each + (0.2 if not plot.shared else 0.0)


def _svg(figure: Figure) -> str:
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    return text.getvalue()


def _pdf(figure: Figure, title: str) -> str:
    content = io.BytesIO()
    figure.savefig(content, format="pdf", metadata={"CreationDate": None, "Title": title})
    return base64.b64encode(content.getvalue()).decode()


def _fill(ax: Axes, panel: Panel, width: float, log_x: bool) -> None:
    ax.set_facecolor("none")
    ax.set_axisbelow(True)
    logarithmic = _spans_decades(panel) if panel.log_y is None else panel.log_y
    for known in panel.known:
        _draw_known(ax, known)
    widest = min(WIDEST, THINNEST + 0.7 * (len(panel.lines) - 1))
    widths = np.linspace(widest, THINNEST, len(panel.lines)) if len(panel.lines) > 1 else [1.6]
    for line, linewidth in zip(panel.lines, widths, strict=True):
        y = np.where(line.y > 0, line.y, np.nan) if logarithmic else line.y
        ax.plot(line.x, y, color=line.colour, linewidth=linewidth, **_pattern(line, len(line.x)))
        _draw_range(ax, line)
        for name, x, value in zip(line.names, line.x, y, strict=False):
            ax.annotate(name, (x, value), xytext=(4, 3), textcoords="offset points", fontsize=6.5)
        shown = np.flatnonzero(np.isfinite(y))
        if line.cut_short and len(shown):
            ax.plot(line.x[shown[-1]], y[shown[-1]], marker="x", color=line.colour, markersize=7, markeredgewidth=1.8)
    if logarithmic:
        ax.set_yscale("log")
        _format_logarithmic(ax.yaxis)
        ax.grid(visible=False, which="minor")
    else:
        ax.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=_ROUND_STEPS))
        low, high = ax.get_ylim()
        if high - low < LEAST_RANGE * max(abs(low), abs(high)):  # rounding alone, which is nothing to look at
            middle = 0.5 * (low + high)
            ax.set_ylim(middle - 0.05 * abs(middle), middle + 0.05 * abs(middle))
    if log_x:
        ax.set_xscale("log")
        _format_logarithmic(ax.xaxis)
    else:
        bins = 10 if width == WIDE else 6 if width >= NARROW else 4
        ax.xaxis.set_major_locator(MaxNLocator(nbins=bins, steps=_ROUND_STEPS, integer=_counts(panel)))
    ax.set_ylabel(textwrap.fill(panel.label, LABEL_CHARACTERS))
    if panel.title:
        ax.set_title(textwrap.fill(panel.title, int(CHARACTERS_PER_INCH * width)))
    if panel.equal:
        ax.set_aspect("equal", adjustable="datalim")


def _counts(panel: Panel) -> bool:
    """Whether what is drawn as points lies at whole numbers, such as those of seeds."""
    points = [line.x for line in panel.lines if line.points]
    return bool(points) and not np.mod(np.concatenate(points), 1).any()


def _limit(ax: Axes, panels: Sequence[Panel], log_x: bool) -> None:
    """Ends of a horizontal axis, from everything that is drawn in the panels that share it."""
    drawn = [line.x for panel in panels for line in panel.lines] + [k.x for panel in panels for k in panel.known]
    ends = [value for x in drawn if len(x) for value in (np.min(x), np.max(x))]
    if log_x:
        ax.set_xlim(0.8 * min(ends), 1.25 * max(ends))
    elif ends and max(ends) > min(ends):
        margin = 0.01 * (max(ends) - min(ends))
        ax.set_xlim(min(ends) - margin, max(ends) + margin)


def _format_logarithmic(axis: Axis) -> None:
    low, high = axis.get_data_interval()
    axis.set_major_locator(LogLocator(subs=(1.0,) if high > 100 * low else (1.0, 2.0, 5.0), numticks=8))
    axis.set_major_formatter(FuncFormatter(_power))
    axis.set_minor_formatter(NullFormatter())


def _power(value: float, _: int | None = None) -> str:
    """Label of a logarithmic axis: the number where it is short, else a power of ten with its factor."""
    if 1e-2 <= value <= 1e4:
        return f"{value:g}"
    mantissa, exponent = f"{value:.0e}".split("e")
    power = "10" + str(int(exponent)).translate(_SUPERSCRIPTS)
    return power if mantissa == "1" else f"{mantissa}·{power}"


def _draw_range(ax: Axes, line: Line) -> None:
    if line.low is None or line.high is None:
        return
    if len(line.x) > FEW_POINTS:
        ax.fill_between(line.x, line.low, line.high, color=line.colour, alpha=0.2, linewidth=0)
        return
    bars = np.abs(np.array([line.y - line.low, line.high - line.y]))
    ax.errorbar(line.x, line.y, yerr=bars, fmt="none", ecolor=line.colour, elinewidth=1.0, capsize=2.5)


def _are_points(known: Known) -> bool:
    return len(known.x) <= FEW_POINTS if known.points is None else known.points


def _draw_known(ax: Axes, known: Known) -> None:
    if _are_points(known):
        bars = None
        if known.low is not None and known.high is not None:
            bars = np.abs(np.array([known.y - known.low, known.high - known.y]))
        marks = {"color": INK, "capsize": 3, "elinewidth": 1.0, "zorder": 5, "linestyle": "", **_known_mark(known)}
        ax.errorbar(known.x, known.y, yerr=bars, **marks)
        return
    if known.low is not None and known.high is not None:
        ax.fill_between(known.x, known.low, known.high, color=MUTED, alpha=0.22, linewidth=0)
    ax.plot(known.x, known.y, color=INK, linewidth=0.9, linestyle=DASHES[known.style % len(DASHES)])


def _known_mark(known: Known) -> dict[str, Any]:
    marker = KNOWN_MARKERS[known.style % len(KNOWN_MARKERS)]
    return {"marker": marker, "markersize": 5, "markerfacecolor": SURFACE, "markeredgewidth": 1.0}


def _legend_entries(plot: Plot) -> list[Line2D]:
    entries: dict[str, Line2D] = {}
    cut_short = False
    for panel in plot.panels:
        for line in panel.lines:
            entries.setdefault(line.label, Line2D([], [], color=line.colour, label=line.label, **_pattern(line, 0)))
            cut_short |= line.cut_short
        for known in panel.known:
            mark: dict[str, Any] = {"linestyle": DASHES[known.style % len(DASHES)]}
            if _are_points(known):
                mark = {"linestyle": "", **_known_mark(known)}
            entries.setdefault(known.label, Line2D([], [], color=INK, linewidth=0.9, label=known.label, **mark))
    if cut_short:
        entries["ended early"] = Line2D(
            [], [], color=INK, linestyle="", marker="x", markersize=6, markeredgewidth=1.6, label="ended early"
        )
    return list(entries.values())


def _pattern(line: Line, points: int) -> dict[str, Any]:
    style = line.style
    if line.points:
        marks = MARKERS[1:]
        return {"linestyle": "", "marker": marks[style % len(marks)], "markersize": 5}
    marker = MARKERS[(style // len(DASHES)) % len(MARKERS)]
    every = max(1, points // 12)
    return {
        "linestyle": DASHES[style % len(DASHES)],
        "marker": marker,
        "markevery": every,
        "markersize": 3.5,
        "dash_capstyle": "butt",
    }


def _columns(entries: list[Line2D], width: float) -> int:
    """How many entries of the legend fit side by side, from the width of its text at 7.5 pt."""
    longest = max((len(str(entry.get_label())) for entry in entries), default=1)
    return int(max(1, min(len(entries) or 1, width * 72 // (longest * 4.8 + 40))))


def _spans_decades(panel: Panel) -> bool:
    values = np.concatenate([line.y for line in panel.lines]) if panel.lines else np.empty(0)
    values = values[np.isfinite(values)]
    positive = values[values > 0]
    return bool(len(positive) and values.min() >= 0 and positive.max() / positive.min() > LOG_RANGE)


def _place(ax: Axes) -> dict[str, float]:
    box = ax.get_position()
    (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
    return {
        "left": box.x0,
        "right": box.x1,
        "top": 1 - box.y1,
        "bottom": 1 - box.y0,
        "x0": x0,
        "x1": x1,
        "y0": y0,
        "y1": y1,
        "log": ax.get_yscale() == "log",
        "log_x": ax.get_xscale() == "log",
    }


def _values(panel: Panel) -> dict[str, Any]:
    lines = [{"colour": n.colour, **_points(n)} for n in panel.lines]
    known = [_points(k) for k in panel.known]
    return {"label": panel.label, "x_label": panel.x_label, "equal": panel.equal, "lines": lines, "known": known}


def _points(drawn: Line | Known) -> dict[str, Any]:
    columns = {"x": drawn.x, "y": drawn.y, "low": drawn.low, "high": drawn.high}
    return {"label": drawn.label, **{name: numbers(values) for name, values in columns.items()}}


def numbers(values: np.ndarray | None) -> list[float | None] | None:
    """Values for JSON with 8 significant digits; None stands for what is not finite."""
    if values is None:
        return None
    return [float(f"{v:.8g}") if math.isfinite(v) else None for v in np.asarray(values, dtype=float).tolist()]
