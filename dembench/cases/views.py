"""What a case wants to be seen beside its time series: figures of curves, and pictures of its particles.

A case describes, the reports draw: nothing here knows of colours, pages or files.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from dembench.scene import Scene

Axis = Literal["x", "y", "z"]


@dataclass(frozen=True)
class Trace:
    """A curve that one run adds to a panel.

    Attributes:
        x, y: Values in the units of the panel, shape (n,).
        label: What tells it from other curves of the same run; empty where there is one.
        points: Whether it is drawn as points.
    """

    x: np.ndarray
    y: np.ndarray
    label: str = ""
    points: bool = False


Measure = Callable[[Scene, Any], list[Trace]]
"""Curves of one run from its scene and its result (see `Recorded`); empty where it has not recorded them."""


@dataclass(frozen=True)
class View:
    """One panel of a figure.

    Attributes:
        measure: Makes the curves of a run.
        x, y: Titles and units of the axes, as shown: "Time [s]".
        title: Heading of the panel; empty for none.
        known: Observable, or observable and component as `name.component`, whose reference curves are drawn too; empty
            for none.
        scale: Factor from the observable's unit to that of the vertical axis, for the reference curves.
        equal: Whether both axes have the same scale: a path in the plane.
    """

    measure: Measure
    x: str
    y: str
    title: str = ""
    known: str = ""
    scale: float = 1.0
    equal: bool = False


@dataclass(frozen=True)
class CaseFigure:
    """A figure of a case.

    Attributes:
        name: Identifier.
        title, caption: Plain text.
        views: Panels.
        columns: Panels side by side where there is room.
        replaces: Observables that it shows better than a plain curve each.
    """

    name: str
    title: str
    caption: str
    views: tuple[View, ...]
    columns: int = 1
    replaces: tuple[str, ...] = ()


@dataclass(frozen=True)
class Picture:
    """Pictures of the particles of every run, drawn to one scale and seen from -y: x to the right, z up.

    Attributes:
        name: Identifier.
        title, caption: Plain text.
        snapshot: Name of the snapshot observable.
        times: Times of the pictures [s]; of each the nearest recorded one is shown.
        x, z: Ranges that are seen [m].
        cut: Particles whose centres lie at y >= cut are drawn, and walls where they cross that plane [m].
        colour: What colours the particles.
        fastest: Speed at the end of the colour scale [m/s]; None takes it from the particles.
        always: Bodies that are drawn wherever they are, by their index in the initial state.
    """

    name: str
    title: str
    caption: str
    snapshot: str
    times: tuple[float, ...]
    x: tuple[float, float]
    z: tuple[float, float]
    cut: float
    colour: Literal["speed", "species"]
    fastest: float | None = None
    always: tuple[int, ...] = ()
