"""The wheel: what travels with it, and that it works outside the checkout."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from email import message_from_bytes
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built without network."""
    if find_spec("hatchling") is None:
        pytest.skip("hatchling is not installed; it is part of the extra 'test'")
    target = tmp_path_factory.mktemp("wheel")
    command = ["pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", str(target), str(ROOT)]
    made = subprocess.run([sys.executable, "-m", *command], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    return next(target.glob("dembench-*.whl"))


def test_everything_that_the_package_reads_travels_with_it(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        packed = set(archive.namelist())
    package = {p for p in (ROOT / "dembench").rglob("*") if p.is_file() and "__pycache__" not in p.parts}
    assert package
    assert {str(p.relative_to(ROOT)) for p in package} - packed == set()
    shared = {p.relative_to(ROOT) for folder in ("data", "recipes") for p in (ROOT / folder).rglob("*") if p.is_file()}
    assert shared
    assert {f"dembench/share/{p}" for p in shared} - packed == set()


def test_the_wheel_says_what_it_is(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        (entry,) = (name for name in archive.namelist() if name.endswith("dist-info/METADATA"))
        (points,) = (name for name in archive.namelist() if name.endswith("entry_points.txt"))
        metadata = message_from_bytes(archive.read(entry))
        assert "dembench = dembench.cli:main" in archive.read(points).decode()
        assert any(name.endswith("licenses/LICENSE") for name in archive.namelist())
    assert metadata["License-Expression"] == "MIT"
    assert metadata["Requires-Python"] == ">=3.11"


def test_it_works_outside_the_checkout(wheel: Path, tmp_path: Path) -> None:
    """The unpacked wheel lists its cases and writes a deck, with the data that it brought along."""
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    program = f"""
import sys
sys.path.insert(0, {str(tmp_path / "site")!r})
import dembench
from dembench.cases import registry
from dembench.share import share
from dembench.engines.liggghts import Liggghts
from dembench.scene import Scene
from pathlib import Path
assert Path(dembench.__file__).is_relative_to({str(tmp_path)!r}), dembench.__file__
assert share("data").is_relative_to({str(tmp_path)!r})
for name in registry.names():
    case = registry.case(name)
    assert case.title and case.source
scene = Scene(
    name="one",
    materials=[dict(name="glass", density=2500, young=1e7, poisson=0.2)],
    pair_laws=[dict(a="glass", b="glass", restitution=0.5, friction=0)],
    species=[dict(name="grain", material="glass", radius=1e-3)],
    bodies=dict(position=[[0, 0, 0]]),
    domain=dict(lower=(-1, -1, -1), upper=(1, 1, 1)),
    duration=1e-3,
)
engine = Liggghts()
engine.write(scene, engine.settings(scene, "closed"), Path("."))
from dembench.cli import app
app(["cases"])
"""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert "case3" in done.stdout
    assert (tmp_path / "in.liggghts").exists()


def test_the_example_of_the_readme_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The spheres fall for half a second and rebound at most to where they came from."""
    text = (ROOT / "README.md").read_text()
    code = text.split("## Use the solver alone")[1].split("```python")[1].split("```")[0]
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "README.md", "exec"), {})
    time, highest, energy, overlap = map(float, capsys.readouterr().out.split()[-4:])
    assert time == pytest.approx(0.5) and 0.05 <= highest < 0.44
    assert np.isfinite(energy) and overlap < 1e-3
    assert {path.name for path in tmp_path.iterdir()} == {"drop.npz", "drop.vtkhdf"}
