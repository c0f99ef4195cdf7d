"""The verb that measures which contact law engines compute."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dembench import campaign, console
from dembench.cli.options import Engines, Fresh, Json, print_json, usage_errors
from dembench.cli.verify import carry_out, write_index
from dembench.verification import campaign as verification
from dembench.verification import suites
from dembench.verification.passport.record import FILE, passports
from dembench.verification.rows import all_right


def passport(
    engines: Engines = None,
    timeout: Annotated[str, typer.Option(help="time limit of each run, as 45s, 30m, 2h")] = "10m",
    out: Annotated[Path, typer.Option(help="directory of the runs, the page and passport.json")] = Path("runs/verify"),
    fresh: Fresh = False,
    json_: Json = False,
) -> None:
    """Measures the contact law of engines on collisions of two spheres, and keeps it for the reports of their runs.

    Exit code 0: every engine computes the law that it says; 1: one does not, or none gave an answer; 2: a usage error.
    """
    suite = suites.suite("passport")
    with usage_errors():
        chosen = campaign.chosen_engines(engines)
        runs = verification.planned(suite, chosen, out, timeout=campaign.seconds(timeout))
    (rows,), (page,) = carry_out([suite], [runs], out, jobs=None, fresh=fresh, quiet=json_)
    write_index(out)
    made = passports([record for run in runs if (record := verification.record(run))])
    if json_:
        print_json({"passports": [one.model_dump(mode="json") for one in made], "file": out / FILE, "report": page})
    else:
        columns = ("engine", "named law that fits", "its distance", "distance to the scene's law", "says it computes")
        cells = [
            (
                one.label,
                one.fits_title,
                f"{one.distance:.4f}",
                f"{one.scene_distance:.4f}",
                one.law or "the scene's law",
            )
            for one in made
        ]
        console.table(columns, cells)
        for row in rows:
            if row.measured is None and row.check.id == "LP0":
                console.line(f"{row.engine}: {row.status}: {row.detail}")
        if page is not None:
            console.line(str(page))
    raise typer.Exit(0 if all_right(rows) and page is not None else 1)
