"""What has been verified, from run directories: features of scenes by suite or case and engine, with the references."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py

from dembench.engines import registry
from dembench.reports.looks import look
from dembench.reports.pages import write_page
from dembench.reports.tables import Cell, Column, Table
from dembench.results.read import read_scene
from dembench.runs.directory import RunRecord
from dembench.scene import SceneError, features
from dembench.verification import suites
from dembench.verification.checks import Suite
from dembench.verification.rows import UNJUDGED, rows_of

INDEX = "index.html"
ANY = "none of these"
"""Name of the feature of scenes that have none."""


@dataclass(frozen=True)
class Verified:
    """One check of one engine.

    Attributes:
        problem: Name of the suite or the case.
        engine: The engine with its settings as typed.
        kind: Kind of the reference.
        status: State of the row, or of the run of a case.
        features: Names of the features of its scenes; empty where no engine made a result of them.
    """

    problem: str
    engine: str
    kind: str
    status: str
    features: frozenset[str]

    @property
    def judged(self) -> bool:
        """Whether it says anything about the engine."""
        return self.status not in UNJUDGED


def verified(runs: Sequence[RunRecord]) -> list[Verified]:
    """All checks of the suites and cases that were run; of a run that was repeated the last one counts."""
    latest: dict[tuple[str, str], RunRecord] = {}
    for run in sorted(runs, key=lambda run: run.status.started):
        latest[run.spec.label(), run.spec.case] = run
    known = _features(runs)
    found = [check for name in suites.names() for check in _of_suite(suites.suite(name), latest, known)]
    for run in runs:
        if run.spec.preset is not None:
            own = known.get(run.spec.scene_digest, frozenset())
            found.append(Verified(run.spec.case, run.spec.label(), "publication", run.status.state, own))
    return found


def render(runs: Sequence[RunRecord], output: Path) -> Path:
    """Writes the index of what has been verified, with links to the pages of the suites beside it.

    Args:
        runs: Runs of suites and cases in any state.
        output: Path of the file.

    Returns:
        The path of the file.
    """
    found = verified(runs)
    problems = list(dict.fromkeys(check.problem for check in found))
    known = registry.names()
    engines = sorted({check.engine for check in found}, key=lambda label: (_place(label, known), label))
    titles = {name: suites.suite(name).title for name in problems if name in suites.names()}
    pages = [(t, f"{name}.html") for name, t in titles.items() if output.with_name(f"{name}.html").exists()]
    names = ",".join(name for name in problems if name in titles)
    return write_page(
        "matrix.html.j2",
        output,
        {look(engine.partition("[")[0]).colour for engine in engines},
        [],
        title="What has been verified",
        summary=" ".join(_summary(engine, found) for engine in engines),
        verdicts=_verdicts(found, problems, engines, titles),
        matrix=_matrix(found, problems, engines),
        pages=pages,
        command=shlex.join(["dembench", "verify", "--suite", names, "--engines", ",".join(engines)]) if names else "",
    )


def _of_suite(
    suite: Suite, latest: dict[tuple[str, str], RunRecord], known: dict[str, frozenset[str]]
) -> list[Verified]:
    found = []
    for engine in dict.fromkeys(engine for engine, _ in latest):
        for experiment in suite.experiments:
            own = {trial.name: latest.get((engine, trial.name)) for trial in experiment.trials}
            if not any(own.values()):
                continue
            digests = [run.spec.scene_digest for run in own.values() if run is not None]
            has = frozenset[str]().union(*(known.get(digest, frozenset()) for digest in digests))
            for row in rows_of(experiment, engine, own):
                found.append(Verified(suite.name, engine, row.check.kind, row.status, has))
    return found


def _features(runs: Sequence[RunRecord]) -> dict[str, frozenset[str]]:
    """Names of the features of every scene of which there is a result, by its digest."""
    found: dict[str, frozenset[str]] = {}
    for run in runs:
        if run.spec.scene_digest in found:
            continue
        try:
            with h5py.File(run.directory / "result.h5", "r") as file:
                found[run.spec.scene_digest] = frozenset(features(read_scene(file)).names() or [ANY])
        except (OSError, KeyError, ValueError, SceneError):
            continue  # another engine's run may have one
    return found


def _summary(engine: str, found: Sequence[Verified]) -> str:
    own = [check for check in found if check.engine == engine and check.judged]
    return f"{engine}: {sum(check.status == 'ok' for check in own)} of {len(own)} checks that it can do are met."


def _verdicts(
    found: Sequence[Verified], problems: Sequence[str], engines: Sequence[str], titles: dict[str, str]
) -> Table:
    columns = (Column("Suite or case", kind="wrap"), Column("Reference", kind="wrap"), *map(_column, engines))
    rows = []
    for problem in problems:
        own = [check for check in found if check.problem == problem]
        name = Cell(titles.get(problem, problem), detail=problem if problem in titles else "")
        rows.append((name, _kinds(own), *_cells(own, engines)))
    return Table("suites", "Verdict by suite and case", columns, tuple(rows), note=_NOTE)


def _matrix(found: Sequence[Verified], problems: Sequence[str], engines: Sequence[str]) -> Table:
    columns = (
        Column("Feature"),
        Column("Suite or case", kind="wrap"),
        Column("Reference", kind="wrap"),
        *map(_column, engines),
    )
    rows = []
    for feature in sorted({name for check in found for name in check.features}):
        for problem in problems:
            own = [check for check in found if check.problem == problem and feature in check.features]
            if own:
                rows.append((Cell(feature.replace("_", " ")), Cell(problem), _kinds(own), *_cells(own, engines)))
    return Table("matrix", "Verification matrix", columns, tuple(rows), note=_NOTE)


_NOTE = (
    "Checks that are met of those that say something about the engine. “cannot”: the engine refuses every such scene; "
    "“another law”: none applies to the law that it computes; a dash: not run."
)


def _place(label: str, known: Sequence[str]) -> int:
    name = label.partition("[")[0]
    return known.index(name) if name in known else len(known)


def _column(engine: str) -> Column:
    return Column(engine, kind="number")


def _kinds(own: Sequence[Verified]) -> Cell:
    return Cell(", ".join(dict.fromkeys(check.kind for check in own)))


def _cells(own: Sequence[Verified], engines: Sequence[str]) -> list[Cell]:
    return [_cell([check for check in own if check.engine == engine]) for engine in engines]


def _cell(own: Sequence[Verified]) -> Cell:
    judged = [check for check in own if check.judged]
    if not own:
        return Cell()
    if not judged:
        refused = all(check.status == "skipped" for check in own)
        return Cell("cannot" if refused else "another law", 0.0)
    met = sum(check.status == "ok" for check in judged)
    return Cell(f"{met} of {len(judged)}", met / len(judged), mark="within" if met == len(judged) else "outside")
