"""Exports of a result for other programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dembench.results.read import Result
from dembench.vtkhdf import append_vtkhdf


def export_csv(result: Result, directory: Path) -> list[Path]:
    """Writes every observable to `<name>.csv` with the unit in the column titles; returns the files."""
    directory.mkdir(parents=True, exist_ok=True)
    written = []
    for name, observed in result.observables.items():
        table = result.frame(name)
        titles = {column: f"{column} [{observed.unit}]" for column in table.columns if column not in ("step", "time")}
        path = directory / f"{name}.csv"
        table.rename(columns={"time": "time [s]", **titles}).to_csv(path, index=False)
        written.append(path)
    return written


def export_vtkhdf(result: Result, directory: Path) -> list[Path]:
    """Writes the snapshots to `<name>.vtkhdf` (see `append_vtkhdf`), absent bodies left out; returns the files."""
    directory.mkdir(parents=True, exist_ok=True)
    written = []
    bodies, radii = result.scene.bodies, result.scene.radii()
    for name, series in result.snapshots.items():
        path = directory / f"{name}.vtkhdf"
        path.unlink(missing_ok=True)
        for k, time in enumerate(series.time):
            ids = np.flatnonzero(np.isfinite(series.position[k]).all(axis=1))
            data = {
                "id": ids,
                "species": bodies.species[ids],
                "radius": radii[ids],
                "velocity": series.velocity[k][ids],
                "angular_velocity": series.angular_velocity[k][ids],
            }
            append_vtkhdf(path, float(time), series.position[k][ids], data)
        written.append(path)
    return written
