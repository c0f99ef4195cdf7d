"""What several adapters ask of a scene."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from dembench.scene import HertzMindlin, Material, PairLaw, Scene, WallForce, features


def steps_of(times: np.ndarray, dt: float) -> list[int]:
    """Step numbers of times [s] that are multiples of the time step [s]."""
    return [round(t / dt) for t in times]


def every_of(steps: list[int], last: int) -> int:
    """The largest interval that meets all steps; `last` where there is nothing but step 0."""
    return math.gcd(*steps) or last


def observed_walls(scene: Scene) -> list[str]:
    """Names of the walls whose force is observed, each once."""
    return list(dict.fromkeys(o.wall for o in scene.observables if isinstance(o, WallForce)))


def in_sink(scene: Scene, position: np.ndarray) -> np.ndarray:
    """Which positions [m], shape (n, 3), lie in a sink: a program may not have removed the body yet."""
    gone = np.zeros(len(position), dtype=bool)
    for sink in scene.sinks:
        gone |= sink.region.contains(position)
    return gone


def materials_of(scene: Scene) -> list[Material]:
    """Materials in use, in the scene's order."""
    used = {s.material for s in scene.species} | {w.material for w in scene.walls}
    return [m for m in scene.materials if m.name in used]


def pairs_of(scene: Scene) -> list[PairLaw]:
    """Laws of the pairs of materials in use, in the scene's order."""
    names = {m.name for m in materials_of(scene)}
    return [pair for pair in scene.pair_laws if {pair.a, pair.b} <= names]


def clipped(scene: Scene) -> bool:
    """Whether the scene's own law clips the tension: then a program that does is given its dashpots."""
    return isinstance(scene.law, HertzMindlin) and scene.law.variant == "no-tension"


def beyond_hertzian_spheres(scene: Scene, variants: Collection[str], lowest: float = 0.0) -> list[str]:
    """What a scene has beyond spheres under the Hertz-Mindlin law without rolling friction, one line each.

    Args:
        scene: The scene.
        variants: Variants of the law that the program has.
        lowest: Restitution above which the program's dashpots hold [-].
    """
    law, present = scene.law, features(scene)
    faults: list[str] = []
    if not isinstance(law, HertzMindlin):
        faults.append(f"contact law {law.kind}")
    elif law.variant not in variants:
        faults.append(f"variant {law.variant} of the contact law")
    faults += [
        f"restitution {pair.restitution:g} of {pair.a}-{pair.b}: accepted is {lowest:g} < e <= 1"
        for pair in scene.pair_laws
        if not lowest < pair.restitution <= 1
    ]
    faults += ["rolling friction"] * present.rolling_friction
    return faults + ["particles that are no spheres"] * present.shapes
