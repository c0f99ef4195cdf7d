"""What a figure shows: plots of panels of lines and known points, before anything is drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Line:
    """One curve.

    Attributes:
        label: Text of the legend, the same for one run in all panels.
        x, y: Values in the units of the axes, shape (n,).
        colour: `#rrggbb`.
        style: Which dash pattern, and beyond them which marker; 0 is a plain solid line.
        cut_short: Whether the run ended before its time; its last point is marked.
        points: Whether it is drawn as points, without a line between them.
        names: Text beside each point; empty for none.
        low, high: Range, shape (n,), or None: bars where there are few points, a band where there are many.
    """

    label: str
    x: np.ndarray
    y: np.ndarray
    colour: str
    style: int = 0
    cut_short: bool = False
    points: bool = False
    names: tuple[str, ...] = ()
    low: np.ndarray | None = None
    high: np.ndarray | None = None


@dataclass(frozen=True)
class Known:
    """Known points: a line where there are many, markers where there are few, with a band or bars of uncertainty.

    Attributes:
        label: Text of the legend.
        x, y: Values in the units of the axes, shape (n,).
        low, high: Range, shape (n,), or None.
        points: Whether they are markers however many there are; None leaves it to their number.
        style: Which marker or dash pattern, where there are several in one panel.
    """

    label: str
    x: np.ndarray
    y: np.ndarray
    low: np.ndarray | None = None
    high: np.ndarray | None = None
    points: bool | None = None
    style: int = 0


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes:
        label: Label of the vertical axis with its unit.
        lines, known: What is drawn.
        log_y: Whether the vertical axis is logarithmic; None leaves it to the range of the values.
        title: Heading of the panel; empty for none.
        x_label: Label of a horizontal axis of its own; empty where all panels share that of the plot.
        equal: Whether both axes have the same scale.
    """

    label: str
    lines: tuple[Line, ...]
    known: tuple[Known, ...] = ()
    log_y: bool | None = None
    title: str = ""
    x_label: str = ""
    equal: bool = False


@dataclass(frozen=True)
class Plot:
    """What a figure shows.

    Attributes:
        name: Identifier, unique on the page.
        title, caption: Plain text.
        x_label: Label of the shared horizontal axis with its unit.
        panels: From top to bottom, or from left to right in rows of `columns`.
        command: What reproduces it.
        log_x: Whether the horizontal axis is logarithmic.
        x_names: Words in the place of the numbers 0, 1, 2, ... of the horizontal axis; empty for numbers.
        columns: Panels side by side where there is room.
        tag: What to know of all runs in it before reading anything, such as that they are softened; shown beside the
            title.
    """

    name: str
    title: str
    caption: str
    x_label: str
    panels: tuple[Panel, ...]
    command: str
    log_x: bool = False
    x_names: tuple[str, ...] = ()
    columns: int = 1
    tag: str = ""

    @property
    def shared(self) -> bool:
        """Whether all panels have the same horizontal axis."""
        return not any(panel.x_label for panel in self.panels)
