"""The table of results that come from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

from dembench.reports.cells import directory_cell, run_cell
from dembench.reports.groups import Group
from dembench.reports.tables import Cell, Column, Table, numbers


def imported_runs(groups: Sequence[Group]) -> Table | None:
    """Files that were imported with what was done to them; None where there are none.

    Their wall times were taken on other machines: they stand here, and in no comparison.
    """
    found = [(m, e) for g in groups for m in g.members for e in m.entries if e.spec.imported]
    if not found:
        return None
    origins = [e.record.result.provenance.get("imported", {}) if e.record.result else {} for _, e in found]
    columns = (
        Column("Program", kind="long"),
        Column("File", kind="wrap"),
        Column("What was done", kind="wrap"),
        Column("Wall time elsewhere", "s", "number", "as given, on another machine"),
        Column("SHA-256", kind="wrap", note="its first 16 digits"),
        Column("Run directory", kind="wrap"),
    )
    walls = numbers([o.get("wall") for o in origins])
    rows = tuple(
        (
            run_cell(m),
            Cell(e.spec.imported),
            Cell("; ".join(o.get("notes", ())) or "taken as it is"),
            walls[k],
            Cell(o.get("sha256", "")[:16]),
            directory_cell(e),
        )
        for k, ((m, e), o) in enumerate(zip(found, origins, strict=True))
    )
    note = "Results of other programs; their run times are from elsewhere and enter no comparison."
    return Table("imported", "Imported results", columns, rows, note)
