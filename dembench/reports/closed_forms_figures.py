"""Figures of the suite of closed forms: oblique impacts, restitution, a cradle, and the order of accuracy."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dembench.reports.looks import look
from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.results import Result
from dembench.runs.directory import RunRecord
from dembench.verification.closed_forms import chains, chung_ooi, order
from dembench.verification.closed_forms.collisions import Contact, impacts
from dembench.verification.closed_forms.oblique import returned
from dembench.verification.scenes import MOTION

Runs = dict[str, dict[str, Result]]
"""Complete results by scene, then by engine with its settings."""


def plots(runs: Sequence[RunRecord], command: str) -> list[Plot]:
    """The figures of complete runs; one whose scene nobody ran is left out."""
    seen: Runs = {}
    colours: dict[str, str] = {}
    for run in runs:
        if run.result is not None:
            seen.setdefault(run.spec.case, {})[run.spec.label()] = run.result
            colours[run.spec.label()] = look(run.spec.engine).colour
    makers: list[Callable[[Runs, dict[str, str], str], Plot | None]] = [_oblique, _restitution, _cradle, _order]
    return [plot for make in makers if (plot := make(seen, colours, command)) is not None]


def _oblique(seen: Runs, colours: dict[str, str], command: str) -> Plot | None:
    results = seen.get(chung_ooi.GRAIN_VOLLEY.name)
    if not results:
        return None
    degrees = np.array([*chung_ooi.PAPER_ANGLES, *chung_ooi.SLIDING_ANGLES])
    velocities, apart = [], []
    fine = np.linspace(2, 88, 87)
    exact, curve = _law(degrees), _law(fine)
    for label, result in results.items():
        found = returned(chung_ooi.GRAIN_VOLLEY.seen(result)[len(chung_ooi.DAMPED) :][: len(degrees)])
        velocities.append(Line(label, degrees, found, colours[label], points=True))
        apart.append(Line(label, degrees, found - exact, colours[label]))
    paper = Known("Chung & Ooi", np.array(chung_ooi.PAPER_ANGLES), np.array(chung_ooi.PAPER), points=True)
    return Plot(
        name="oblique",
        title="CO4: oxide spheres of 5 mm hit a wall under many angles",
        caption=f"Tangential velocity after over that before at {chung_ooi.SMALL_SPEED:g} m/s with e = 0.98 "
        "and μ = 0.092. Above 32.5° the spheres slide through the whole contact; below, the tangential spring gives "
        "back a part, so that less is left than the 5/7 of a rigid sphere that sticks. The second panel shows how far "
        "each engine is from the integral of the scene's law.",
        x_label="Angle to the normal [degrees]",
        panels=(
            Panel(
                "Tangential restitution",
                tuple(velocities),
                (Known("the scene's law, integrated", fine, curve), paper),
            ),
            Panel("Difference from the law", tuple(apart), (Known("no difference", fine, 0 * fine),), log_y=False),
        ),
        command=command,
    )


def _law(degrees: np.ndarray) -> np.ndarray:
    """Tangential restitution of the oxide under the scene's law for some angles [degrees], shape (n,)."""
    speed = chung_ooi.SMALL_SPEED * np.cos(np.radians(degrees))
    along = chung_ooi.SMALL_SPEED * np.sin(np.radians(degrees))
    found = impacts([Contact.with_wall(chung_ooi.GRAINS["oxide"])] * len(degrees), speed, along)
    return np.array([1 - one.push / v for one, v in zip(found, along, strict=True)])


