"""Observables from frames and tracks: ONE function for all engines, usable while a run is still going on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from dembench.results.elastic import NormalSprings
from dembench.results.schema import PARTICLE_UNITS, Observed, SnapshotSeries, channels, snapshot_times
from dembench.scene import (
    CentreOfMass,
    Count,
    ElasticEnergy,
    Energy,
    Overlap,
    Scene,
    Snapshot,
    Trajectory,
    WallForce,
    ZoneCount,
)
from dembench.scene.overlap import Touching, touching


@dataclass(frozen=True)
class Fault:
    """Why what an engine wrote is no result: reason (`nan`, `lost particles`) and one line about it."""

    reason: str
    detail: str


def observe(scene: Scene, frames: Sequence[Any], tracks: Any | None = None) -> dict[str, Observed]:
    """Time series of a scene from the frames and tracks of an engine.

    Args:
        scene: The scene; its observables say what is computed and when.
        frames: Frames with step, time, present, position, velocity, angular_velocity (see `dembench.engines.base`),
            ascending in time. A frame is used where its time is that of a scene's frame within half a step.
        tracks: Tracks of the tracked bodies with step, time, position, or None.

    Returns:
        Observed series by name; fewer rows than the scene asks for where frames are missing.
    """
    observer = Observer(scene)
    observer.update(frames, tracks)
    return observer.observed()


class Observer:
    """Computes the observables of a run frame by frame.

    `update` may be called again and again with growing sequences: every frame is loaded and used once. The first
    frame with a NaN or a lost particle ends the record and is kept as `fault`.
    """

    def __init__(self, scene: Scene) -> None:
        """Prepares the record of a scene.

        Raises:
            ValueError: The scene has an observable that no engine can record.
        """
        self.scene = scene
        self.fault: Fault | None = None
        self._channels = channels(scene)
        self._times = scene.frame_times()
        self._radii, self._masses = scene.radii(), scene.masses()
        self._rows: dict[str, list[tuple[int, float, Any]]] = {name: [] for name in self._channels}
        self._kept = {o.name: _Kept(scene, o) for o in scene.observables if isinstance(o, Snapshot)}
        self._seen = np.zeros(len(self._times), dtype=bool)
        self._next = 0
        self._tracks: Any | None = None
        self._pairs: tuple[Any, Touching] | None = None

    def update(self, frames: Sequence[Any], tracks: Any | None = None) -> None:
        """Uses the frames that are new since the last call and takes the tracks as they are now."""
        self._tracks = tracks
        while self._next < len(frames) and self.fault is None:
            frame = frames[self._next]
            self._next += 1
            row = self._row_of(frame)
            if row is None or self._seen[row]:
                continue
            self.fault = self._fault_of(frame)
            if self.fault is None:
                self._seen[row] = True
                self._record(frame, self._times[row])
        if self.fault is None and tracks is not None:
            bad = np.argwhere(~np.isfinite(tracks.position))
            if len(bad):
                body = self.scene.tracked_bodies()[int(bad[0][1])]
                self.fault = Fault("nan", f"track of body {body} is not finite at t = {tracks.time[bad[0][0]]:.6g} s")

    def missing(self) -> np.ndarray:
        """Frame times of the scene for which no frame was seen [s]."""
        return self._times[~self._seen]

    def observed(self) -> dict[str, Observed]:
        """The series so far, by name."""
        found = {}
        for o in self.scene.observables:
            if isinstance(o, Trajectory):
                self._fill_minimum(o)
        for name, channel in self._channels.items():
            rows = self._rows[name]
            found[name] = Observed(
                step=np.array([row[0] for row in rows], dtype=np.int64),
                time=np.array([row[1] for row in rows], dtype=np.float64),
                value=np.array([row[2] for row in rows], dtype=np.float64).reshape(channel.shape(len(rows))),
                unit=channel.unit,
                components=channel.components,
                title=channel.title,
            )
        return found

    def snapshots(self) -> dict[str, SnapshotSeries]:
        """The snapshots so far, by name; the arrays are views of what is recorded here."""
        return {name: kept.series() for name, kept in self._kept.items()}

    # ---- one frame

    def _row_of(self, frame: Any) -> int | None:
        row = int(np.argmin(np.abs(self._times - frame.time)))
        half_step = 0.5 * frame.time / frame.step if frame.step else 0.0
        near = abs(self._times[row] - frame.time) <= half_step * (1 + 1e-6) + 1e-9 * self.scene.sampling_interval()
        return row if near else None

    def _fault_of(self, frame: Any) -> Fault | None:
        when = f"at t = {frame.time:.6g} s"
        bodies = len(self.scene.bodies)
        lost = bodies - len(frame.present)
        if lost and not self.scene.sinks:
            gone = np.setdiff1d(np.arange(bodies), frame.present)
            names = ", ".join(str(k) for k in gone[:5]) + (", ..." if lost > 5 else "")
            return Fault("lost particles", f"{lost} of {bodies} missing {when}: {names}")
        for field in ("position", "velocity", "angular_velocity"):
            bad = np.flatnonzero(~np.isfinite(getattr(frame, field)).all(axis=1))
            if len(bad):
                body = int(frame.present[bad[0]])
                return Fault("nan", f"{field} of body {body} is not finite {when} ({len(bad)} bodies)")
        for body in self.scene.tracked_bodies():
            if body not in frame.present:
                return Fault("lost particles", f"tracked body {body} is gone {when}")
        return None

    def _record(self, frame: Any, time: float) -> None:
        for o in self.scene.observables:
            if isinstance(o, Snapshot):
                self._kept[o.name].add(frame, time)
                continue
            for name, value in self._values(o, frame).items():
                if np.any(self._channels[name].time == time):
                    self._rows[name].append((frame.step, time, value))

    def _values(self, o: Any, frame: Any) -> dict[str, Any]:
        match o:
            case Trajectory():
                k = int(np.searchsorted(frame.present, o.body))
                position = frame.position[k]
                return {
                    f"{o.name}_displacement": position[2] - self.scene.bodies.position[o.body, 2],
                    f"{o.name}_position": position,
                    f"{o.name}_velocity": frame.velocity[k],
                }
            case Energy():
                return {o.name: self._energy(frame)}
            case ElasticEnergy():
                return {o.name: self._springs.energy(frame.position, frame.present, self._pairs_of(frame))}
            case Overlap():
                return {o.name: float(self._pairs_of(frame)[2].max(initial=0.0))}
            case WallForce():
                return {o.name: frame.wall_forces[o.wall]}
            case Count():
                return {o.name: np.count_nonzero(o.region.contains(frame.position))}
            case ZoneCount():
                return {o.name: self._zones(o, frame)}
            case CentreOfMass():
                return {o.name: self._centres(frame)}
        raise TypeError(f"observable {o.name}: {type(o).__name__} has no function")

    def _energy(self, frame: Any) -> tuple[float, float, float]:
        """Sum of m v^2/2, I w^2/2 with I = 2/5 m r^2 of a solid sphere, and -m g.x [J]."""
        mass, radius = self._masses[frame.present], self._radii[frame.present]
        inertia = 0.4 * mass * radius**2
        return (
            0.5 * float(mass @ (frame.velocity**2).sum(axis=1)),
            0.5 * float(inertia @ (frame.angular_velocity**2).sum(axis=1)),
            -float(mass @ (frame.position @ np.array(self.scene.gravity))),
        )

    def _pairs_of(self, frame: Any) -> Touching:
        """Pairs that overlap in a frame; they are sought once for all that is observed of it."""
        if self._pairs is None or self._pairs[0] is not frame:
            self._pairs = frame, touching(frame.position, self._radii[frame.present], self.scene.domain)
        return self._pairs[1]

    @cached_property
    def _springs(self) -> NormalSprings:
        return NormalSprings(self.scene)

    def _zones(self, o: ZoneCount, frame: Any) -> list[int]:
        species = self.scene.bodies.species
        inside = [zone.contains(frame.position) for zone in o.zones.values()]
        if o.by_species:
            own = [species[frame.present] == k for k in np.unique(species)]
            inside = [zone & kind for zone in inside for kind in own]
        return [int(np.count_nonzero(mask)) for mask in inside]

    def _centres(self, frame: Any) -> list[float]:
        """Centre of mass of each species that the initial state has [m]; NaN where all of it has left."""
        species, mass, found = self.scene.bodies.species, self._masses[frame.present], []
        for k in np.unique(species):
            own = species[frame.present] == k
            total = mass[own].sum()
            found += list(mass[own] @ frame.position[own] / total) if total else [np.nan] * 3
        return found

    # ---- tracks

    def _fill_minimum(self, o: Trajectory) -> None:
        """Lowest displacement in (t - interval, t] for every sample that the track has reached."""
        name, tracks = f"{o.name}_minimum", self._tracks
        self._rows[name] = []
        if tracks is None:
            return
        height = tracks.position[:, self.scene.tracked_bodies().index(o.body), 2]
        height = height - self.scene.bodies.position[o.body, 2]
        cadence, times = self.scene.track_times()[1], self._channels[name].time
        first = np.searchsorted(tracks.time, times - o.interval + 0.5 * cadence, side="right")
        end = np.searchsorted(tracks.time, times + 0.5 * cadence)
        for time, covered in zip(times, map(slice, first, end), strict=True):
            expected = 1 if time == 0 else round(o.interval / cadence)
            if len(height[covered]) < expected or not np.isfinite(height[covered]).all():
                break
            self._rows[name].append((int(tracks.step[covered][-1]), time, height[covered].min()))


class _Kept:
    """The snapshots of one observable so far: arrays of their final size, whose pages are taken as they are filled."""

    def __init__(self, scene: Scene, snapshot: Snapshot) -> None:
        self._times, n = snapshot_times(scene, snapshot), len(scene.bodies)
        self._rows = 0
        self._step = np.zeros(len(self._times), dtype=np.int64)
        self._fields = {name: np.empty((len(self._times), n, 3)) for name in PARTICLE_UNITS}

    def add(self, frame: Any, time: float) -> None:
        """Takes a frame where its time [s] is one of those asked for."""
        k = self._rows
        if k == len(self._times) or not np.isclose(self._times[k:], time, rtol=1e-9, atol=0).any():
            return
        self._times[k], self._step[k] = time, frame.step
        for name, array in self._fields.items():
            array[k] = np.nan
            array[k, frame.present] = getattr(frame, name)
        self._rows += 1

    def series(self) -> SnapshotSeries:
        """The snapshots so far."""
        k = self._rows
        return SnapshotSeries(self._step[:k], self._times[:k], **{name: a[:k] for name, a in self._fields.items()})
