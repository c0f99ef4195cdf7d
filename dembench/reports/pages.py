"""Pages: one HTML file from a template, with style and script inside, that needs no other file and no network."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from dembench import __version__
from dembench.atomic import write_text
from dembench.reports.figures import Drawing
from dembench.reports.svg import palette


def write_page(
    template: str, output: Path, colours: Iterable[str], drawings: Iterable[Drawing], /, **content: Any
) -> Path:
    """Writes a page.

    Args:
        template: Name of a template that extends `base.html.j2`.
        output: Path of the file.
        colours: Light-mode colours `#rrggbb` that the page uses outside its figures.
        drawings: Figures of the page.
        content: What the template shows.

    Returns:
        The path of the file.
    """
    environment = Environment(
        loader=PackageLoader("dembench.reports"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    script = _source(environment, "page.js")
    page = environment.get_template(template).render(
        **content,
        version=__version__,
        palette=palette(set(colours).union(*(drawing.colours for drawing in drawings))),
        style=_source(environment, "page.css"),
        script=script,
        script_hash="sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
    )
    write_text(output, page)
    return output


def _source(environment: Environment, name: str) -> str:
    assert environment.loader is not None
    return environment.loader.get_source(environment, name)[0]
