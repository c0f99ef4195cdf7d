"""Observables of a scene from the time series of another program.

What a file holds is put on the scene's sampling times: as it is where a sample lies there, linear between samples that
are at most one and a half sampling intervals apart, and left out elsewhere. Known faults of files are repaired only
where the file itself proves them, and every repair is said in a note.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from dembench.results.foreign import Foreign, ForeignError
from dembench.results.observe import observe
from dembench.results.schema import Channel, Observed, channels
from dembench.scene import Count, Scene, Trajectory, ZoneCount

SAME = 1e-6
"""Times closer than this share of a sampling interval are the same [-]."""
GAP = 1.5
"""Largest distance of two samples, in sampling intervals, between which a value is interpolated [-]."""
LATE = 1.5
"""Largest delay of times, in the file's own samples, that is one of writing [-]."""
FINE = 0.1
"""Spacing of samples, in sampling intervals, from which the lowest value between two of the scene is known [-]."""
OTHER_STATE = 0.1
"""Counts at the start that differ by more than this share of the bodies are not those of the scene [-]."""
TIMES = ("t", "time")
UNITS = {"s": ("s",), "m": ("m",), "1": ("1", "-", "")}
JUMP = 1.5
"""Ratio of a last row of counts to the one before that makes it suspect of being two frames [-]."""


@dataclass(frozen=True)
class Imported:
    """Series of a file on the times of a scene.

    Attributes:
        observables: By name.
        notes: What was repaired, added, interpolated and left out, one line each.
    """

    observables: dict[str, Observed]
    notes: tuple[str, ...]


def imported(scene: Scene, case: str, file: Foreign) -> Imported:
    """The observables of a scene that a file holds.

    Args:
        scene: The scene.
        case: Its name, for errors.
        file: The file.

    Raises:
        ForeignError: Columns are missing, have another unit, another length or values that cannot be those of the case.
    """
    notes: list[str] = []
    found: dict[str, Observed] = {}
    for o, channel, read in _series(scene, case, file, notes):
        fallen = _falling(file, scene, o, *read, notes) if isinstance(o, Trajectory) else read
        rows = _started(file, scene, o, channel, *fallen, notes)
        found[channel.name] = _sampled(channel, *rows, o.interval, notes)
        if isinstance(o, Trajectory) and np.diff(rows[0]).max() <= FINE * o.interval * (1 + SAME):
            lowest = channels(scene)[f"{o.name}_minimum"]
            found[lowest.name] = _lowest(lowest, *rows, o.interval)
    return Imported(found, tuple(dict.fromkeys(notes)))


def check_columns(scene: Scene, case: str, file: Foreign) -> None:
    """Checks all that does not depend on where the bodies of a scene start: columns, units, lengths, times, counts.

    Raises:
        ForeignError: See `imported`.
    """
    _series(scene, case, file, [])


# ---- columns

Rows = tuple[np.ndarray, np.ndarray]
"""Times [s], shape (t,), and values, shape (t, c)."""


def _series(scene: Scene, case: str, file: Foreign, notes: list[str]) -> list[tuple[Any, Channel, Rows]]:
    """The observables of a scene that files hold, with their channels and the rows of the file."""
    found = []
    for o in scene.observables:
        if not isinstance(o, Count | ZoneCount | Trajectory):
            continue
        channel = channels(scene)[_channel(o)]
        time = _column(file, case, TIMES, "s", scene)
        values = np.stack([_column(file, case, names, channel.unit, scene) for names in _names(o, channel)], axis=1)
        if len(values) != len(time):
            raise ForeignError(f"{file.path}: {len(time)} times and {len(values)} values; accepted are as many")
        rows = _ascending(file, time, values, notes)
        _check_times(file, rows[0], scene)
        if not isinstance(o, Trajectory):
            rows = _counted(file, *rows, len(scene.bodies), notes)
        found.append((o, channel, rows))
    if not found:
        raise ForeignError(f"{case}: its scene records no series that a file could hold")
    return found


def _channel(o: Any) -> str:
    """Name of the series of an observable that a file holds."""
    return f"{o.name}_displacement" if isinstance(o, Trajectory) else str(o.name)


def _names(o: Any, channel: Channel) -> list[tuple[str, ...]]:
    """Accepted names of each column of an observable, in lower case."""
    if isinstance(o, Trajectory):
        return [("z", "displacement", channel.name)]
    if isinstance(o, Count):
        return [("count", "n", channel.name)]
    return [(c.lower().replace("zone", "z").replace(".", "_"), c.lower()) for c in channel.components]


