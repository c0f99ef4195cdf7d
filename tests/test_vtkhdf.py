"""VTKHDF: the structure that the specification asks for, read back by its rules alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from dembench.vtkhdf import TOPOLOGIES, append_vtkhdf


def steps(random: Any) -> list[tuple[float, Any, dict[str, Any]]]:
    """Times with 5, 7 and 2 points."""
    found = []
    for k, n in enumerate((5, 7, 2)):
        data = {"radius": random.random(n), "velocity": random.random((n, 3)), "id": np.arange(n) + 10 * k}
        found.append((0.5 * k, random.random((n, 3)), data))
    return found


@pytest.fixture
def written(tmp_path: Path) -> tuple[Path, Any]:
    path, wanted = tmp_path / "state.vtkhdf", steps(np.random.default_rng(1))
    for step in wanted:
        append_vtkhdf(path, *step)
    return path, wanted


def test_every_time_is_found_by_its_offsets(written: tuple[Path, Any]) -> None:
    """Arrays are flat over time; step k starts at the offsets of row k, and `Offsets` has one entry more per part."""
    path, wanted = written
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        assert list(root.attrs["Version"]) == [2, 0] and root.attrs["Type"] == b"PolyData"
        kind = h5py.check_string_dtype(root.attrs.get_id("Type").dtype)
        assert kind.encoding == "ascii" and kind.length == len("PolyData")
        at = root["Steps"]
        assert at.attrs["NSteps"] == 3
        for k, (time, points, data) in enumerate(wanted):
            assert at["Values"][k] == time
            assert at["NumberOfParts"][k] == 1 and at["PartOffsets"][k] == k
            n, first = root["NumberOfPoints"][k], at["PointOffsets"][k]
            assert np.array_equal(root["Points"][first : first + n], points)
            for name, values in data.items():
                start = at["PointDataOffsets"][name][k]
                assert np.array_equal(root["PointData"][name][start : start + n], values)
            for column, cells in enumerate(TOPOLOGIES):
                count = root[cells]["NumberOfCells"][k]
                assert count == (n if cells == "Vertices" else 0)
                start = at["ConnectivityIdOffsets"][k, column]
                length = root[cells]["NumberOfConnectivityIds"][k]
                assert np.array_equal(root[cells]["Connectivity"][start : start + length], np.arange(count))
                start = at["CellOffsets"][k, column] + at["PartOffsets"][k]
                assert np.array_equal(root[cells]["Offsets"][start : start + count + 1], np.arange(count + 1))


def test_what_does_not_continue_a_file_is_refused(written: tuple[Path, Any]) -> None:
    path, wanted = written
    before = path.read_bytes()
    _time, points, data = wanted[-1]
    with pytest.raises(ValueError, match="time 1 s is given; accepted is one above 1 s"):
        append_vtkhdf(path, 1.0, points, data)
    with pytest.raises(ValueError, match="accepted are those of the file: id, radius, velocity"):
        append_vtkhdf(path, 2.0, points, {"radius": data["radius"]})
    with pytest.raises(ValueError, match="data radius has 1 rows, there are 2 points"):
        append_vtkhdf(path, 2.0, points, {**data, "radius": data["radius"][:1]})
    append_vtkhdf(path, 2.0, np.empty((0, 3)), {})
    assert path.read_bytes() == before
