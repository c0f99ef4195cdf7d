"""The study of the impulse solver on the quick bed: what its page must find."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from reading import Page
from typer.testing import CliRunner

from dembench.cli import app

pytestmark = pytest.mark.slow


def test_compliant_rows_follow_explicit_springs(tmp_path: Path) -> None:
    """Substeps by stiffness and eight substeps go down as explicit soft spheres do, within 0.3 mm of 126 at 27 ms.

    Substeps that are too long for the stiffness may fail; their rows say so.
    """
    words = ["run", "impulse-study", "--preset", "quick", "--out", str(tmp_path), "--json"]
    page = Page(Path(json.loads(CliRunner().invoke(app, words).stdout)["report"]).read_text())
    head, *rows = page.tables["scene1-variants"]
    column = next(k for k, cell in enumerate(head) if cell.text.startswith("Displacement at 27 ms"))
    depth = {row[0].value: float(row[column].value or "nan") for row in rows}
    assert depth["peclet-hertz"] == pytest.approx(-125.8, abs=0.5)
    for choice in ("peclet[rows=compliant]", "peclet[rows=compliant,velocity_sweeps=1,substeps=8]"):
        assert depth[choice] == pytest.approx(depth["peclet-hertz"], abs=0.3)
    assert len(page.figures) == 2
