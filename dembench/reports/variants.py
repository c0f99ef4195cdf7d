"""The runs of a recipe in the order of its blocks: problems, and in each of them the variants that are compared."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from dembench.campaign import is_file
from dembench.cases.base import Quantity, Reference
from dembench.recipes import Block, CaseChoice, Value
from dembench.reports import facts
from dembench.reports.groups import Group, Member, gather
from dembench.reports.units import measure
from dembench.runs.directory import RunRecord

ENDED = ("ok", "unscored", "inaccurate")
"""States of runs that came to their end: what is inaccurate is a finding here."""


@dataclass(frozen=True)
class Variant:
    """One engine with one setting on one case: its runs with all seeds and repeats.

    Attributes:
        block: The block of the recipe that asked for it.
        family: Number of the block and engine among all of the recipe.
        choice: The engine as typed.
        value: Value of the parameter that is studied; None where none is.
        members: Its runs, one member per seed.
    """

    block: Block
    family: int
    choice: str
    value: Value | None
    members: tuple[Member, ...]

    @property
    def title(self) -> str:
        """Name of its family in legends."""
        return self.block.title or self.members[0].shown.spec.engine

    @property
    def short(self) -> str:
        """What tells it from the others of its family; empty where nothing does."""
        swept = self.block.swept(self.members[0].shown.spec.overrides)
        return " × ".join(text for text in (swept, "" if self.value is None else str(self.value)) if text)

    @property
    def ended(self) -> list[Member]:
        """The runs that came to their end."""
        return [m for m in self.members if m.state in ENDED]

    @property
    def state(self) -> str:
        """The state of the runs, of several the one that did not end."""
        states = [m.state for m in self.members]
        return next((s for s in states if s not in ENDED), states[0])

    @cached_property
    def quantities(self) -> dict[str, list[Quantity]]:
        """Quantities by name, one per seed."""
        found: dict[str, list[Quantity]] = {}
        for member in self.ended:
            for quantity in {s.quantity.name: s.quantity for s in member.shown.scores}.values():
                found.setdefault(quantity.name, []).append(quantity)
        return found

    @cached_property
    def references(self) -> dict[str, Reference]:
        """What was published of quantities, by name: of several references the first that is no necessary condition."""
        found: dict[str, Reference] = {}
        for score in (s for member in self.ended for s in member.shown.scores):
            if score.reference is not None and not score.reference.necessary:
                found.setdefault(score.quantity.name, score.reference)
        return found

    def values(self, quantity: str) -> list[float]:
        """Values of a quantity, one per seed that has it."""
        return [q.value for q in self.quantities.get(quantity, [])]

    def mean(self, quantity: str) -> float | None:
        """Mean of a quantity over the seeds; None where no run has it."""
        values = self.values(quantity)
        return statistics.fmean(values) if values else None

    @property
    def loop(self) -> float | None:
        """Median time of the stepping loop over seeds and repeats [s]."""
        loops = [loop for member in self.ended for loop in member.loops]
        return statistics.median(loops) if loops else None


@dataclass(frozen=True)
class Problem:
    """What is compared: one case, or one case with all values of the parameter that is studied.

    Attributes:
        name: Identifier on the page.
        title: Heading.
        groups: Its runs by scene, both divisions together, in the order of the recipe.
        variants: Its variants in the order of the recipe; one of which no run is known is left out.
    """

    name: str
    title: str
    groups: tuple[Group, ...]
    variants: tuple[Variant, ...]

    @property
    def tag(self) -> str:
        """What to know of all its runs before reading anything: that they are softened, or nothing."""
        return self.groups[0].tag

    @property
    def references(self) -> list[Variant]:
        """The variants that the others are compared with."""
        return [v for v in self.variants if v.block.reference]

    def reference(self, quantity: str) -> Reference | None:
        """What a quantity is compared with beside the runs; None where nothing is known."""
        return next((v.references[quantity] for v in self.variants if quantity in v.references), None)

    def known(self, quantity: str) -> Quantity | None:
        """A quantity as one of the variants has it; None where none has."""
        return next((q for v in self.variants for q in v.quantities.get(quantity, [])), None)


Blocks = Sequence[tuple[Block, Sequence[RunRecord]]]


def problems(blocks: Blocks, parameter: str | None = None) -> list[Problem]:
    """The problems of a recipe.

    Args:
        blocks: Its blocks with their runs.
        parameter: The parameter that is studied: cases that differ by it alone are one problem.
    """
    records = {record.name: record for _, runs in blocks for record in runs}
    choices = list({_case(c): c for block, _ in blocks for c in block.case_choices()}.items())
    order = {case: k for k, (case, _) in enumerate(choices)}
    groups = gather(records.values(), by_division=False)
    alike: dict[str, list[Group]] = {}
    for group in sorted(groups, key=lambda group: order[group.first.spec.case]):
        alike.setdefault(_heading(group, dict(choices)[group.first.spec.case], parameter), []).append(group)
    return [_problem(blocks, title, tuple(own), parameter) for title, own in alike.items()]


def _heading(group: Group, choice: CaseChoice, parameter: str | None) -> str:
    """What a group is about; the same for all values of the parameter that is studied."""
    entry = group.first
    if parameter is None:
        return f"{facts.problem_name(entry)}, {measure(entry.spec.duration, 's')}"
    others = {name: value for name, value in choice.values.items() if name != parameter}
    return f"{CaseChoice(choice.base, others).text}, {entry.spec.preset}, by {parameter.replace('_', ' ')}"


def _case(choice: CaseChoice) -> str:
    """The case as run directories name it."""
    return Path(choice.text).name if is_file(choice.text) else choice.text


def _problem(blocks: Blocks, title: str, groups: tuple[Group, ...], parameter: str | None) -> Problem:
    members: dict[tuple[str, str], list[Member]] = {}
    for member in (m for group in groups for m in group.members):
        members.setdefault((member.shown.spec.case, member.shown.spec.label()), []).append(member)
    variants, family = [], 0
    for block, runs in blocks:
        own = {run.name for run in runs}
        for engine in block.engines:
            for choice in block.engine_choices([engine]):
                for case in block.case_choices():
                    found = [m for m in members.get((_case(case), choice), []) if any(e.name in own for e in m.entries)]
                    if found:
                        value = case.values.get(parameter) if parameter else None
                        variants.append(Variant(block, family, choice, value, tuple(found)))
            family += 1
    return Problem(groups[0].name, title, groups, tuple(variants))
