"""Small scenes for the tests of the engine musen."""

from __future__ import annotations

from typing import Any

from parts import DRUM, GLASS, PAIRS, STEEL, TURNING

from dembench.scene import Scene, scene_from

FLOOR = {"kind": "plane", "name": "floor", "material": "steel", "point": (0, 0, 0), "normal": (0, 0, 1)}
BOX = {"kind": "box", "name": "box", "material": "steel", "lower": (-0.01,) * 3, "upper": (0.01,) * 3}
CONE = {
    "kind": "frustum",
    "name": "cone",
    "material": "steel",
    "start": (0, 0, -0.01),
    "end": (0, 0, 0.01),
    "radius_start": 0.004,
    "radius_end": 0.012,
}
SINK = {"name": "outlet", "region": {"upper": (None, None, -0.02)}}


def scene(**changes: Any) -> Scene:
    """Two grains of 1 mm radius at rest, without walls, in a domain of 6 cm, for 10 ms."""
    fields: dict[str, Any] = {
        "name": "deck",
        "materials": (GLASS, STEEL),
        "pair_laws": PAIRS,
        "species": ({"name": "grain", "material": "glass", "radius": 0.001},),
        "bodies": {"position": [[-0.0015, 0, 0.002], [0.0015, 0, 0.002]]},
        "domain": {"lower": (-0.03,) * 3, "upper": (0.03,) * 3},
        "duration": 0.01,
        "time_step": 1e-5,
        "observables": ({"kind": "energy", "name": "energy", "interval": 1e-3},),
    }
    return scene_from({**fields, **changes})


def two_spheres(young: float = 1e7) -> Scene:
    """Two grains head on, 0.5 m/s each, with a step of 1 us for 5 ms."""
    return scene(
        name="two_spheres",
        materials=({**GLASS, "young": young},),
        pair_laws=({"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0.3},),
        bodies={"position": [[-0.0015, 0, 0], [0.0015, 0, 0]], "velocity": [[0.5, 0, 0], [-0.5, 0, 0]]},
        gravity=(0, 0, 0),
        duration=5e-3,
        time_step=1e-6,
    )


def everything() -> Scene:
    """A large tracked ball among grains, a turning drum, a rising floor whose force is observed, and a sink."""
    return scene(
        name="everything",
        time_step=5e-5,
        walls=({**DRUM, "motion": TURNING}, {**FLOOR, "point": (0, 0, -0.017), "motion": {"velocity": (0, 0, 0.1)}}),
        species=(
            {"name": "grain", "material": "glass", "radius": 0.001},
            {"name": "ball", "material": "steel", "radius": 0.004},
        ),
        pair_laws=(
            {"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0.3},
            {"a": "steel", "b": "glass", "restitution": 0.4, "friction": 0.2},
            {"a": "steel", "b": "steel", "restitution": 0.6, "friction": 0.5},
        ),
        bodies={
            "position": [[0.005, 0, -0.012], [-0.005, 0.001, -0.012], [0, 0, 0.008]],
            "velocity": [[0, 0, 0], [0, 0.1, 0], [0, 0, -1]],
            "angular_velocity": [[0, 0, 0], [0, 0, 7], [0, 0, 0]],
            "species": [0, 0, 1],
        },
        sinks=(SINK,),
        observables=(
            {"kind": "trajectory", "name": "ball", "body": 2, "interval": 1e-3, "track_interval": 2e-4},
            {"kind": "wall-force", "name": "load", "wall": "floor", "interval": 1e-3},
            {"kind": "snapshot", "name": "late", "times": (0.0045,)},
        ),
    )
