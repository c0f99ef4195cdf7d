"""From a suite and engines to runs, and from runs to rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dembench.engines import registry
from dembench.results import Result
from dembench.runs.directory import RunRecord
from dembench.runs.plan import EngineChoice, PlannedRun, SceneChoice, plan
from dembench.runs.states import Verdict
from dembench.runs.supervise import Judge
from dembench.verification.checks import Row, Suite, measured, rows_of


def planned(
    suite: Suite, engines: Sequence[EngineChoice], out: Path, *, timeout: float | None = None
) -> list[PlannedRun]:
    """One run of every engine on every scene of a suite, long scenes first.

    Args:
        suite: The suite.
        engines: Engines with the settings that were typed; the suite's are added where an engine knows them.
        out: Directory of the run directories.
        timeout: Time limit of each run [s].

    Raises:
        RequestError, SettingsError: See `dembench.runs.plan.plan`.
    """
    scenes = [experiment.scene() for experiment in suite.experiments]
    scenes.sort(key=lambda scene: len(scene.bodies) * scene.duration, reverse=True)
    chosen = [SceneChoice(case=scene.name, preset=None, seed=0, scene=scene) for scene in scenes]
    return plan(chosen, [_with_settings(suite, choice) for choice in engines], out, timeout=timeout)


def rows(suite: Suite, runs: Sequence[PlannedRun]) -> list[Row]:
    """The rows of a suite from the directories of its runs, in the order of the checks, then of the engines."""
    experiments = {experiment.name: experiment for experiment in suite.experiments}
    found = [row for run in runs for row in rows_of(experiments[run.spec.case], run.spec.label(), record(run))]
    return sorted(found, key=lambda row: row.check.id)


def record(run: PlannedRun) -> RunRecord | None:
    """What is recorded of a run; None where it was never started."""
    return RunRecord(run.directory.path) if run.directory.status() is not None else None


def all_right(found: Sequence[Row]) -> bool:
    """Whether a value was measured and every row that was not skipped is ok."""
    judged = [row for row in found if row.status != "skipped"]
    return bool(judged) and all(row.status == "ok" for row in judged)


def judge(suites: Sequence[Suite]) -> Judge:
    """A judge for runs of these suites: inaccurate where a check is missed."""
    experiments = {e.name: e for suite in suites for e in suite.experiments}

    def verdict(run: PlannedRun, result: Result) -> Verdict:
        missed = [
            f"{check.id} {value:.6g} is not {check.expected:.6g} within {check.tolerance:.2g}"
            for check, value in measured(experiments[run.spec.case], result)
            if not check.accepts(value)
        ]
        return Verdict(state="inaccurate" if missed else "ok", scored=True, detail="; ".join(missed))

    return verdict


def _with_settings(suite: Suite, choice: EngineChoice) -> EngineChoice:
    known = registry.engine(choice.engine).settings_type.model_fields
    own = {key: value for key, value in suite.settings.items() if key in known}
    return EngineChoice(choice.engine, choice.overrides, given=own)
