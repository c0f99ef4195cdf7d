"""Reading a result file."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd

from dembench.results.schema import PARTICLE_UNITS, RECORDS, VERSION, Observed, SnapshotSeries
from dembench.scene import Bodies, Scene, scene_from


class ResultError(ValueError):
    """A file that is no result, or one of another version."""


@dataclass(frozen=True)
class Result:
    """What one run produced; a partial result has fewer rows.

    Attributes:
        scene: The scene that was run.
        engine: Name of the engine.
        division: `closed` or `open`.
        settings: Settings of the engine.
        environment: The machine, as found at the start of the run.
        timing: Wall times of the parts of the run [s] and who measured them.
        resources: Wall time, CPU time [s] and peak memory [bytes] of the process tree.
        counters: The engine's own figures.
        status: State of the run, with its reason.
        provenance: Versions, command and times that say where the file comes from.
        observables: Time series by name.
        snapshots: All bodies at some times, by name; those of a file are loaded when they are first asked for.
    """

    scene: Scene
    engine: str
    division: str
    settings: dict[str, Any] = field(default_factory=dict)
    environment: dict[str, Any] = field(default_factory=dict)
    timing: dict[str, Any] = field(default_factory=dict)
    resources: dict[str, Any] = field(default_factory=dict)
    counters: dict[str, Any] = field(default_factory=dict)
    status: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    observables: dict[str, Observed] = field(default_factory=dict)
    snapshots: Mapping[str, SnapshotSeries] = field(default_factory=dict)

    def frame(self, name: str) -> pd.DataFrame:
        """One observable as a table: columns `step`, `time` and its components, or its name where it has none.

        Raises:
            KeyError: The result has no observable of that name.
        """
        if name not in self.observables:
            raise KeyError(f"no observable is called '{name}'; there are {', '.join(self.observables)}")
        o = self.observables[name]
        columns = {"step": o.step, "time": o.time}
        values = o.value.reshape(len(o.time), -1)
        for k, column in enumerate(o.components or (name,)):
            columns[column] = values[:, k]
        return pd.DataFrame(columns)


def read(path: Path) -> Result:
    """The result in a file.

    Raises:
        ResultError: The file cannot be read as a result; the message says what is wrong.
    """
    with opened(path) as file:
        return _read(file, path)


def read_records(path: Path) -> dict[str, dict[str, Any]]:
    """The records of a result file alone, by name (`RECORDS`): no series, no scene.

    Raises:
        ResultError: The file cannot be read as a result.
    """
    with opened(path) as file:
        return _records(file["dembench"])


@contextmanager
def opened(path: Path, part: str = "result") -> Iterator[h5py.File]:
    """An open result file; what the library says of one that it cannot read becomes a ResultError.

    Args:
        path: The file.
        part: What of it is read, for the message.
    """
    try:
        with h5py.File(path, "r") as file:
            yield file
    except FileNotFoundError:
        raise ResultError(f"{path}: no such file") from None
    except (OSError, RuntimeError):
        raise ResultError(
            f"{path}: no readable {part}: the file is damaged, cut off or no HDF5 file; "
            "`dembench run ... --fresh` makes the result of a run anew"
        ) from None
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        raise ResultError(
            f"{path}: no readable {part}: {error}; `dembench validate {path}` lists what is wrong"
        ) from None


def read_scene(file: h5py.File) -> Scene:
    """The scene stored in an open result file; KeyError or SceneError where there is none."""
    stored = file["dembench/scene"]
    data = json.loads(stored["json"].asstr()[()])
    data["bodies"] = Bodies(**{name: stored["bodies"][name][()] for name in stored["bodies"]})
    return scene_from(data, "/dembench/scene")


def _read(file: h5py.File, path: Path) -> Result:
    group = file["dembench"]
    version = tuple(int(v) for v in group.attrs["version"])
    if version[0] != VERSION[0]:
        raise ResultError(f"result version {version[0]}.{version[1]}; this program reads {VERSION[0]}.x")
    return Result(
        scene=read_scene(file),
        engine=str(group.attrs["engine"]),
        division=str(group.attrs["division"]),
        observables={name: _observed(file["observables"][name]) for name in file["observables"]},
        snapshots=_Snapshots(path, list(file["particles"])),
        **_records(group),
    )


def _records(group: h5py.Group) -> dict[str, dict[str, Any]]:
    return {name: json.loads(group[name].asstr()[()]) for name in RECORDS}


def _observed(group: h5py.Group) -> Observed:
    value = group["value"]
    return Observed(
        step=group["step"][()],
        time=group["time"][()],
        value=value[()],
        unit=str(value.attrs["unit"]),
        components=tuple(str(c) for c in value.attrs["components"]),
        title=str(group.attrs["title"]),
    )


class _Snapshots(Mapping[str, SnapshotSeries]):
    """The snapshots in a file, by name, each loaded once when it is first asked for: they are by far the largest part.

    Args:
        path: The file; one that is replaced meanwhile by a later state of the same run may give more times.
        names: Names of the snapshots in it.
    """

    def __init__(self, path: Path, names: list[str]) -> None:
        self._path = path
        self._loaded: dict[str, SnapshotSeries | None] = dict.fromkeys(names)

    def __getitem__(self, name: str) -> SnapshotSeries:
        found = self._loaded[name]
        if found is None:
            with opened(self._path, f"snapshots '{name}'") as file:
                found = self._loaded[name] = _snapshots(file["particles"][name])
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._loaded)

    def __len__(self) -> int:
        return len(self._loaded)


def _snapshots(group: h5py.Group) -> SnapshotSeries:
    first = group["position"]
    fields: dict[str, np.ndarray] = {name: group[name]["value"][()] for name in PARTICLE_UNITS}
    return SnapshotSeries(step=first["step"][()], time=first["time"][()], **fields)
