"""Columns of tables by the names that programs give them."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from dembench.initial.formats.state import UNITS, State, StateError, state_of

SCALARS = {
    "id": ("id", "ids", "particleid"),
    "radius": ("radius", "radii", "r"),
    "diameter": ("diameter", "d"),
    "density": ("density", "rho"),
    "mass": ("mass", "m"),
    "species": ("species",),
    "type": ("type",),
}
"""Names of columns with one value per sphere, in lower case without `_`; a type counts from 1, a species from 0."""
VECTORS = {
    "position": ("position", "pos", "coordinates", ""),
    "velocity": ("velocity", "vel", "v", "linvelvec"),
    "angular_velocity": ("angularvelocity", "omega", "w", "angvelvec"),
}
"""Names of vectors; a column has the name with x, y or z behind it."""
_TITLE = re.compile(r"\s*(?P<name>[^\[\]]*?)\s*(\[(?P<unit>[^\[\]]*)\])?\s*")
_UNITS = {**UNITS, "diameter": "m", "mass": "kg", "id": "1", "species": "1", "type": "1"}


def field_of(title: str) -> tuple[str, int | None] | None:
    """Field and axis (None for one value per sphere, -1 for a whole vector) of a column; None for one of no use here.

    Args:
        title: As in `radius`, `vx`, `PosX[m]` or `position_x [m]`.

    Raises:
        StateError: The unit in brackets is another than the SI unit.
    """
    match = _TITLE.fullmatch(title)
    if match is None:
        return None
    name, unit = match["name"].lower().replace("_", "").replace(" ", ""), match["unit"]
    field = next((field for field, names in SCALARS.items() if name in names), None)
    axis: int | None = None
    if field is None:
        for vector, names in VECTORS.items():
            if name and name in names:
                field, axis = vector, -1
            elif name[-1:] in ("x", "y", "z") and name[:-1] in names:
                field, axis = vector, "xyz".index(name[-1])
    if field is None:
        return None
    if unit is not None and unit.strip().replace("^", "") != _UNITS[field]:
        raise StateError(f"column '{title.strip()}': the unit is {unit}; accepted is {_UNITS[field]}")
    return field, axis


def state_from(columns: Mapping[str, np.ndarray]) -> State:
    """A state from columns by their titles; columns of no use here are left out.

    A diameter gives the radius, and a mass with it the density of a solid sphere, where these are not given.

    Raises:
        StateError: No position, an incomplete vector, two columns for one field, another unit, or a bad value.
    """
    scalars: dict[str, np.ndarray] = {}
    vectors: dict[str, dict[int, np.ndarray]] = {}
    titles: dict[tuple[str, int | None], str] = {}
    for title, values in columns.items():
        found = field_of(title)
        if found is None or (found[1] == -1) != (np.ndim(values) == 2):
            continue
        if found in titles:
            raise StateError(f"columns '{titles[found]}' and '{title}' are both {found[0]}; accepted is one")
        titles[found] = title
        field, axis = found
        if axis is None:
            scalars[field] = values
        elif axis >= 0:
            vectors.setdefault(field, {})[axis] = values
        else:
            vectors.setdefault(field, {}).update(enumerate(np.asarray(values).T))
    whole: dict[str, np.ndarray] = {}
    for field, parts in vectors.items():
        if set(parts) != {0, 1, 2}:
            missing = ", ".join(axis for k, axis in enumerate("xyz") if k not in parts)
            raise StateError(f"{field} has no {missing}; accepted are all of x, y, z, or none")
        whole[field] = np.stack([parts[k] for k in range(3)], axis=1)
    if "position" not in whole:
        raise StateError(f"no positions; accepted are columns x, y, z. There are {', '.join(columns) or 'none'}")
    return state_of(**whole, **_derived(scalars))


def _derived(scalars: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Radius, density and species where diameter, mass and type are given."""
    found = dict(scalars)
    diameter, mass, kind = (found.pop(name, None) for name in ("diameter", "mass", "type"))
    if diameter is not None and "radius" not in found:
        found["radius"] = 0.5 * np.asarray(diameter)
    if mass is not None and "density" not in found and "radius" in found:
        found["density"] = np.asarray(mass) / (4 / 3 * np.pi * np.asarray(found["radius"]) ** 3)
    if kind is not None and "species" not in found:
        found["species"] = np.asarray(kind) - 1
    return found
