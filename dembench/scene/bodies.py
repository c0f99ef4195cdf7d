"""The bodies of a scene as arrays: the exact initial state that every engine starts from."""

from __future__ import annotations

import hashlib
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, PlainSerializer, model_validator

from dembench.scene.base import Model


def _numbers(value: Any) -> np.ndarray:
    try:
        return np.array(value, dtype=np.float64)
    except TypeError as error:
        raise ValueError(f"expected numbers: {error}") from None


def _rows(value: Any) -> np.ndarray:
    array = _numbers(value)
    if array.size == 0:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"expected shape (n, 3), got {array.shape}")
    return _checked(array)


def _column(value: Any) -> np.ndarray:
    array = _numbers(value)
    if array.ndim != 1:
        raise ValueError(f"expected shape (n,), got {array.shape}")
    return _checked(array)


def _indices(value: Any) -> np.ndarray:
    array = _numbers(value)
    if array.ndim != 1:
        raise ValueError(f"expected shape (n,), got {array.shape}")
    whole = np.isfinite(array) & (array == np.round(array)) & (np.abs(array) < 2**31)
    if not whole.all():
        bad = int(np.argmin(whole))
        raise ValueError(f"particle {bad} has the value {array[bad]:g}; expected whole numbers")
    array = array.astype(np.int32)
    array.setflags(write=False)
    return array


def _checked(array: np.ndarray) -> np.ndarray:
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        index = tuple(int(k) for k in bad[0])
        raise ValueError(
            f"particle {index[0]} has the value {array[index]}; all {array.size} values must be finite numbers "
            f"({len(bad)} are not)"
        )
    if not array.view(np.uint64).any():
        # of a state at rest: one zero in memory stands for all
        return np.broadcast_to(0.0, array.shape)
    array.setflags(write=False)
    return array


def _quaternions(value: Any) -> np.ndarray:
    array = _numbers(value)
    if array.size == 0:
        array = array.reshape(0, 4)
    if array.ndim != 2 or array.shape[1] != 4:
        raise ValueError(f"expected shape (n, 4), got {array.shape}")
    length = np.linalg.norm(_checked(array), axis=1)
    if not (np.abs(length - 1) < 1e-6).all():
        bad = int(np.argmax(np.abs(length - 1)))
        raise ValueError(f"quaternion of particle {bad} has the norm {length[bad]:g}; it must be 1")
    return array


_as_list = PlainSerializer(lambda array: array.tolist(), return_type=list)


def _array_of(items: dict[str, Any]) -> Any:
    return Field(json_schema_extra={"type": ["array", "null"], "items": items})


_vector = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
_quaternion = {"type": "array", "items": {"type": "number"}, "minItems": 4, "maxItems": 4}
Rows = Annotated[Any, BeforeValidator(_rows), _as_list, _array_of(_vector)]
Quaternions = Annotated[Any, BeforeValidator(_quaternions), _as_list, _array_of(_quaternion)]
Column = Annotated[Any, BeforeValidator(_column), _as_list, _array_of({"type": "number", "exclusiveMinimum": 0})]
Indices = Annotated[Any, BeforeValidator(_indices), _as_list, _array_of({"type": "integer", "minimum": 0})]


class Bodies(Model):
    """Arrays of the initial state; body k is row k of every array.

    Attributes:
        position: Centres [m], shape (n, 3), float64.
        species: Index into the scene's species, shape (n,), int32; None means species 0 for all.
        velocity: Velocities [m/s], shape (n, 3); None means at rest.
        angular_velocity: Angular velocities [rad/s], shape (n, 3); None means none.
        radius: Radii [m], shape (n,), where they differ from those of the species; None means those of the species.
        orientation: Unit quaternions (x, y, z, w) that turn the frames of the shapes into space, shape (n, 4); None
            means that none is turned.
    """

    position: Rows
    species: Indices = None
    velocity: Rows = None
    angular_velocity: Rows = None
    radius: Column | None = None
    orientation: Quaternions | None = None

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, data: Any) -> Any:
        if not isinstance(data, dict) or not hasattr(data.get("position"), "__len__"):
            return data
        n = len(data["position"])
        filled = dict(data)
        for name, empty in (
            ("species", np.zeros(n, np.int32)),
            ("velocity", np.zeros((n, 3))),
            ("angular_velocity", np.zeros((n, 3))),
        ):
            if filled.get(name) is None:
                filled[name] = empty
        return filled

    @model_validator(mode="after")
    def _same_length(self) -> Bodies:
        n = len(self.position)
        for name in ("species", "velocity", "angular_velocity", "radius", "orientation"):
            array = getattr(self, name)
            if array is not None and len(array) != n:
                raise ValueError(f"{name} has {len(array)} rows, position has {n}")
        if self.radius is not None and n and not (self.radius > 0).all():
            bad = int(np.argmin(self.radius > 0))
            raise ValueError(f"radius of particle {bad} is {self.radius[bad]:g} m; it must be above 0")
        return self

    def __len__(self) -> int:
        return len(self.position)

    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays that are present, by field name."""
        return {name: a for name in type(self).model_fields if (a := getattr(self, name)) is not None}

    def digest(self) -> str:
        """SHA-256 of the content: names, shapes and bytes of all arrays."""
        digest = hashlib.sha256()
        for name, array in self.arrays().items():
            digest.update(f"{name}{array.shape}{array.dtype.str}".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()

    def __hash__(self) -> int:
        return hash(self.digest())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Bodies) and self.digest() == other.digest()
