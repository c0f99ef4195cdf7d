"""The page of an ablation: what each scene needs, what is left out, and what leaving out saves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dembench.ablation import Ablation
from dembench.engines import registry
from dembench.reports.facts import words
from dembench.reports.pages import write_page
from dembench.reports.svg import variable
from dembench.reports.tables import Cell, Column, Table, numbers, significant
from dembench.reports.units import measure
from dembench.runs.plan import SceneChoice
from dembench.runs.supervise import command_line
from dembench.scene import features


def render(scenes: Sequence[SceneChoice], rows: Sequence[Ablation], output: Path) -> Path:
    """Writes the page as one HTML file that needs no other file and no network; returns its path."""
    parts = []
    for k, scene in enumerate(scenes, 1):
        own = [row for row in rows if row.scene == scene.case]
        parts.append((scene.case, _facts(scene), table(f"scene-{k}-rows", own)))
    colours = {_colour(row.engine) for row in rows}
    output.parent.mkdir(parents=True, exist_ok=True)
    return write_page(
        "ablation.html.j2",
        output,
        colours,
        [],
        title="What leaving out saves",
        summary=" ".join(_summary(engine, rows) for engine in dict.fromkeys(row.engine for row in rows)),
        parts=parts,
        command=command_line(),
    )


def _facts(scene: SceneChoice) -> list[tuple[str, str]]:
    own, present = scene.scene, features(scene.scene)
    return [
        ("Scene", f"{own.name}, {len(own.bodies)} bodies, {measure(own.duration, 's')} simulated"),
        ("Features present", words(present.names())),
        ("Left out", words(present.absent())),
    ]


def table(name: str, rows: Sequence[Ablation]) -> Table:
    """The rows of one scene; the name is that of the table on the page."""
    columns = (
        Column("Engine", kind="long"),
        Column("Forced on", note="a feature that the scene does not need"),
        Column("Loop time, left out", "s", "number", "CPU time where it is known; median of the repeats"),
        Column("Loop time, forced", "s", "number", "CPU time where it is known; median of the repeats"),
        Column("Time", "ratio", "number", "forced over left out"),
        Column("Arrays, left out", "MB", "number"),
        Column("Arrays, forced", "MB", "number"),
        Column("Peak memory, left out", "MB", "number"),
        Column("Peak memory, forced", "MB", "number"),
        Column("Results", kind="wrap"),
    )
    columns_of_numbers = [
        numbers([row.left_out.loop for row in rows]),
        numbers([row.forced.loop for row in rows]),
        numbers([row.slowdown for row in rows]),
        numbers([_megabytes(row.left_out.state) for row in rows]),
        numbers([_megabytes(row.forced.state) for row in rows]),
        numbers([_megabytes(row.left_out.peak) for row in rows]),
        numbers([_megabytes(row.forced.peak) for row in rows]),
    ]
    listed = tuple(
        (
            Cell(row.engine, row.engine, colour=variable(_colour(row.engine))),
            Cell(row.feature.replace("_", " ")),
            *(column[k] for column in columns_of_numbers),
            Cell(_results(row)),
        )
        for k, row in enumerate(rows)
    )
    note = "Equal means equal to the bit in all that is recorded. Spread of the repeats: " + "; ".join(_spreads(rows))
    return Table(name, "Left out and forced on", columns, listed, note=note)


def _spreads(rows: Sequence[Ablation]) -> list[str]:
    """Shortest and longest loop of each engine with everything left out."""
    found = {}
    for row in rows:
        cost = row.left_out
        if cost.shortest is not None:
            found[row.engine] = f"{row.engine} {significant(cost.shortest, 3)} to {significant(cost.longest, 3)} s"
    return list(found.values())


def _results(row: Ablation) -> str:
    if row.equal is None:
        return row.why
    if row.equal:
        return "equal to the bit"
    since, apart = measure(row.first or 0.0, "s"), significant(row.apart, 2)
    return f"differ from t = {since} on, positions then by {apart} m: {row.why}"


def _summary(engine: str, rows: Sequence[Ablation]) -> str:
    own = [row for row in rows if row.engine == engine and row.equal is not None]
    if not own:
        return f"{engine}: nothing to compare."
    equal = sum(row.equal is True for row in own)
    return f"{engine}: {equal} of {len(own)} forced features change no bit."


def _megabytes(size: float | None) -> float | None:
    return None if size is None else size / 1e6


def _colour(engine: str) -> str:
    return registry.engine(engine.partition("[")[0]).colour
