"""Skeletons of packages that add an engine or a case: complete, installable, with a contract test that passes."""

from __future__ import annotations

import keyword
import re
import shutil
import tempfile
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from dembench import plugins
from dembench.cases import registry as cases
from dembench.engines import registry as engines

KINDS = {"engine": (engines.BUILT_IN, engines.GROUP), "case": (cases.BUILT_IN, cases.GROUP)}
"""What there are skeletons of: names that are taken, and the group of the entry points."""
_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


class SkeletonError(ValueError):
    """A name or a directory that is not accepted."""


def write(kind: str, name: str, parent: Path) -> Path:
    """Writes the skeleton of a package into a new directory of the package's name; returns the directory.

    Args:
        kind: One of `KINDS`.
        name: Name of the engine or case on the command line.
        parent: Existing directory in which the new one is made.

    Raises:
        SkeletonError: The name is none or is taken, or the directory is there.
    """
    _check(kind, name)
    directory = parent / f"dembench-{name}"
    if directory.exists():
        raise SkeletonError(f"{directory} is there already; accepted is a name or --directory where it is not")
    if not parent.is_dir():
        raise SkeletonError(f"--directory {parent}: there is no such directory")
    module = "dembench_" + name.replace("-", "_")
    values = {"kind": kind, "name": name, "module": module, "type": "".join(map(str.capitalize, name.split("-")))}
    environment = Environment(
        loader=PackageLoader("dembench", "skeletons"), undefined=StrictUndefined, keep_trailing_newline=True
    )
    places = {
        "pyproject.toml.j2": "pyproject.toml",
        "README.md.j2": "README.md",
        f"{kind}/__init__.py.j2": f"{module}/__init__.py",
        f"{kind}/program.py.j2": f"{module}/program.py",
        f"{kind}/test_contract.py.j2": "tests/test_contract.py",
    }
    made = Path(tempfile.mkdtemp(prefix=".skeleton-", dir=parent))
    try:
        for source in set(places) & set(environment.list_templates()):
            path = made / places[source]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(environment.get_template(source).render(values))
        made.chmod(0o755)
        made.rename(directory)
    finally:
        shutil.rmtree(made, ignore_errors=True)
    return directory


def _check(kind: str, name: str) -> None:
    if kind not in KINDS:
        raise SkeletonError(f"'{kind}' has no skeleton; accepted are {', '.join(KINDS)}")
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        raise SkeletonError(f"'{name}' is no name; accepted are small letters, digits and single hyphens, as my-{kind}")
    built_in, group = KINDS[kind]
    if name in plugins.names(built_in, group):
        raise SkeletonError(f"the name '{name}' is taken by a known {kind}; choose another one")
