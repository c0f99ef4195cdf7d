"""Keeps generated packings: one file each, named by the hash of everything that it depends on."""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pooch

from dembench.atomic import replacing


def cache_directory() -> Path:
    """The cache: the environment variable DEMBENCH_CACHE, or the user's cache directory of this system."""
    given = os.environ.get("DEMBENCH_CACHE")
    return Path(given) if given else Path(pooch.os_cache("dembench"))


def entry(kind: str, inputs: dict[str, Any]) -> Path:
    """Where the cache keeps what is made from some inputs; see `cached`."""
    return cache_directory() / f"{kind}-{hashlib.sha256(_text(inputs).encode()).hexdigest()[:16]}.npz"


def cached(kind: str, inputs: dict[str, Any], make: Callable[[], np.ndarray]) -> np.ndarray:
    """An array from the cache, or made and stored there.

    Args:
        kind: First part of the file name.
        inputs: Everything that the array depends on, as plain JSON data; its hash is the key.
        make: Makes the array where the cache does not have it, or has a file that cannot be read.
    """
    path = entry(kind, inputs)
    try:
        array, found = load(path)
        if _text(found) == _text(inputs):
            return array
    except ValueError:
        pass
    made = make()
    store(path, inputs, made)
    return made


def load(path: Path) -> tuple[np.ndarray, dict[str, Any]]:
    """The array of a file that `store` has written, and what it was made from.

    Raises:
        ValueError: The file is not there, is damaged or is no such file.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            return stored["array"], json.loads(str(stored["inputs"]))
    except FileNotFoundError:
        raise ValueError("there is no such file") from None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        raise ValueError("it is damaged, cut off or another program's") from None


def store(path: Path, inputs: dict[str, Any], array: np.ndarray) -> None:
    """Writes an array with what it was made from; the file appears when it is complete."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        np.savez_compressed(stream, array=array, inputs=np.array(_text(inputs)))


def _text(inputs: dict[str, Any]) -> str:
    return json.dumps(inputs, sort_keys=True)
