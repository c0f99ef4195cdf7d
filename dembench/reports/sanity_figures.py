"""Figures of the sanity suite: one for each of the six problems, every engine beside the closed form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dembench.reports.looks import look
from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.reports.svg import MUTED
from dembench.results.schema import SnapshotSeries
from dembench.runs.directory import RunRecord
from dembench.verification import sanity
from dembench.verification import sanity_scenes as scenes

FALLING_TIME = 4.0
"""Time of the falling sphere that is drawn [s]."""
SLIDING_TIME = 1.0
DRAWN_LAYERS = (10, 20, 30, 40)


@dataclass(frozen=True)
class Seen:
    """What one engine made of one scene: its label, its colour and all bodies at the recorded times."""

    label: str
    colour: str
    motion: SnapshotSeries

    def line(self, x: np.ndarray, y: np.ndarray, style: int = 0, what: str = "", points: bool = False) -> Line:
        """A curve of this engine; `what` tells several of one panel apart."""
        return Line(f"{self.label}{what and ', '}{what}", x, y, self.colour, style, points=points)


def plots(runs: Sequence[RunRecord], command: str) -> list[Plot]:
    """The figures of complete runs; one whose scene nobody ran is left out."""
    seen: dict[str, list[Seen]] = {}
    for run in runs:
        if run.result is not None:
            engine = look(run.spec.engine)
            seen.setdefault(run.spec.case, []).append(Seen(run.spec.label(), engine.colour, sanity.motion(run.result)))
    makers: list[Callable[[dict[str, list[Seen]], str], Plot | None]] = [
        _restitution,
        _bounces,
        _rolling,
        _column,
        _deflection,
        _bed,
    ]
    return [plot for make in makers if (plot := make(seen, command)) is not None]


def _restitution(seen: dict[str, list[Seen]], command: str) -> Plot | None:
    if "sanity_collisions" not in seen:
        return None
    e = np.array(scenes.HEAD_ON)
    exact = np.linspace(0, 1, 21)
    measured = [(s, _measured_restitutions(s.motion)) for s in seen["sanity_collisions"]]
    return Plot(
        name="restitution",
        title="SP1: head-on pairs part with the restitution that was set",
        caption="Relative velocity after the contact over that before it, for five pairs at 2 m/s each.",
        x_label="Restitution set",
        panels=(
            Panel(
                "Restitution measured",
                tuple(s.line(e, y, points=True) for s, y in measured),
                (Known("closed form", exact, exact),),
            ),
            Panel(
                "Measured − set",
                tuple(s.line(e, y - e, points=True) for s, y in measured),
                (Known("closed form", exact, 0 * exact, 0 * exact - 1e-4, 0 * exact + 1e-4),),
            ),
        ),
        command=command,
    )


def _measured_restitutions(motion: SnapshotSeries) -> np.ndarray:
    end = motion.velocity[-1]
    return np.array([(end[2 * k + 1, 0] - end[2 * k, 0]) / (2 * scenes.SPEED) for k in range(len(scenes.HEAD_ON))])


def _bounces(seen: dict[str, list[Seen]], command: str) -> Plot | None:
    floors = {"sanity_floor": "plane", "sanity_sdf_floor": "signed distance"}
    panels = []
    time = np.linspace(0, FALLING_TIME, 401)
    for scene, floor in floors.items():
        if scene in seen:
            lines = tuple(s.line(*_height(s.motion)) for s in seen[scene])
            exact = (Known("closed form", time, bouncing(time)),)
            panels.append(Panel("Height [m]", lines, exact, log_y=False, title=floor.capitalize()))
    if not panels:
        return None
    ratios = [
        f"{s.label} on the {floor} {sanity.bounce(s.motion):.4f}"
        for scene, floor in floors.items()
        for s in seen.get(scene, [])
    ]
    return Plot(
        name="bounce",
        title="SP2: a sphere falls 5 m on a plane and on a signed distance",
        caption=f"Gap below the sphere. First bounce over fall: {', '.join(ratios)}; e² is {scenes.BOUNCE**2:.4f}.",
        x_label="Time [s]",
        panels=tuple(panels),
        command=command,
    )


def _height(motion: SnapshotSeries) -> tuple[np.ndarray, np.ndarray]:
    rows = motion.time <= FALLING_TIME
    z = motion.position[rows, 0, 2]
    return motion.time[rows], z - z[0] + scenes.DROP


def bouncing(time: np.ndarray) -> np.ndarray:
    """Height of a point that falls `DROP` and rebounds with `BOUNCE` again and again [m], shape of `time` [s]."""
    height = np.empty_like(time)
    start, speed, top = 0.0, 0.0, scenes.DROP
    for k, t in enumerate(time):
        while True:
            ends = start + (speed + np.sqrt(speed**2 + 2 * scenes.GRAVITY * top)) / scenes.GRAVITY
            if t <= ends:
                break
            impact = np.sqrt(speed**2 + 2 * scenes.GRAVITY * top)
            start, speed, top = ends, scenes.BOUNCE * impact, 0.0
        height[k] = top + speed * (t - start) - 0.5 * scenes.GRAVITY * (t - start) ** 2
    return height


def _rolling(seen: dict[str, list[Seen]], command: str) -> Plot | None:
    if "sanity_floor" not in seen:
        return None
    time = np.linspace(0, SLIDING_TIME, 201)
    fall = scenes.SLIDE_FRICTION * scenes.GRAVITY * time / scenes.SLIDE
    exact = np.maximum(1 - fall, 5 / 7), np.minimum(2.5 * fall, 5 / 7)
    lines: tuple[list[Line], list[Line]] = ([], [])
    for s in seen["sanity_floor"]:
        rows = s.motion.time <= SLIDING_TIME
        t = s.motion.time[rows]
        lines[0].append(s.line(t, s.motion.velocity[rows, 1, 0] / scenes.SLIDE))
        lines[1].append(s.line(t, s.motion.angular_velocity[rows, 1, 1] * scenes.RADIUS / scenes.SLIDE))
    return Plot(
        name="rolling",
        title="SP3: a sliding sphere ends rolling with 5/7 of its speed",
        caption="Sliding: v = v0 − μ g t and ω r = 5/2 μ g t, until both are 5/7 v0 at 2 v0/(7 μ g) = 0.175 s.",
        x_label="Time [s]",
        panels=(
            Panel("Velocity / v0", tuple(lines[0]), (Known("closed form", time, exact[0]),)),
            Panel("Spin · r / v0", tuple(lines[1]), (Known("closed form", time, exact[1]),)),
        ),
        command=command,
    )


def _column(seen: dict[str, list[Seen]], command: str) -> Plot | None:
    if "sanity_floor" not in seen:
        return None
    speeds, spacings = [], []
    for s in seen["sanity_floor"]:
        column = slice(2, 2 + scenes.COLUMN)
        speeds.append(s.line(s.motion.time, np.linalg.norm(s.motion.velocity[:, column], axis=2).max(axis=1)))
        spacing = np.diff(s.motion.position[:, column, 2], axis=1).mean(axis=1)
        spacings.append(s.line(s.motion.time, 1e3 * (spacing - 2 * scenes.RADIUS)))
    rest = _at_rest(scenes.COLUMN_STEPS * scenes.DT)
    return Plot(
        name="column",
        title="SP4: a column of six stands",
        caption="Largest speed of the six spheres, and the mean spacing of their centres less two radii.",
        x_label="Time [s]",
        panels=(
            Panel("Largest speed [m/s]", tuple(speeds), (rest,)),
            Panel("Spacing − 2 r [mm]", tuple(spacings), (rest,)),
        ),
        command=command,
    )


def _deflection(seen: dict[str, list[Seen]], command: str) -> Plot | None:
    if "sanity_collisions" not in seen:
        return None
    equal, opposite = 2 * len(scenes.HEAD_ON), 2 * len(scenes.HEAD_ON) + 2
    panels = []
    time = np.linspace(0, 2, 201)
    since = np.maximum(time - (scenes.HALF_GAP - scenes.RADIUS) / scenes.SPEED, 0)
    bound = sanity.COULOMB * since
    page = sanity.PAGE_DEFLECTION * since
    for first, name in ((equal, "equal spins"), (opposite, "opposite spins")):
        lines = [
            s.line(s.motion.time, s.motion.position[:, body, 1], style=side, what=("left", "right")[side])
            for s in seen["sanity_collisions"]
            for side, body in enumerate((first, first + 1))
        ]
        if first == equal:
            lines.append(Line("published page", time, page, MUTED, 2))
        allowed = Known("Coulomb's bound", time, bound, -bound, bound)
        panels.append(Panel("Lateral position [m]", tuple(lines), (allowed,), title=name.capitalize()))
    return Plot(
        name="deflection",
        title="SP5: spinning spheres are deflected up to Coulomb's bound",
        caption="Lateral positions of the two spheres of a pair, spin 10 rad/s each. The band is what the bound of "
        f"Coulomb allows, μ (1 + e) v = {sanity.COULOMB:.2f} m/s. {sanity.SPIN_NOTE}",
        x_label="Time [s]",
        panels=tuple(panels),
        command=command,
    )


def _bed(seen: dict[str, list[Seen]], command: str) -> Plot | None:
    if "sanity_bed" not in seen:
        return None
    speeds, heights = [], []
    for s in seen["sanity_bed"]:
        speeds.append(s.line(s.motion.time, np.linalg.norm(s.motion.velocity, axis=2).max(axis=1)))
        layers = sanity.layers(s.motion).mean(axis=2)
        for style, layer in enumerate(DRAWN_LAYERS):
            moved = 1e3 * (layers[:, layer - 1] - layers[0, layer - 1])
            heights.append(s.line(s.motion.time, moved, style, f"layer {layer}"))
    rest = _at_rest(scenes.BED_STEPS * scenes.DT)
    return Plot(
        name="bed",
        title="SP6: a bed of 40 layers stands",
        caption="Largest speed of all 1,000 spheres, and how far layers have moved from where they stood.",
        x_label="Time [s]",
        panels=(
            Panel("Largest speed [m/s]", tuple(speeds), (rest,)),
            Panel("Height − start [mm]", tuple(heights), (rest,)),
        ),
        command=command,
    )


def _at_rest(duration: float) -> Known:
    time = np.linspace(0, duration, 21)
    return Known("rest", time, 0 * time)
