"""What the words of a command stand for: cases and scene files, or a recipe; and the page at its end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dembench import console, recipes
from dembench.campaign import Request
from dembench.cli.results import write_report
from dembench.recipes import Block, Recipe
from dembench.runs.directory import RunRecord
from dembench.runs.plan import PlannedRun, split_list
from dembench.runs.supervise import command_line

if TYPE_CHECKING:
    from dembench.reports.sensitivity import Finding


@dataclass(frozen=True)
class Asked:
    """What was asked for.

    Attributes:
        requests: One for cases and scene files, one for each block of a recipe.
        out: Directory of the runs.
        recipe: The recipe; None for none.
        name: Its name, which its page has, too.
        blocks: The blocks of the recipe that the requests are of.
    """

    requests: tuple[Request, ...]
    out: Path
    recipe: Recipe | None = None
    name: str = ""
    blocks: tuple[Block, ...] = ()

    @property
    def accepted(self) -> tuple[str, ...]:
        """States of runs that are no failure: what is inaccurate in a recipe is a finding."""
        return ("ok", "inaccurate") if self.recipe else ("ok",)


@dataclass(frozen=True)
class Conclusion:
    """What the runs came to.

    Attributes:
        page: The page; None where none was asked for or it could not be written.
        findings: What was found of quantities that must vary; None where the recipe studies no parameter.
        ok: Whether the page is there as asked for and every quantity varies that must.
    """

    page: Path | None
    findings: list[Finding] | None = None
    ok: bool = True


def asked(what: Sequence[str], engines: str | None, out: Path, options: Mapping[str, Any]) -> Asked:
    """What the words and options of a command stand for; see `dembench.recipes` for errors."""
    file = recipes.asked_for(what)
    if file is None:
        return Asked((Request(what=tuple(what), engines=engines, out=out, **options),), out)
    recipe = recipes.load(file)
    pairs = recipe.requests(out, split_list(engines) if engines else None, **options)
    return Asked(tuple(r for _, r in pairs), out, recipe, file.stem, tuple(b for b, _ in pairs))


def conclude(asked: Asked, planned: Sequence[Sequence[PlannedRun]], report: bool) -> Conclusion:
    """Judges what must vary and writes the page; what the runs produced is safe whatever happens here.

    Args:
        asked: What was asked for.
        planned: The runs of each of its requests.
        report: Whether a page is wanted.
    """
    if asked.recipe is None:
        page = write_report(asked.out, asked.out / "report.html") if report else None
        return Conclusion(page, ok=page is not None or not report)
    try:
        return _conclude(asked, asked.recipe, planned, report)
    except Exception as error:
        console.error(f"the page could not be written: {type(error).__name__}: {error}")
        return Conclusion(None, ok=False)


def _conclude(asked: Asked, recipe: Recipe, planned: Sequence[Sequence[PlannedRun]], report: bool) -> Conclusion:
    from dembench.reports import report as common
    from dembench.reports import sensitivity, study
    from dembench.reports.variants import problems

    records = [[RunRecord(r.directory.path) for r in runs if r.directory.status() is not None] for runs in planned]
    output = asked.out / f"{asked.name}.html"
    if recipe.page is None:
        flat = {record.name: record for own in records for record in own}
        return Conclusion(common.render(list(flat.values()), output, recipe.title) if report else None)
    parameter = recipe.sensitivity.parameter if recipe.sensitivity else None
    found = problems(list(zip(asked.blocks, records, strict=True)), parameter)
    findings = sensitivity.findings(recipe.sensitivity, found) if recipe.sensitivity else None
    page = study.render(recipe, recipe.page, found, findings or [], output, command_line()) if report else None
    return Conclusion(page, findings, all(finding.varies for finding in findings or ()))
