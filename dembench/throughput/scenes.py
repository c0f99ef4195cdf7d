"""The scenes whose steps are timed: the bulk cases at their published sizes, and one bed in many sizes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from dembench.cases.initial_states import given_file
from dembench.cases.registry import parse_case
from dembench.initial.cache import cached
from dembench.initial.progress import Progress
from dembench.runs.plan import RequestError
from dembench.scene import Bodies, Domain, Energy, Material, PairLaw, Plane, Scene, Species
from dembench.scene.checks import check_scene
from dembench.scene.overlap import touching

WORK = 5e7
"""Particle-steps that are timed: some ten seconds of one core."""
LEAST = 200
"""Least number of steps that are timed."""
START = 0.25
"""Steps of the shorter of both runs over the steps that are timed [-]."""
BALL_GAP, BALL_SPEED = 5e-4, 5.2
"""Height of the ball above the bed [m], and its speed [m/s]: it digs in within the shorter run."""

RADIUS, DENSITY, YOUNG, POISSON, RESTITUTION, FRICTION, STEP = 1e-3, 2500.0, 1e7, 0.25, 0.5, 0.5, 1e-5
"""Grains of the bed in many sizes [m], [kg/m^3], [Pa], [-], [-], [-], and its time step [s], 12 % of Rayleigh's."""
GRAVITY = 9.81
WIDTH, LAYERS, SPACING, POURING = 5, 20, 2.3, 0.3
"""Grains along an edge of a tile before they fall, their layers, their distance in radii, and the time in which they
come to rest [s]."""
TILES = {"1k": (1, 2), "5k": (2, 5), "25k": (5, 10), "100k": (10, 20), "500k": (25, 40), "1M": (40, 50)}
"""Tiles of 500 grains along both edges of the bed by its size."""
SERIES = "scaling"
"""Name that stands for the bed in all its sizes."""
WIDE, RATIOS, WIDE_TILES = "wide", (1, 10, 100), (22, 22)
"""Name that stands for a bed with balls of these sizes over that of its grains, where 1 is the bed alone; its tiles
along both edges, more than 100 grain diameters."""
WIDE_SPEED = 1.0
"""Speed at which these balls are set down [m/s]: what is timed is the search for neighbours, not an impact."""


@dataclass(frozen=True)
class Timed:
    """A scene that is run twice, up to two ends: what lies between them is timed, and nothing else.

    Attributes:
        name: Its name.
        short, long: The scene up to both ends, equal in all else.
        touching: Pairs that touch at the start, over the number of bodies [-].
    """

    name: str
    short: Scene
    long: Scene
    touching: float

    @property
    def bodies(self) -> int:
        """Number of bodies."""
        return len(self.long.bodies)

    @property
    def dt(self) -> float:
        """Time step of all engines [s]."""
        return self.long.closed_step()

    @property
    def steps(self) -> int:
        """Number of steps that are timed."""
        return round((self.long.duration - self.short.duration) / self.dt)


def timed(name: str, scene: Scene, steps: int | None = None) -> Timed:
    """A scene in two lengths, which records its start and its end and nothing else.

    Args:
        name: Name of the scene.
        scene: The scene.
        steps: Steps that are timed; None for as many as make `WORK`, at least `LEAST`.

    Raises:
        SceneError: Bodies lie outside the walls or overlap.
    """
    check_scene(scene)
    bodies = scene.bodies
    count = steps or max(LEAST, math.ceil(WORK / len(bodies)))
    start = math.ceil(START * count)
    pairs = len(touching(bodies.position, scene.radii(), scene.domain)[0])
    return Timed(name, _ending(scene, start), _ending(scene, start + count), pairs / len(bodies))


def _ending(scene: Scene, steps: int) -> Scene:
    step = scene.closed_step()
    ends = Energy(name="ends", interval=steps * step)
    return scene.model_copy(update={"duration": steps * step, "time_step": step, "observables": (ends,)})


def names(text: str) -> list[str]:
    """Names of scenes from a text such as `bed25k,scaling`; a series stands for all its members.

    Raises:
        RequestError: A scene is not known.
    """
    found: list[str] = []
    for name in (part.strip() for part in text.split(",")):
        members = [known for known in SCENES if known.startswith(f"{name}-")] if name in (SERIES, WIDE) else [name]
        if members[0] not in SCENES:
            raise RequestError(f"scene '{name}' is not known; accepted are {', '.join(SCENES)}, {SERIES}, {WIDE}")
        found += [member for member in members if member not in found]
    return found


# ---- the bulk cases


def _impact(ball: bool, initial: Path | None, progress: Progress | None) -> Scene:
    """The settled bed of case 3, alone or with the ball just above it."""
    scene = _bulk("case3", "impact 25k", initial, progress)
    position, velocity = scene.bodies.position.copy(), scene.bodies.velocity.copy()
    grains = position[:-1]
    if not ball:
        return scene.model_copy(update={"bodies": Bodies(position=grains), "species": scene.species[:1]})
    radii = scene.radii()
    position[-1, 2] = _above(grains, radii[-1] + radii[:-1], position[-1, :2])
    velocity[-1] = (0, 0, -BALL_SPEED)
    bodies = Bodies(position=position, velocity=velocity, species=scene.bodies.species)
    return scene.model_copy(update={"bodies": bodies})


