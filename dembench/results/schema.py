"""What a result file of a scene holds: names, units, components and times, the same for every engine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dembench.scene import (
    CentreOfMass,
    Count,
    ElasticEnergy,
    Energy,
    Overlap,
    Rigid,
    Scene,
    Snapshot,
    Species,
    Trajectory,
    WallForce,
    ZoneCount,
    features,
    geometry_moves,
)

VERSION = (1, 0)
H5MD_VERSION = (1, 1)
TIME_UNIT = "s"
AXES = ("x", "y", "z")
PARTICLE_UNITS = {"position": "m", "velocity": "m s-1", "angular_velocity": "rad s-1"}
RECORDS = ("settings", "environment", "timing", "resources", "counters", "status", "provenance")
"""JSON texts of the group `/dembench`, beside the scene."""


@dataclass(frozen=True)
class Channel:
    """One time series of a result file, as the scene asks for it.

    Attributes:
        name: Name of the group below `/observables`.
        title: What it is, for figures and tables.
        unit: Unit of the values; `1` for a number.
        components: Names of the columns; empty where there is one value per time.
        time: Times at which it is recorded [s], t = 0 first, shape (t,).
    """

    name: str
    title: str
    unit: str
    components: tuple[str, ...]
    time: np.ndarray

    def shape(self, rows: int) -> tuple[int, ...]:
        """Shape of the values for that many rows."""
        return (rows, len(self.components)) if self.components else (rows,)


@dataclass(frozen=True)
class Observed:
    """A recorded time series.

    Attributes:
        step, time: Step numbers of the engine and times [s], shape (t,).
        value: Shape (t,), or (t, c) with the c components.
        unit: Unit of the values.
        components: Names of the columns; empty where there is one value per time.
        title: What it is.
    """

    step: np.ndarray
    time: np.ndarray
    value: np.ndarray
    unit: str
    components: tuple[str, ...]
    title: str


@dataclass(frozen=True)
class SnapshotSeries:
    """All bodies at the times of one snapshot observable; a body that has left is NaN.

    Attributes:
        step, time: Shape (t,), [s].
        position, velocity, angular_velocity: [m], [m/s], [rad/s], shape (t, n, 3) in the order of the initial state.
    """

    step: np.ndarray
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray


def channels(scene: Scene) -> dict[str, Channel]:
    """Every time series that a complete result of the scene holds, by name; snapshots are apart.

    Raises:
        ValueError: There is an observable that no engine can record.
    """
    if refused := not_recorded(scene):
        raise ValueError("; ".join(refused))
    found: dict[str, Channel] = {}
    for o in scene.observables:
        if isinstance(o, Snapshot):
            continue
        time = times_of(scene, o.interval)
        name = o.name
        if isinstance(o, Trajectory):
            rows = [
                (f"{name}_displacement", f"Vertical displacement of {name}", "m", ()),
                (f"{name}_minimum", f"Lowest vertical displacement of {name} since the last sample", "m", ()),
                (f"{name}_position", f"Position of {name}", "m", AXES),
                (f"{name}_velocity", f"Velocity of {name}", "m s-1", AXES),
            ]
        elif isinstance(o, Energy):
            rows = [(name, "Kinetic and potential energy", "J", ("translational", "rotational", "potential"))]
        elif isinstance(o, ElasticEnergy):
            rows = [(name, "Energy of the normal springs", "J", ())]
        elif isinstance(o, Overlap):
            rows = [(name, "Largest overlap of two particles", "m", ())]
        elif isinstance(o, Count):
            rows = [(name, f"Number of particles in {name}", "1", ())]
        elif isinstance(o, ZoneCount):
            rows = [(name, f"Number of particles per zone of {name}", "1", _zone_components(scene, o))]
        elif isinstance(o, WallForce):
            rows = [(name, f"Contact force on {o.wall}", "N", AXES)]
        elif isinstance(o, CentreOfMass):
            parts = tuple(f"{s.name}.{axis}" for s in _inhabited(scene) for axis in AXES)
            rows = [(name, "Centre of mass by species", "m", parts)]
        for key, title, unit, components in rows:
            if key in found:
                raise ValueError(f"observables: two of them record '{key}'; rename one")
            found[key] = Channel(key, title, unit, components, time)
    return found


def not_recorded(scene: Scene) -> list[str]:
    """Observables that no engine can record, one line each."""
    found = []
    for o in scene.observables:
        if isinstance(o, ElasticEnergy) and (why := _without_springs(scene)):
            found.append(f"observable {o.name}: the energy of springs is not known where {why}")
        if isinstance(o, Energy | Overlap) and features(scene).shapes:
            found.append(f"observable {o.name}: frames have no orientations of bodies that are no spheres")
    return found


def _without_springs(scene: Scene) -> str:
    """Why positions do not tell the energy of the springs; empty where they do."""
    if isinstance(scene.law, Rigid):
        return "the law is rigid and has none"
    if any(geometry_moves(wall) for wall in scene.walls):
        return "walls change their place"
    return "bodies are no spheres" if features(scene).shapes else ""


def times_of(scene: Scene, interval: float) -> np.ndarray:
    """Those of the scene's frame times that are multiples of `interval` [s], shape (t,)."""
    ratio = scene.frame_times() / interval
    return scene.frame_times()[np.abs(ratio - np.round(ratio)) < 1e-6]


def snapshot_times(scene: Scene, snapshot: Snapshot) -> np.ndarray:
    """Those of the scene's frame times that the snapshot asks for, ascending [s], shape (t,)."""
    frames = scene.frame_times()
    wanted = np.array(snapshot.times)
    return frames[np.abs(frames[:, None] - wanted).min(axis=1) < 0.5 * scene.sampling_interval()]


def _inhabited(scene: Scene) -> list[Species]:
    return [s for k, s in enumerate(scene.species) if (scene.bodies.species == k).any()]


def _zone_components(scene: Scene, observable: ZoneCount) -> tuple[str, ...]:
    if not observable.by_species:
        return tuple(observable.zones)
    return tuple(f"{zone}.{s.name}" for zone in observable.zones for s in _inhabited(scene))
