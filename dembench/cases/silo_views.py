"""What the page of a silo shows: discharge, velocities at the snapshot, wall forces, the silo cut open."""

from __future__ import annotations

from typing import Any

import numpy as np

from dembench.cases import silo_scores
from dembench.cases.publication import published
from dembench.cases.published_results import PublishedResult, recorded
from dembench.cases.views import CaseFigure, Picture, Trace, View
from dembench.scene import Count, Scene, Snapshot, WallForce

SNAPSHOT = "flow"
BINS = 100
SPIN_RANGE = 0.5
"""Rotation about the axis that the histogram covers, both ways [rad/s]."""
QUANTILES = {"radial": (0.05, 0.99), "vertical": (0.05, 1.0)}
"""Shares of the grains below the ends of the histograms of velocity [-]."""
LAYER = 4.0
"""Thickness of the layers of the profile across the silo, and width of the core, in radii [-]."""
RINGS = 16
ABOVE_CONE = 0.05
"""Height above the cone of the upper layer [m]."""

RECORDED = {
    "ratio": ("Discharge rate over that of the small orifice", "1"),
    "slowing": ("Loss of rate from the first to the third second of the window", "1"),
    "time_500": ("Time until 500 grains are left", "s"),
    "time_empty": ("Time until the silo is empty", "s"),
}
"""Title and unit of what is on record of others beside the quantities of the case."""


def figures(scene: Scene) -> list[CaseFigure]:
    """Figures of a silo; those of the snapshot only where the scene lasts until it."""
    walls = [o for o in scene.observables if isinstance(o, WallForce)]
    found = [
        CaseFigure(
            name="discharge",
            title="Grains in the silo and discharge rate",
            caption="Grains above the lip, and the rate between samples; horizontal: the rate of the line "
            "that is fitted to the count, over the window of the fit.",
            views=(
                View(_count, "Time [s]", "Grains [thousand]", known="inside", scale=1e-3),
                View(_rate, "Time [s]", "Rate [thousand/s]"),
            ),
            replaces=("inside",),
        )
    ]
    if walls:
        found.append(
            CaseFigure(
                name="wall-force",
                title="Vertical force of the grains on the walls",
                caption="Contact forces, positive upwards.",
                views=tuple(View(_vertical_force(o.name), "Time [s]", "Force [N]", o.wall.capitalize()) for o in walls),
                replaces=tuple(o.name for o in walls),
            )
        )
    time = _time(scene)
    if time is None:
        return found
    when = f"{time:g} s"
    found += [
        CaseFigure(
            name="velocities",
            title=f"Velocities of the grains at {when}",
            caption=f"Histograms of {BINS} bins over the grains above the lip: radial velocity (x vx + y vy)/r between "
            "its 5 % and 99 % quantiles, rotation about the axis (x vy − y vx)/r², vertical velocity from its 5 % "
            "quantile to 0.",
            views=(
                View(_radial, "Radial velocity [mm/s]", "Density [s/mm]"),
                View(_rotation, "Rotation [rad/s]", "Density [s/rad]"),
                View(_vertical, "Vertical velocity [mm/s]", "Density [s/mm]"),
            ),
            columns=3,
        ),
        CaseFigure(
            name="profile",
            title=f"Vertical velocity across and along the silo at {when}",
            caption=f"Means over rings of equal width in layers of {LAYER:g} radii: {1e3 * ABOVE_CONE:g} mm above the "
            "cone, and half way down the cone. Along the axis: means over the grains within the orifice's radius.",
            views=(
                View(_across(upper=True), "Radius [mm]", "Velocity [mm/s]", "Above the cone"),
                View(_across(upper=False), "Radius [mm]", "Velocity [mm/s]", "In the cone"),
                View(_along, "Height above the lip [mm]", "Velocity [mm/s]", "On the axis"),
            ),
            columns=3,
        ),
    ]
    return found


def pictures(scene: Scene) -> list[Picture]:
    """The silo cut open at the snapshot; none of a scene that ends before it."""
    time = _time(scene)
    if time is None:
        return []
    own, radius = silo_scores.orifice_of(scene), float(scene.radii().max())
    top = float(scene.bodies.position[:, 2].max()) + 3 * radius
    half = float(np.abs(scene.bodies.position[:, :2]).max()) + 3 * radius
    return [
        Picture(
            name="cut-open",
            title=f"The silo cut open at {time:g} s",
            caption="Grains behind the plane through the axis.",
            snapshot=SNAPSHOT,
            times=(time,),
            x=(-half, half),
            z=(own["lip"] - 0.02, top),
            cut=0.0,
            colour="speed",
        )
    ]


def published_results(orifice: str, material: str) -> list[PublishedResult]:
    """Rates, times and numbers of grains left that are on record of single codes."""
    entries = [e for e in published("silo")["runs"] if (e["orifice"], e["material"]) == (orifice, material)]
    return recorded(entries, {**silo_scores.QUANTITIES, **RECORDED})


