"""Quantities, references and known curves of the rotating drum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from dembench.cases import drum_bed
from dembench.cases.base import Curve, Preset, Quantity, Recorded, Reference
from dembench.cases.publication import cited, published
from dembench.cases.quantities import (
    OVERLAP_MARGIN,
    SHARE,
    Extremum,
    extrema,
    kept_shape,
    overlap_in_diameters,
    titled,
)
from dembench.scene import Scene

COUNTED = "zone2.M1"
"""The published curve: M1 grains with x < 0 and z < 0."""
LEAST_SWING = 0.015
"""Smallest swing of the count, as a share of all M1, that makes an extremum [-]."""
STEADY = 1.0
"""Time from which surface and wall layer are those of the steady flow [s]."""

QUANTITIES = {
    "first_trough": ("First trough of M1 in zone 2", "1"),
    "first_peak": ("First peak of M1 in zone 2", "1"),
    "first_peak_time": ("Time of the first peak", "s"),
    "second_peak": ("Second peak of M1 in zone 2", "1"),
    "second_peak_time": ("Time of the second peak", "s"),
    "third_peak": ("Third peak of M1 in zone 2", "1"),
    "third_peak_time": ("Time of the third peak", "s"),
    "first_period": ("Time from first to second peak", "s"),
    "second_period": ("Time from second to third peak", "s"),
    "amplitude": ("Swing from the first peak to the trough after it", "1"),
    "first_decay": ("Second peak over the first", "1"),
    "second_decay": ("Third peak over the second", "1"),
    "lacey_start": ("Lacey index at the start", "1"),
    "lacey_end": ("Lacey index at the end", "1"),
    "surface_angle": ("Angle of the free surface, mean of the steady flow", "deg"),
    "corotation": ("Speed of the wall layer over that of the wall, mean of the steady flow", "1"),
    "slip": ("Slip at the wall over the speed of the wall, mean of the steady flow", "1"),
    "overlap": ("Largest overlap, in diameters of the smallest grains", "1"),
}
"""Title and unit of every quantity, in the order of tables."""
MARGINS = {"lacey_start": SHARE, "lacey_end": SHARE, "slip": SHARE, "overlap": OVERLAP_MARGIN}
"""Changes that do not matter of what can be zero: indices and slip lie between 0 and 1 [-]."""


def quantities(scene: Scene, result: Recorded) -> list[Quantity]:
    """The quantities that the record covers."""
    found: dict[str, float | None] = {}
    zones = result.observables.get("zones")
    if zones is not None and len(zones.time) > 2:
        count = np.asarray(zones.value, dtype=float)[:, list(zones.components).index(COUNTED)]
        found |= _swings(extrema(np.asarray(zones.time), count, LEAST_SWING * _grains(scene, "M1")))
    shots = result.snapshots.get("mixing")
    if shots is not None and len(shots.time):
        found |= _bed(scene, shots)
    found["overlap"] = overlap_in_diameters(scene, result)
    return titled(QUANTITIES, found, MARGINS)


def _grains(scene: Scene, species: str) -> int:
    k = [s.name for s in scene.species].index(species)
    return int(np.count_nonzero(scene.bodies.species == k))


def _swings(found: list[Extremum]) -> dict[str, float]:
    """Peaks, troughs, periods and decay of the count; what the record does not reach is left out."""
    peaks, troughs = [e for e in found if e.peak], [e for e in found if not e.peak]
    values: dict[str, float] = {}
    if troughs and (not peaks or troughs[0].time < peaks[0].time):
        values["first_trough"] = troughs[0].value
    for name, peak in zip(("first", "second", "third"), peaks, strict=False):
        values[f"{name}_peak"], values[f"{name}_peak_time"] = peak.value, peak.time
    for name, before, after in zip(("first", "second"), peaks, peaks[1:], strict=False):
        values[f"{name}_period"] = after.time - before.time
        values[f"{name}_decay"] = after.value / before.value
    later = [t for t in troughs if peaks and t.time > peaks[0].time]
    if later:
        values["amplitude"] = peaks[0].value - later[0].value
    return values


def _bed(scene: Scene, shots: Any) -> dict[str, float]:
    """What snapshots tell of mixture, surface and wall layer."""
    values = {"lacey_start": drum_bed.lacey_index(scene, shots.position[0])}
    if shots.time[-1] >= scene.duration * (1 - 1e-9):
        values["lacey_end"] = drum_bed.lacey_index(scene, shots.position[-1])
    steady = np.flatnonzero(np.asarray(shots.time) >= STEADY - 1e-9)
    if len(steady):
        values["surface_angle"] = float(np.mean([drum_bed.surface_angle(scene, shots.position[k]) for k in steady]))
        layers = [
            layer for k in steady.tolist() if (layer := drum_bed.wall_layer(scene, *_state(shots, k))) is not None
        ]
        if layers:
            values["corotation"], values["slip"] = (float(x) for x in np.mean(layers, axis=0))
    return values


def _state(shots: Any, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return shots.position[k], shots.velocity[k], shots.angular_velocity[k]


def references(scene: Scene, parameters: Any, preset: Preset) -> list[Reference]:
    """What holds for a variant: published numbers where its contacts are the published ones.

    They judge runs from the published state; a bed filled otherwise is denser or looser and only stands beside them.
    """
    if preset == "quick":
        return [kept_shape(), *cited(published("drum")["quick"], QUANTITIES, parameters)]
    found = cited(published("drum"), QUANTITIES, parameters)
    if not scene.name.endswith("_published"):
        found = [replace(r, low=None, high=None) for r in found]
    return [kept_shape(), *found]


def curves(scene: Scene, parameters: Any, preset: Preset) -> list[Curve]:
    """The recorded extrema of other codes, where the contacts are the published ones."""
    if preset == "quick" or parameters.changed():
        return []
    return [_extrema(entry) for entry in published("drum")["runs"]]


def _extrema(entry: Mapping[str, Any]) -> Curve:
    points = np.array(entry["time"]), np.array(entry["extrema"])
    source = f"{entry['source']}; doi {published('drum')['doi']}"
    return Curve("zones", f"{entry['code']}, extrema", *points, None, None, source, component=COUNTED, points=True)
