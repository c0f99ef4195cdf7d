"""Where data files lie: at the top of a checkout, inside the package of an installed wheel."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def share(*parts: str) -> Path:
    """Path of a file that travels with the package, e.g. share("data", "published", "impact.toml").

    Raises:
        FileNotFoundError: Neither a checkout nor an installed package has it.
    """
    candidates = [root.joinpath(*parts) for root in (_PACKAGE / "share", _PACKAGE.parent)]
    for path in candidates:
        if path.exists():
            return path
    raise FileNotFoundError(f"{'/'.join(parts)} is neither in {candidates[0].parent} nor in {candidates[1].parent}")
