"""Bodies that leave through a sink: the frames carry those that are left, and what is counted is right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from launching import installed, run
from test_two_spheres import scene

from dembench.results import observe
from dembench.scene import Scene


def stream(**changes: object) -> Scene:
    """21 drops, one above the other, that fall through z = -1 cm."""
    position = [[0, 0, 3.1e-3 * k] for k in range(21)]
    counts = (
        {"kind": "count", "name": "all", "interval": 5e-3},
        {"kind": "energy", "name": "energy", "interval": 5e-3},
    )
    given = {
        "bodies": {"position": position},
        "gravity": (0, 0, -9.81),
        "domain": {"lower": (-0.1,) * 3, "upper": (0.1,) * 3},
        "sinks": ({"name": "out", "region": {"upper": (None, None, -0.01)}},),
        "observables": counts,
        "duration": 0.1,
        "time_step": 1e-5,
    }
    return scene(**{**given, **changes})


@pytest.mark.parametrize("name", ["peclet", "peclet-hertz", "liggghts", "lammps", "yade", "kratos", "peclet-dem"])
def test_what_is_left_is_counted(name: str, tmp_path: Path) -> None:
    """Drop k has fallen by 3.1 mm k + 1 cm after sqrt(2 (3.1 mm k + 1 cm) / g); no one within 0.1 ms of a sample."""
    falling = stream()
    series = run(installed(name), falling, tmp_path)
    found = observe(falling, series.frames)["all"]
    passes = np.sqrt(2 * (0.01 + 3.1e-3 * np.arange(21)) / 9.81)
    left = [np.count_nonzero(passes > t) for t in found.time]
    assert np.abs(passes[:, None] - found.time).min() > 1e-4
    assert found.value.ravel().tolist() == left
    assert left[0] == 21 and left[-1] < 10
    last = series.frames[-1]
    assert last.present.tolist() == list(range(21 - left[-1], 21)) and len(last.position) == left[-1]


@pytest.mark.parametrize("name", ["peclet", "peclet-hertz", "liggghts", "lammps", "yade", "kratos", "peclet-dem"])
def test_a_tracked_body_that_leaves_ends_the_run(name: str, tmp_path: Path) -> None:
    track = {"kind": "trajectory", "name": "first", "body": 0, "interval": 5e-3, "track_interval": 5e-3}
    series = run(installed(name), stream(observables=(track,)), tmp_path)
    assert series.failure == "lost particles" and "tracked body 0 is gone by t = 0.05 s" in series.detail
