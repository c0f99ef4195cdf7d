"""What the page of a drum shows: counts in both zones, centres of mass, mixing, surface, wall layer, pictures."""

from __future__ import annotations

from typing import Any

import numpy as np

from dembench.cases import drum_bed, drum_scores
from dembench.cases.publication import published
from dembench.cases.published_results import PublishedResult, recorded
from dembench.cases.views import CaseFigure, Picture, Trace, View
from dembench.scene import Scene, Snapshot

SNAPSHOT = "mixing"
INSTANTS = 5
ZONES = {"zone2": "Zone 2 (x < 0, z < 0)", "zone1": "Zone 1 (x > 0, z > 0)"}
SPECIES = ("M1", "M2")
EXTREMA = ("first_trough", "first_peak", "second_trough", "second_peak", "third_trough", "third_peak")
"""What the extrema on record of others are, in the order of time."""
RECORDED = {
    "sampled_peak": ("Largest sample of M1 in zone 2 at the first peak", "1"),
    "third_trough": ("Third trough of M1 in zone 2", "1"),
    "start_m1": ("M1 in zone 2 at the start", "1"),
    "start_m2": ("M2 in zone 2 at the start", "1"),
    "end": ("M1 in zone 2 after 5 s", "1"),
}
"""Title and unit of what is on record of others beside the quantities of the case."""


def figures(scene: Scene) -> list[CaseFigure]:
    """Figures of a drum."""
    return [
        CaseFigure(
            name="zones",
            title="Grains in the two zones",
            caption="Grains whose centres lie in a zone, by species, every 0.1 s.",
            views=tuple(
                View(_zone(f"{zone}.{s}"), "Time [s]", f"{s} [thousand]", text, known=f"zones.{zone}.{s}", scale=1e-3)
                for zone, text in ZONES.items()
                for s in SPECIES
            ),
            columns=2,
            replaces=("zones",),
        ),
        CaseFigure(
            name="centres",
            title="Paths of the centres of mass",
            caption="In the plane across the axis, seen from −y; the wall carries the bed up on the right. The circle "
            "is the start.",
            views=tuple(View(_path(s), "x [mm]", "z [mm]", s, equal=True) for s in SPECIES),
            columns=2,
            replaces=("centres",),
        ),
        CaseFigure(
            name="mixing",
            title="Mixing, free surface and wall layer",
            caption="From the snapshots: Lacey's index of mixing by volume (0 apart, 1 mixed at random), the angle of "
            "the free surface to the horizontal, and the tangential velocity of the grains at the mantle over that of "
            "the wall.",
            views=(
                View(_lacey, "Time [s]", "Lacey index"),
                View(_angle, "Time [s]", "Surface [°]"),
                View(_corotation, "Time [s]", "Wall layer / wall"),
            ),
        ),
    ]


def pictures(scene: Scene) -> list[Picture]:
    """The drum along its axis at five instants."""
    times = next(o.times for o in scene.observables if isinstance(o, Snapshot) and o.name == SNAPSHOT)
    shown = np.unique(np.round(np.linspace(0, len(times) - 1, INSTANTS)).astype(int))
    half = min(-scene.domain.lower[0], scene.domain.upper[0])
    front = float(scene.bodies.position[:, 1].min() - 0.5 * scene.radii().min())
    return [
        Picture(
            name="along-the-axis",
            title="The drum along its axis",
            caption="Seen through the front plate; the drum turns counter-clockwise.",
            snapshot=SNAPSHOT,
            times=tuple(times[k] for k in shown),
            x=(-half, half),
            z=(-half, half),
            cut=front,
            colour="species",
        )
    ]


def published_results() -> list[PublishedResult]:
    """Extrema, periods, decays and slip at the wall that are on record of single codes."""
    entries = [
        {
            **entry,
            **dict(zip(EXTREMA, entry["extrema"], strict=True)),
            **{f"{name}_time": time for name, time in zip(EXTREMA, entry["time"], strict=True)},
        }
        for entry in published("drum")["runs"]
    ]
    return recorded([*entries, *published("drum")["wall_layer"]], {**drum_scores.QUANTITIES, **RECORDED})


def _zone(component: str) -> Any:
    def measure(scene: Scene, result: Any) -> list[Trace]:
        zones = result.observables.get("zones")
        if zones is None or component not in zones.components:
            return []
        return [Trace(zones.time, zones.value[:, zones.components.index(component)] / 1e3)]

    return measure


def _path(species: str) -> Any:
    def measure(scene: Scene, result: Any) -> list[Trace]:
        centres = result.observables.get("centres")
        if centres is None or f"{species}.x" not in centres.components:
            return []
        x, z = (1e3 * centres.value[:, centres.components.index(f"{species}.{axis}")] for axis in "xz")
        return [Trace(x, z), Trace(x[:1], z[:1], points=True)]

    return measure


def _each(scene: Scene, result: Any, measure: Any) -> list[Trace]:
    """A number of every snapshot over time."""
    shots = result.snapshots.get(SNAPSHOT)
    if shots is None or not len(shots.time):
        return []
    return [Trace(shots.time, np.array([measure(shots, k) for k in range(len(shots.time))]))]


def _lacey(scene: Scene, result: Any) -> list[Trace]:
    return _each(scene, result, lambda shots, k: drum_bed.lacey_index(scene, shots.position[k]))


def _angle(scene: Scene, result: Any) -> list[Trace]:
    return _each(scene, result, lambda shots, k: drum_bed.surface_angle(scene, shots.position[k]))


def _corotation(scene: Scene, result: Any) -> list[Trace]:
    def measure(shots: Any, k: int) -> float:
        layer = drum_bed.wall_layer(scene, shots.position[k], shots.velocity[k], shots.angular_velocity[k])
        return np.nan if layer is None else layer[0]

    return _each(scene, result, measure)
