"""Materials, pairs and walls that scenes of several engines' tests are made of."""

from __future__ import annotations

GLASS = {"name": "glass", "density": 2500, "young": 1e7, "poisson": 0.2}
STEEL = {"name": "steel", "density": 7200, "young": 2.1e11, "poisson": 0.2}
PAIRS = (
    {"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0.3},
    {"a": "steel", "b": "glass", "restitution": 0.4, "friction": 0.2},
)
DRUM = {
    "kind": "cylinder",
    "name": "drum",
    "material": "steel",
    "start": (0, -0.012, 0),
    "end": (0, 0.012, 0),
    "radius": 0.018,
    "closed_start": True,
    "closed_end": True,
}
TURNING = {"angular_velocity": (0, -2, 0)}
