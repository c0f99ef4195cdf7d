"""What identifies a run: its spec, the hash over everything that its result depends on, and its name."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from typing import Any

from pydantic import Field

from dembench.scene.base import Model

HASHED = (
    "scene_digest",
    "engine",
    "engine_version",
    "settings",
    "division",
    "seed",
    "repeat",
)
"""Fields that the result depends on; the case's name and the time limit are not among them."""


class RunSpec(Model):
    """One engine on one scene with one setting and one seed.

    Attributes:
        case: Case as typed, or the name of a scene file.
        preset: Preset of the case; None for a scene file.
        engine: Name of the engine.
        engine_version: Its version.
        overrides: Settings as typed.
        given: Settings that came with the problem; what was typed replaces them.
        settings: All settings, resolved.
        division: `closed` or `open`.
        seed: Seed of the initial state.
        repeat: Number of the timing sample, from 1.
        scene_digest: Digest of the scene, the initial state by content.
        scene_name: Name of the scene.
        bodies: Number of bodies.
        duration: Simulated time [s].
        cores: Number of cores that it occupies.
        law: Contact law that the engine computes; empty where it is the scene's own.
        precision, device: As shown in timing tables.
        timeout: Time limit [s]; None for no limit.
        estimate: Estimated wall time [s]; None where the engine offers none.
        imported: Name of the file where another program's result was imported; empty for a run.
    """

    case: str
    preset: str | None = None
    engine: str
    engine_version: str = ""
    overrides: dict[str, str] = Field(default_factory=dict)
    given: dict[str, str] = Field(default_factory=dict)
    settings: dict[str, Any] = Field(default_factory=dict)
    division: str = "closed"
    seed: int = 0
    repeat: int = 1
    scene_digest: str
    scene_name: str
    bodies: int = 0
    duration: float = 0.0
    cores: int = 1
    law: str = ""
    precision: str = ""
    device: str = "cpu"
    timeout: float | None = None
    estimate: float | None = None
    imported: str = ""

    def digest(self) -> str:
        """SHA-256 over everything that the result depends on."""
        text = json.dumps({name: getattr(self, name) for name in HASHED}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def label(self) -> str:
        """The engine with its settings as typed: `name[dt=1e-6]`; `name (imported)` for another program's result."""
        if self.imported:
            return f"{self.engine} (imported)"
        return label(self.engine, self.overrides)

    def name(self) -> str:
        """Readable name of the run with a short hash: `case3-quick__engine__1a2b3c4d`."""
        what = _slug(self.case) + (f"-{_slug(self.preset)}" if self.preset else "")
        return f"{what}__{_slug(self.engine)}__{self.digest()[:8]}"


def label(engine: str, overrides: Mapping[str, str]) -> str:
    """An engine with its settings as typed: `name[dt=1e-6]`."""
    typed = ",".join(f"{key}={value}" for key, value in overrides.items())
    return f"{engine}[{typed}]" if typed else engine


def _slug(text: str) -> str:
    """Letters, digits and single hyphens only: safe in a path and a page."""
    return re.sub(r"[^A-Za-z0-9]+", "-", text).strip("-")[:60] or "run"
