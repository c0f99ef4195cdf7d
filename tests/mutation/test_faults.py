"""The suites of known answers see ten faults that are planted into the solver, one at a time."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from faults import FAULTS, Fault, plant

SUITES = ("--tier", "default")
ENGINE = "peclet-hertz"


@pytest.mark.parametrize("fault", FAULTS, ids=lambda f: f.name)
def test_a_fault_can_be_planted(fault: Fault, tmp_path: Path) -> None:
    plant(fault, tmp_path)
    changed = (tmp_path / "dembench" / "solver" / fault.file).read_text()
    assert fault.wrong in changed
    compile(changed, fault.file, "exec")


def missed(directory: Path) -> dict[str, str]:
    """Checks that the solver in a directory misses, with what it measured, from the suites' default tier."""
    command = [sys.executable, "-c", "from dembench.cli import main; main()", "verify", *SUITES]
    done = subprocess.run(
        [*command, "--engines", ENGINE, "--json", "--out", str(directory / "runs")],
        cwd=directory,
        check=False,
        env={**os.environ, "PYTHONPATH": str(directory)},
        stdout=subprocess.PIPE,
        text=True,
        timeout=1800,
    )
    assert done.returncode in (0, 1), done.returncode
    judged = [row for row in json.loads(done.stdout)["rows"] if row["status"] not in ("skipped", "not applicable")]
    assert judged
    return {row["id"]: f"{row['status']}: {row['measured']}" for row in judged if row["status"] != "ok"}


@pytest.fixture(scope="module")
def unchanged(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    directory = tmp_path_factory.mktemp("unchanged")
    plant(None, directory)
    return missed(directory)


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS, ids=lambda f: f.name)
def test_a_planted_fault_is_seen(
    fault: Fault, unchanged: dict[str, str], tmp_path: Path, record_property: Callable[[str, str], None]
) -> None:
    """Some check that the right solver meets is missed by the wrong one; which, is recorded."""
    plant(fault, tmp_path)
    caught = {key: value for key, value in missed(tmp_path).items() if key not in unchanged}
    record_property("caught", ", ".join(f"{key} ({value})" for key, value in caught.items()))
    assert caught, f"{fault.title}, and no check of the suites sees it"
