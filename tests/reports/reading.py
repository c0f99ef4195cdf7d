"""Reads a report as a browser would: tables with their cells, figures with their data."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from html.parser import HTMLParser
from typing import Any


@dataclass
class Cell:
    """Text of a cell, its raw value and its classes."""

    text: str = ""
    value: str | None = None
    classes: str = ""


@dataclass
class Figure:
    """Parts of a figure."""

    data: Any = None
    command: str = ""
    pdf: str = ""
    texts: list[str] = field(default_factory=list)


class Page(HTMLParser):
    """Tables as lists of rows by the id of the table, headings first; figures by id; every tag with its attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tables: dict[str, list[list[Cell]]] = {}
        self.figures: dict[str, Figure] = {}
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.ids: list[str] = []
        self.text: list[str] = []
        self._open: list[str] = []
        self._rows: list[list[Cell]] = []
        self._cell: Cell | None = None
        self._figure: Figure | None = None
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.tags.append((tag, found))
        if found.get("id"):
            self.ids.append(str(found["id"]))
        self._open.append(tag)
        if tag == "table":
            self._rows = self.tables[str(found["id"])] = []
        elif tag == "tr":
            self._rows.append([])
        elif tag in ("td", "th"):
            self._cell = Cell(value=found.get("data-value", found.get("data-title")), classes=found.get("class") or "")
            self._rows[-1].append(self._cell)
        elif tag == "figure":
            self._figure = self.figures[str(found["id"])] = Figure()
        elif tag == "a" and self._figure is not None:
            self._figure.pdf = str(found["href"])

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop() != tag:
            pass
        if tag in ("td", "th"):
            self._cell = None
        elif tag == "figure":
            self._figure = None

    def handle_data(self, data: str) -> None:
        self.text.append(data)
        if self._cell is not None:
            self._cell.text += data
        elif self._figure is not None and self._open:
            if self._open[-1] == "script":
                self._figure.data = json.loads(data)
            elif self._open[-1] == "pre":
                self._figure.command += data
            elif self._open[-1] == "text":
                self._figure.texts.append(data)

    def column(self, table: str, title: str) -> list[Cell]:
        """The cells below the heading that starts with a title."""
        rows = self.tables[table]
        index = next(k for k, cell in enumerate(rows[0]) if (cell.value or "").startswith(title))
        return [row[index] for row in rows[1:]]

    def table_with(self, title: str) -> str:
        """The first table that has a column of that title."""
        return next(n for n, rows in self.tables.items() if any((c.value or "").startswith(title) for c in rows[0]))
