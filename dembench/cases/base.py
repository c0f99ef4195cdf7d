"""What a case is: it builds scenes from its parameters, derives quantities from results and holds references."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal, Protocol

import numpy as np

from dembench.cases.published_results import PublishedResult
from dembench.cases.run_times import RunTime, published_run_times
from dembench.cases.views import CaseFigure, Picture
from dembench.initial.filling import Filling
from dembench.initial.progress import Progress
from dembench.scene import Scene
from dembench.scene.base import Model

Preset = Literal["quick", "published"]
Kind = Literal["closed form", "converged run", "ensemble", "publication"]
Worse = Literal["higher", "lower", "either"]
"""Which change of a number from one version to the next is for the worse."""


class CaseError(ValueError):
    """A case, parameter or initial state that cannot be used: names it, its value and what would be accepted."""


@dataclass(frozen=True)
class Quantity:
    """A number derived from the observables of one run.

    Attributes:
        name: Identifier, the same for all engines.
        title: What it is, for tables.
        value: In `unit`.
        unit: SI unit.
        margin: Largest change from one version to the next, or from one engine to another, that does not matter, in
            `unit`; None for a share of the value. What can be zero or near it has one.
        worse: Which change is for the worse: `higher` of what a right run does not have at all.
    """

    name: str
    title: str
    value: float
    unit: str
    margin: float | None = None
    worse: Worse = "either"


@dataclass(frozen=True)
class Reference:
    """What a quantity should be, with its uncertainty and source.

    Attributes:
        quantity: Name of the quantity.
        value: Reference value; None for a pure bound.
        low, high: Accepted range; None where that side is open. Both None: the spread is unknown, nothing is judged.
        unit: SI unit of all three.
        source: Where it comes from and what the range means.
        kind: Kind of the reference; errors of different kinds are never mixed.
        necessary: A condition that every correct run meets, so that missing it makes a run inaccurate and meeting it
            proves nothing.
    """

    quantity: str
    value: float | None
    low: float | None
    high: float | None
    unit: str
    source: str
    kind: Kind
    necessary: bool = False


@dataclass(frozen=True)
class Ratio:
    """A quantity of one variant of a case over the same quantity of another, for the same engine, setting and seed.

    Attributes:
        title: What it is, for tables.
        quantity: Name of the quantity.
        over, under: Parameters of the two variants in which they differ; all others are the same.
        value, low, high: Reference and accepted range.
        source: Where it comes from and what the range means.
    """

    title: str
    quantity: str
    over: Mapping[str, Any]
    under: Mapping[str, Any]
    value: float
    low: float
    high: float
    source: str


@dataclass(frozen=True)
class Statistics:
    """What of a chaotic case is compared between ensembles of seeds.

    Attributes:
        curve: Observable whose curve is compared, with its component as in `zones.left`; empty for none.
        cycles: Whether the curve swings, so that period, phase, amplitude and decay are compared, too.
        numbers: Quantities that are compared, with what they are: `rate`, `depth`, `period` or `amplitude`.
    """

    curve: str = ""
    cycles: bool = False
    numbers: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Curve:
    """Points known of an observable, for figures.

    Attributes:
        observable: Name of the observable.
        label: Text for the legend.
        time: Times [s], shape (t,).
        value: Values in the observable's unit, shape (t,).
        low, high: Range at each time, shape (t,), or None.
        source: Where the points come from.
        component: Component of the observable that they belong to; empty where it has none.
        points: Single points, not a line through them.
    """

    observable: str
    label: str
    time: np.ndarray
    value: np.ndarray
    low: np.ndarray | None
    high: np.ndarray | None
    source: str
    component: str = ""
    points: bool = False


class Series(Protocol):
    """A recorded observable: times [s], shape (t,), and values, shape (t, ...)."""

    @property
    def time(self) -> np.ndarray: ...

    @property
    def value(self) -> np.ndarray: ...


class Recorded(Protocol):
    """What a case needs of a result: its observables and snapshots by name."""

    @property
    def observables(self) -> Mapping[str, Any]: ...

    @property
    def snapshots(self) -> Mapping[str, Any]: ...


class Case(ABC):
    """A named problem.

    Class attributes:
        name: Name on the command line.
        title: One line for tables.
        source: Citation.
        parameters: Model of the parameters, all with defaults.
        presets: Presets that the case has.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    source: ClassVar[str]
    parameters: ClassVar[type[Model]]
    presets: ClassVar[tuple[Preset, ...]] = ("quick", "published")

    def check(self, parameters: Any, preset: Preset, initial: Path | None = None) -> None:
        """Whether the parameters, the preset and a given initial state fit together, without building anything.

        A case that asks for more than a preset that it has adds to this.

        Raises:
            CaseError: They do not; the message says what would be accepted.
        """
        if preset not in self.presets:
            raise CaseError(f"{self.name} has no preset '{preset}'; accepted are {', '.join(self.presets)}")

    @abstractmethod
    def scene(
        self,
        parameters: Any,
        preset: Preset,
        initial: Path | None = None,
        seed: int = 0,
        progress: Progress | None = None,
    ) -> Scene:
        """The scene of a variant.

        Args:
            parameters: An instance of `self.parameters`.
            preset: One of `self.presets`.
            initial: File or directory with the published initial state; None generates one.
            seed: Seed of whatever is random in the initial state.
            progress: Called while an initial state is generated.

        Raises:
            CaseError: See `check`.
        """

    def filling(self, parameters: Any, preset: Preset) -> Filling | None:
        """How the initial state is made where none is given; None where the case has none that is filled."""
        return None

    def bed_name(self, parameters: Any) -> str:
        """Name of the file with the bed of the quick preset."""
        return self.name

    def softening(self, parameters: Any, preset: Preset) -> str:
        """How the materials of a variant are softer than the published ones; empty where they are not."""
        return ""

    def ratios(self) -> tuple[Ratio, ...]:
        """Ratios between variants that are compared with a reference."""
        return ()

    @abstractmethod
    def quantities(self, scene: Scene, result: Recorded) -> list[Quantity]:
        """The quantities that the record of a run covers; those it ends too early for are left out."""

    @abstractmethod
    def references(self, scene: Scene, parameters: Any, preset: Preset) -> list[Reference]:
        """The references that hold for this scene."""

    @abstractmethod
    def reference_curves(self, scene: Scene, parameters: Any, preset: Preset) -> list[Curve]:
        """Points known from publications and closed forms that hold for this scene, for figures."""

    def statistics(self) -> Statistics:
        """What is compared between ensembles of seeds."""
        return Statistics()

    def run_times(self, parameters: Any, preset: Preset) -> list[RunTime]:
        """Run times that others have published of this case with these parameters; none of a preset of our own."""
        return published_run_times(self.name, parameters) if preset == "published" else []

    def figures(self, scene: Scene) -> list[CaseFigure]:
        """Figures that a page shows beside the time series of a scene of this case."""
        return []

    def pictures(self, scene: Scene) -> list[Picture]:
        """Pictures of the particles that a page shows of a scene of this case."""
        return []

    def published_results(self, parameters: Any, preset: Preset) -> list[PublishedResult]:
        """Results of single codes that were published for this variant, for a table beside the quantities."""
        return []
