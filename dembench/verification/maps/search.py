"""Bisection of the largest stable step, shared by all cells of a rig: one run probes each of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from dembench.engines import registry
from dembench.runs.directory import RunRecord
from dembench.runs.plan import EngineChoice, PlannedRun
from dembench.verification.maps.breaking import Outcome, of_run
from dembench.verification.maps.rigs import Family, Rig
from dembench.verification.rows import MEASURED

LOW, HIGH = 1 / 16, 4.0
"""Range of the search, in theoretical bounds."""
FIRST = (HIGH, 0.5)
"""Steps that are probed first: the end of the range for engines that never break, half the bound for their errors."""
RATIO = 1.15
"""Ratio of the smallest step that breaks to the largest one that does not at which a search ends."""
BEYOND_GUARD = "allow_unstable"
"""Setting with which engines that have it run beyond their own guard."""


@dataclass
class Search:
    """The search for one engine on one rig.

    Attributes:
        choice: The engine as typed.
        family: The map.
        rig: The scene with its cells.
        guards: The rig about which it asks where the engine's own guard lies, the setting that exceeds it left alone;
            None for a search for what is stable.
        found: Outcome of every cell by the number of steps in a sampling interval.
        runs: Names of the run directories, likewise.
        details: Why a whole run came to no end, likewise.
        law: Contact law that the engine computes; empty where it is the scene's.
        trouble: Why it cannot go on; empty where it can.
    """

    choice: EngineChoice
    family: Family
    rig: Rig
    guards: Rig | None = None
    found: dict[int, list[Outcome]] = field(default_factory=dict)
    runs: dict[int, str] = field(default_factory=dict)
    details: dict[int, str] = field(default_factory=dict)
    law: str = ""
    trouble: str = ""

    @property
    def variant(self) -> str:
        """The engine as typed."""
        typed = ",".join(f"{key}={text}" for key, text in self.choice.overrides.items())
        return f"{self.choice.engine}[{typed}]" if typed else self.choice.engine

    def step(self, count: int) -> float:
        """The step with so many in a sampling interval [s]."""
        return self.rig.scene.sampling_interval() / count

    def factor(self, count: int) -> float:
        """The same over the theoretical bound [-]."""
        return self.step(count) / self.rig.bound

    def count(self, factor: float) -> int:
        """The number of steps nearest to a factor."""
        return max(1, round(self.rig.scene.sampling_interval() / (factor * self.rig.bound)))

    def engine(self, count: int) -> EngineChoice:
        """The engine with that step."""
        given = {}
        if self.guards is None and BEYOND_GUARD in registry.engine(self.choice.engine).settings_type.model_fields:
            given[BEYOND_GUARD] = "true"
        return EngineChoice(self.choice.engine, {**self.choice.overrides, "dt": f"{self.step(count):.12g}"}, given)

    def next(self) -> int | None:
        """The step to probe next, as a number of steps; None where every cell is known well enough."""
        if self.trouble:
            return None
        for factor in FIRST[:1] if self.guards else FIRST:
            if (count := self.count(factor)) not in self.found:
                return count
        widest = max((self._open(k) for k in range(len(self.rig.cells))), default=None)
        return None if widest is None or widest[0] <= 1 else widest[1]

    def _open(self, cell: int) -> tuple[float, int]:
        """Width of the bracket of a cell over what is asked for, and the step in its middle; 0 where it is closed."""
        broken = [count for count, outcomes in self.found.items() if self.is_broken(outcomes[cell])]
        if not broken:
            return 0.0, 0
        high = max(broken)
        fine = [count for count in self.found if count > high]
        low = min(fine) if fine else self.count(LOW)
        middle = round(math.sqrt(low * high))
        if middle in (low, high) or low <= high:
            return 0.0, 0
        return math.log(low / high) / math.log(RATIO), middle

    def is_broken(self, outcome: Outcome) -> bool:
        """Whether a step is too large: of a guard only where the engine refuses it."""
        return outcome.kind == "refused" if self.guards else outcome.kind != "stable"

    def take(self, count: int, run: PlannedRun) -> None:
        """Takes what came of a run."""
        record = RunRecord(run.directory.path)
        self.runs[count], self.law = record.name, record.spec.law
        if record.status.state in MEASURED and record.result is not None:
            self.found[count] = [self.rig.judge(record.result, cell) for cell in self.rig.cells]
        elif (kind := of_run(record)) is not None:
            self.found[count] = [Outcome(kind)] * len(self.rig.cells)
            self.details[count] = record.status.detail
        else:
            self.trouble = "; ".join(t for t in (record.status.state, record.status.reason, record.status.detail) if t)


def searches(families: Sequence[Family], axes: Sequence[str], engines: Sequence[EngineChoice]) -> list[Search]:
    """The searches of a command, those for guards last.

    Args:
        families: The maps.
        axes: Axes that are varied.
        engines: Engines as typed.
    """
    found, guards = [], []
    for family in families:
        rigs = family.rigs(family.values(axes))
        for choice in engines:
            found += [Search(choice, family, rig) for rig in rigs]
            if BEYOND_GUARD in registry.engine(choice.engine).settings_type.model_fields:
                guards += [Search(choice, family, family.guard_rig(rig), guards=rig) for rig in rigs]
    return found + guards
