"""The runs of a sweep, in the order in which they tell most for their time."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dembench.runs.directory import RunRecord
from dembench.runs.plan import EngineChoice, PlannedRun, plan
from dembench.verification.precision import knobs
from dembench.verification.precision.knobs import Value
from dembench.verification.precision.targets import SHIFTED, Target


@dataclass
class Group:
    """The runs of one point: one engine with one value of the knob, over seeds or trials and repeats.

    Attributes:
        choice: The engine as typed, without the knob.
        value: The value.
        runs: Its runs.
        shifted: Runs of the companion that tells when paths diverge.
    """

    choice: EngineChoice
    value: Value
    runs: list[PlannedRun] = field(default_factory=list)
    shifted: list[PlannedRun] = field(default_factory=list)

    @property
    def variant(self) -> str:
        """The engine as typed, without the knob."""
        typed = ",".join(f"{key}={text}" for key, text in self.choice.overrides.items())
        return f"{self.choice.engine}[{typed}]" if typed else self.choice.engine

    def records(self) -> list[RunRecord]:
        """What is recorded of its runs; those that were never started are left out."""
        return [RunRecord(run.directory.path) for run in self.runs if run.directory.status() is not None]


def groups(
    target: Target,
    engines: Sequence[EngineChoice],
    knob: str,
    taken: dict[int, list[Value]],
    out: Path,
    *,
    own_step: bool = False,
    repeats: int = 1,
    timeout: float | None = None,
) -> list[Group]:
    """The points of a sweep with their runs; values that a scene's sampling makes equal are one point.

    Args:
        target: What it is about.
        engines: Engines as typed.
        knob: Name of the setting.
        taken: Values for each engine; see `dembench.verification.precision.knobs.values`.
        out: Directory of the run directories.
        own_step: Whether the time step that an engine takes by itself is a point, too.
        repeats: Timing samples of each run.
        timeout: Time limit of each run [s].

    Raises:
        RequestError, SettingsError: See `dembench.runs.plan.plan`.
    """
    found: list[Group] = []
    known: dict[tuple[str, ...], Group] = {}
    first = target.scenes[0]
    for k, choice in enumerate(engines):
        own = taken[k]
        if own_step:
            own = knobs.with_own_step(own, choice, first.scene, target.given.get(first.case, {}))
        for value in own:
            group = Group(choice, value)
            for scene in target.scenes:
                companion = target.kind == "path" and scene.seed == SHIFTED
                if companion and value is not own[-1]:
                    continue
                one = knobs.chosen(choice, knob, value, scene.scene, target.given.get(scene.case, {}))
                division = target.divisions.get(scene.case, "closed")
                times = 1 if companion else repeats
                made = plan([scene], [one], out, division=division, repeats=times, timeout=timeout)
                (group.shifted if companion else group.runs).extend(made)
            same = known.setdefault(tuple(run.spec.name() for run in group.runs), group)
            if same is group:
                found.append(group)
            same.shifted = same.shifted or group.shifted
    return found


def in_order(found: Sequence[Group]) -> list[PlannedRun]:
    """All runs: the ends of the range first, then its middle, then what lies between; cheap ones first within each.

    Timing samples after the first come last: an error is worth more than a second measurement of its cost.
    """
    turn = {id(g): _turn(g.value.rank, _last(found, g)) for g in found}
    everything = [(turn[id(g)], run) for g in found for run in (*g.runs, *g.shifted)]

    def key(entry: tuple[int, PlannedRun]) -> tuple[int, int, float, int]:
        turn, run = entry
        return (min(run.spec.repeat, 2), turn, run.spec.estimate or 0.0, run.spec.repeat)

    return [run for _, run in sorted(everything, key=key)]


def _last(found: Sequence[Group], group: Group) -> int:
    return max(g.value.rank for g in found if g.choice == group.choice)


def _turn(rank: int, last: int) -> int:
    """In which turn a rank from 0 to `last` is run: 0 the ends, 1 the middle, 2 the quarters, ..."""
    ends, turn = [0, last], 0
    while rank not in ends:
        ends = sorted({*ends, *((a + b) // 2 for a, b in itertools.pairwise(ends))})
        turn += 1
    return turn
