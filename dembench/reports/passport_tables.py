"""Tables of law passports: of the suite's page, and the small one beside the bulk results of an engine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from dembench.reports.groups import Group
from dembench.reports.looks import look
from dembench.reports.svg import variable
from dembench.reports.tables import Cell, Column, Table, significant
from dembench.runs.directory import RunRecord
from dembench.scene import HertzMindlin
from dembench.solver.timestep import choose_step
from dembench.verification.laws import LAWS
from dembench.verification.passport.measure import ASPECTS, together
from dembench.verification.passport.record import Passport, command, kept, passports

DISTANCE = (
    "root mean square over all aspects, each in its own scale; laws that differ in their lever alone are 0.012 apart"
)
WORDS = {law.name: law for law in LAWS}


def tables(runs: Sequence[RunRecord]) -> list[Table]:
    """The tables of the suite's page: the law that fits each engine, and its distances to all laws."""
    made = passports(runs)
    return [_fits(made), _aspects(made), _distances(made), _laws()] if made else []


def measured_law(group: Group) -> Table | None:
    """What is known of the contacts of the engines of a group; None where its law is not that of the passports.

    An engine without a passport has the command that makes one.
    """
    scene = group.first.scene
    if scene is None or not isinstance(scene.law, HertzMindlin):
        return None
    rows = []
    contact = choose_step(scene).contact_time
    for label, entry in {e.spec.label(): e for e in group.entries if not e.spec.imported}.items():
        spec = entry.spec
        here = _steps(contact / entry.dt if entry.dt else None)
        found = kept(spec.engine, spec.engine_version, spec.settings)
        if found is None:
            missing = Cell("not measured", detail=command([(spec.engine, spec.overrides)]))
            rows.append((_engine(label, spec.engine), Cell(), missing, Cell(), Cell(), here, Cell()))
        else:
            measured = _steps(found.steps_per_contact)
            rows.append((_engine(label, spec.engine), *_verdict(found), measured, here, Cell(found.date)))
    if not rows:
        return None
    columns = (
        Column("Engine", kind="long"),
        Column("Distance to the scene's law", kind="number", note=DISTANCE),
        Column("Named law that fits", kind="wrap"),
        Column("Its distance", kind="number", note=DISTANCE),
        Column("Steps per contact, measured", kind="number", note="of the passport's collisions"),
        Column("Steps per contact, here", kind="number", note="of the shortest contact that is expected"),
        Column("Measured on"),
    )
    note = (
        "Collisions of two spheres of the reference variant of the law, measured apart from these runs and with finer "
        "steps: with few steps per contact an engine is farther from its law, and a sweep says how far. "
        "Engines that divide their steps themselves are finer than their time step says."
    )
    return Table(f"{group.name}-law", "Contact law, measured", columns, tuple(rows), note=note)


def _fits(made: Sequence[Passport]) -> Table:
    columns = (
        Column("Engine", kind="long"),
        Column("Distance to the scene's law", kind="number", note=DISTANCE),
        Column("Named law that fits", kind="wrap"),
        Column("Its distance", kind="number", note=DISTANCE),
        Column("Next one", kind="wrap", note="the named law with the second smallest distance"),
        Column("Says it computes", kind="wrap", note="empty: the scene's own law"),
    )
    rows = []
    for one in made:
        ranked = sorted(one.distances, key=lambda name: together(one.distances[name]))
        second = together(one.distances[ranked[1]])
        following = Cell(f"{WORDS[ranked[1]].title}: {significant(second, 3)}")
        rows.append((_engine(one.label, one.engine), *_verdict(one), following, Cell(one.law or "the scene's law")))
    return Table("passports", "Passports", columns, tuple(rows))


def _aspects(made: Sequence[Passport]) -> Table:
    columns = (
        Column("Engine", kind="long"),
        Column("All", kind="number", note=DISTANCE),
        *(Column(a.name.capitalize(), kind="number", note=f"{a.title}; scale: {a.scale}") for a in ASPECTS),
    )
    rows = []
    for one in made:
        own = one.distances[one.scene_law]
        rows.append((_engine(one.label, one.engine), _number(together(own)), *(_number(own[a.name]) for a in ASPECTS)))
    return Table("aspects", "Distance to the scene's law by aspect", columns, tuple(rows))


def _distances(made: Sequence[Passport]) -> Table:
    columns = (Column("Law", kind="wrap"), *(Column(one.label, kind="number", note=DISTANCE) for one in made))
    rows = []
    for law in LAWS:
        cells = []
        for one in made:
            cell = _number(together(one.distances[law.name]))
            cells.append(replace(cell, mark="within") if law.name == one.fits else cell)
        rows.append((Cell(law.title, detail=law.name), *cells))
    return Table("distances", "Distance to the named laws", columns, tuple(rows), note="Marked: the law that fits.")


def _laws() -> Table:
    columns = (
        Column("Law", kind="wrap"),
        Column("Known from", kind="wrap"),
        Column("Tension"),
        Column("Bound of friction", kind="wrap"),
        Column("What it limits", kind="wrap"),
        Column("Shear", kind="wrap"),
        Column("Lever", kind="wrap"),
    )
    rows = []
    for law in LAWS:
        shear = f"{law.shear:.2g} of Mindlin's stiffness, {law.history} remembered"
        soft = law.spring != "rigid"
        rows.append(
            (
                Cell(law.title, detail=law.name),
                Cell(law.known_from),
                Cell("kept" if law.tension and soft else "none"),
                Cell("friction × whole normal force" if law.bound == "whole" else "friction × spring's force"),
                Cell({"sum": "spring and dashpot"}.get(law.limited, law.limited) if soft else "impulse"),
                Cell((shear if law.spring == "hertz" else "linear spring") if soft else "none"),
                Cell("radius − overlap/2" if law.lever == "reduced" else "radius"),
            )
        )
    return Table("laws", "The named laws", columns, tuple(rows))


def _verdict(one: Passport) -> tuple[Cell, Cell, Cell]:
    return _number(one.scene_distance), Cell(one.fits_title, detail=one.fits), _number(one.distance)


def _steps(value: float | None) -> Cell:
    """Steps per contact; empty where they are not known or nothing moves."""
    return Cell(significant(value, 2), value) if value is not None and math.isfinite(value) else Cell()


def _number(value: float) -> Cell:
    return Cell(f"{value:.4f}", float(f"{value:.6g}"))


def _engine(label: str, engine: str) -> Cell:
    return Cell(label, label, colour=variable(look(engine).colour))
