"""Point clouds as VTK data: the arrays of a state by name."""

from __future__ import annotations

import numpy as np

from dembench.initial.formats.state import FIELDS, State


def arrays_of(state: State) -> dict[str, np.ndarray]:
    """The data per point that the state knows, by name; numbers and species are int64."""
    return {name: array for name in FIELDS if (array := getattr(state, name)) is not None}
