"""What a search for stability leaves: `map.json`, every cell of every map with its probes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dembench.atomic import write_json
from dembench.runs.directory import now
from dembench.scene.base import Model
from dembench.verification.maps.breaking import Class
from dembench.verification.maps.rigs import Family
from dembench.verification.maps.search import HIGH, LOW, Search

FILE = "map.json"


class Probed(Model):
    """One cell at one step.

    Attributes:
        step: [s].
        factor: The same over the theoretical bound [-].
        kind: Class of the outcome.
        energy: Kinetic energy over that of the start [-].
        error: Error of the restitution [-].
        run: Name of the run directory.
        detail: Why the whole run came to no end; empty where it did.
    """

    step: float
    factor: float
    kind: Class
    energy: float | None
    error: float | None
    run: str
    detail: str = ""


class CellFound(Model):
    """One cell of a map with its probes, from large to small steps.

    Attributes:
        at: Values on the axes.
        rayleigh: Rayleigh time of its smallest body [s].
        probes: What was probed.
    """

    at: dict[str, float]
    rayleigh: float
    probes: tuple[Probed, ...]

    @property
    def breaks(self) -> Probed | None:
        """The smallest step that breaks; None where none did."""
        return next((p for p in reversed(self.probes) if p.kind != "stable"), None)

    @property
    def stable(self) -> Probed | None:
        """The largest step below all that break; None where none is."""
        smallest = self.breaks
        return next((p for p in self.probes if smallest is None or p.factor < smallest.factor), None)


class Guard(Model):
    """Where the guard of an engine lies on the usual cell of a rig.

    Attributes:
        at: Values on the axes.
        accepted: Largest step that it accepts, over the theoretical bound [-]; None where it accepts none.
        refused: Smallest step that it refuses; None where it refuses none.
        detail: What the engine says.
    """

    at: dict[str, float]
    accepted: float | None
    refused: float | None
    detail: str = ""


class RowFound(Model):
    """One engine on one rig.

    Attributes:
        engine, variant: Its name, and the same with what was typed.
        law: Contact law that it computes; empty where it is the scene's.
        bound: Theoretical bound [s].
        cells: The cells.
        guard: Its guard; None for an engine whose guard cannot be exceeded, or that has none.
        trouble: Why there is no more; empty where there is.
    """

    engine: str
    variant: str
    law: str = ""
    bound: float
    cells: tuple[CellFound, ...]
    guard: Guard | None = None
    trouble: str = ""


class Map(Model):
    """One map of all engines.

    Attributes:
        name, title, text: See `Family`.
        axes: Its axes.
        measures_restitution: Whether its cells have an error of the restitution.
        rows: Engines and rigs.
    """

    name: str
    title: str
    text: str
    axes: tuple[str, ...]
    measures_restitution: bool
    rows: tuple[RowFound, ...]

    def variants(self) -> list[str]:
        """The engines as typed."""
        return list(dict.fromkeys(row.variant for row in self.rows))


class Maps(Model):
    """All maps of a command.

    Attributes:
        version: Of this format.
        command: What reproduces it.
        made: Time in ISO 8601.
        complete: Whether every search came to its end within the budget.
        lowest, highest: Range of the steps that a search looks at, over the theoretical bound [-].
        maps: The maps.
    """

    version: int = 1
    command: str
    made: str
    complete: bool
    lowest: float = LOW
    highest: float = HIGH
    maps: tuple[Map, ...]


def gather(families: Sequence[Family], searches: Sequence[Search], command: str, complete: bool) -> Maps:
    """The maps from their searches.

    Args:
        families: What was asked for.
        searches: The searches, in any state.
        command: What reproduces them.
        complete: Whether all came to their end.
    """
    maps = []
    for family in families:
        own = [s for s in searches if s.family is family]
        guards = {(s.variant, id(s.guards)): s for s in own if s.guards is not None}
        rows = tuple(_row(s, guards.get((s.variant, id(s.rig)))) for s in own if s.guards is None)
        maps.append(
            Map(
                name=family.name,
                title=family.title,
                text=family.text,
                axes=family.axes,
                measures_restitution=family.measures_restitution,
                rows=rows,
            )
        )
    return Maps(command=command, made=now(), complete=complete, maps=tuple(maps))


def _row(search: Search, guard: Search | None) -> RowFound:
    counts = sorted(search.found)
    cells = []
    for k, cell in enumerate(search.rig.cells):
        probes = [
            Probed(
                step=search.step(count),
                factor=search.factor(count),
                kind=search.found[count][k].kind,
                energy=search.found[count][k].energy,
                error=search.found[count][k].error,
                run=search.runs[count],
                detail=search.details.get(count, ""),
            )
            for count in counts
        ]
        cells.append(CellFound(at=dict(cell.at), rayleigh=cell.rayleigh, probes=tuple(probes)))
    return RowFound(
        engine=search.choice.engine,
        variant=search.variant,
        law=search.law,
        bound=search.rig.bound,
        cells=tuple(cells),
        guard=None if guard is None or not guard.found else _guard(guard),
        trouble=search.trouble,
    )


def _guard(search: Search) -> Guard:
    refused = [count for count, outcomes in search.found.items() if search.is_broken(outcomes[0])]
    accepted = [count for count in search.found if count > max(refused, default=0)]
    return Guard(
        at=dict(search.rig.cells[0].at),
        accepted=search.factor(min(accepted)) if accepted else None,
        refused=search.factor(max(refused)) if refused else None,
        detail=search.details.get(max(refused), "") if refused else "",
    )


def write(found: Maps, directory: Path) -> Path:
    """Writes `map.json` into a directory."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / FILE
    write_json(path, found.model_dump(mode="json"))
    return path
