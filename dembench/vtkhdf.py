"""VTKHDF files for ParaView and VTK: points with data at growing times, one file, a step appended at a time.

Layout: VTKHDF 2.0, type PolyData, temporal; every point is a vertex cell. Specification:
https://docs.vtk.org/en/latest/vtk_file_formats/vtkhdf_file_format/vtkhdf_specifications.html
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np

TOPOLOGIES = ("Vertices", "Lines", "Polygons", "Strips")
"""The kinds of cells of PolyData in the order of the columns of CellOffsets."""


def append_vtkhdf(path: Path, time: float, points: np.ndarray, data: Mapping[str, np.ndarray]) -> None:
    """Appends one time to a file, which is made where it is not there.

    A time without points is left out: the reader of VTK 9.7 misses the cells of the times behind it.

    Args:
        path: The file, usually `*.vtkhdf`.
        time: Time [s]; above that of the last step of the file.
        points: Points [m], shape (n, 3); n may differ from step to step.
        data: Values per point by name, shape (n,) or (n, k); the same names and types in every step.

    Raises:
        ValueError: The time or the names do not continue the file, or a length is not n.
    """
    n = len(points)
    if n == 0:
        return
    for name, values in data.items():
        if len(values) != n:
            raise ValueError(f"{path}: data {name} has {len(values)} rows, there are {n} points")
    with h5py.File(path, "a") as file:
        root = file["VTKHDF"] if "VTKHDF" in file else _create(file, data)
        steps = root["Steps"]
        count = int(steps.attrs["NSteps"])
        if set(root["PointData"]) != set(data):
            names = ", ".join(root["PointData"])
            raise ValueError(f"{path}: data {', '.join(data)} are given; accepted are those of the file: {names}")
        if count and not time > steps["Values"][-1]:
            raise ValueError(f"{path}: time {time:g} s is given; accepted is one above {steps['Values'][-1]:g} s")
        vertices = root["Vertices"]
        offsets = [len(vertices["Connectivity"]), 0, 0, 0]
        _append(steps["Values"], [time])
        _append(steps["NumberOfParts"], [1])
        _append(steps["PartOffsets"], [count])
        _append(steps["PointOffsets"], [len(root["Points"])])
        _append(steps["CellOffsets"], [offsets])
        _append(steps["ConnectivityIdOffsets"], [[len(vertices["Connectivity"]), 0, 0, 0]])
        for name in data:
            _append(steps["PointDataOffsets"][name], [len(root["PointData"][name])])
        steps.attrs["NSteps"] = count + 1
        _append(root["NumberOfPoints"], [n])
        _append(root["Points"], points)
        for kind in TOPOLOGIES:
            cells = n if kind == "Vertices" else 0
            _append(root[kind]["NumberOfCells"], [cells])
            _append(root[kind]["NumberOfConnectivityIds"], [cells])
            _append(root[kind]["Connectivity"], np.arange(cells))
            _append(root[kind]["Offsets"], np.arange(cells + 1))
        for name, values in data.items():
            _append(root["PointData"][name], values)


def _create(file: h5py.File, data: Mapping[str, np.ndarray]) -> h5py.Group:
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array([2, 0], dtype=np.int64)
    root.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", len("PolyData")))
    _growing(root, "NumberOfPoints", np.int64)
    _growing(root, "Points", np.float64, 3)
    for kind in TOPOLOGIES:
        group = root.create_group(kind)
        for name in ("NumberOfCells", "NumberOfConnectivityIds", "Connectivity", "Offsets"):
            _growing(group, name, np.int64)
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = 0
    _growing(steps, "Values", np.float64)
    for name in ("NumberOfParts", "PartOffsets", "PointOffsets"):
        _growing(steps, name, np.int64)
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        _growing(steps, name, np.int64, len(TOPOLOGIES))
    offsets, point_data = steps.create_group("PointDataOffsets"), root.create_group("PointData")
    for name, values in data.items():
        array = np.asarray(values)
        _growing(point_data, name, array.dtype, *array.shape[1:])
        _growing(offsets, name, np.int64)
    return root


def _growing(group: h5py.Group, name: str, dtype: object, *width: int) -> None:
    group.create_dataset(name, shape=(0, *width), maxshape=(None, *width), dtype=dtype, chunks=True)


def _append(dataset: h5py.Dataset, rows: object) -> None:
    values = np.asarray(rows)
    first = len(dataset)
    dataset.resize(first + len(values), axis=0)
    dataset[first:] = values
