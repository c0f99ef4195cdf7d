"""Small scenes for the tests of the engines whose decks are scripts."""

from __future__ import annotations

from typing import Any

import numpy as np
from parts import DRUM, GLASS, PAIRS, STEEL, TURNING

from dembench.scene import Scene, scene_from

BOX = {"kind": "box", "name": "box", "material": "steel", "lower": (-0.012,) * 3, "upper": (0.012,) * 3}
VOID = {
    "kind": "sdf",
    "name": "void",
    "material": "steel",
    "values": np.tile([-0.01, 0.0, 0.01], (3, 3, 1)),
    "origin": (0, 0, -0.01),
    "spacing": 0.01,
}
FLOOR = {"kind": "plane", "name": "floor", "material": "steel", "point": (0, 0, -0.02), "normal": (0, 0, 1)}
SINKS = ({"name": "outlet", "region": {"lower": (0.01, None, None), "upper": (None, None, -0.01)}},)
PERIODIC = {"lower": (-0.03,) * 3, "upper": (0.03,) * 3, "periodic": (True, True, False)}


def scene(**changes: Any) -> Scene:
    """One grain of 1.5 mm radius at rest, without walls, in a domain of 6 cm, for 10 ms."""
    fields: dict[str, Any] = {
        "name": "deck",
        "materials": (GLASS, STEEL),
        "pair_laws": PAIRS,
        "species": ({"name": "grain", "material": "glass", "radius": 0.0015},),
        "bodies": {"position": [[0, 0, 0]]},
        "domain": {"lower": (-0.03,) * 3, "upper": (0.03,) * 3},
        "duration": 0.01,
        "time_step": 5e-6,
        "observables": ({"kind": "energy", "name": "energy", "interval": 1e-3},),
    }
    return scene_from({**fields, **changes})


def two_spheres() -> Scene:
    """Two frictionless grains head on."""
    return scene(
        name="two_spheres",
        materials=(GLASS,),
        pair_laws=({"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0},),
        bodies={"position": [[-0.002, 0, 0], [0.002, 0, 0]], "velocity": [[0.5, 0, 0], [-0.5, 0, 0]]},
        gravity=(0, 0, 0),
    )


def box() -> Scene:
    """Grains and a large tracked ball over a box with an open top."""
    return scene(
        name="box",
        walls=({**BOX, "open_faces": ("z+",)},),
        species=(
            {"name": "grain", "material": "glass", "radius": 0.0015},
            {"name": "ball", "material": "steel", "radius": 0.006},
        ),
        pair_laws=(
            {"a": "glass", "b": "glass", "restitution": 0.5, "friction": 0.3},
            {"a": "steel", "b": "glass", "restitution": 0.4, "friction": 0.2},
            {"a": "steel", "b": "steel", "restitution": 0.6, "friction": 0.5},
        ),
        bodies={
            "position": [[0.004, 0, -0.0105], [-0.004, 0.001, -0.0105], [0, 0, 0.008]],
            "velocity": [[0, 0, 0], [0, 0, 0], [0, 0, -1]],
            "species": [0, 0, 1],
        },
        constraints=({"kind": "fixed", "bodies": (0,)},),
        observables=(
            {"kind": "trajectory", "name": "ball", "body": 2, "interval": 1e-3, "track_interval": 2e-4},
            {"kind": "snapshot", "name": "late", "times": (0.0045,)},
        ),
    )


def drum(**changes: Any) -> Scene:
    """Grains in a turning cylinder."""
    start = [[0.003 * k, 0.002 * k, -0.0164 + 0.0005 * k * k] for k in range(-2, 3)]
    return scene(**{"name": "drum", "walls": ({**DRUM, "motion": TURNING},), "bodies": {"position": start}, **changes})


def chute(motion: dict[str, Any] | None = None, observed: tuple[str, ...] = ()) -> Scene:
    """A grain between a moving belt and a slope, a body that cannot turn, and a sink.

    Args:
        motion: That of the slope.
        observed: Walls whose forces are recorded.
    """
    belt = {**FLOOR, "name": "belt", "motion": {"velocity": (0.5, 0, 0), "surface": True}}
    slope = {**FLOOR, "name": "slope", "material": "glass", "normal": (0, 0.6, 0.8), "motion": motion}
    forces = ({"kind": "wall-force", "name": name, "wall": name, "interval": 1e-3} for name in observed)
    return scene(
        name="chute",
        walls=(belt, slope),
        bodies={"position": [[0, 0, 0], [0.005, 0, 0]]},
        constraints=({"kind": "rotation-locked", "bodies": (1,)},),
        sinks=SINKS,
        observables=({"kind": "count", "name": "all", "interval": 1e-3}, *forces),
    )


def layer(law: dict[str, str], **changes: Any) -> Scene:
    """Grains over a floor between periodic sides."""
    bodies = {"position": [[0, 0, 0], [0.005, 0, 0]]}
    return scene(name="layer", law=law, walls=(FLOOR,), bodies=bodies, domain=PERIODIC, **changes)


def grains() -> Scene:
    """Sixty-four moving grains that fall into a box."""
    line = np.linspace(-0.009, 0.009, 4)
    position = np.stack(np.meshgrid(line, line, line), axis=-1).reshape(-1, 3)
    velocity = 0.1 * np.sin(1000 * position[:, [1, 2, 0]] + position)
    return scene(name="grains", walls=(BOX,), bodies={"position": position, "velocity": velocity}, duration=0.04)
