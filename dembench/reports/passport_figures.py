"""Figures of the suite `passport`: what engines measured over the curves of the named laws."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from dembench.reports.looks import look
from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.runs.directory import RunRecord
from dembench.verification.passport.measure import (
    forces,
    friction,
    levers,
    motion_of,
    pairs,
    predicted,
    restitution,
    scene,
    separation,
)
from dembench.verification.passport.pairs import Motion
from dembench.verification.passport.scenes import RESTITUTIONS, SLOPES, of_family

SHORT = {
    "hertz-mindlin": "Hertz-Mindlin",
    "full-lever": "full lever",
    "no-tension": "tension clipped",
    "thornton": "Thornton, force kept",
    "two-thirds": "2/3 of the shear",
    "spring-bound": "bound by spring",
    "sliding-dashpot": "dashpot slides",
    "force-history": "force kept",
    "linear": "linear",
    "rigid": "rigid",
}
DRAWN = (0.5, 0.9)
"""Restitutions of the pairs whose forces are drawn."""
Own = TypeVar("Own", int, list[int])


@dataclass(frozen=True)
class Seen:
    """The motion of one engine, its label, its colour, and which it is among those of this colour."""

    label: str
    colour: str
    style: int
    motion: Motion

    def line(self, x: np.ndarray, y: np.ndarray, points: bool = False) -> Line:
        """A curve of this engine."""
        return Line(self.label, x, y, self.colour, self.style, points=points)


def plots(runs: Sequence[RunRecord], command: str) -> list[Plot]:
    """The figures of complete runs."""
    seen: list[Seen] = []
    for run in runs:
        if run.result is not None and run.spec.case == scene().name:
            colour = look(run.spec.engine).colour
            same = sum(other.colour == colour for other in seen)
            seen.append(Seen(run.spec.label(), colour, same, motion_of(run.result)))
    return [make(seen, command) for make in (_restitution, _sliding, _forces, _shear, _oblique)] if seen else []


def _known(names: Sequence[str], styles: Mapping[str, int] | None = None) -> list[tuple[int, str, Motion]]:
    """Style, short name and motion of laws; a law has its place as its style unless another is given."""
    own = {name: k for k, name in enumerate(names)} | dict(styles or {})
    return [(own[name], SHORT[name], predicted()[name]) for name in names]


def _restitution(seen: list[Seen], command: str) -> Plot:
    e, own = np.array(RESTITUTIONS), of_family("normal")
    names = ("hertz-mindlin", "no-tension", "thornton")
    return Plot(
        name="restitution",
        title="Restitution after head-on impacts",
        caption="Speed after over speed before. A law that forbids tension and keeps the dashpot of one that allows it "
        "rebounds faster: 0.55 for 0.5 (Schwager & Poeschel 2007).",
        x_label="Restitution set",
        panels=(
            Panel(
                "Measured − set",
                tuple(s.line(e, restitution(pairs(), s.motion)[own] - e, points=True) for s in seen),
                tuple(
                    Known(n, e, restitution(pairs(), m)[own] - e, style=k, points=False) for k, n, m in _known(names)
                ),
                log_y=False,
            ),
        ),
        command=command,
    )


def _sliding(seen: list[Seen], command: str) -> Plot:
    e, own = np.array(RESTITUTIONS), of_family("sliding")
    mu = pairs().friction[own]
    names = ("hertz-mindlin", "no-tension", "thornton", "spring-bound")
    levered = ("hertz-mindlin", "full-lever")
    return Plot(
        name="sliding",
        title="Effective friction and lever of spheres that slide through the whole contact",
        caption="Spins of 150 rad/s give a slip three times as fast as the approach. Left: tangential over normal "
        "impulse, over the coefficient that was set. The dashpot of a law that leaves it out of the bound while its "
        "spring is still short adds to friction, the more the lower the restitution. Right: angular impulse over "
        "radius times tangential impulse.",
        x_label="Restitution set",
        panels=(
            Panel(
                "Friction measured / set",
                tuple(s.line(e, friction(pairs(), s.motion)[own] / mu, points=True) for s in seen),
                tuple(Known(n, e, friction(pairs(), m)[own] / mu, style=k, points=False) for k, n, m in _known(names)),
                log_y=False,
            ),
            Panel(
                "Lever / radius",
                tuple(s.line(e, levers(pairs(), s.motion, own), points=True) for s in seen),
                tuple(
                    Known(n, e, levers(pairs(), m, own), style=k, points=False)
                    for k, n, m in _known(levered, {"full-lever": len(names)})
                ),
                log_y=False,
            ),
        ),
        command=command,
        columns=2,
    )


def _forces(seen: list[Seen], command: str) -> Plot:
    names = ("hertz-mindlin", "no-tension", "thornton", "linear")
    shown = {f"e = {e:g}": of_family("normal")[RESTITUTIONS.index(e)] for e in DRAWN}

    def curve(motion: Motion, own: int) -> tuple[np.ndarray, np.ndarray]:
        depth, normal, _ = forces(pairs(), motion)
        touching = depth[:, own] > 0
        return 1e6 * depth[touching, own], normal[touching, own]

    return Plot(
        name="normal",
        title="Normal force against overlap",
        caption="Mean force between two recorded times, m* dv/dt: loading above, unloading below; below zero the "
        "contact pulls.",
        x_label="Overlap [µm]",
        panels=_panels("Normal force [N]", shown, curve, seen, names),
        command=command,
        columns=2,
    )


def _panels(
    axis: str,
    shown: Mapping[str, Own],
    curve: Callable[[Motion, Own], tuple[np.ndarray, np.ndarray]],
    seen: list[Seen],
    names: tuple[str, ...],
    points: bool = False,
) -> tuple[Panel, ...]:
    """For each title with its pairs a curve, or points, of every engine over the curves of some named laws."""
    return tuple(
        Panel(
            axis,
            tuple(s.line(*curve(s.motion, own), points=points) for s in seen),
            tuple(Known(n, *curve(m, own), style=k, points=False) for k, n, m in _known(names)),
            log_y=False,
            title=title,
        )
        for title, own in shown.items()
    )


def _shear(seen: list[Seen], command: str) -> Plot:
    names = ("hertz-mindlin", "two-thirds", "force-history", "linear")
    rough, oblique = of_family("rough"), of_family("oblique")
    shown = {"Nothing slides: μ = 5, e = 0.98, slope 0.5": rough[4], "Sticks and slides: μ = 0.2, e = 0.5": oblique[2]}

    def curve(motion: Motion, own: int) -> tuple[np.ndarray, np.ndarray]:
        middle = 0.5e3 * (motion.time[1:] + motion.time[:-1])
        _, _, tangential = forces(pairs(), motion)
        part = middle < 2.8
        return middle[part], -tangential[part, own]

    return Plot(
        name="shear",
        title="Tangential force through an oblique impact",
        caption="A law that remembers the way of the slip loses force as the contact opens; one that remembers the "
        "force keeps it.",
        x_label="Time [ms]",
        panels=_panels("Tangential force [N]", shown, curve, seen, names),
        command=command,
        columns=2,
    )


def _oblique(seen: list[Seen], command: str) -> Plot:
    names = ("hertz-mindlin", "two-thirds", "spring-bound", "rigid")
    own = of_family("oblique")
    shown = {f"e = {e:g}, μ = 0.2": own[k * len(SLOPES) : (k + 1) * len(SLOPES)] for k, e in enumerate((0.5, 0.9))}

    def curve(motion: Motion, own: list[int]) -> tuple[np.ndarray, np.ndarray]:
        v = separation(motion)[:, own, 1]
        return np.array(SLOPES), v[-1] / v[0]

    return Plot(
        name="oblique",
        title="Tangential rebound of oblique impacts",
        caption="Two spheres without spin that meet with a tangential velocity. Soft ones turn about each other while "
        "they touch, which rigid ones do not.",
        x_label="Tangential over normal velocity before",
        panels=_panels("Tangential velocity after / before", shown, curve, seen, names, points=True),
        command=command,
        columns=2,
    )
