"""The bodies of a simulation as files for other programs."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from dembench.atomic import replacing
from dembench.vtkhdf import append_vtkhdf

COLUMNS = {"position": "m", "velocity": "m/s", "angular_velocity": "rad/s"}


def write_csv(path: Path, simulation: Any) -> None:
    """Writes the present state as a table: a row per body, the unit in the column titles."""
    titles = ["id", "species", "radius [m]"]
    titles += [f"{name}_{axis} [{unit}]" for name, unit in COLUMNS.items() for axis in "xyz"]
    columns = [simulation.ids, simulation.species, simulation.radii]
    columns += [column for name in COLUMNS for column in getattr(simulation, name).T]
    with replacing(path) as temporary, open(temporary, "w", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(titles)
        table.writerows(zip(*(column.tolist() for column in columns), strict=True))


def write_vtkhdf(path: Path, simulation: Any) -> None:
    """Appends the present state to a VTKHDF file (see `append_vtkhdf`): a point per body with what belongs to it."""
    data = {
        "id": simulation.ids,
        "species": simulation.species,
        "radius": simulation.radii,
        "velocity": simulation.velocity,
        "angular_velocity": simulation.angular_velocity,
    }
    append_vtkhdf(path, simulation.time, simulation.position, data)
