"""How quantities answer to a parameter: curves with the spread of the seeds, and flags where one stays flat."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dembench.recipes import Sensitivity
from dembench.reports.plot import Line, Panel, Plot
from dembench.reports.tables import Cell, Column, Table
from dembench.reports.units import labelled, measure, shown_in
from dembench.reports.variants import Problem, Variant
from dembench.scoring.sensitivity import CONFIDENCE, Response, response


@dataclass(frozen=True)
class Finding:
    """Whether a quantity that must depend on the parameter does so with one variant.

    Attributes:
        problem: Name of the problem on the page.
        variant: The engine as typed.
        quantity, title, unit: The quantity; its name stands for the title where no run has it.
        parameter, words: The parameter, and how a person writes it.
        response: What was found; None where fewer than two values of the parameter are known.
    """

    problem: str
    variant: str
    quantity: str
    title: str
    unit: str
    parameter: str
    words: str
    response: Response | None

    @property
    def varies(self) -> bool:
        """Whether it does; not where too little is known."""
        return self.response is not None and not self.response.flat

    def sentence(self) -> str:
        """What was found, in words."""
        what = f"{self.variant}: {self.title[:1].lower()}{self.title[1:]}"
        if self.response is None:
            return f"{what} is not known for two values of {self.words}, so nothing can be said."
        change = measure(self.response.change, self.unit, 3)
        if not self.response.flat:
            return f"{what} varies with {self.words}, by {change}."
        beside = (
            f"the seeds alone make {measure(self.response.scatter, self.unit, 3)}"
            if self.response.scatter >= self.response.least
            else f"at least {measure(self.response.least, self.unit, 3)} is asked for"
        )
        return f"{what} stays FLAT where it must vary with {self.words}: it changes by {change}, {beside}."

    def plain(self) -> dict[str, Any]:
        """As plain data."""
        found = self.response
        return {
            "variant": self.variant,
            "quantity": self.quantity,
            "parameter": self.parameter,
            "verdict": "unknown" if found is None else "flat" if found.flat else "varies",
            "change": found.change if found else None,
            "scatter": found.scatter if found else None,
            "least": found.least if found else None,
        }


def findings(study: Sensitivity, problems: Sequence[Problem]) -> list[Finding]:
    """Each quantity that must vary, for each variant, references included."""
    found = []
    for problem in problems:
        for name, own in itertools.product(study.must_vary, _series(problem)):
            known = problem.known(name)
            title, unit = (known.title, known.unit) if known else (name, "")
            answer = response([v.values(name) for v in own], study.least_change)
            found.append(Finding(problem.name, own[0].choice, name, title, unit, study.parameter, study.words, answer))
    return found


def table(study: Sensitivity, problem: Problem, found: Sequence[Finding]) -> Table:
    """The findings of a problem, flat curves marked."""
    columns = (
        Column("Quantity", kind="wrap"),
        Column("Engine", kind="long"),
        Column("Verdict"),
        Column("Change", "", "number", f"range of the means over {study.words}"),
        Column("Seeds alone", "", "number", "range that equal means would show by the scatter of the seeds"),
        Column("Least", "", "number", "smallest change that counts"),
    )
    rows = tuple(_row(finding) for finding in found if finding.problem == problem.name)
    note = (
        f"These quantities are known to depend on {study.words}. Flat: the range of the means is not beyond that "
        f"which the scatter of the seeds makes of equal means in {CONFIDENCE:.0%} of cases (Tukey), or below "
        f"{study.least_change:.2g} of the largest magnitude."
    )
    title = f"Does it depend on {study.words}?"
    return Table(f"{problem.name}-sensitivity", title, columns, rows, note, tag=problem.tag)


def _row(finding: Finding) -> tuple[Cell, ...]:
    numbers = [Cell()] * 3
    if (found := finding.response) is not None:
        numbers = [Cell(measure(v, finding.unit, 3), v) for v in (found.change, found.scatter, found.least)]
    word = "unknown" if found is None else "flat" if found.flat else "varies"
    verdict = Cell(word, mark="state ok" if finding.varies else "state inaccurate")
    return (Cell(finding.title), Cell(finding.variant), verdict, *numbers)


def plot(study: Sensitivity, problem: Problem, names: Sequence[str], command: str) -> Plot | None:
    """Every quantity against the parameter, one panel each; None where none is known."""
    values = list(dict.fromkeys(v.value for v in problem.variants))
    words = not all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)
    place = {value: float(k) if words else float(value) for k, value in enumerate(values)}  # type: ignore[arg-type]
    panels = [panel for name in names if (panel := _panel(problem, name, place)) is not None]
    if not panels:
        return None
    return Plot(
        name=f"{problem.name}-sensitivity-curves",
        title=f"What depends on {study.words}",
        caption="Means over the seeds; bars: their range.",
        x_label=study.words.capitalize(),
        panels=tuple(panels),
        command=command,
        x_names=tuple(map(str, values)) if words else (),
        tag=problem.tag,
    )


def _panel(problem: Problem, name: str, place: dict[Any, float]) -> Panel | None:
    known = problem.known(name)
    if known is None:
        return None
    series = [[v for v in own if v.values(name)] for own in _series(problem)]
    factor, unit = shown_in(known.unit, *(v.values(name) for own in series for v in own))
    lines: list[Line] = []
    for own in filter(None, series):
        x = np.array([place[v.value] for v in own])
        y, low, high = (factor * np.array([f(v.values(name)) for v in own]) for f in (np.mean, np.min, np.max))
        order = np.argsort(x)
        style = sum(line.colour == own[0].members[0].shown.look.colour for line in lines)
        colour = own[0].members[0].shown.look.colour
        lines.append(Line(own[0].choice, x[order], y[order], colour, style, low=low[order], high=high[order]))
    return Panel(labelled("Value", unit), tuple(lines), log_y=False, title=known.title)


def _series(problem: Problem) -> list[list[Variant]]:
    """The variants that differ by the parameter alone."""
    found: dict[tuple[int, str], list[Variant]] = {}
    for variant in problem.variants:
        found.setdefault((variant.family, variant.choice), []).append(variant)
    return list(found.values())
