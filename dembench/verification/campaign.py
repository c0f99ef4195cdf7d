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
from dembench.verification.checks import Suite, Trial
from dembench.verification.rows import Row, measured, rows_of


def planned(
    suite: Suite, engines: Sequence[EngineChoice], out: Path, *, timeout: float | None = None
) -> list[PlannedRun]:
    """One run of every engine on every trial of a suite, long scenes first.

    Args:
        suite: The suite.
        engines: Engines with the settings that were typed; those of suite and trial are added where an engine knows
            them.
        out: Directory of the run directories.
        timeout: Time limit of each run [s].

    Raises:
        RequestError, SettingsError: See `dembench.runs.plan.plan`.
    """
    runs = []
    for trial in (trial for experiment in suite.experiments for trial in experiment.trials):
        chosen = SceneChoice(case=trial.name, preset=None, seed=0, scene=trial.scene())
        given = [_with_settings(suite, trial, choice) for choice in engines]
        runs += plan([chosen], given, out, division=trial.division, timeout=timeout)
    return sorted(runs, key=lambda run: run.spec.bodies * run.spec.duration / run.settings.dt, reverse=True)


def rows(suite: Suite, runs: Sequence[PlannedRun]) -> list[Row]:
    """The rows of a suite from the directories of its runs, in the order of the checks, then of the engines."""
    by_engine: dict[str, dict[str, RunRecord | None]] = {}
    for run in runs:
        by_engine.setdefault(run.spec.label(), {})[run.spec.case] = record(run)
    found = []
    for engine, records in by_engine.items():
        for experiment in suite.experiments:
            own = {trial.name: records.get(trial.name) for trial in experiment.trials}
            found += rows_of(experiment, engine, own)
    return sorted(found, key=lambda row: row.check.id)


def record(run: PlannedRun) -> RunRecord | None:
    """What is recorded of a run; None where it was never started."""
    return RunRecord(run.directory.path) if run.directory.status() is not None else None


def judge(suites: Sequence[Suite]) -> Judge:
    """A judge for runs of these suites: inaccurate where a check of an experiment of one run is missed.

    What is measured on several runs is no property of any one of them.
    """
    alone = {e.trials[0].name: e for suite in suites for e in suite.experiments if len(e.trials) == 1}

    def verdict(run: PlannedRun, result: Result) -> Verdict:
        experiment = alone.get(run.spec.case)
        if experiment is None:
            return Verdict()
        found, _ = measured(experiment, {run.spec.case: result})
        applicable = [check for check in experiment.checks if not (check.scene_law and run.spec.law)]
        missed = [
            f"{check.id} {found[check.id]:.6g} is not {check.range_text()}"
            for check in applicable
            if not check.accepts(found[check.id])
        ]
        state = "inaccurate" if missed else "ok"
        return Verdict(state=state, scored=bool(applicable), detail="; ".join(missed))

    return verdict


def _with_settings(suite: Suite, trial: Trial, choice: EngineChoice) -> EngineChoice:
    known = registry.engine(choice.engine).settings_type.model_fields
    own = {key: value for key, value in {**suite.settings, **trial.settings}.items() if key in known}
    return EngineChoice(choice.engine, choice.overrides, given=own)
