"""Writing a result file: the only writer, under a temporary name that is then renamed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from dembench import __version__
from dembench.atomic import replacing
from dembench.results.read import Result
from dembench.results.schema import H5MD_VERSION, PARTICLE_UNITS, RECORDS, TIME_UNIT, VERSION, Observed, SnapshotSeries
from dembench.scene import Scene


def write(result: Result, path: Path) -> None:
    """Writes a result to a file; a reader sees the old file or the new one, never a part of it.

    The layout is that of H5MD 1.1 (de Buyl, Colberg & Hoefling 2014, doi 10.1016/j.cpc.2014.01.018), with the group
    `/dembench` beside it.
    """
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        _h5md(file)
        series = file.create_group("observables")
        for name, observed in result.observables.items():
            _observable(series.create_group(name), observed)
        particles = file.create_group("particles")
        for name, snapshots in result.snapshots.items():
            _particles(particles.create_group(name), result.scene, snapshots)
        _own(file.create_group("dembench"), result)


def _h5md(file: h5py.File) -> None:
    group = file.create_group("h5md")
    group.attrs["version"] = np.array(H5MD_VERSION, dtype=np.int32)
    group.create_group("author").attrs["name"] = "dembench"
    creator = group.create_group("creator")
    creator.attrs["name"] = "dembench"
    creator.attrs["version"] = __version__
    units = group.create_group("modules").create_group("units")
    units.attrs["version"] = np.array((1, 0), dtype=np.int32)
    units.attrs["system"] = "SI"


def _observable(group: h5py.Group, observed: Observed) -> None:
    group.attrs["title"] = observed.title
    _times(group, observed.step, observed.time)
    value = group.create_dataset("value", data=observed.value)
    value.attrs["unit"] = observed.unit
    value.attrs.create("components", list(observed.components), shape=(len(observed.components),), dtype=_text())


def _particles(group: h5py.Group, scene: Scene, snapshots: SnapshotSeries) -> None:
    box = group.create_group("box")
    box.attrs["dimension"] = 3
    box.attrs["boundary"] = ["periodic" if p else "none" for p in scene.domain.periodic]
    edges = box.create_dataset("edges", data=np.subtract(scene.domain.upper, scene.domain.lower))
    edges.attrs["unit"] = "m"
    first = None
    for name, unit in PARTICLE_UNITS.items():
        element = group.create_group(name)
        if first is None:
            _times(element, snapshots.step, snapshots.time)
            first = element
        else:
            element["step"], element["time"] = first["step"], first["time"]
        value = element.create_dataset("value", data=getattr(snapshots, name), compression="gzip", compression_opts=1)
        value.attrs["unit"] = unit
    group.create_dataset("radius", data=scene.radii()).attrs["unit"] = "m"
    group.create_dataset("species", data=scene.bodies.species)
    group.create_dataset("id", data=np.arange(len(scene.bodies)))


def _times(group: h5py.Group, step: np.ndarray, time: np.ndarray) -> None:
    group.create_dataset("step", data=step.astype(np.int64))
    group.create_dataset("time", data=time).attrs["unit"] = TIME_UNIT


def _own(group: h5py.Group, result: Result) -> None:
    group.attrs["version"] = np.array(VERSION, dtype=np.int32)
    group.attrs["engine"] = result.engine
    group.attrs["division"] = result.division
    scene = group.create_group("scene")
    scene.create_dataset("json", data=json.dumps(result.scene.description()), dtype=_text())
    scene.attrs["sha256"] = result.scene.digest()
    bodies = scene.create_group("bodies")
    for name, array in result.scene.bodies.arrays().items():
        bodies.create_dataset(name, data=array)
    for name in RECORDS:
        group.create_dataset(name, data=json.dumps(getattr(result, name), default=_plain), dtype=_text())


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return str(value)


def _text() -> Any:
    return h5py.string_dtype("utf-8")