def _column(file: Foreign, case: str, names: tuple[str, ...], unit: str, scene: Scene) -> np.ndarray:
    own = next((name for name in names if name in file.columns), None)
    if own is None:
        wanted = [TIMES[0]]
        for o in scene.observables:
            if isinstance(o, Count | ZoneCount | Trajectory):
                wanted += [accepted[0] for accepted in _names(o, channels(scene)[_channel(o)])]
        raise ForeignError(
            f"{file.path}: no column '{names[0]}'; {case} needs {', '.join(wanted)}, "
            f"the file has {', '.join(file.columns) or 'none'}"
        )
    if file.units.get(own, unit) not in UNITS[unit]:
        raise ForeignError(f"{file.path}: column '{own}' is in {file.units[own]}; accepted is {unit}")
    values = np.asarray(file.columns[own], dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise ForeignError(f"{file.path}: {own} is {values[bad[0]]} in row {bad[0] + 1}; accepted are finite numbers")
    return values


# ---- what may be wrong with a file


def _ascending(file: Foreign, time: np.ndarray, values: np.ndarray, notes: list[str]) -> Rows:
    """Rows in ascending time; of rows that are the same the first is kept."""
    step = np.diff(time)
    if (step < 0).any():
        row = int(np.argmax(step < 0)) + 1
        found = f"t is {time[row]:g} s in row {row + 1}, after {time[row - 1]:g} s"
        raise ForeignError(f"{file.path}: {found}; accepted are ascending times")
    again = np.flatnonzero(step == 0) + 1
    for row in again.tolist():
        if (values[row] != values[row - 1]).any():
            raise ForeignError(f"{file.path}: rows {row} and {row + 1} are both t = {time[row]:g} s and differ")
    if len(again):
        notes.append(f"{len(again)} rows that repeat the one before were left out")
    return np.delete(time, again), np.delete(values, again, axis=0)


def _check_times(file: Foreign, time: np.ndarray, scene: Scene) -> None:
    if len(time) < 2:
        raise ForeignError(f"{file.path}: {len(time)} rows; a series has two at least")
    if time[0] < 0:
        raise ForeignError(f"{file.path}: t begins at {time[0]:g} s; the scene begins at 0")
    if not scene.duration / 50 <= time[-1] <= scene.duration * 50:
        raise ForeignError(f"{file.path}: t ends at {time[-1]:g} s; the scene lasts {scene.duration:g} s")


def _counted(file: Foreign, time: np.ndarray, values: np.ndarray, bodies: int, notes: list[str]) -> Rows:
    """Counts; a last row that is proven to be the sum of two frames is halved."""
    if _is_doubled(values):
        values = values.copy()
        values[-1] /= 2
        notes.append(
            f"the last row, t = {time[-1]:g} s, counts two frames: all its counts are even, their sum is "
            f"{2 * values[-1].sum() / values[-2].sum():.2f} times that of the row before; it was halved"
        )
    bad = np.argwhere((values < 0) | (values > bodies))
    if len(bad):
        row, column = (int(k) for k in bad[0])
        found = f"{values[row, column]:g} bodies in row {row + 1}"
        raise ForeignError(f"{file.path}: {found}; accepted are 0 to {bodies}, all of the scene")
    return time, values


def _is_doubled(values: np.ndarray) -> bool:
    if len(values) < 5:
        return False
    total = values.sum(axis=1)
    if (total[-5:-1] <= 0).any() or (values[-1] % 2).any():
        return False
    before = total[-4:-1] / total[-5:-2]
    return bool(total[-1] > JUMP * total[-2] and (np.abs(np.log(before)) < 0.5 * np.log(JUMP)).all())


def _falling(
    file: Foreign, scene: Scene, o: Trajectory, time: np.ndarray, values: np.ndarray, notes: list[str]
) -> Rows:
    """Displacements; heights and times that are late by one constant are set right where the free fall proves them.

    Heights begin at that of the body in the scene. Before the body can meet another one, z = v0 t - g t^2/2, which
    gives the time of every sample.
    """
    height = float(scene.bodies.position[o.body, 2])
    if height and time[0] <= SAME * o.interval and abs(values[0, 0] - height) <= SAME:
        values = values - height
        notes.append(f"z was the height of {o.name}: the {height:g} m at which it starts were taken off")
    known = time <= _free_time(scene, o)
    speed, gravity = -scene.bodies.velocity[o.body, 2], -scene.gravity[2]
    if np.count_nonzero(known) >= 3 and (values[known, 0] <= 0).all():
        fallen = (np.sqrt(speed**2 - 2 * gravity * values[known, 0]) - speed) / gravity
        late, sample = fallen - time[known], float(np.diff(time).min())
        shift = float(np.median(late))
        if _is_constant(late) and 0.01 * sample < abs(shift) <= LATE * sample:
            notes.append(f"t was set {shift:.3g} s later: {len(late)} samples of the free fall prove it to 2 %")
            return time + shift, values
    expected = 0.0 - speed * time - 0.5 * gravity * time**2
    wrong = np.flatnonzero(known & (np.abs(values[:, 0] - expected) > 0.1 * np.abs(expected) + SAME))
    if len(wrong):
        k = int(wrong[0])
        raise ForeignError(
            f"{file.path}: z is {values[k, 0]:g} m at t = {time[k]:g} s, the free fall of {o.name} gives "
            f"{expected[k]:.4g} m; accepted are displacements from the start, downwards negative, and heights that "
            f"begin at {height:g} m"
        )
    return time, values


def _is_constant(values: np.ndarray) -> bool:
    return bool(np.ptp(values) < 0.02 * abs(np.median(values)))


def _free_time(scene: Scene, o: Trajectory) -> float:
    """Time [s] in which a body that falls cannot reach another one: nine tenths of that for the smallest gap."""
    position, radii = scene.bodies.position, scene.radii()
    distance = np.linalg.norm(position - position[o.body], axis=1) - radii - radii[o.body]
    gap = float(np.delete(distance, o.body).min()) if len(position) > 1 else np.inf
    speed, gravity = -scene.bodies.velocity[o.body, 2], -scene.gravity[2]
    if speed < 0 or gravity <= 0 or gap <= 0:
        return 0.0
    if not np.isfinite(gap):
        return scene.duration
    return 0.9 * float(2 * gap / (speed + np.sqrt(speed**2 + 2 * gravity * gap)))


def _started(
    file: Foreign,
    scene: Scene,
    o: Any,
    channel: Channel,
    time: np.ndarray,
    values: np.ndarray,
    notes: list[str],
) -> Rows:
    """The rows with that of t = 0, which the initial state gives where the file has none."""
    first = np.atleast_1d(_initial(scene, o, channel.name))
    if time[0] > SAME * o.interval:
        notes.append("the row at t = 0 is that of the scene's initial state; the file has none")
        return np.concatenate([[0.0], time]), np.vstack([first, values])
    if not isinstance(o, Trajectory):
        off = np.abs(values[0] - first)
        if (off > OTHER_STATE * len(scene.bodies)).any() or (isinstance(o, Count) and off[0] > 0.01 * first[0]):
            raise ForeignError(
                f"{file.path}: {_listed(values[0])} bodies at t = 0; the scene has {_listed(first)}: "
                "this is another case, another preset or another initial state"
            )
        if off.any():
            notes.append(f"another initial state: {_listed(values[0])} at t = 0, the scene has {_listed(first)}")
    return np.concatenate([[0.0], time[1:]]), values


def _initial(scene: Scene, o: Any, name: str) -> np.ndarray:
    """What an observable is at the start of a scene."""
    bodies = scene.bodies
    frame = SimpleNamespace(
        step=0,
        time=0.0,
        present=np.arange(len(bodies)),
        position=bodies.position,
        velocity=bodies.velocity,
        angular_velocity=bodies.angular_velocity,
    )
    alone = scene.model_copy(update={"observables": (o,)})
    return np.asarray(observe(alone, [frame])[name].value[0])


def _listed(values: np.ndarray) -> str:
    return ", ".join(f"{value:g}" for value in values)


# ---- on the times of the scene


def _sampled(channel: Channel, time: np.ndarray, values: np.ndarray, interval: float, notes: list[str]) -> Observed:
    right = np.clip(np.searchsorted(time, channel.time - SAME * interval), 1, len(time) - 1)
    left = right - 1
    nearest = np.where(channel.time - time[left] < time[right] - channel.time, left, right)
    same = np.abs(time[nearest] - channel.time) <= SAME * interval
    inside = channel.time <= time[-1] + SAME * interval
    known = inside & (same | (time[right] - time[left] <= GAP * interval * (1 + SAME)))
    between_samples = np.stack([np.interp(channel.time, time, column) for column in values.T], axis=1)
    found = np.where(same[:, None], values[nearest], between_samples)[known]
    between, lacking = int((known & ~same).sum()), int((~known & inside).sum())
    if between:
        notes.append(f"{between} of {int(known.sum())} rows are linear between two samples")
    if lacking:
        notes.append(f"{lacking} rows are left out: samples are more than {GAP:g} sampling intervals apart")
    if not inside.all():
        notes.append(f"the record ends at {time[-1]:g} of {channel.time[-1]:g} s")
    return _observed(channel, channel.time[known], found)


def _lowest(channel: Channel, time: np.ndarray, values: np.ndarray, interval: float) -> Observed:
    """The lowest sample since the sampling time before, for the sampling times that the record reaches."""
    reached = channel.time[channel.time <= time[-1] + SAME * interval]
    lowest = []
    for end in reached:
        own = (time <= end + SAME * interval) & (time > end - interval + SAME * interval)
        lowest.append(values[own, 0].min())
    return _observed(channel, reached, np.array(lowest)[:, None])


def _observed(channel: Channel, time: np.ndarray, values: np.ndarray) -> Observed:
    """A series without steps, which a file does not tell."""
    return Observed(
        step=np.zeros(len(time), dtype=np.int64),
        time=time,
        value=values.reshape(channel.shape(len(time))),
        unit=channel.unit,
        components=channel.components,
        title=channel.title,
    )
