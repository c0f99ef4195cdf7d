"""The verb that puts results of other programs among the runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from dembench import console
from dembench.cli.options import DivisionName, Initial, Json, Out, print_json, usage_errors
from dembench.imports import LIKE, UNKNOWN_LAW, Folder, Origin, import_file, import_folder
from dembench.initial.fetch import initial_state
from dembench.runs.directory import RunRecord
from dembench.runs.plan import RequestError


def import_results(
    what: Annotated[list[str], typer.Argument(metavar="[CASE] FILE_OR_FOLDER", help="case3 FILE, or a FOLDER")],
    engine: Annotated[str | None, typer.Option(help="name of the program that made FILE")] = None,
    preset: Annotated[Literal["quick", "published"], typer.Option(help="preset of the case")] = "published",
    initial: Initial = None,
    seed: Annotated[int, typer.Option(min=0, help="seed of the initial state")] = 0,
    division: DivisionName = None,
    law: Annotated[str, typer.Option(help="contact law that was computed")] = UNKNOWN_LAW,
    wall: Annotated[float | None, typer.Option(min=0, help="wall time of the program in s, shown apart")] = None,
    out: Out = Path("runs"),
    json_: Json = False,
) -> None:
    """Puts results of other programs (CSV, npz, HDF5) among the runs: scored and shown like every run.

    Columns: t and count for case1; t, z1_m1, z1_m2, z2_m1, z2_m2 for case2; t and z (displacement) for case3. A folder
    has files called case1_large_M1_NAME, case2_NAME, case3_25k_NAME, and may have wall times in timings.json.
    Its other files are left out and named. Exit code 0: all results are imported; 1: some are not; 2: a usage error.
    """
    with usage_errors(), console.bar(json_) as progress:
        origin = Origin(preset, division or "closed", seed, initial_state(initial), law, out)
        path = Path(what[-1])
        if len(what) == 1 and path.is_dir():
            if engine is not None or wall is not None:
                raise RequestError("--engine and --wall are for a file; those of a folder come from its files")
            done = import_folder(path, origin, progress)
        elif len(what) == 2 and engine is not None:
            done = Folder((import_file(what[0], path, engine, origin, wall, progress),), (), ())
        else:
            raise RequestError("give CASE FILE --engine NAME, or a FOLDER")
    if json_:
        runs = [_plain(run) for run in done.runs]
        print_json({"runs": runs, "refused": list(done.refused), "left_out": list(done.left_out)})
    else:
        for run in done.runs:
            console.line(f"{run.directory}: {run.status.label()}")
            for note in _notes(run):
                console.line(f"  {note}")
        for line in done.refused:
            console.error(line)
        if done.left_out:
            console.line(f"left out, as they are not called like {LIKE}: {', '.join(done.left_out)}")
    raise typer.Exit(1 if done.refused else 0)


def _plain(run: RunRecord) -> dict[str, Any]:
    return {"directory": str(run.directory), **run.status.plain(), "notes": _notes(run)}


def _notes(run: RunRecord) -> list[str]:
    found: list[str] = run.result.provenance["imported"]["notes"] if run.result else []
    return found
