"""Checking a result file against what its scene asks for."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np

from dembench.results.read import read_scene
from dembench.results.schema import (
    H5MD_VERSION,
    PARTICLE_UNITS,
    RECORDS,
    TIME_UNIT,
    VERSION,
    channels,
    snapshot_times,
)
from dembench.scene import Scene, Snapshot

COMPLETE = ("ok", "inaccurate")
"""States of a run whose result must have every row."""


def validate(path: Path) -> list[str]:
    """The faults of a result file, one line each with the place in the file; empty where it has none.

    Another program's result that was imported may lack observables and end before the scene does.

    Any file may be given. Times are compared with those of the scene; a result of a run that did not end well may
    have fewer rows, never other ones.
    """
    try:
        with h5py.File(path, "r") as file:
            return _faults(file)
    except FileNotFoundError:
        return ["no such file"]
    except (OSError, RuntimeError):
        return ["not an HDF5 file that can be read: it is damaged, cut off or of another format"]


def _faults(file: h5py.File) -> list[str]:
    faults = [
        f"/{name}: the group is missing"
        for name in ("h5md", "observables", "particles", "dembench")
        if not isinstance(file.get(name), h5py.Group)
    ]
    if faults:
        return faults
    faults += _version(file["h5md"], H5MD_VERSION) + _version(file["dembench"], VERSION)
    for name in ("engine", "division"):
        if name not in file["dembench"].attrs:
            faults.append(f"/dembench: the attribute '{name}' is missing")
    faults += _records(file["dembench"])
    try:
        scene = read_scene(file)
        wanted = channels(scene)
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        return [*faults, f"/dembench/scene: no scene: {error}"]
    if file["dembench/scene"].attrs.get("sha256") != scene.digest():
        faults.append("/dembench/scene: the attribute 'sha256' is not the digest of the scene")
    brought = _is_imported(file)
    complete = _state(file) in COMPLETE and not brought
    observables = file["observables"]
    if brought:
        wanted = {name: channel for name, channel in wanted.items() if name in observables}
    faults += _same_names("observables", set(observables), set(wanted))
    for name in sorted(set(observables) & set(wanted)):
        channel = wanted[name]
        place = f"/observables/{name}"
        faults += _element(
            observables[name], place, channel.unit, channel.shape, channel.time, complete, may_be_nan=bool(scene.sinks)
        )
        value = observables[name].get("value") if isinstance(observables[name], h5py.Group) else None
        if isinstance(value, h5py.Dataset) and tuple(value.attrs.get("components", ())) != channel.components:
            faults.append(f"{place}/value: the attribute 'components' must be {list(channel.components)}")
    return faults + _particles(file["particles"], scene, complete, brought)


def _version(group: h5py.Group, known: tuple[int, int]) -> list[str]:
    version = np.atleast_1d(group.attrs.get("version", ()))
    if len(version) != 2 or version[0] != known[0]:
        return [f"{group.name}: the attribute 'version' is {list(version)}; accepted is {known[0]}.x"]
    return []


def _records(group: h5py.Group) -> list[str]:
    faults = []
    for name in RECORDS:
        try:
            if not isinstance(json.loads(group[name].asstr()[()]), dict):
                faults.append(f"/dembench/{name}: must hold a JSON object")
        except KeyError:
            faults.append(f"/dembench/{name}: is missing")
        except (ValueError, TypeError, AttributeError) as error:
            faults.append(f"/dembench/{name}: no JSON text: {error}")
    return faults


def _state(file: h5py.File) -> str:
    try:
        return str(json.loads(file["dembench/status"].asstr()[()]).get("state", ""))
    except (KeyError, ValueError, TypeError, AttributeError):
        return ""


def _is_imported(file: h5py.File) -> bool:
    """Whether it is another program's result, which may lack observables and end before the scene does."""
    try:
        return "imported" in json.loads(file["dembench/provenance"].asstr()[()])
    except (KeyError, ValueError, TypeError, AttributeError):
        return False


