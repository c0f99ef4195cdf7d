"""Quantities, references and known curves of the particle impact."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dembench.cases.base import Curve, Preset, Quantity, Recorded, Reference
from dembench.cases.publication import cited, stated
from dembench.cases.quantities import SHARE, lowest, sample_at, titled
from dembench.scene import Box, Scene

FREE_FALL_SHARE = 0.9
FREE_FALL_TOLERANCE = 1e-3
FLOOR_TOLERANCE = 0.01
ENERGY_TOLERANCE = 0.01
ENERGY_SHARE = 1e-5
"""Change of an energy that does not matter, as a share of the ball's at the start [-]."""

QUANTITIES = {
    "deepest": ("Deepest point of the ball, 1 ms samples", "m"),
    "deepest_between": ("Deepest point of the ball, between samples too", "m"),
    "deepest_time": ("Time of the deepest 1 ms sample", "s"),
    "descent_25ms": ("Displacement at 25 ms", "m"),
    "descent_27ms": ("Displacement at 27 ms", "m"),
    "descent_29ms": ("Displacement at 29 ms", "m"),
    "speed_35ms": ("Vertical velocity of the ball at 35 ms", "m/s"),
    "end_point": ("Displacement at the end", "m"),
    "free_fall": ("Displacement at the last sample of the free fall", "m"),
    "floor_clearance": ("Smallest gap between ball and floor", "m"),
    "energy_excess": ("Largest kinetic and potential energy above that at the start", "J"),
    "energy_rise": ("Largest rise of the energy, normal springs included, between 1 ms samples", "J"),
}
"""Title and unit of every quantity, in the order of tables."""


def quantities(scene: Scene, result: Recorded) -> list[Quantity]:
    """The quantities that the record covers."""
    seen = result.observables
    found: dict[str, float | None] = {}
    if "ball_displacement" in seen and len(seen["ball_displacement"].time):
        found |= _depths(scene, seen)
    if "ball_velocity" in seen:
        velocity = seen["ball_velocity"]
        found["speed_35ms"] = sample_at(velocity.time, np.asarray(velocity.value).reshape(-1, 3)[:, 2], 0.035)
    if "energy" in seen and len(seen["energy"].time):
        total = np.asarray(seen["energy"].value).sum(axis=1)
        found["energy_excess"] = float(total.max() - total[0])
        found["energy_rise"] = _rise(total, seen.get("springs"))
    return titled(QUANTITIES, found, _margins(scene), ("energy_excess", "energy_rise"))


def _margins(scene: Scene) -> dict[str, float]:
    """Changes that do not matter of what can be zero: shares of the ball's way to the floor, of its speed or energy."""
    energy = ENERGY_SHARE * _ball_energy(scene)
    return {
        "floor_clearance": SHARE * _floor_gap(scene),
        "speed_35ms": SHARE * abs(float(scene.bodies.velocity[_ball(scene), 2])),
        "energy_excess": energy,
        "energy_rise": energy,
    }


def _ball_energy(scene: Scene) -> float:
    """Kinetic energy of the ball at the start [J]."""
    ball = _ball(scene)
    return float(0.5 * scene.masses()[ball] * scene.bodies.velocity[ball, 2] ** 2)


def _rise(total: np.ndarray, springs: Any) -> float | None:
    """Largest rise [J] between neighbouring samples of `total` and the springs' energy, which a rebound feeds on.

    What shear springs store is not in it: no position tells it. 0 where it never rises.
    """
    if springs is None or len(springs.time) < 2:
        return None
    n = min(len(total), len(springs.time))
    return max(0.0, float(np.diff(total[:n] + np.asarray(springs.value)[:n]).max()))


def _depths(scene: Scene, seen: Mapping[str, Any]) -> dict[str, float | None]:
    time, depth = seen["ball_displacement"].time, seen["ball_displacement"].value
    found: dict[str, float | None] = {}
    deepest = lowest(time, depth)
    if deepest is not None:
        found["deepest_time"], found["deepest"] = deepest
    between = depth
    if "ball_minimum" in seen and len(seen["ball_minimum"].time):
        between = seen["ball_minimum"].value
        fine = lowest(seen["ball_minimum"].time, between)
        found["deepest_between"] = fine[1] if fine is not None else None
    found["descent_25ms"] = sample_at(time, depth, 0.025)
    found["descent_27ms"] = sample_at(time, depth, 0.027)
    found["descent_29ms"] = sample_at(time, depth, 0.029)
    found["end_point"] = sample_at(time, depth, scene.duration)
    found["free_fall"] = sample_at(time, depth, free_fall_end(scene))
    found["floor_clearance"] = float(min(np.min(depth), np.min(between))) + _floor_gap(scene)
    return found


def _ball(scene: Scene) -> int:
    return scene.tracked_bodies()[0]


def _floor_gap(scene: Scene) -> float:
    """Gap between ball and floor at the start [m]."""
    box = next(wall for wall in scene.walls if isinstance(wall, Box))
    ball = _ball(scene)
    return float(scene.bodies.position[ball, 2] - box.lower[2] - scene.radii()[ball])


