"""What is known of an engine's answers: numbers, the scenes that they are measured on, and the suites of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from dembench.engines.base import Division
from dembench.results import Result
from dembench.runs.directory import RunRecord
from dembench.scene import Scene

Kind = Literal["closed form", "publication", "ensemble", "converged run"]
"""Where an expected value comes from; errors of different kinds are never mixed."""

Tier = Literal["default", "long", "statistical"]
"""How long an experiment takes: seconds; up to an hour for all of one engine; up to three hours."""
TIERS: tuple[Tier, ...] = ("default", "long", "statistical")

Sense = Literal["within", "at most", "at least"]


@dataclass(frozen=True)
class Published:
    """The same number on a published page, which is not always right.

    Attributes:
        value: What the page measured.
        expected: What it expected.
        tolerance: What it accepted as a deviation, in the check's unit.
        note: Why the page and the closed form differ, where they do.
    """

    value: float
    expected: float
    tolerance: float
    note: str = ""

    def accepts(self, measured: float) -> bool:
        """Whether a value lies inside the page's own tolerance."""
        return abs(measured - self.expected) <= self.tolerance


@dataclass(frozen=True)
class Check:
    """A number that a right engine reproduces.

    Attributes:
        id: Identifier, unique in its suite.
        title: What is measured.
        unit: SI unit; "1" for a number without one.
        expected: Its exact value, or the bound.
        tolerance: Largest deviation that is accepted, in `unit`.
        source: Where the exact value comes from.
        published: The same number elsewhere, or None.
        sense: Whether the value lies within the tolerance of what is expected, or only at most or at least there.
        kind: Kind of the expected value.
        scene_law: Whether it holds for the contact law of the scene only: it does not apply to an engine that computes
            another law.
        scale: What a relative error of one is, in `unit`, where the expected value is zero or near it; None takes the
            expected value.
    """

    id: str
    title: str
    unit: str
    expected: float
    tolerance: float
    source: str
    published: Published | None = None
    sense: Sense = "within"
    kind: Kind = "closed form"
    scene_law: bool = False
    scale: float | None = None

    def accepts(self, measured: float) -> bool:
        """Whether a value is near enough; what is no number never is."""
        too_low = self.sense != "at most" and not measured >= self.expected - self.tolerance
        too_high = self.sense != "at least" and not measured <= self.expected + self.tolerance
        return measured == measured and not too_low and not too_high

    def range_text(self) -> str:
        """What is accepted, for messages: `0.5 within 0.01`, `at most 0.1`."""
        if self.sense == "within":
            return f"{self.expected:.6g} within {self.tolerance:.2g}"
        sign = 1 if self.sense == "at most" else -1
        return f"{self.sense} {self.expected + sign * self.tolerance:.6g}"


def at_most(id: str, title: str, unit: str, bound: float, source: str, *, tolerance: float = 0.0, **more: Any) -> Check:
    """A check of an upper bound, which may be exceeded by a tolerance; `more` are further fields of `Check`."""
    return Check(id, title, unit, bound, tolerance, source, sense="at most", **more)


def at_least(
    id: str, title: str, unit: str, bound: float, source: str, *, tolerance: float = 0.0, **more: Any
) -> Check:
    """A check of a lower bound, which may be missed by a tolerance; `more` are further fields of `Check`."""
    return Check(id, title, unit, bound, tolerance, source, sense="at least", **more)


def deviation(id: str, title: str, tolerance: float, source: str, scene_law: bool = False, **more: Any) -> Check:
    """A check that a relative deviation, zero where everything is right, is at most `tolerance` [-]."""
    return at_most(id, title, "1", 0.0, source, tolerance=tolerance, scene_law=scene_law, scale=1.0, **more)


@dataclass(frozen=True)
class Trial:
    """One run of an experiment.

    Attributes:
        name: Identifier, unique in its suite; the name of its scene.
        scene: Builds the scene.
        settings: Settings that every engine gets which has a setting of that name, unless another value is typed.
        division: `closed` or `open`.
    """

    name: str
    scene: Callable[[], Scene]
    settings: Mapping[str, str] = field(default_factory=dict)
    division: Division = "closed"


@dataclass(frozen=True)
class Experiment:
    """Scenes with the checks that are made on what came of them.

    Attributes:
        name: Identifier.
        title: One line for tables.
        trials: Its runs.
        measure: Measures complete results by the names of their trials: a value for the id of every check.
        checks: What is known of it.
        tier: How long it takes.
        deaths_count: Whether a run that failed or ran out of time is an answer, too: `measure` finds no result under
            its name then. Otherwise there are no values unless every run came to its end.
    """

    name: str
    title: str
    trials: tuple[Trial, ...]
    measure: Callable[[Mapping[str, Result]], Mapping[str, float]]
    checks: tuple[Check, ...]
    tier: Tier = "default"
    deaths_count: bool = False


def on_one_scene(
    name: str,
    title: str,
    scene: Callable[[], Scene],
    measure: Callable[[Result], Mapping[str, float]],
    checks: tuple[Check, ...],
    tier: Tier = "default",
    settings: Mapping[str, str] | None = None,
) -> Experiment:
    """An experiment of one run, which has its name."""
    trial = Trial(name, scene, settings or {})
    return Experiment(name, title, (trial,), lambda results: measure(results[name]), checks, tier)


@dataclass(frozen=True)
class Suite:
    """Experiments that are reported together.

    Attributes:
        name: Name on the command line.
        title: Heading of its page.
        text: What it is about, a few sentences.
        source: Where its problems come from.
        experiments: The experiments.
        settings: Settings that every engine gets which has a setting of that name, unless another value is typed.
        keep: Keeps what its complete runs say beyond the rows, beside its page in a directory; None for nothing.
    """

    name: str
    title: str
    text: str
    source: str
    experiments: tuple[Experiment, ...]
    settings: Mapping[str, str] = field(default_factory=dict)
    keep: Callable[[Sequence[RunRecord], Path], object] | None = None

    def part(self, tier: Tier | None = None, only: Sequence[str] = ()) -> Suite:
        """The suite with some of its experiments.

        Args:
            tier: The longest tier that is taken; None takes all.
            only: Beginnings of the ids of checks; an experiment is taken where one fits. Empty takes all.
        """
        taken = TIERS if tier is None else TIERS[: TIERS.index(tier) + 1]
        fits = [
            experiment
            for experiment in self.experiments
            if experiment.tier in taken
            and (not only or any(check.id.startswith(tuple(only)) for check in experiment.checks))
        ]
        return replace(self, experiments=tuple(fits))
