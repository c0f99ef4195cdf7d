"""Cells that many tables share: the name of a run, the state of a run."""

from __future__ import annotations

from dataclasses import replace

from dembench.reports.entries import Entry
from dembench.reports.groups import Ensemble, Group, Member
from dembench.reports.svg import variable
from dembench.reports.tables import Cell, Table

STATE_NAMES = {"unscored": "ok, unscored"}


def run_cell(member: Member | Ensemble, detail: str = "") -> Cell:
    """The name of a member or of an engine with all its seeds, with the colour of its curves."""
    return Cell(member.label, member.label, colour=variable(member.shown.look.colour), detail=detail)


def directory_cell(entry: Entry) -> Cell:
    """The name of a run directory, and that the run is softened where it is."""
    return Cell(entry.name, detail="softened" if entry.softening else "")


def tagged(table: Table, group: Group) -> Table:
    """A table of a group with what to know of all its runs first."""
    return replace(table, tag=group.tag)


def state_cell(state: str, detail: str = "") -> Cell:
    """A run state as a word with its mark."""
    return Cell(STATE_NAMES.get(state, state), mark=f"state {state}", detail=detail)
