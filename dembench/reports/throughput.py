"""The page of a comparison of speeds: the roofline of the machine, rates over the number of bodies, rates by scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from dembench.engines import registry
from dembench.reports.figures import draw
from dembench.reports.pages import write_page
from dembench.reports.plot import Known, Line, Panel, Plot
from dembench.reports.svg import variable
from dembench.reports.tables import Cell, Column, Table, grouped, numbers, significant
from dembench.runs.environment import last_cache
from dembench.runs.environment import machine as this_machine
from dembench.runs.supervise import command_line
from dembench.throughput.machine import Machine, least_work
from dembench.throughput.model import Model, fitted
from dembench.throughput.rates import LEAST_BUSY, Rate, settings_text
from dembench.throughput.scenes import SERIES

MARKS = {
    "c": f"c: contended: other programs used the cores, or less than {LEAST_BUSY:.0%} of wall time times cores is CPU "
    "time. The rate may be too low.",
    "l": "l: a contact law or walls of its own, see the settings: another work, without a ratio.",
}
INTENSITIES = (0.1, 10.0)
"""Ends of the horizontal axis of the roofline [1/B]."""


def render(rows: Sequence[Rate], machines: Sequence[Machine], output: Path) -> Path:
    """Writes the page as one HTML file that needs no other file and no network; returns its path."""
    command = command_line()
    by_scene = {name: [row for row in rows if row.scene == name] for name in dict.fromkeys(row.scene for row in rows)}
    sized = [row for row in rows if row.scene.startswith(SERIES)]
    plots = [roofline(rows, machines, command)] if any(row.samples for row in rows) else []
    models = fitted(rows, last_cache())
    if len({row.bodies for row in sized if row.samples}) > 1:
        plots.append(scaling(sized, machines, models, command))
    drawings = [draw(plot) for plot in plots]
    own = this_machine()
    contended = sum(row.contended for row in rows)
    output.parent.mkdir(parents=True, exist_ok=True)
    return write_page(
        "throughput.html.j2",
        output,
        {_colour(row) for row in rows},
        drawings,
        title="How fast engines step",
        summary=f"{own['cpu']}, {own['cores']} cores. "
        + (
            f"{contended} of {len(rows)} rates were disturbed by other load."
            if contended
            else "No other load was seen."
        ),
        figures=drawings,
        tables=[rate_table(name, own_rows, machines) for name, own_rows in by_scene.items()],
        model=model_table(models, own["memory"]) if models else None,
        settings=settings_table(rows),
        machine=machine_table(machines),
        command=command,
    )


# ---- figures


def roofline(rows: Sequence[Rate], machines: Sequence[Machine], command: str) -> Plot:
    """Arithmetic over intensity, a panel for each scene: what the machine allows, and where the engines are.

    Of the bed in many sizes the largest with a rate is shown.
    """
    rated = [row for row in rows if row.particle_steps_per_second is not None]
    largest = max((row.bodies for row in rated if row.scene.startswith(SERIES)), default=0)
    shown = [row for row in rated if not row.scene.startswith(SERIES) or row.bodies == largest]
    roofs = _roofs(machines)
    panels = []
    for scene in dict.fromkeys(row.scene for row in shown):
        lines = tuple(_point(row) for row in shown if row.scene == scene)
        panels.append(Panel("Operations [10⁹/s]", lines, roofs, log_y=True, title=scene))
    return Plot(
        "roofline",
        "Roofline of this machine",
        "The slope is the measured memory bandwidth, the level part the measured arithmetic in float64. A point is an "
        "engine: the operations that the contact law needs at least, times the measured rate, over the operations for "
        "each byte that a step must move at least. What an engine does beyond that (neighbours, empty pairs, "
        "iterations) lies between its point and the roof; a scene that fits in the caches may go beyond the slope.",
        "Operations per byte [1/B]",
        tuple(panels),
        command,
        log_x=True,
        columns=2,
        tag=_disturbed(machines),
    )


def _roofs(machines: Sequence[Machine]) -> tuple[Known, ...]:
    """The roof of every number of cores, in float64."""
    found = []
    for k, limits in enumerate(machines):
        x = np.unique(np.clip([INTENSITIES[0], limits.double / limits.bandwidth, INTENSITIES[1]], *INTENSITIES))
        y = np.minimum(limits.double, x * limits.bandwidth) / 1e9
        found.append(Known(f"roof of {_cores(limits.cores)}", x, y, points=False, style=k))
    return tuple(found)


def _point(row: Rate) -> Line:
    """An engine below the roof."""
    work = least_work(row.touching)
    speed = work.flops * (row.particle_steps_per_second or 0.0) / 1e9
    name = _series_name(row.engine, row.cores)
    return Line(name, np.array([work.intensity]), np.array([speed]), _colour(row), style=row.cores - 1, points=True)


def scaling(rows: Sequence[Rate], machines: Sequence[Machine], models: Sequence[Model], command: str) -> Plot:
    """Rates over the number of bodies of one bed in many sizes, below the roof of the machine, with the models."""
    by_name, lines = {model.engine: model for model in models}, []
    for (engine, cores), own in _by_engine(rows).items():
        name, model = _series_name(engine, cores), by_name.get(engine)
        lines.append(
            Line(
                name,
                np.array([row.bodies for row in own], dtype=float),
                np.array([_millions(row.particle_steps_per_second) for row in own]),
                _colour(own[0]),
                style=cores - 1,
                points=model is not None,
                low=np.array([_millions(row.slowest) for row in own]),
                high=np.array([_millions(row.fastest) for row in own]),
            )
        )
        if model is not None:
            bodies = np.geomspace(own[0].bodies, own[-1].bodies, 60)
            times = np.array([model.time(n, own[0].touching, cores) for n in bodies])
            lines.append(Line(f"{name}, model", bodies, 1e-6 / times, _colour(own[0]), style=cores - 1))
    ends = np.array([min(row.bodies for row in rows), max(row.bodies for row in rows)], dtype=float)
    work = least_work(max(row.touching for row in rows))
    known = tuple(
        Known(f"roof of {_cores(m.cores)}", ends, np.full(2, m.attainable(work) / 1e6), points=False, style=k)
        for k, m in enumerate(machines)
    )
    return Plot(
        "scaling",
        "Rate over the number of bodies",
        "One settled bed between periodic sides, repeated along both. Bars are the slowest and the fastest sample; the "
        "model is fitted to the rates of all scenes.",
        "Bodies",
        (Panel("Particle-steps [10⁶/s]", tuple(lines), known, log_y=True),),
        command,
        log_x=True,
        tag=_disturbed(machines),
    )


# ---- tables


def rate_table(scene: str, rows: Sequence[Rate], machines: Sequence[Machine]) -> Table:
    """The rates of one scene, every engine with every number of cores, those without a rate with the reason."""
    limits, first = {m.cores: m for m in machines}, rows[0]
    work = least_work(first.touching)
    speeds = [row.particle_steps_per_second for row in rows]
    of_roof = [
        speed and 100 * speed / limits[row.cores].attainable(work) for speed, row in zip(speeds, rows, strict=True)
    ]
    columns: list[tuple[Column, list[Cell]]] = [
        (Column("Engine", kind="long"), [_engine(row) for row in rows]),
        (Column("Cores", kind="number"), numbers([row.cores for row in rows], digits=1)),
        (Column("Particle-steps", "10⁶/s", "number", "median of the samples"), numbers([_millions(v) for v in speeds])),
        (
            Column("Spread", "%", "number", "fastest less slowest sample, over the median"),
            _percent(r.spread for r in rows),
        ),
        (Column("Ratio", kind="number", note="to the slowest on as many cores"), numbers(_ratios(rows))),
        (Column("Of the roof", "%", "number", "of the rate that the roofline allows"), numbers(of_roof, digits=2)),
        (Column("Wall time", "s", "number", "of the steps that are timed"), numbers([row.wall for row in rows])),
        (
            Column("Core-seconds", "s", "number", "CPU time of all processes"),
            numbers([row.core_seconds for row in rows]),
        ),
        (Column("Busy", "%", "number", "core-seconds over wall time and cores"), _percent(row.busy for row in rows)),
        (
            Column("By its own clock", "10⁶/s", "number", "particle-steps by the time that the engine states"),
            numbers([_millions(row.own_clock) for row in rows]),
        ),
        (Column("Memory", "MB", "number"), numbers([_millions(row.peak_memory) for row in rows], most=0)),
        (Column("Samples", kind="number"), numbers([row.samples for row in rows], digits=1)),
    ]
    used = "".join(_marks(row) for row in rows)
    return Table(
        f"{scene}-rates",
        scene,
        tuple(column for column, _ in columns),
        tuple(tuple(cells[k] for _, cells in columns) for k in range(len(rows))),
        note=f"{grouped(first.bodies, 0)} bodies, {significant(first.touching, 3)} touching pairs each, from the state "
        f"{first.start}; {grouped(first.steps, 0)} steps of {significant(first.dt * 1e6)} µs are timed.",
        footnotes=tuple(text for mark, text in MARKS.items() if mark in used),
    )


def model_table(models: Sequence[Model], memory: float) -> Table:
    """What a step costs by bodies, pairs and cores, and for how many bodies this machine has memory."""
    terms = {
        "body": Column("Body", "ns", "number", "a: a body without contacts"),
        "pair": Column("Pair", "ns", "number", "b: a touching pair"),
        "beyond": Column("Beyond cache", "ns", "number", "c: added where the bodies do not fit into the last cache"),
        "serial": Column("Not divided", "ns", "number", "d: what more cores do not shorten"),
        "step": Column("Step", "µs", "number", "e: a step of no bodies"),
    }
    columns: list[tuple[Column, list[Cell]]] = [
        (
            Column("Engine", kind="long"),
            [Cell(m.engine, m.engine, colour=variable(_colour_of(m.engine))) for m in models],
        )
    ]
    for name, column in terms.items():
        scale = 1e6 if name == "step" else 1e9
        values = [scale * getattr(m, name) if name in m.terms else None for m in models]
        columns.append((column, numbers(values)))
    columns += [
        (
            Column("Deviation", "%", "number", "largest of a rate from the model"),
            _percent(m.deviation for m in models),
        ),
        (Column("Rates", kind="number"), numbers([m.rates for m in models], digits=1)),
        (Column("Memory", "B", "number", "of a body"), numbers([m.memory and m.memory[1] for m in models], most=0)),
        (
            Column("Room", "10⁶ bodies", "number", "for which this machine has memory"),
            numbers([_millions(m.limit(memory)) for m in models]),
        ),
        (Column("Beyond one machine"), [Cell("ranks of MPI" if m.divided else "no") for m in models]),
    ]
    return Table(
        "model",
        "Model of the time of a step",
        tuple(column for column, _ in columns),
        tuple(tuple(cells[k] for _, cells in columns) for k in range(len(models))),
        note="Wall time of a step for each of N bodies with z touching pairs each, on p cores: "
        "(a + b z + c m)/p + d (1 - 1/p) + e/N, with the share m of the bodies that has no place in the last cache. "
        "What the rates at hand do not tell is left out.",
    )


def settings_table(rows: Sequence[Rate]) -> Table:
    """What every engine was: its version, its law where it is its own, and all its settings."""
    used: dict[tuple[str, str, str, str], list[Rate]] = {}
    for row in rows:
        if row.settings:
            used.setdefault((row.engine, row.version, settings_text(row.settings), row.law), []).append(row)
    listed = tuple(
        (
            Cell(engine, engine, colour=variable(_colour(own[0]))),
            Cell(version),
            Cell(", ".join(dict.fromkeys(row.scene for row in own))),
            Cell(settings),
            Cell(law or "the scene's"),
        )
        for (engine, version, settings, law), own in used.items()
    )
    columns = (
        Column("Engine", kind="long"),
        Column("Version"),
        Column("Scenes", kind="wrap"),
        Column("Settings", kind="wrap"),
        Column("Contact law, walls", kind="wrap"),
    )
    return Table("settings", "Settings of the engines", columns, listed, note="All that are not typed are defaults.")


def machine_table(machines: Sequence[Machine]) -> Table:
    """What the machine can do at most."""
    columns = (
        Column("Cores", kind="number"),
        Column("Memory", "GB/s", "number", "copies of large arrays, bytes read and written"),
        Column("Arithmetic, float32", "GFlop/s", "number", "products of matrices"),
        Column("Arithmetic, float64", "GFlop/s", "number", "products of matrices"),
        Column("Busy", "%", "number", "CPU time over wall time and cores"),
    )
    cells = [
        numbers([m.cores for m in machines], digits=1),
        numbers([m.bandwidth / 1e9 for m in machines]),
        numbers([m.single / 1e9 for m in machines]),
        numbers([m.double / 1e9 for m in machines]),
        _percent(m.busy for m in machines),
    ]
    listed = tuple(tuple(column[k] for column in cells) for k in range(len(machines)))
    return Table(
        "machine",
        "Limits of this machine",
        columns,
        listed,
        note="The best of many passes on all cores at once."
        + (" Other programs held the cores meanwhile: the limits are understated." if _disturbed(machines) else ""),
    )


def _by_engine(rows: Sequence[Rate]) -> dict[tuple[str, int], list[Rate]]:
    """Rows with a rate by engine and cores, by number of bodies."""
    found: dict[tuple[str, int], list[Rate]] = {}
    for row in sorted(rows, key=lambda row: row.bodies):
        if row.particle_steps_per_second is not None:
            found.setdefault((row.engine, row.cores), []).append(row)
    return found


def _disturbed(machines: Sequence[Machine]) -> str:
    """What to know of limits that were measured beside other load; empty where there was none."""
    return "roof understated: other load" if any(m.busy < LEAST_BUSY for m in machines) else ""


def _series_name(engine: str, cores: int) -> str:
    return f"{engine}, {_cores(cores)}"


def _cores(number: int) -> str:
    return f"{number} core" if number == 1 else f"{number} cores"


def _engine(row: Rate) -> Cell:
    return Cell(row.engine, row.engine, colour=variable(_colour(row)), detail=row.detail, flags=_marks(row))


def _colour(row: Rate) -> str:
    return _colour_of(row.engine)


def _colour_of(engine: str) -> str:
    return registry.engine(engine.partition("[")[0]).colour


def _marks(row: Rate) -> str:
    return "" if row.particle_steps_per_second is None else "c" * row.contended + "l" * bool(row.law)


def _ratios(rows: Sequence[Rate]) -> list[float | None]:
    """Rates over the slowest on as many cores, of those with the scene's law."""
    found: list[float | None] = []
    for row in rows:
        own = row.particle_steps_per_second
        alike = [
            r.particle_steps_per_second
            for r in rows
            if r.cores == row.cores and r.particle_steps_per_second is not None and not r.law
        ]
        found.append(own / min(alike) if own and alike and not row.law else None)
    return found


def _millions(value: float | None) -> float | None:
    return None if value is None else value / 1e6


def _percent(values: Iterable[float | None]) -> list[Cell]:
    return numbers([None if value is None else 100 * value for value in values], digits=2)
