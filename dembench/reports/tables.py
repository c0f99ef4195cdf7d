"""Tables of a report: typed columns with units, decimals aligned per column, raw values kept for sorting and CSV."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

Kind = Literal["number", "number run", "number wide", "text", "wrap", "long", "line"]


@dataclass(frozen=True)
class Column:
    """A column: its heading, unit, kind of content and what the heading means in full."""

    title: str
    unit: str = ""
    kind: Kind = "text"
    note: str = ""


@dataclass(frozen=True)
class Cell:
    """One cell.

    Attributes:
        text: What is shown; empty shows a dash.
        value: What is sorted and exported where it is not the text.
        mark: CSS class of a word that is judged: a run state, `within`, `outside`.
        colour: CSS variable of the swatch before the name of a run.
        detail: A second, quieter line.
        tone: CSS class of the whole cell.
        flags: Marks after the text, explained below the table.
    """

    text: str = ""
    value: float | str | None = None
    mark: str = ""
    colour: str = ""
    detail: str = ""
    tone: str = ""
    flags: str = ""


@dataclass(frozen=True)
class Table:
    """A table of a page.

    Attributes:
        name: Unique on the page.
        title: Its heading.
        columns: Its columns.
        rows: A cell for each column.
        note: A line above it; what stands between backticks is code.
        footnotes: Lines below it, likewise.
        tag: Stands beside the title: what to know of all its rows first.
        folded: A table of details that a reader unfolds below it.
    """

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    footnotes: tuple[str, ...] = ()
    tag: str = ""
    folded: Table | None = None


def numbers(values: Iterable[float | None], digits: int = 3, most: int = 6) -> list[Cell]:
    """Cells of one column with the same number of decimals, so that decimal points line up.

    Args:
        values: Values in the column's unit; None and what is not finite give an empty cell.
        digits: Significant digits of the smallest value that is not 0.
        most: Largest number of decimals.
    """
    known = [v if v is not None and math.isfinite(v) else None for v in values]
    places = decimals([v for v in known if v is not None], digits, most)
    return [Cell() if v is None else Cell(grouped(v, places), float(f"{v:.10g}")) for v in known]


def decimals(values: Sequence[float], digits: int = 3, most: int = 6) -> int:
    """Decimals that give the smallest value that is not 0 so many significant digits, between 0 and `most`."""
    sizes = [abs(v) for v in values if v]
    if not sizes:
        return 0
    return min(most, max(0, digits - 1 - math.floor(math.log10(min(sizes)))))


def grouped(value: float, places: int) -> str:
    """A number with so many decimals, a true minus sign and thin spaces between thousands; 0 has no sign."""
    text = f"{value if round(value, places) else 0.0:,.{places}f}".replace(",", "\u202f")
    return text.replace("-", "\u2212")


def significant(value: float | None, digits: int = 4) -> str:
    """A number on its own with so many significant digits; empty for None."""
    if value is None:
        return ""
    if value != 0 and not 1e-4 <= abs(value) < 1e6:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
        return f"{mantissa}e{int(exponent)}".replace("-", "\u2212")
    return f"{value:.{digits}g}".replace("-", "\u2212")
