"""The deck of Yade: everything that the script's template needs, and the initial state beside it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from dembench.engines.scene_queries import (
    clipped,
    materials_of,
    observed_walls,
    pairs_of,
)
from dembench.engines.script_runs import IDS_PER_LINE, rendered, sampling
from dembench.engines.yade_walls import STAYS, Built, across, built
from dembench.scene import PairLaw, Region, Scene, features

ROOM = 4.0
"""Length of the periodic cell along an axis that is not periodic, in lengths of the domain: no image is met there."""
BLOCKED = {"fixed": "xyzXYZ", "kinematic": "xyzXYZ", "rotation-locked": "XYZ"}
"""What the program leaves as it is, by the kind of the constraint."""


def deck(scene: Scene, settings: Any, command: str) -> str:
    """The script of a run.

    Args:
        scene: The scene.
        settings: YadeSettings of the run.
        command: Command line of the run, for the reader of the script.
    """
    return rendered("yade_simulate.py.j2", _values(scene, settings), command=command)


def _values(scene: Scene, settings: Any) -> dict[str, Any]:
    walls = built(scene, settings.segments)
    edges = np.subtract(scene.domain.upper, scene.domain.lower)
    return {
        "scene": scene,
        "count": len(scene.bodies),
        "dt": settings.dt,
        "skin": settings.skin,
        "materials": materials_of(scene),
        "damping": "betan" if clipped(scene) else "en",
        "pairs": [_pair(scene, pair) for pair in pairs_of(scene)],
        "friction": features(scene).friction,
        "blocked": _blocked(scene),
        "periodic": [axis for axis in range(3) if scene.domain.periodic[axis]],
        "across": across(scene),
        "cell": [repr(float(e if p else ROOM * e)) for e, p in zip(edges, scene.domain.periodic, strict=True)],
        "walls": walls,
        "surfaces": any(wall.mask == STAYS for wall in walls),
        "shaken": [wall for wall in walls if wall.amplitude],
        "observed": observed_walls(scene),
        "sinks": [_within(sink.region) for sink in scene.sinks],
        "removal": max(1, round(settings.sink_interval / settings.dt)),
        **sampling(scene, settings.dt),
    }


def _pair(scene: Scene, pair: PairLaw) -> dict[str, Any]:
    """Numbers of a pair: its restitution, or the ratio sqrt(5/6) b of its dashpots, and its angle of friction."""
    damping = math.sqrt(5 / 6) * pair.damping_ratio() if clipped(scene) else pair.restitution
    return {"a": pair.a, "b": pair.b, "damping": repr(damping), "angle": repr(math.atan(pair.friction))}


def _blocked(scene: Scene) -> list[tuple[str, list[int]]]:
    """Axes that are blocked and the bodies, in short lines."""
    kinds: dict[int, set[str]] = {}
    for constraint in scene.constraints:
        for body in constraint.bodies:
            kinds.setdefault(body, set()).update(BLOCKED[constraint.kind])
    found = []
    for axes in ("xyzXYZ", "XYZ"):
        bodies = sorted(body for body, blocked in kinds.items() if blocked == set(axes))
        found += [(axes, bodies[k : k + IDS_PER_LINE]) for k in range(0, len(bodies), IDS_PER_LINE)]
    return found


def _within(region: Region) -> str:
    """Whether x, y, z lie in a region, as a Python expression."""
    terms = [
        f"{bound!r} <= {axis}" if side == 0 else f"{axis} <= {bound!r}"
        for side, bounds in enumerate((region.lower, region.upper))
        for axis, bound in zip("xyz", bounds, strict=True)
        if bound is not None
    ]
    return f"({' and '.join(terms) or 'True'})"


def write_triangles(walls: list[Built], directory: Path) -> None:
    """Triangles of walls, nine coordinates in a line."""
    for wall in walls:
        if wall.file:
            np.savetxt(directory / wall.file, wall.triangles.reshape(-1, 9), fmt="%.17g")
