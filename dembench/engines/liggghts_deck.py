"""The deck of LIGGGHTS: script, initial state, and how a run is cut where bodies leave and checkpoints are written."""

from __future__ import annotations

import math
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from dembench.engines.base import names_of
from dembench.engines.liggghts_output import FIRST_FORCES, Launch
from dembench.engines.liggghts_walls import AXES, Walls, type_of
from dembench.engines.round_walls import half_space
from dembench.engines.scene_queries import every_of, materials_of, observed_walls, steps_of
from dembench.scene import Motion, Region, Scene, features

SOFT_YOUNG, HARD_YOUNG = 5e6, 1e9
IDS_PER_LINE = 1000
FAR = 1e6
"""Height of a plane that no body comes near [m]."""
FASTEST = 10.0
"""Speed up to which no body crosses the room behind a sink between two removals [m/s]."""


def deck(scene: Scene, settings: Any, parts: Walls, legs: list[int], launch: Launch, command: str) -> str:
    """The script of one launch.

    Args:
        scene: The scene.
        settings: LiggghtsSettings of the run.
        parts: Its walls.
        legs: Steps at which the launch writes a checkpoint, and its last step, ascending.
        launch: Where it starts.
        command: Command line of the launch, for the reader of the script.
    """
    template = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True).from_string(
        files("dembench.engines").joinpath("liggghts.in.j2").read_text()
    )
    return template.render(_values(scene, settings, parts), walls=parts, legs=legs, launch=launch, command=command)


