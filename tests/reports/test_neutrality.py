"""No engine gets a special case in what plans, runs, records, scores and reports."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import dembench
from dembench.engines import registry

PACKAGE = Path(dembench.__file__).parent


@pytest.mark.parametrize("folder", ["cases", "runs", "results", "scoring", "verification", "reports", "throughput"])
def test_no_engine_is_named(folder: str) -> None:
    names = "|".join(map(re.escape, registry.BUILT_IN))
    pattern = re.compile(rf"""["'`]({names})["'`\[]|import.*\bengines\.({names.replace("-", "_")})""")
    files = [p for p in (PACKAGE / folder).rglob("*") if p.suffix in (".py", ".j2", ".js", ".css")]
    assert files
    assert not [f"{path.name}: {found[0]}" for path in files if (found := pattern.search(path.read_text("utf-8")))]