def first_contact(scene: Scene) -> float:
    """Time at which the ball, falling freely, first touches a resting grain or the floor [s]."""
    ball = _ball(scene)
    others = np.arange(len(scene.bodies)) != ball
    reach = scene.radii()[ball] + scene.radii()[others]
    offset = scene.bodies.position[others] - scene.bodies.position[ball]
    aside = np.hypot(offset[:, 0], offset[:, 1])
    below = (aside < reach) & (offset[:, 2] < 0)
    drops = -offset[below, 2] - np.sqrt(reach[below] ** 2 - aside[below] ** 2)
    drop = min(_floor_gap(scene), float(drops.min()) if len(drops) else np.inf)
    speed, gravity = -scene.bodies.velocity[ball, 2], -scene.gravity[2]
    return float(2 * drop / (speed + np.sqrt(speed**2 + 2 * gravity * drop)))


def free_fall_end(scene: Scene) -> float:
    """The last sample of the free fall: at most 0.9 of the time to the first contact [s]."""
    interval = next(o.interval for o in scene.observables if o.name == "ball" and hasattr(o, "interval"))
    return float(np.floor(FREE_FALL_SHARE * first_contact(scene) / interval) * interval)


def _fall(scene: Scene, time: float | np.ndarray) -> Any:
    """Displacement in free fall [m]: v0 t + g t^2/2."""
    return scene.bodies.velocity[_ball(scene), 2] * time + 0.5 * scene.gravity[2] * time**2


def references(scene: Scene, published: Mapping[str, Any], parameters: Any, preset: Preset) -> list[Reference]:
    """What holds for a variant: published numbers, or ensembles of our own for the quick bed; see `Case.references`."""
    found = _necessary(scene)
    if preset == "quick":
        return found + cited(published["quick"], QUANTITIES, parameters)
    if parameters.changed():
        return found
    if parameters.bed == "25k":
        found.append(_deepest_25k(published))
    found += [
        stated(entry, QUANTITIES)
        for entry in published["references"]
        if _applies(entry, scene, parameters.bed) and _same_end(entry["quantity"], scene, published)
    ]
    return found


def _applies(entry: Mapping[str, Any], scene: Scene, bed: str) -> bool:
    state = "published" if scene.name.endswith("_published") else "other"
    return entry["bed"] == bed and entry["state"] in (state, "any")


def _same_end(quantity: str, scene: Scene, published: Mapping[str, Any]) -> bool:
    return quantity != "end_point" or bool(np.isclose(scene.duration, published["published"]["duration"]))


def _deepest_25k(published: Mapping[str, Any]) -> Reference:
    """Deepest point from the codes' means over ten initial conditions."""
    codes = published["deepest_25k"]
    means = np.array([c["mean"] for c in codes])
    deviations = np.array([c["deviation"] for c in codes])
    return Reference(
        quantity="deepest",
        value=float(means.mean()),
        low=float((means - 2 * deviations).min()),
        high=float((means + 2 * deviations).max()),
        unit="m",
        source=f"mean of {len(codes)} codes over ten initial conditions; band: every code's mean with two of its "
        f"standard deviations; doi {published['doi']}",
        kind="publication",
    )


def _necessary(scene: Scene) -> list[Reference]:
    """Conditions that every correct run meets, whatever the bed."""
    fall = float(_fall(scene, free_fall_end(scene)))
    ball = _ball(scene)
    radius = scene.radii()[ball]
    return [
        Reference(
            quantity="free_fall",
            value=fall,
            low=fall - FREE_FALL_TOLERANCE * abs(fall),
            high=fall + FREE_FALL_TOLERANCE * abs(fall),
            unit="m",
            source=f"v0 t + g t^2/2 at {free_fall_end(scene) * 1e3:g} ms; band: {FREE_FALL_TOLERANCE:.1%}",
            kind="closed form",
            necessary=True,
        ),
        Reference(
            quantity="floor_clearance",
            value=None,
            low=float(-FLOOR_TOLERANCE * radius),
            high=None,
            unit="m",
            source=f"the ball does not pass the floor; band: {FLOOR_TOLERANCE:.0%} of its radius",
            kind="closed form",
            necessary=True,
        ),
        Reference(
            quantity="energy_excess",
            value=None,
            low=None,
            high=ENERGY_TOLERANCE * _ball_energy(scene),
            unit="J",
            source=f"nothing feeds energy in; band: {ENERGY_TOLERANCE:.0%} of the ball's kinetic energy at the start",
            kind="closed form",
            necessary=True,
        ),
    ]


def curves(scene: Scene, published: Mapping[str, Any], parameters: Any, preset: Preset) -> list[Curve]:
    """The free fall until the first contact, and the points known of the published runs of this variant."""
    time = np.linspace(0, min(first_contact(scene), scene.duration), 20)
    found = [Curve("ball_displacement", "free fall", time, _fall(scene, time), None, None, "v0 t + g t^2/2")]
    if preset == "quick" or parameters.changed():
        return found
    for entry in published["curves"]:
        if _applies(entry, scene, parameters.bed):
            low, high = np.array(entry["low"]), np.array(entry["high"])
            points = np.array(entry["time"]), np.array(entry["value"])
            source = f"{entry['source']}; doi {published['doi']}"
            found.append(Curve(entry["observable"], entry["label"], *points, low, high, source, points=True))
    for reference in references(scene, published, parameters, preset):
        if reference.quantity == "end_point" and reference.value is not None and reference.low is not None:
            band = (np.array([reference.low]), np.array([reference.high]))
            point = (np.array([scene.duration]), np.array([reference.value]))
            label = "published end point"
            found.append(Curve("ball_displacement", label, *point, *band, reference.source, points=True))
    return found
