"""Scenes as files: one JSON text, with large arrays in one `.npz` beside it."""

from __future__ import annotations

import hashlib
import json
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from dembench.atomic import replacing, write_json
from dembench.scene.bodies import Bodies
from dembench.scene.scene import Scene

INLINE_BODIES = 100
"""A file of a scene with more bodies has their arrays beside it."""
INLINE_NUMBERS = 3000
"""An array outside the bodies with more numbers, as of a mesh or a field, stands beside the file."""
_PLAIN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*\.npz")


class SceneError(ValueError):
    """A scene that cannot be used: names the field, the value and what would be accepted."""


def save_scene(scene: Scene, path: Path) -> None:
    """Writes a scene to a JSON file.

    The arrays of more than 100 bodies and other large arrays go into `<stem>.npz` beside it.
    """
    beside: dict[str, np.ndarray] = {}
    store = path.with_suffix(".npz")
    data = _put_beside(scene.description(), "", store.name, beside)
    if len(scene.bodies) <= INLINE_BODIES:
        data["bodies"] = {name: array.tolist() for name, array in scene.bodies.arrays().items()}
    else:
        beside.update(scene.bodies.arrays())
        data["bodies"] = {"file": store.name, "sha256": scene.bodies.digest()}
    if beside:
        with replacing(store) as temporary, open(temporary, "wb") as stream:
            np.savez(stream, allow_pickle=False, **beside)
    write_json(path, data)


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
    data = _take_back(data, path)
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


def _put_beside(data: Any, place: str, store: str, beside: dict[str, np.ndarray]) -> Any:
    """The data with a reference in place of every large array, which goes into `beside`."""
    if isinstance(data, dict):
        return {key: _put_beside(value, f"{place}.{key}", store, beside) for key, value in data.items()}
    if not isinstance(data, list):
        return data
    if data and isinstance(data[0], list):
        array = np.array(data)
        if array.size > INLINE_NUMBERS:
            name = place.lstrip(".")
            beside[name] = array
            return {"file": store, "array": name, "sha256": _digest(array)}
        return data
    return [_put_beside(value, f"{place}.{k}", store, beside) for k, value in enumerate(data)]


def _take_back(data: Any, path: Path) -> Any:
    """The data with the arrays that stand beside the file."""
    if isinstance(data, dict) and {"file", "array"} <= set(data):
        stored = _stored(path, data["array"], data["file"])
        if data["array"] not in stored:
            raise SceneError(f"{path}: {data['array']}: {data['file']} has no such array")
        array = stored[data["array"]]
        if data.get("sha256") not in (None, _digest(array)):
            raise SceneError(f"{path}: {data['array']}: {data['file']} is not the file that this scene was saved with")
        return array
    if isinstance(data, dict):
        return {key: _take_back(value, path) for key, value in data.items()}
    return [_take_back(value, path) for value in data] if isinstance(data, list) else data


def _digest(array: np.ndarray) -> str:
    return hashlib.sha256(f"{array.shape}{array.dtype.str}".encode() + array.tobytes()).hexdigest()


def _stored(path: Path, field: str, name: Any) -> dict[str, np.ndarray]:
    """The arrays of a file beside the scene."""
    if not isinstance(name, str) or not _PLAIN_NAME.fullmatch(name):
        raise SceneError(f"{path}: {field}: {name!r} must be the plain name of an .npz file beside the scene")
    try:
        with np.load(path.parent / name, allow_pickle=False) as stored:
            return {key: stored[key] for key in stored.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise SceneError(f"{path}: {field}: cannot read {name}: {error}") from None


def _load_bodies(path: Path, reference: dict[str, Any]) -> Bodies:
    name = reference["file"]
    stored = _stored(path, "bodies.file", name)
    try:
        # arrays of other parts of the scene have a dot in their names
        bodies = Bodies(**{key: array for key, array in stored.items() if "." not in key})
    except ValidationError as error:
        raise SceneError(explain(error, str(path.parent / name))) from None
    if reference.get("sha256") not in (None, bodies.digest()):
        raise SceneError(f"{path}: bodies.sha256: {name} is not the file that this scene was saved with")
    return bodies
