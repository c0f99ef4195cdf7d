"""What a sweep leaves: `sweep.json`, one table of points with their costs and errors."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError

from dembench.atomic import write_json
from dembench.scene.base import Model

FILE = "sweep.json"
Class = Literal["closed form", "path", "distance", "number", "cycle"]
"""Kind of error: of a number with a closed form, of paths, of curves of ensembles, of numbers of ensembles, of the
cycles of ensembles. Errors of different kinds never share an axis."""
State = Literal["ok", "failed", "timeout", "interrupted", "skipped", "missing", "not run"]


class Measure(Model):
    """What an error is of.

    Attributes:
        name: Identifier, unique in its sweep.
        title: What it is.
        kind: Kind of error.
        unit: What the error is in, for labels: shares of a scale, diameters, spreads of the seeds.
        scale: What an error of one is, in words.
        source: Where the reference comes from.
        accepted: Error up to which the case accepts it [-]: for D the criterion, for numbers of ensembles the margin
            that was given beforehand; None where there is none.
    """

    name: str
    title: str
    kind: Class
    unit: str
    scale: str
    source: str
    accepted: float | None = None


class Error(Model):
    """Error of one point in one measure, none below 0.

    Attributes:
        measure: Name of the measure.
        total: Distance to the law of the scene: to the closed form, or to other codes; None where it is not known.
        own: Distance to the limit of the engine itself as the setting is refined; None for that limit.
        low, high: Interval of the total error; None without one.
        band: Error that the seeds alone make, or what references of paths still move; below it nothing is ranked.
        verdict: `equivalent`, `different` or `undecided` against the margin; empty without a margin.
    """

    measure: str
    total: float | None = None
    own: float | None = None
    low: float | None = None
    high: float | None = None
    band: float = 0.0
    verdict: str = ""


class Loop(Model):
    """Wall time of the stepping loop over repeats and seeds [s].

    Attributes:
        median, low, high: [s].
        count: How many were timed.
        outside: Set-up, compilation and output of the median run together [s].
    """

    median: float
    low: float
    high: float
    count: int
    outside: float = 0.0


class Point(Model):
    """One engine with one value of the knob.

    Attributes:
        engine: Its name.
        variant: The engine with what was typed, without the knob.
        label: The same with the knob.
        value: Value of the knob, as typed; for a time step its factor of the scene's step of the closed
            division.
        rank: Place of the value from coarse (0) to fine.
        dt: Time step [s], the largest where scenes have different ones.
        settings: All settings of the first run.
        law: Contact law that the engine computes; empty where it is the scene's own.
        precision, device, cores: As in timing tables.
        state: `ok`, or the state of a run that did not come to its end.
        detail: Why.
        runs: Names of the run directories.
        seeds: Seeds that came to their end.
        loop: Time; None where no run came to its end.
        core_seconds: Loop time times cores [s].
        steps: Time steps of all runs of one seed.
        passes: Passes over the contacts.
        contended: Whether other programs used the cores.
        order: Order of accuracy in the time step that the method has in theory; None where none is stated.
        errors: Its errors.
    """

    engine: str
    variant: str
    label: str
    value: str
    rank: int
    dt: float
    settings: dict[str, object] = Field(default_factory=dict)
    law: str = ""
    precision: str = ""
    device: str = "cpu"
    cores: int = 1
    state: State
    detail: str = ""
    runs: tuple[str, ...] = ()
    seeds: int = 0
    loop: Loop | None = None
    core_seconds: float | None = None
    steps: int | None = None
    passes: float | None = None
    contended: bool = False
    order: float | None = None
    errors: tuple[Error, ...] = ()

    def error(self, measure: str) -> Error | None:
        """Its error in a measure; None where it has none."""
        return next((e for e in self.errors if e.measure == measure), None)


class Problem(Model):
    """What tells one problem from another, for advice on a scene that was never swept.

    Attributes:
        title: One line.
        law: Kind of the contact law.
        features: Features of the scene that are present.
        bodies: Number of bodies.
        young: Young's modulus of the stiffest material of bodies [Pa].
        softness: Expected overlap of the fastest body over its radius, (rho v^2/E)^(2/5) [-].
        restitution: Lowest coefficient of restitution of its pairs [-].
    """

    title: str
    law: str
    features: tuple[str, ...]
    bodies: int
    young: float
    softness: float
    restitution: float


class Sweep(Model):
    """A sweep of one knob on one target.

    Attributes:
        version: Of this format.
        target: The target as typed.
        kind: `closed form`, `path` or `ensemble`.
        knob: Name of the setting.
        problem: What kind of problem it is.
        command: What reproduces it.
        made: Time in ISO 8601.
        machine: Processor and cores.
        references: Engines whose limits stand for the truth where there is no closed form.
        converged: Whether the limit of a variant has settled: its two finest points are not further apart than what
            counts as equal; None with one point.
        horizon: Time at which paths diverge [s]; None where it was not measured or not reached.
        notes: What to know before reading.
        measures, points: The table.
    """

    version: int = 1
    target: str
    kind: Literal["closed form", "path", "ensemble"]
    knob: str
    problem: Problem
    command: str
    made: str
    machine: str
    references: tuple[str, ...] = ()
    converged: dict[str, bool | None] = Field(default_factory=dict)
    horizon: float | None = None
    notes: tuple[str, ...] = ()
    measures: tuple[Measure, ...]
    points: tuple[Point, ...]

    def variants(self) -> list[str]:
        """The engines with what was typed, in their order."""
        return list(dict.fromkeys(point.variant for point in self.points))

    def words(self, value: str) -> str:
        """A value of the knob in words; empty for an engine that has no such setting."""
        if not value:
            return ""
        return f"{value} × closed step" if self.knob == "dt" else f"{self.knob} = {value}"

    def of(self, variant: str) -> list[Point]:
        """The points of a variant from coarse to fine."""
        return sorted((p for p in self.points if p.variant == variant), key=lambda p: p.rank)


def write(sweep: Sweep, directory: Path) -> Path:
    """Writes `sweep.json` into a directory."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / FILE
    write_json(path, sweep.model_dump(mode="json"))
    return path


def find(directory: Path) -> list[tuple[Path, Sweep]]:
    """The sweeps in a directory and the directories in it; one that cannot be read is left out with a warning."""
    found = []
    for path in sorted([*directory.glob(FILE), *directory.glob(f"*/{FILE}"), *directory.glob("*.sweep.json")]):
        try:
            found.append((path, Sweep.model_validate_json(path.read_text())))
        except (OSError, ValidationError) as error:
            warnings.warn(f"{path}: no readable sweep: {error}", stacklevel=2)
    return found
