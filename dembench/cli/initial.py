"""Verbs about initial states: make, quality, convert."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from dembench import console
from dembench.cases.base import CaseError, Preset
from dembench.cases.registry import parse_case
from dembench.cli.options import Initial, Json, PresetName, print_json, usage_errors
from dembench.initial import formats
from dembench.initial.beds import Bed, read_bed, shipped_file, write_bed
from dembench.initial.fetch import initial_state
from dembench.initial.filling import PackingError, cache_path, filled, measure
from dembench.initial.formats.state import FIELDS, UNITS, State
from dembench.initial.progress import Progress
from dembench.initial.rows import CoordinatesError

app = typer.Typer(no_args_is_help=True, help="Initial states: makes, measures and converts them.")
_NAMES = ", ".join(formats.names())


@app.command()
def make(
    case: Annotated[str, typer.Argument(metavar="CASE", help="case1[orifice=large]")],
    preset: PresetName = None,
    seed: Annotated[int, typer.Option(min=0, help="seed of the filling")] = 0,
    out: Annotated[Path | None, typer.Option(help="file *.npz or directory; default: the cache")] = None,
    json_: Json = False,
) -> None:
    """Makes the initial state of a case, or finds it in the package or the cache, and shows how it is packed.

    A bed that ships is made anew where `--out` asks for a file of it. An interrupted filling goes on where it was when
    it is asked for again.
    """
    with usage_errors():
        chosen, parameters = parse_case(case)
        chosen.check(parameters, preset or "quick")
        plan = chosen.filling(parameters, preset or "quick")
        if plan is None:
            raise CaseError(f"{case}: its initial state is not filled")
    path = cache_path(plan, seed)
    ready = shipped_file(chosen.bed_name(parameters))
    bed = read_bed(ready) if out is None and ready is not None else None
    if ready is not None and bed is not None and (bed.plan, bed.seed) == (plan, seed):
        path, position = ready, bed.position
    else:
        try:
            with console.bar(json_) as progress:
                position = filled(plan, seed, progress)
        except PackingError as error:
            console.error(str(error))
            raise typer.Exit(1) from None
    if out is not None:
        path = out if out.suffix == ".npz" else out / f"{chosen.bed_name(parameters)}.npz"
        write_bed(path, Bed(plan, seed, position))
    found = measure(plan, position)
    if json_:
        print_json({"file": str(path), **found.model_dump()})
    else:
        console.line(str(path))
        console.line(found.line())


@app.command()
def quality(
    what: Annotated[str, typer.Argument(metavar="FILE_OR_CASE", help="bed *.npz made here, or case1[orifice=large]")],
    preset: PresetName = None,
    initial: Initial = None,
    seed: Annotated[int, typer.Option(min=0, help="seed of the initial state")] = 0,
    forces: Annotated[bool, typer.Option(help="stresses from contact forces, which takes most of the time")] = True,
    figure: Annotated[Path | None, typer.Option(help="picture to write, *.svg, *.png or *.pdf")] = None,
    json_: Json = False,
) -> None:
    """Shows how good a settled packing is: density, surface, overlaps and the stress that it carries.

    Of a case, the container is as it was closed for the filling; what is no part of the packing is left out.
    """
    from dembench.initial.quality import quality as measured
    from dembench.reports.packing import draw

    if figure is not None and figure.suffix not in (".svg", ".png", ".pdf"):
        console.error(f"--figure {figure}: accepted are *.svg, *.png and *.pdf")
        raise typer.Exit(2)
    try:
        with usage_errors(), console.bar(json_) as progress:
            bed = _bed(what, preset, initial_state(initial), seed, progress)
            found = measured(bed.plan, bed.position, forces, progress)
    except PackingError as error:
        console.error(str(error))
        raise typer.Exit(1) from None
    if figure is not None:
        draw(found, what, figure)
    if json_:
        print_json(found.model_dump())
        return
    console.line(found.packing.line())
    console.table(("quantity", "value"), found.rows())
    console.table(("height mm", "solid fraction", "stress Pa", "weight above Pa", "Janssen Pa"), found.level_rows())
    if figure is not None:
        console.line(str(figure))


def _bed(what: str, preset: Preset | None, initial: Path | None, seed: int, progress: Progress) -> Bed:
    """The bed of a file, or that of a case."""
    if what.endswith(".npz"):
        return read_bed(Path(what))
    case, parameters = parse_case(what)
    scene = case.scene(parameters, preset or "quick", initial, seed, progress)
    plan = case.filling(parameters, preset or "quick")
    if plan is None:
        raise CaseError(f"{what}: its initial state is not filled")
    return Bed(plan, seed, scene.bodies.position[: plan.count])


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help="file with a state of spheres")],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="file to write; its ending says the format")],
    from_: Annotated[str | None, typer.Option("--from", help=f"format of IN, else by its content: {_NAMES}")] = None,
    to: Annotated[str | None, typer.Option("--to", help="format of OUT, else by its ending")] = None,
    frame: Annotated[int, typer.Option(help="which frame of IN: 0 the first, -1 the last")] = -1,
    radius: Annotated[float | None, typer.Option(help="radius in m, where IN has none")] = None,
    density: Annotated[float | None, typer.Option(help="density in kg/m3, where IN has none")] = None,
    drop: Annotated[str, typer.Option(help=f"what may be lost, of {', '.join(FIELDS)}, as a,b")] = "",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace OUT where it is there")] = False,
    json_: Json = False,
) -> None:
    """Converts a state of spheres between the file formats of programs; all numbers keep their bits.

    What OUT cannot hold is refused unless `--drop` names it.
    """
    with usage_errors():
        if target.exists() and not overwrite:
            raise CoordinatesError(f"{target}: is there; give another name, or --overwrite")
        into = formats.format_named(to) if to else formats.format_for(target)
        state = formats.read(source, formats.format_named(from_) if from_ else None, frame)
        state = _without(_with(_with(state, "radius", radius), "density", density), drop)
        formats.write(state, target, into)
    if json_:
        print_json({"file": str(target), "format": into.name, "spheres": len(state), "fields": state.said()})
    else:
        console.line(f"{target}: {len(state)} spheres, {into.title}; position, {', '.join(state.said())}")


def _with(state: State, name: str, value: float | None) -> State:
    """The state with one value of a field for all spheres."""
    if value is None:
        return state
    if getattr(state, name) is not None:
        raise CoordinatesError(f"--{name} {value:g} {UNITS[name]}: the file has a {name} of its own, which is kept")
    return state.with_fields(**{name: np.full(len(state), value)})


def _without(state: State, drop: str) -> State:
    """The state without fields that may be lost."""
    names = [name.strip() for name in drop.split(",") if name.strip()]
    for name in names:
        if name not in FIELDS:
            raise CoordinatesError(f"--drop {name}: accepted are {', '.join(FIELDS)}")
    return state.with_fields(**dict.fromkeys(names)) if names else state