def _same_names(place: str, found: set[str], wanted: set[str]) -> list[str]:
    return [f"/{place}/{name}: the group is missing" for name in sorted(wanted - found)] + [
        f"/{place}/{name}: the scene has no such observable" for name in sorted(found - wanted)
    ]


def _particles(group: h5py.Group, scene: Scene, complete: bool, brought: bool) -> list[str]:
    wanted = {o.name: o for o in scene.observables if isinstance(o, Snapshot) and (o.name in group or not brought)}
    faults = _same_names("particles", set(group), set(wanted))
    n = len(scene.bodies)
    for name in sorted(set(group) & set(wanted)):
        place = f"/particles/{name}"
        members = group[name]
        if not isinstance(members, h5py.Group):
            faults.append(f"{place}: must be a group")
            continue
        times = snapshot_times(scene, wanted[name])
        for field, unit in PARTICLE_UNITS.items():
            if field not in members:
                faults.append(f"{place}/{field}: the group is missing")
                continue
            faults += _element(
                members[field], f"{place}/{field}", unit, lambda rows: (rows, n, 3), times, complete, bool(scene.sinks)
            )
        for field in ("radius", "species", "id"):
            array = members.get(field)
            if not isinstance(array, h5py.Dataset) or array.shape != (n,):
                faults.append(f"{place}/{field}: must be an array of shape ({n},)")
        if "box" not in members:
            faults.append(f"{place}/box: the group is missing")
    return faults


def _element(group, place, unit, shape_for, times, complete, may_be_nan) -> list[str]:
    """Faults of one H5MD element `{step, time, value}` with the unit, shape and times that it must have."""
    if not isinstance(group, h5py.Group):
        return [f"{place}: must be a group"]
    absent = [part for part in ("step", "time", "value") if not isinstance(group.get(part), h5py.Dataset)]
    if absent:
        return [f"{place}/{part}: is missing" for part in absent]
    faults = []
    time, step, value = group["time"], group["step"], group["value"]
    for dataset, expected in ((time, TIME_UNIT), (value, unit)):
        if dataset.attrs.get("unit") != expected:
            faults.append(f"{dataset.name}: the unit is {dataset.attrs.get('unit')!r}; it must be {expected!r}")
    rows = len(time) if time.ndim == 1 else -1
    if rows < 0 or step.shape != (rows,):
        return [*faults, f"{place}: step has shape {step.shape} and time {time.shape}; both must be the same (t,)"]
    if value.shape != shape_for(rows):
        return [*faults, f"{place}/value: shape {value.shape}; with {rows} times it must be {shape_for(rows)}"]
    if not all(np.issubdtype(d.dtype, np.number) for d in (time, step, value)):
        return [*faults, f"{place}: step, time and value must be numbers"]
    return faults + _rows(place, time[()], step[()], value[()], times, complete, may_be_nan)


def _rows(place, time, step, value, times, complete, may_be_nan) -> list[str]:
    faults = []
    if not np.isfinite(time).all():
        return [f"{place}/time: has values that are not finite"]
    if (np.diff(time) <= 0).any():
        row = int(np.argmax(np.diff(time) <= 0)) + 1
        faults.append(f"{place}/time: not ascending at row {row}: {time[row - 1]:g} s, then {time[row]:g} s")
    if (np.diff(step) < 0).any():
        faults.append(f"{place}/step: not ascending at row {int(np.argmax(np.diff(step) < 0)) + 1}")
    if len(time) and times[0] == 0 and time[0] != 0:
        faults.append(f"{place}/time: there is no row at t = 0; the first is at {time[0]:g} s")
    strange = [t for t in time if not np.isclose(times, t, rtol=1e-9, atol=1e-15).any()]
    if strange:
        faults.append(f"{place}/time: {strange[0]:g} s is no sampling time of the scene ({len(strange)} such rows)")
    if complete and len(time) < len(times):
        faults.append(f"{place}/time: {len(time)} rows; the scene asks for {len(times)}")
    bad = np.argwhere(~np.isfinite(value))
    if len(bad) and not may_be_nan:
        faults.append(f"{place}/value: {len(bad)} values are not finite, the first at row {int(bad[0][0])}")
    return faults
