"""The deck of LAMMPS: everything that the script's template needs."""

from __future__ import annotations

import math
from importlib.resources import files
from typing import Any

import jinja2
import numpy as np

from dembench.engines.base import names_of
from dembench.engines.lammps_walls import Feature, features_of, groups, law_of
from dembench.engines.liggghts_deck import IDS_PER_LINE, block_of, grid, removal
from dembench.engines.liggghts_walls import AXES
from dembench.engines.scene_queries import every_of, materials_of, observed_walls, steps_of
from dembench.scene import Scene, features

LARGE_RATIO = 3.0
"""Ratio of radii above which small and large bodies are searched apart."""


def deck(scene: Scene, settings: Any, command: str) -> str:
    """The script of a run.

    Args:
        scene: The scene.
        settings: LammpsSettings of the run.
        command: Command line of the run, for the reader of the script.
    """
    template = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True).from_string(
        files("dembench.engines").joinpath("lammps.in.j2").read_text()
    )
    return template.render(_values(scene, settings), command=command)


def _values(scene: Scene, settings: Any) -> dict[str, Any]:
    materials = materials_of(scene)
    present = features(scene).forced(names_of(settings.force))
    laws = {frozenset((p.a, p.b)): p for p in scene.pair_laws}
    pairs = [
        {
            "types": f"{i} {j}",
            "names": f"{a.name}-{b.name}",
            "law": law_of(laws.get(frozenset((a.name, b.name))), a, b, present.tangential_history),
        }
        for i, a in enumerate(materials, 1)
        for j, b in enumerate(materials, 1)
        if i <= j
    ]
    walls = features_of(scene, materials, present.tangential_history)
    steps = steps_of(np.array([scene.duration]), settings.dt)[0]
    held = sorted({b for c in scene.constraints for b in c.bodies})
    smallest, largest = scene.extreme_radii()
    return {
        "scene": scene,
        "count": len(scene.bodies),
        "dt": settings.dt,
        "steps": steps,
        "skin": settings.skin,
        "large": f"{math.sqrt(smallest * largest) * 2!r} {2 * largest!r}" if largest > LARGE_RATIO * smallest else None,
        "boundary": " ".join("p" if p else "f" for p in scene.domain.periodic),
        "grid": grid(scene, settings.ranks) if settings.ranks > 1 else None,
        "pairs": pairs,
        "groups": groups(scene),
        "walls": walls,
        "rotation": present.rotation,
        "gravity": {"magnitude": math.hypot(*scene.gravity), "direction": scene.gravity} if present.gravity else None,
        "fixed": [[b + 1 for b in held[k : k + IDS_PER_LINE]] for k in range(0, len(held), IDS_PER_LINE)],
        "sinks": [block_of(sink.region) for sink in scene.sinks],
        "removal": removal(scene, settings),
        "thermo": max(1, steps // 200),
        "frame_every": every_of(steps_of(scene.frame_times(), settings.dt), steps),
        "tracked": [b + 1 for b in scene.tracked_bodies()],
        "track_every": every_of(steps_of(scene.track_times(), settings.dt), steps),
        **_forces(scene, walls),
    }


def _forces(scene: Scene, walls: list[Feature]) -> dict[str, Any]:
    """Ids of the fixes whose forces are recorded, and the force on each observed wall as a sum over its fixes."""
    observed = observed_walls(scene)
    fixes = {wall: [part.id for made in walls if made.wall == wall for part in made.parts] for wall in observed}
    sums = [
        (f"on_{wall}_{axis}", "0" + "".join(f"-c_on_{id}[{k}]" for id in fixes[wall]))
        for wall in observed
        for k, axis in enumerate(AXES, 1)
    ]
    return {"observed": observed, "summed": [id for wall in observed for id in fixes[wall]], "forces": sums}
