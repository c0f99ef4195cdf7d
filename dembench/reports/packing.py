"""The figure of a packing: solid fraction and vertical stress by height."""

from __future__ import annotations

from pathlib import Path

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dembench.initial.quality import Quality

SIZE = (7.0, 3.4)
"""Width and height [in]."""
BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "#5d6672"


def draw(quality: Quality, title: str, path: Path) -> None:
    """Writes the figure of a packing; the ending of the path says in which format."""
    with matplotlib.rc_context({"font.size": 8, "svg.fonttype": "none", "pdf.fonttype": 42, "text.parse_math": False}):
        figure = Figure(figsize=SIZE, layout="constrained")
        FigureCanvasAgg(figure)
        stressed = [level for level in quality.levels if level.stress is not None]
        panels = figure.subplots(1, 2 if stressed else 1, sharey=True, squeeze=False)[0]
        height = [level.height * 1e3 for level in quality.levels]
        panels[0].plot([level.fraction for level in quality.levels], height, color=BLUE)
        panels[0].axvline(quality.packing.bulk_fraction, color=GREY, linestyle=":", label="bulk")
        panels[0].set(xlabel="solid fraction", ylabel="height (mm)", xlim=(0, 0.75))
        panels[0].legend(frameon=False)
        if stressed:
            _stress(panels[1], quality)
        for panel in panels:
            panel.axhline(quality.surface.mean * 1e3, color=GREY, linewidth=0.6)
            panel.spines[["top", "right"]].set_visible(False)
        figure.suptitle(f"{title}: {quality.packing.count} particles", x=0.01, ha="left")
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=200)


def _stress(panel: matplotlib.axes.Axes, quality: Quality) -> None:
    for name, label, colour, style in (
        ("stress", "contact forces", BLUE, "-"),
        ("hydrostatic", "weight above", GREY, "--"),
        ("janssen", "Janssen, mobilised friction", ORANGE, "-."),
    ):
        points = [(getattr(x, name) / 1e3, x.height * 1e3) for x in quality.levels if getattr(x, name) is not None]
        if points:
            panel.plot(*zip(*points, strict=True), color=colour, linestyle=style, label=label)
    panel.set(xlabel="vertical stress (kPa)", xlim=(0, None))
    panel.legend(frameon=False)