def _restitution(seen: Runs, colours: dict[str, str], command: str) -> Plot | None:
    results = seen.get(chung_ooi.GRAIN_VOLLEY.name)
    if not results:
        return None
    e = np.array(chung_ooi.RESTITUTIONS)
    panels = []
    for k, (name, title) in enumerate((("oxide", "Aluminium oxide"), ("iron", "Cast iron"))):
        lines = []
        for label, result in results.items():
            shots = chung_ooi.GRAIN_VOLLEY.seen(result)[k * len(e) : (k + 1) * len(e)]
            assert all(shot.kind.startswith(name) for shot, _ in shots), "the damped shots come first, by material"
            measured = np.array([outcome.rebound / shot.speed for shot, outcome in shots])
            lines.append(Line(label, e, measured - e, colours[label], points=True))
        exact = Known("pair law", e, 0 * e, -7.5e-3 * e, 7.5e-3 * e, points=False)
        panels.append(Panel("Measured − set", tuple(lines), (exact,), log_y=False, title=title))
    return Plot(
        name="restitution",
        title="CO3: restitution of head-on impacts",
        caption="Normal speed after over that before, less the restitution that was set. The band is what is accepted.",
        x_label="Restitution set",
        panels=tuple(panels),
        command=command,
        columns=2,
    )


def _cradle(seen: Runs, colours: dict[str, str], command: str) -> Plot | None:
    results = seen.get("cradle")
    if not results:
        return None
    panels = []
    for k, (_, title, kind, gap) in enumerate(chains.ROWS):
        time = np.linspace(0, chains.END, 401)
        exact = chains.chain_of(kind, gap).velocities(time)
        known = tuple(Known("chain, integrated", 1e6 * time, v / chains.SPEED) for v in exact.T)
        lines = []
        for turn, (label, result) in enumerate(results.items()):
            motion, shown = result.snapshots[MOTION], slice(turn, None, len(results))
            v = motion.velocity[shown, k * chains.BALLS : (k + 1) * chains.BALLS, 0] / chains.SPEED
            time_shown = 1e6 * motion.time[shown]
            lines += [Line(label, time_shown, v[:, ball], colours[label], points=True) for ball in (0, -1)]
        panels.append(Panel("Velocity / v0", tuple(lines), known, log_y=False, title=title.capitalize()))
    return Plot(
        name="cradle",
        title="SR10: Newton's cradle",
        caption="Velocities of the five balls. Touching soft spheres share the impact: the last one leaves with 98.9 % "
        "of the speed, and the others move back. Balls apart meet one by one, and the last one takes all. Of the "
        "engines the first and the last ball are drawn, their samples in turn, so that none hides another.",
        x_label="Time [μs]",
        panels=tuple(panels),
        command=command,
    )


def _order(seen: Runs, colours: dict[str, str], command: str) -> Plot | None:
    panels = []
    for kind, title, restitution, quantity, expected in (
        ("elastic", "Elastic: duration", 1.0, 1, 2),
        ("damped", "e = 0.5: restitution", order.DAMPED, 0, 1),
    ):
        names = [order.name_of(kind, n) for n in order.STEPS]
        labels = [label for label in seen.get(names[0], {}) if all(label in seen.get(name, {}) for name in names)]
        lines = []
        steps = np.array(order.STEPS, dtype=float)
        for label in labels:
            found = order.errors({name: seen[name][label] for name in names}, kind, restitution)
            values = np.array([one[quantity] for one in found])
            slope = order.slope(values)
            lines.append(Line(f"{label}, order {slope:.2f}", steps, values, colours[label], points=False))
        if lines:
            guide = max(line.y[0] for line in lines) * (steps / steps[0]) ** -expected
            known = (Known(f"order {expected}", steps, guide, points=False),)
            panels.append(Panel("Relative error", tuple(lines), known, log_y=True, title=title))
    if not panels:
        return None
    return Plot(
        name="order",
        title="SR14: order of accuracy in the time step",
        caption="Root mean square error of 256 collisions that meet the grid of steps at different phases. Elastic "
        "Hertz contacts leave a method of second order its order; a dashpot sets in at once and takes it to first "
        "order where it takes the velocity of half a step before.",
        x_label="Steps in a contact",
        panels=tuple(panels),
        command=command,
        log_x=True,
        columns=2,
    )
