"""The state of spheres that all file formats share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dembench.initial.rows import CoordinatesError

FIELDS = ("radius", "density", "velocity", "angular_velocity", "species", "id")
"""What a state may know of its spheres beside their positions."""
UNITS = {"position": "m", "radius": "m", "density": "kg/m3", "velocity": "m/s", "angular_velocity": "rad/s"}


class StateError(CoordinatesError):
    """Arrays that are no state of spheres: names the field, the sphere, its value and what is accepted."""


@dataclass(frozen=True)
class State:
    """Spheres in the order of their numbers; a field that is not known is None.

    Attributes:
        position: Centres [m], shape (n, 3), float64.
        id: Numbers, whole, from 1, ascending, shape (n,), int64.
        radius: Radii [m], shape (n,).
        density: Densities [kg/m^3], shape (n,).
        velocity: Velocities [m/s], shape (n, 3).
        angular_velocity: Angular velocities [rad/s], shape (n, 3).
        species: Kinds of spheres, whole, from 0, shape (n,), int64.
    """

    position: np.ndarray
    id: np.ndarray
    radius: np.ndarray | None = None
    density: np.ndarray | None = None
    velocity: np.ndarray | None = None
    angular_velocity: np.ndarray | None = None
    species: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.position)

    def said(self) -> list[str]:
        """The fields that say something which the positions in their order do not.

        Velocities of zero, one species and numbers without gaps say nothing.
        """
        silent = {
            "velocity": self.velocity is None or not self.velocity.any(),
            "angular_velocity": self.angular_velocity is None or not self.angular_velocity.any(),
            "species": self.species is None or not self.species.any(),
            "id": bool((np.diff(self.id) == 1).all()) and (len(self) == 0 or self.id[0] == 1),
        }
        return [name for name in FIELDS if not silent.get(name, getattr(self, name) is None)]

    def with_fields(self, **changes: np.ndarray | None) -> State:
        """The same spheres with other fields; None forgets one.

        Raises:
            StateError: See `state_of`.
        """
        fields = {name: getattr(self, name) for name in ("position", *FIELDS)}
        return state_of(**{**fields, **changes})


def state_of(position: Any, **fields: Any) -> State:
    """A state from arrays in any order of the spheres.

    Args:
        position: Centres [m], shape (n, 3).
        **fields: Those of `FIELDS` that are known. Numbers that count from 0 are raised by one; without numbers the
            spheres are numbered in the order given.

    Raises:
        StateError: A shape, or a value of a sphere, is not accepted.
    """
    centres = _numbers("position", position, (len(position), 3))
    n = len(centres)
    if n == 0:
        raise StateError("no spheres")
    given = fields.get("id")
    number = np.arange(1, n + 1) if given is None else _whole("id", given, n)
    number = number + (number.min() == 0)
    order = np.argsort(number, kind="stable")
    twice = np.flatnonzero(np.diff(number[order]) == 0)
    if len(twice):
        raise StateError(f"two spheres have the number {number[order][twice[0]]}; each has one of its own")
    known: dict[str, np.ndarray] = {}
    for name in FIELDS:
        value = fields.get(name)
        if name == "id" or value is None:
            continue
        if name == "species":
            array = _whole(name, value, n)
        else:
            array = _numbers(name, value, (n, 3) if "velocity" in name else (n,))
        if name in ("radius", "density") and not (array > 0).all():
            k = int(np.argmin(array > 0))
            raise StateError(f"{name} of sphere {number[k]} is {array[k]:g} {UNITS[name]}; accepted is one above 0")
        known[name] = array[order]
    return State(position=centres[order], id=number[order], **known)


def _numbers(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise StateError(f"{name}: expected numbers: {error}") from None
    if array.shape != shape:
        raise StateError(f"{name} has the shape {array.shape}; accepted is {shape}")
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        row = int(bad[0][0])
        raise StateError(
            f"{name} of sphere {row + 1} in the file is {array[tuple(bad[0])]}; accepted are finite numbers"
        )
    return array


def _whole(name: str, value: Any, n: int) -> np.ndarray:
    array = _numbers(name, value, (n,))
    accepted = (array == np.round(array)) & (array >= 0) & (array < 2**53)
    if not accepted.all():
        k = int(np.argmin(accepted))
        raise StateError(f"{name} of sphere {k + 1} in the file is {array[k]:g}; accepted are whole numbers from 0")
    return array.astype(np.int64)
