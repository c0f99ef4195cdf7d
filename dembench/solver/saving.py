"""The complete state of a simulation as one file, from which it goes on with the same bits.

The file is an uncompressed `.npz`: a header (JSON: format, version, scene, settings), the arrays of the scene's bodies
and every array and number that the objects of a simulation hold, found by walking through them. So nothing that a
solver keeps between two steps can be forgotten: lists, contact memory, travel since the last build, counters.
"""

from __future__ import annotations

import dataclasses
import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

import dembench
from dembench.atomic import replacing
from dembench.scene import Scene, SceneError, scene_from
from dembench.solver.guard import SolverError

FORMAT = "dembench simulation"


def write_state(path: Path, root: Any, scene: Scene, settings: dict[str, Any]) -> None:
    """Writes the state of an object and of all objects of the solver below it; the file appears when it is complete."""
    header = {"format": FORMAT, "version": dembench.__version__, "scene": scene.description(), "settings": settings}
    arrays = {f"bodies/{name}": array for name, array in scene.bodies.arrays().items()}
    for key, _owner, _name, value in _leaves(root, "state"):
        arrays[key] = value.numpy() if isinstance(value, wp.array) else np.asarray(value)
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        np.savez(stream, allow_pickle=False, header=np.array(json.dumps(header)), **arrays)


def read_state(path: Path) -> tuple[Scene, dict[str, Any], dict[str, np.ndarray]]:
    """Scene, settings and arrays of a file.

    Raises:
        SolverError: The file is not there, is damaged or was written by another version.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {key: stored[key] for key in stored.files}
        header = json.loads(str(arrays.pop("header")))
        if header["format"] != FORMAT:
            raise ValueError("no state of a simulation")
    except FileNotFoundError:
        raise SolverError(f"{path}: there is no such file") from None
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise SolverError(f"{path}: damaged, or no state of a simulation: {error}") from None
    if header["version"] != dembench.__version__:
        raise SolverError(
            f"{path}: written by version {header['version']}; accepted is {dembench.__version__}, the version that runs"
        )
    bodies = {key.removeprefix("bodies/"): arrays.pop(key) for key in list(arrays) if key.startswith("bodies/")}
    try:
        scene = scene_from({**header["scene"], "bodies": bodies}, str(path))
    except SceneError as error:
        raise SolverError(f"{path}: damaged: {error}") from None
    return scene, header["settings"], arrays


def restore(root: Any, arrays: dict[str, np.ndarray], path: Path) -> None:
    """Puts the arrays of a file into an object made from the same scene and settings; SolverError where they differ."""
    leaves = list(_leaves(root, "state"))
    differ = {key for key, *_rest in leaves} ^ set(arrays)
    if differ:
        raise SolverError(f"{path}: written by another solver: {', '.join(sorted(differ)[:3])} is not in both")
    renewed: dict[int, wp.array] = {}
    for key, owner, name, value in leaves:
        stored = arrays[key]
        if isinstance(value, wp.array):
            # two names of one array stay two names of one array
            if id(value) not in renewed:
                shape = stored.shape[: value.ndim]
                fits = shape == value.shape
                renewed[id(value)] = value if fits else wp.zeros(shape, dtype=value.dtype, device=value.device)
                renewed[id(value)].assign(stored)
            setattr(owner, name, renewed[id(value)])
        else:
            setattr(owner, name, stored if isinstance(value, np.ndarray) else type(value)(stored.item()))


def array_bytes(root: Any) -> int:
    """Bytes of all arrays of kernels that an object and the objects of the solver below it hold."""
    held = {id(value): value for *_, value in _leaves(root, "state") if isinstance(value, wp.array)}
    return sum(array.capacity for array in held.values())


def _leaves(owner: Any, key: str, seen: set[int] | None = None) -> Iterator[tuple[str, Any, str, Any]]:
    """Key, owner, attribute name and value of every array and number of an object and of those below it."""
    seen = {id(owner)} if seen is None else seen
    record = hasattr(owner, "_cls")
    names = list(owner._cls.vars) if record else list(vars(owner))
    for name in names:
        value, at = getattr(owner, name), f"{key}/{name}"
        if isinstance(value, wp.array | np.ndarray | bool | int | float | np.number):
            yield at, owner, name, value
        elif id(value) not in seen and _is_ours(value):
            seen.add(id(value))
            yield from _leaves(value, at, seen)


def _is_ours(value: Any) -> bool:
    """Whether an object is one of the solver's that changes while it runs."""
    if hasattr(value, "_cls"):
        return True
    module = type(value).__module__
    return module.startswith("dembench.solver") and hasattr(value, "__dict__") and not dataclasses.is_dataclass(value)
