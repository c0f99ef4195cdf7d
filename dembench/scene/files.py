"""Scenes as files: one JSON text, with large arrays in one `.npz` beside it."""

from __future__ import annotations

import json
import os
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from dembench.scene.bodies import Bodies
from dembench.scene.scene import Scene

INLINE_BODIES = 100
_PLAIN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*\.npz")


class SceneError(ValueError):
    """A scene that cannot be used: names the field, the value and what would be accepted."""


def save_scene(scene: Scene, path: Path) -> None:
    """Writes a scene to a JSON file; the arrays of more than 100 bodies go into `<stem>.npz` beside it."""
    data = scene.description()
    if len(scene.bodies) <= INLINE_BODIES:
        data["bodies"] = {name: array.tolist() for name, array in scene.bodies.arrays().items()}
    else:
        arrays = path.with_suffix(".npz")
        temporary = arrays.with_name(arrays.name + ".tmp")
        with open(temporary, "wb") as stream:
            np.savez(stream, allow_pickle=False, **scene.bodies.arrays())
        os.replace(temporary, arrays)
        data["bodies"] = {"file": arrays.name, "sha256": scene.bodies.digest()}
    temporary = path.with_name(path.name + ".tmp")
    temporary.write_text(json.dumps(data, indent=1))
    os.replace(temporary, path)


def load_scene(path: Path) -> Scene:
    """Reads a scene from a JSON file.

    Raises:
        SceneError: The file is not there, is no JSON or no scene; the message names the field and what is accepted.
    """
    try:
        data = json.loads(path.read_text())
    except OSError as error:
        raise SceneError(f"{path}: {error.strerror}") from None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise SceneError(f"{path}: not JSON: {error}") from None
    if isinstance(data, dict) and isinstance(data.get("bodies"), dict) and "file" in data["bodies"]:
        data["bodies"] = _load_bodies(path, data["bodies"])
    return scene_from(data, str(path))


def scene_from(data: Any, source: str = "scene") -> Scene:
    """A scene from plain data; SceneError with one line per fault where it is none."""
    try:
        return Scene.model_validate(data)
    except ValidationError as error:
        raise SceneError(explain(error, source)) from None


def scene_schema() -> dict[str, Any]:
    """JSON schema of a scene file: a scene whose bodies are arrays, or the name of the `.npz` file beside it."""
    schema = Scene.model_json_schema()
    schema["properties"]["bodies"] = {
        "anyOf": [
            schema["properties"]["bodies"],
            {
                "type": "object",
                "properties": {
                    "file": {"type": "string", "pattern": f"^{_PLAIN_NAME.pattern}$"},
                    "sha256": {"type": "string", "pattern": "^[0-9a-f]{64}$"},
                },
                "required": ["file"],
                "additionalProperties": False,
            },
        ]
    }
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def explain(error: ValidationError, source: str) -> str:
    """The faults of a validation error, one per line: field, what is wrong, the value given."""
    lines = []
    for fault in error.errors():
        place = ".".join(str(part) for part in fault["loc"]) or "scene"
        message = fault["msg"].removeprefix("Value error, ")
        given = fault.get("input")
        shown = "" if isinstance(given, dict | list | tuple | np.ndarray | None) else f" (given: {str(given)[:60]!r})"
        lines.append(f"{source}: {place}: {message}{shown}")
    return "\n".join(lines)


def _load_bodies(path: Path, reference: dict[str, Any]) -> Bodies:
    name = reference["file"]
    if not isinstance(name, str) or not _PLAIN_NAME.fullmatch(name):
        raise SceneError(f"{path}: bodies.file: {name!r} must be the plain name of an .npz file beside the scene")
    try:
        with np.load(path.parent / name, allow_pickle=False) as stored:
            arrays = {key: stored[key] for key in stored.files}
        bodies = Bodies(**arrays)
    except ValidationError as error:
        raise SceneError(explain(error, str(path.parent / name))) from None
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise SceneError(f"{path}: bodies.file: cannot read {name}: {error}") from None
    if reference.get("sha256") not in (None, bodies.digest()):
        raise SceneError(f"{path}: bodies.sha256: {name} is not the file that this scene was saved with")
    return bodies
