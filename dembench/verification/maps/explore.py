"""Carrying out searches: round by round, one run of each search that still goes on."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from dembench import campaign
from dembench.runs.plan import PlannedRun, SceneChoice, plan
from dembench.runs.scheduler import Job
from dembench.verification.maps.search import Search

ANSWERS = ("ok", "inaccurate", "skipped", "failed", "timeout")
"""States of runs that are answers: an engine that died at a step dies there again."""


def explore(
    searches: Sequence[Search],
    out: Path,
    *,
    budget: float,
    timeout: float | None,
    at_once: int,
    fresh: bool,
    show: Callable[[list[Job]], None],
) -> bool:
    """Carries out searches until all are done or the budget is spent; what was found is in them.

    Args:
        searches: The searches.
        out: Directory of the run directories.
        budget: Time after which no other run is started [s].
        timeout: Time limit of each run [s].
        at_once: Largest number of runs at a time.
        fresh: Whether runs that have ended are run again.
        show: Called with the jobs of a round.

    Returns:
        Whether all searches are done.

    Raises:
        RequestError, SettingsError: See `dembench.runs.plan.plan`.
    """
    end = time.monotonic() + budget
    while True:
        asked = [(search, count) for search in searches if (count := search.next()) is not None]
        if not asked:
            return True
        runs = [(search, count, _planned(search, count, out, timeout)) for search, count in asked]
        todo = {run.directory.path: run for _, _, run in runs if fresh or not _answered(run)}
        left = end - time.monotonic()
        if todo and left > 0:
            jobs = campaign.carry_out(list(todo.values()), at_once=at_once, fresh=fresh, budget=left, show=show)
            if any(job.status is not None and job.status.state == "interrupted" for job in jobs):
                return False
        known = [one for one in runs if one[2].directory.status() is not None]
        for search, count, run in known:
            search.take(count, run)
        if len(known) < len(runs):
            return False


def _planned(search: Search, count: int, out: Path, timeout: float | None) -> PlannedRun:
    chosen = SceneChoice(case=search.rig.name, preset=None, seed=0, scene=search.rig.scene)
    return plan([chosen], [search.engine(count)], out, timeout=timeout)[0]


def _answered(run: PlannedRun) -> bool:
    return run.before is not None and run.before.state in ANSWERS