def _above(grains: np.ndarray, reach: np.ndarray | float, point: np.ndarray) -> float:
    """Height at which a ball hangs `BALL_GAP` above grains that it touches within `reach` of their centres [m]."""
    aside = np.linalg.norm(grains[:, :2] - point, axis=1)
    return float((grains[:, 2] + np.sqrt(np.maximum(reach**2 - aside**2, 0)))[aside < reach].max()) + BALL_GAP


def _bulk(case_name: str, file: str, initial: Path | None, progress: Progress | None) -> Scene:
    """A published case from its initial state; from a fill of our own where what is given lacks that file."""
    case, parameters = parse_case(case_name)
    given = initial if given_file(initial, file, optional=True) else None
    return case.scene(parameters, "published", given, 0, progress)


# ---- the bed in many sizes


def _tiled(tiles: tuple[int, int], initial: Path | None, progress: Progress | None) -> Scene:
    """A settled bed between periodic sides, repeated along both of them: its parts are alike in every size.

    Args:
        tiles: Tiles along both edges.
        initial, progress: Not used; the tile is settled within seconds and kept in the cache.
    """
    inputs = {"version": 1, "radius": RADIUS, "width": WIDTH, "layers": LAYERS, "spacing": SPACING, "time": POURING}
    tile = cached("tile", inputs, _settled)
    edge = WIDTH * SPACING * RADIUS
    offsets = edge * np.stack(np.meshgrid(*map(np.arange, tiles), [0], indexing="ij"), axis=-1).reshape(-1, 1, 3)
    return _between_periodic_sides((tile + offsets).reshape(-1, 3), (tiles[0] * edge, tiles[1] * edge))


def _wide(ratio: int, initial: Path | None, progress: Progress | None) -> Scene:
    """The bed of `WIDE_TILES` with a ball `ratio` times as large as its grains just above it; with 1 the bed alone."""
    bed = _tiled(WIDE_TILES, initial, progress)
    if ratio == 1:
        return bed
    grains, radius = bed.bodies.position, ratio * RADIUS
    middle = 0.5 * np.array(bed.domain.upper[:2])
    height = _above(grains, radius + RADIUS, middle)
    motion = np.zeros((len(grains) + 1, 3))
    motion[-1, 2] = -WIDE_SPEED
    bodies = Bodies(
        position=np.vstack([grains, [*middle, height]]),
        velocity=motion,
        species=np.append(np.zeros(len(grains), dtype=int), 1),
    )
    upper = (*bed.domain.upper[:2], height + radius + 2 * RADIUS)
    ball = Species(name="ball", material="solid", radius=radius)
    changes = {"bodies": bodies, "species": (*bed.species, ball), "name": f"wide_{ratio}"}
    return bed.model_copy(update={**changes, "domain": bed.domain.model_copy(update={"upper": upper})})


def _settled() -> np.ndarray:
    """Centres of the grains of a tile that has come to rest [m], shape (n, 3)."""
    from dembench.solver import Simulation

    pitch = SPACING * RADIUS
    lattice = np.stack(np.meshgrid(np.arange(WIDTH), np.arange(WIDTH), np.arange(LAYERS)), axis=-1).reshape(-1, 3) + 0.5
    position = lattice * pitch + np.random.default_rng(0).uniform(-0.1, 0.1, lattice.shape) * RADIUS
    simulation = Simulation(_between_periodic_sides(position, (WIDTH * pitch, WIDTH * pitch)), STEP)
    simulation.step(round(POURING / STEP))
    return simulation.position


def _between_periodic_sides(position: np.ndarray, edges: tuple[float, float]) -> Scene:
    """Grains above a floor, in a box of these edges [m] whose sides are joined."""
    position = np.column_stack([np.mod(position[:, :2], edges), position[:, 2]])
    room = 2 * RADIUS
    return Scene(
        name=f"bed_{len(position)}",
        materials=(Material(name="solid", density=DENSITY, young=YOUNG, poisson=POISSON),),
        pair_laws=(PairLaw(a="solid", b="solid", restitution=RESTITUTION, friction=FRICTION),),
        species=(Species(name="grain", material="solid", radius=RADIUS),),
        walls=(Plane(name="floor", material="solid", point=(0, 0, 0), normal=(0, 0, 1)),),
        bodies=Bodies(position=position),
        domain=Domain(
            lower=(0, 0, -room), upper=(*edges, float(position[:, 2].max()) + room), periodic=(True, True, False)
        ),
        gravity=(0, 0, -GRAVITY),
        duration=POURING,
        time_step=STEP,
        observables=(),
    )


SCENES: dict[str, Callable[[Path | None, Progress | None], Scene]] = {
    "bed25k": partial(_impact, False),
    "bed25k-ball": partial(_impact, True),
    "drum38k": partial(_bulk, "case2", "drum"),
    "silo100k": partial(_bulk, "case1", "silo large M1"),
    **{f"{SERIES}-{size}": partial(_tiled, tiles) for size, tiles in TILES.items()},
    **{f"{WIDE}-{ratio}": partial(_wide, ratio) for ratio in RATIOS},
}
"""What makes a scene from the directory of published states, or from what dembench makes itself, by name."""