def _time(scene: Scene) -> float | None:
    """Time of the snapshot [s]; None for a scene that ends before it."""
    times = (o.times[0] for o in scene.observables if isinstance(o, Snapshot) and o.name == SNAPSHOT)
    return next(times, None)


# ---- over time


def _count(scene: Scene, result: Any) -> list[Trace]:
    inside = result.observables.get("inside")
    return [] if inside is None else [Trace(inside.time, inside.value / 1e3)]


def _rate(scene: Scene, result: Any) -> list[Trace]:
    """Rate between samples; and that of the fit, over its window."""
    inside = result.observables.get("inside")
    if inside is None or len(inside.time) < 2:
        return []
    middle = 0.5 * (inside.time[1:] + inside.time[:-1])
    found = [Trace(middle, -np.diff(inside.value) / np.diff(inside.time) / 1e3)]
    rates = [q.value for q in silo_scores.quantities(scene, result) if q.name == "discharge_rate"]
    if rates:
        low, high = silo_scores.window(scene)
        window = np.array([low, min(high, float(inside.time[-1]))])
        found.append(Trace(window, np.full(2, rates[0] / 1e3), "fit"))
    return found


def _vertical_force(name: str) -> Any:
    def measure(scene: Scene, result: Any) -> list[Trace]:
        force = result.observables.get(name)
        return [] if force is None else [Trace(force.time, force.value[:, 2])]

    return measure


# ---- at the snapshot


def _flowing(scene: Scene, result: Any) -> tuple[np.ndarray, np.ndarray] | None:
    """Centres [m] and velocities [m/s] of the grains above the lip, shape (n, 3); None without a snapshot."""
    shots = result.snapshots.get(SNAPSHOT)
    if shots is None or not len(shots.time):
        return None
    lip = next(o.region.lower[2] for o in scene.observables if isinstance(o, Count))
    x, y, z = shots.position[0].T
    above = (z > lip) & (np.hypot(x, y) > 0)  # on the axis there is no radial velocity
    return shots.position[0][above], shots.velocity[0][above]


def _histogram(values: np.ndarray, low: float, high: float) -> list[Trace]:
    if not high > low:
        return []
    density, edges = np.histogram(values, BINS, (low, high))
    width = edges[1] - edges[0]
    return [Trace(0.5 * (edges[1:] + edges[:-1]), density / (len(values) * width))]


def _radial(scene: Scene, result: Any) -> list[Trace]:
    if (flowing := _flowing(scene, result)) is None:
        return []
    (x, y, _), (vx, vy, _) = (a.T for a in flowing)
    radial = 1e3 * (x * vx + y * vy) / np.hypot(x, y)
    return _histogram(radial, *np.quantile(radial, QUANTILES["radial"]))


def _rotation(scene: Scene, result: Any) -> list[Trace]:
    if (flowing := _flowing(scene, result)) is None:
        return []
    (x, y, _), (vx, vy, _) = (a.T for a in flowing)
    return _histogram((x * vy - y * vx) / (x**2 + y**2), -SPIN_RANGE, SPIN_RANGE)


def _vertical(scene: Scene, result: Any) -> list[Trace]:
    if (flowing := _flowing(scene, result)) is None:
        return []
    vertical = 1e3 * flowing[1][:, 2]
    return _histogram(vertical, float(np.quantile(vertical, QUANTILES["vertical"][0])), 0.0)


def _across(*, upper: bool) -> Any:
    """Profile over the radius in a layer above the cone or in it."""

    def measure(scene: Scene, result: Any) -> list[Trace]:
        if (flowing := _flowing(scene, result)) is None:
            return []
        position, velocity = flowing
        own = silo_scores.orifice_of(scene)
        height = own["lip"] + (own["cone"] + ABOVE_CONE if upper else 0.5 * own["cone"])
        layer = np.abs(position[:, 2] - height) < 0.5 * LAYER * scene.radii()[0]
        radius = np.hypot(position[layer, 0], position[layer, 1])
        return _means(1e3 * radius, 1e3 * velocity[layer, 2])

    return measure


def _along(scene: Scene, result: Any) -> list[Trace]:
    if (flowing := _flowing(scene, result)) is None:
        return []
    position, velocity = flowing
    own = silo_scores.orifice_of(scene)
    core = np.hypot(position[:, 0], position[:, 1]) < own["radius"]
    return _means(1e3 * (position[core, 2] - own["lip"]), 1e3 * velocity[core, 2])


def _means(place: np.ndarray, value: np.ndarray) -> list[Trace]:
    """Means of values in bins of equal width over their places; empty bins are left out."""
    if not len(place):
        return []
    edges = np.linspace(0, float(place.max()) * (1 + 1e-9), RINGS + 1)
    index = np.digitize(place, edges) - 1
    count, total = np.bincount(index, minlength=RINGS), np.bincount(index, value, minlength=RINGS)
    used = count > 0
    return [Trace((0.5 * (edges[1:] + edges[:-1]))[used], total[used] / count[used])]
