"""The runs of a report, each with its result, scores and look."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from dembench.cases.base import Case, CaseError, Curve
from dembench.cases.published_results import PublishedResult
from dembench.cases.registry import parse_case, softening
from dembench.cases.run_times import RunTime
from dembench.cases.views import CaseFigure, Picture
from dembench.reports.looks import look
from dembench.results import Observed
from dembench.runs.directory import RunRecord
from dembench.scene import Scene
from dembench.scoring.score import Score, score, verdict

RANKED = ("ok", "unscored")
"""States whose timings are compared: accuracy comes before speed."""


class Entry:
    """One run as a report shows it."""

    def __init__(self, record: RunRecord) -> None:
        """The run of a record; its scores are computed anew."""
        self.record = record
        self.name = record.name
        self.spec = record.spec
        self.status = record.status
        self.look = look(record.spec.engine)

    @cached_property
    def problem(self) -> tuple[Case, Any] | None:
        """The case and its parameters; None for a scene file or a case that is not known here."""
        if self.spec.preset is None:
            return None
        try:
            return parse_case(self.spec.case)
        except CaseError:
            return None

    @cached_property
    def scene(self) -> Scene | None:
        """The scene; None where no result was written."""
        return self.record.result.scene if self.record.result else None

    @cached_property
    def observables(self) -> dict[str, Observed]:
        """Time series that have at least one sample."""
        found = self.record.result.observables if self.record.result else {}
        return {name: series for name, series in found.items() if len(series.time)}

    @cached_property
    def scores(self) -> list[Score]:
        """Quantities with their references; empty without a case or a result."""
        if self.problem is None or self.record.result is None:
            return []
        case, parameters = self.problem
        return score(case, self.record.result.scene, self.record.result, parameters, self.spec.preset)  # type: ignore[arg-type]

    @cached_property
    def curves(self) -> list[Curve]:
        """Points known of the observables; empty without a case or a scene."""
        if self.problem is None or self.scene is None:
            return []
        case, parameters = self.problem
        return case.reference_curves(self.scene, parameters, self.spec.preset)  # type: ignore[arg-type]

    @cached_property
    def figures(self) -> list[CaseFigure]:
        """Figures that the case asks for; empty without a case or a scene."""
        return self.problem[0].figures(self.scene) if self.problem and self.scene else []

    @property
    def pictures(self) -> list[Picture]:
        """Pictures that the case asks for; empty without a case or a scene."""
        return self.problem[0].pictures(self.scene) if self.problem and self.scene else []

    @property
    def softening(self) -> str:
        """How the materials are softer than the published ones; empty where they are not."""
        return softening(self.spec.case, self.spec.preset)

    def quantity(self, name: str) -> float | None:
        """A quantity of the case; None where the record does not cover it."""
        return next((s.quantity.value for s in self.scores if s.quantity.name == name), None)

    @property
    def published_results(self) -> list[PublishedResult]:
        """Published results of single codes for the case; empty without one."""
        if self.problem is None:
            return []
        case, parameters = self.problem
        return case.published_results(parameters, self.spec.preset)  # type: ignore[arg-type]

    @property
    def run_times(self) -> list[RunTime]:
        """Published run times of the case; empty without one."""
        if self.problem is None:
            return []
        case, parameters = self.problem
        return case.run_times(parameters, self.spec.preset)  # type: ignore[arg-type]

    @cached_property
    def state(self) -> str:
        """The run state; what ran to its end is `ok`, `inaccurate` or `unscored` by its scores.

        Where the case is not known here the recorded verdict stands; without a readable result nothing is ok.
        """
        if self.status.state not in ("ok", "inaccurate"):
            return self.status.state
        if self.record.result is None:
            return "failed"
        if self.problem is None:
            return "unscored" if self.status.state == "ok" and not self.status.scored else self.status.state
        return verdict(self.scores)

    @property
    def timing(self) -> dict[str, Any]:
        """Wall times of the parts of the run [s]."""
        return self.record.result.timing if self.record.result else {}

    @property
    def resources(self) -> dict[str, Any]:
        """Wall time, CPU time and peak memory of the process tree."""
        return self.record.result.resources if self.record.result else {}

    @property
    def counters(self) -> dict[str, float]:
        """The engine's own figures."""
        return self.record.result.counters if self.record.result else {}

    @property
    def steps(self) -> int | None:
        """Number of the last step on record; None without a record."""
        return max((int(o.step[-1]) for o in self.observables.values()), default=None)

    @property
    def reached(self) -> float:
        """Simulated time on record [s]."""
        return max((float(o.time[-1]) for o in self.observables.values()), default=self.status.time)

    @property
    def complete(self) -> bool:
        """Whether the record reaches the end of the scene."""
        return self.reached >= self.spec.duration * (1 - 1e-6)

    @property
    def dt(self) -> float | None:
        """Time step [s]; None where the settings have none."""
        try:
            return float(self.spec.settings["dt"])
        except (KeyError, TypeError, ValueError):
            return None

    @property
    def own_step(self) -> bool:
        """Whether a run of the closed division has another time step than the division's."""
        if self.spec.division != "closed" or self.scene is None or self.dt is None:
            return False
        return not math.isclose(self.dt, self.scene.closed_step(), rel_tol=1e-6)

    @property
    def of_division(self) -> bool:
        """Whether law and time step are those of its division; the open one takes any."""
        return self.spec.division != "closed" or not (self.own_step or self.spec.law)

    @property
    def loop(self) -> float | None:
        """Time of the stepping loop [s]; None where it is not known."""
        found = self.timing.get("loop")
        return float(found) if found is not None else None


def common_times(first: Observed, second: Observed) -> tuple[np.ndarray, np.ndarray]:
    """Rows of two series at the times that both have, as index arrays."""
    _, a, b = np.intersect1d(np.round(first.time, 9), np.round(second.time, 9), return_indices=True)
    return a, b