def _values(scene: Scene, settings: Any, parts: Walls) -> dict[str, Any]:
    """Everything that the template needs apart from the walls and the launch."""
    materials = materials_of(scene)
    present = features(scene).forced(names_of(settings.force))
    laws = {frozenset((p.a, p.b)): p for p in scene.pair_laws}
    pairs = [laws.get(frozenset((a.name, b.name))) for a in materials for b in materials]
    steps = steps_of(np.array([scene.duration]), settings.dt)[0]
    held = sorted({b for c in scene.constraints for b in c.bodies})
    magnitude = math.hypot(*scene.gravity)
    tracks = steps_of(scene.track_times(), settings.dt)
    # By itself the program takes half the largest cutoff, which is nothing once all bodies are gone.
    cell = float(f"{scene.radii().max() + settings.skin / 2:.6g}") if scene.sinks else None
    return {
        "scene": scene,
        "count": len(scene.bodies),
        "dt": settings.dt,
        "steps": steps,
        "skin": settings.skin,
        "bin_size": settings.bin_size or cell,
        "sort_size": settings.sort_size or cell,
        "boundary": " ".join("p" if p else "f" for p in scene.domain.periodic),
        "grid": grid(scene, settings.ranks) if settings.ranks > 1 else None,
        "hard": any(m.young > HARD_YOUNG for m in materials),
        "soft": any(m.young < SOFT_YOUNG for m in materials),
        "materials": materials,
        "restitution": [p.restitution if p else 1.0 for p in pairs],  # None: two materials that never touch
        "friction": [p.friction if p else 0.0 for p in pairs],
        "history": present.tangential_history,
        "rotation": present.rotation,
        "gravity": {"magnitude": magnitude, "direction": scene.gravity} if present.gravity else None,
        "fixed": [[b + 1 for b in held[k : k + IDS_PER_LINE]] for k in range(0, len(held), IDS_PER_LINE)],
        "sinks": [block_of(sink.region) for sink in scene.sinks],
        "removal": removal(scene, settings),
        "thermo": max(1, steps // 200),
        "frame_every": every_of(steps_of(scene.frame_times(), settings.dt), steps),
        "far": FAR,
        "first_forces": FIRST_FORCES,
        **_forces(scene, parts),
        "tracked": [b + 1 for b in scene.tracked_bodies()],
        "track_every": every_of(tracks, steps),
    }


def _forces(scene: Scene, parts: Walls) -> dict[str, Any]:
    """Ids of the parts whose forces are recorded, and the force on each observed wall as a sum over its parts."""
    observed = observed_walls(scene)
    summed = [p.id for p in parts.primitives if p.wall in observed]
    stressed = [s.id for s in parts.surfaces if s.wall in observed]
    sums = []
    for wall in observed:
        for k, axis in enumerate(AXES, 1):
            terms = [f"-c_on_{p.id}[{k}]" for p in parts.primitives if p.wall == wall]
            terms += [f"+f_{s.id}[{k}]" for s in parts.surfaces if s.wall == wall]
            sums.append((f"on_{wall}_{axis}", "0" + "".join(terms)))
    return {"summed": summed, "stressed": stressed, "forces": sums}


def block_of(region: Region) -> str:
    """A region as arguments of the style `block`."""
    bounds = [
        "INF" if bound is None else repr(bound)
        for pair in zip(region.lower, region.upper, strict=True)
        for bound in pair
    ]
    return " ".join(bounds)


def removal(scene: Scene, settings: Any) -> int:
    """Steps between two removals of the bodies in sinks; 0 without sinks."""
    return max(1, round(settings.sink_interval / settings.dt)) if scene.sinks else 0


def legs(scene: Scene, settings: Any, throughput: float, start: int = 0) -> list[int]:
    """Steps at which a checkpoint is written, and the last step, ascending and after `start`.

    Args:
        scene: The scene.
        settings: LiggghtsSettings of the run.
        throughput: Steps of one body in a second of wall time [1/s].
        start: Step at which the launch starts.
    """
    last = steps_of(np.array([scene.duration]), settings.dt)[0]
    size = max(1, round(settings.checkpoint * throughput / len(scene.bodies)))
    if unit := removal(scene, settings):
        size = math.ceil(size / unit) * unit
    return [step for step in range(size, last - size // 2, size) if step > start] + [last]


def grid(scene: Scene, ranks: int) -> tuple[int, int, int]:
    """The division of the domain among ranks.

    The ranks have equal parts of the domain, not of the bodies: first comes the grid whose fullest part holds the
    fewest bodies, so that no cut leaves a part empty, and among grids within a tenth of that the one with the least cut
    surface through the bodies. Where walls turn, the bed will climb with them: it is looked at there, too.
    """
    position = scene.bodies.position
    low, high = np.array(scene.domain.lower), np.array(scene.domain.upper)
    turned = [_climbed(position, w.motion) for w in scene.walls if w.motion and any(w.motion.angular_velocity)]
    shares = [np.clip((p - low) / (high - low), 0, np.nextafter(1, 0)) for p in (position, *turned)]
    spread = np.std(position, axis=0) + scene.radii().mean()  # not the extent: a single ball would set it
    faces = spread.prod() / spread
    grids = [
        (a, b, ranks // (a * b)) for a in range(1, ranks + 1) for b in range(1, ranks // a + 1) if ranks % (a * b) == 0
    ]
    loads = [
        max(np.unique((share * g).astype(int), axis=0, return_counts=True)[1].max() for share in shares) for g in grids
    ]
    even = [g for g, load in zip(grids, loads, strict=True) if load <= 1.1 * min(loads)]
    return min(even, key=lambda g: (np.array(g) - 1) @ faces)


def _climbed(position: np.ndarray, motion: Motion) -> np.ndarray:
    """Positions [m] after an eighth of a turn of a wall: Rodrigues' rotation."""
    axis = np.array(motion.angular_velocity) / np.linalg.norm(motion.angular_velocity)
    relative = position - motion.centre
    along = (relative @ axis)[:, None] * axis
    angle = math.pi / 4
    return motion.centre + along + math.cos(angle) * (relative - along) + math.sin(angle) * np.cross(axis, relative)


def box(scene: Scene, settings: Any, parts: Walls) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the program's box [m].

    The domain, but where a sink takes a whole side of it only the way that a body may make in the sink before it is
    removed; and the triangles of walls wherever they move.
    """
    low, high = np.array(scene.domain.lower), np.array(scene.domain.upper)
    way = FASTEST * settings.sink_interval
    for half in filter(None, (half_space(sink.region) for sink in scene.sinks)):
        axis, side, border = half
        if side < 0:
            low[axis] = min(border - way, scene.bodies.position[:, axis].min())
        else:
            high[axis] = max(border + way, scene.bodies.position[:, axis].max())
    for surface in parts.surfaces:
        reached = surface.reach(scene.duration)
        low, high = np.minimum(low, reached[0]), np.maximum(high, reached[1])
    low, high = np.maximum(low, parts.floor), np.minimum(high, parts.ceiling)
    periodic = scene.domain.periodic
    return np.where(periodic, scene.domain.lower, low), np.where(periodic, scene.domain.upper, high)


def write_bodies(scene: Scene, corners: tuple[np.ndarray, np.ndarray], path: Path) -> None:
    """The initial state of a scene, every number to its last bit, in a box with these corners [m]."""
    bodies = scene.bodies
    n = len(bodies)
    still = np.isin(np.arange(n), [b for c in scene.constraints if c.kind == "fixed" for b in c.bodies])[:, None]
    number = np.arange(1, n + 1)
    types = np.array([type_of(scene, s.material) for s in scene.species])[bodies.species]
    atoms = np.column_stack([number, types, 2 * scene.radii(), scene.densities(), bodies.position])
    motion = np.column_stack([np.where(still, 0, bodies.velocity), np.where(still, 0, bodies.angular_velocity)])
    sides = [f"{float(lo)!r} {float(hi)!r} {a}lo {a}hi" for lo, hi, a in zip(*corners, AXES, strict=True)]
    with open(path, "w") as stream:
        stream.write(f"Initial state of {scene.name}\n\n{n} atoms\n{len(materials_of(scene))} atom types\n\n")
        stream.write("\n".join(sides) + "\n\nAtoms\n\n")
        np.savetxt(stream, atoms, fmt="%d %d" + 5 * " %.17g")
        stream.write("\nVelocities\n\n")
        np.savetxt(stream, np.column_stack([number, motion]), fmt="%d" + 6 * " %.17g")
