"""What every scene model shares: frozen, closed, finite, and named by identifiers."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,47}$")]
"""An identifier: letters, digits, underscore. It can be written into a deck, a path or a page as it is."""

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Vector = tuple[Finite, Finite, Finite]


def _unit(value: Vector) -> Vector:
    length = math.hypot(*value)
    if length == 0:
        raise ValueError("a direction must not be the zero vector")
    if abs(length - 1) < 1e-14:  # so that a direction read back from a file is the same to the last bit
        return value
    return (value[0] / length, value[1] / length, value[2] / length)


Direction = Annotated[Vector, AfterValidator(_unit)]
"""A vector that is normalised on entry."""


class Model(BaseModel):
    """Frozen pydantic model that refuses unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)
