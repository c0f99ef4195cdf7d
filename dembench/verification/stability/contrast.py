"""Contrasts of mass and size, and columns: D4 to D8."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from dembench.results import Result
from dembench.scene import Box, Overlap, PairLaw, Rigid, Scene, WallForce
from dembench.scene.materials import Law
from dembench.verification.checks import Check, Experiment, Trial, at_least, at_most, on_one_scene
from dembench.verification.scenes import WALL, Body, Kind, every, floor, scene_of
from dembench.verification.stability.common import (
    lattice,
    motion,
    rayleigh,
    resting_overlap,
    speeds,
    within,
)

G = 9.81

DECADES = (0, 2, 4, 6)
"""Mass of the upper sphere in that of the lower, as powers of ten."""
SIZE, STIFF = 0.1, 1e12
LIGHT_DENSITY = 1 / (4 / 3 * math.pi * SIZE**3)
"""Density of a sphere of 1 kg [kg/m^3]."""
STACK_STEPS, RIGID_STEP = 100_000, 1e-3

GRAIN, BALL = 1e-3, (1e-2, 1e-1)
"""Radii of the grains and of the two balls on them [m]."""
BALL_MASS = 0.05
BED_TIME = 0.01

UNIT_DENSITY = 3 / (4 * math.pi)
"""Density of a sphere of r = 1 m and m = 1 kg [kg/m^3]."""
TOWERS = ((10, 40, 60, 113), (300,), (1000,))
TOWER_TIME, TOWER_STEP = 2.0, 2e-3

BLOCK = (8, 8, 20)
BLOCK_G = 10.0


# ---- D4 and D5: heavy on light, light between heavies


def stack_scene(name: str, law: Law | None) -> Scene:
    """A sphere of 1 kg with one of 10^k kg on it for every k, and one between two of 10^6 kg.

    Soft spheres start at rest in their closed form: with a reduced mass of 1 kg dashpots do not damp a body of 10^6 kg.
    """
    e = 0.0 if law else 0.1
    masses = {"light": 0, **{f"heavy{k}": k for k in DECADES}}
    kinds = {n: Kind(STIFF, LIGHT_DENSITY * 10.0**k, SIZE, restitution=e, friction=0.5) for n, k in masses.items()}
    between = [PairLaw(a="light", b=name, restitution=e, friction=0.5) for name in kinds if name != "light"]
    stacks = [*(["light", f"heavy{k}"] for k in DECADES), ["heavy6", "light", "heavy6"]]
    bodies: list[Body] = []
    for place, stack in enumerate(stacks):
        heights = column([kinds[n] for n in stack], G, rigid=law is not None)
        bodies += [Body(n, (10 * SIZE * place, 0, z)) for n, z in zip(stack, heights, strict=True)]
    dt = RIGID_STEP if law else 0.1 * rayleigh(kinds["light"])
    end = 2.0 if law else STACK_STEPS * dt
    return scene_of(
        name,
        kinds,
        bodies,
        time_step=dt,
        times=every(end / 20, end),
        gravity=(0, 0, -G),
        walls=(floor(),),
        between=between,
        law=law,
    )


def column(kinds: Sequence[Kind], gravity: float, *, rigid: bool) -> np.ndarray:
    """Heights of spheres of one radius and modulus that rest on each other [m], the lowest first."""
    above = np.cumsum([k.mass for k in kinds][::-1])[::-1] * gravity
    one = kinds[0]
    overlap = [0.0 if rigid else resting_overlap(one, f, wall=k == 0) for k, f in enumerate(above)]
    return one.radius * (2 * np.arange(len(kinds)) + 1) - np.cumsum(overlap)


def _stacks(result: Result, *, rigid: bool) -> Mapping[str, float]:
    seen = motion(result)
    last = seen.position[-1]
    lateral = float(np.abs(seen.position[:, -3:, :2] - seen.position[0, -3:, :2]).max() / SIZE)
    lower = last[: 2 * len(DECADES) : 2, 2]
    if rigid:
        upper = last[1 : 2 * len(DECADES) : 2, 2]
        sunk = max(float((SIZE - lower).max()), float((2 * SIZE - upper + lower).max())) / SIZE
        return {"D4c": sunk, "D4d": float(speeds(seen)[-1].max() / (G * RIGID_STEP)), "D5b": lateral}
    kind = Kind(STIFF, LIGHT_DENSITY, SIZE)
    exact = np.array([resting_overlap(kind, (1 + 10.0**k) * kind.mass * G, wall=True) for k in DECADES])
    error = np.abs((SIZE - lower) / exact - 1)
    return {"D4a": float(error[:-1].max()), "D4b": float(error[-1]), "D5a": lateral}


# ---- D6: size


def ball_scene(name: str, size: float, with_ball: bool) -> Scene:
    """A ball in the hollow of four grains of a single layer that fills a box; without it, the layer alone."""
    kinds = {
        "grain": Kind(1e8, 2500, GRAIN, restitution=0.3, friction=0.5),
        "ball": Kind(1e8, BALL_MASS / (4 / 3 * math.pi * size**3), size, restitution=0.3, friction=0.5),
    }
    across = 2 * (math.ceil(1.05 * size / (2 * GRAIN)) + 1)
    bodies = [Body("grain", p) for p in lattice((across, across, 1), 2 * GRAIN) + GRAIN]
    middle = across * GRAIN
    height = GRAIN + math.sqrt((size + GRAIN) ** 2 - 2 * GRAIN**2)
    if with_ball:
        bodies.append(Body("ball", (middle, middle, height)))
    else:
        kinds.pop("ball")
    box = Box(name="box", material=WALL, lower=(0, 0, 0), upper=(2 * middle, 2 * middle, 3 * size), open_faces=("z+",))
    dt = 0.1 * rayleigh(kinds["grain"])
    return scene_of(
        name,
        kinds,
        bodies,
        time_step=dt,
        times=[0, BED_TIME],
        gravity=(0, 0, -G),
        walls=(box,),
        between=[PairLaw(a="grain", b="ball", restitution=0.3, friction=0.5)] if with_ball else [],
        observables=[Overlap(name="overlap", interval=round(BED_TIME / 20 / dt) * dt)],
    )


def sudden_overlap(size: float) -> float:
    """Largest overlap of ball and grain [m] where a quarter of the ball's weight is laid on at once.

    Work F a = (2/5) k a^(5/2) gives (5/2)^(2/3) times the overlap at rest; the contact normal leans by the hollow.
    """
    modulus = Kind(1e8, 1.0, 1.0).modulus / 2
    reduced = size * GRAIN / (size + GRAIN)
    force = 0.25 * BALL_MASS * G / math.sqrt(1 - 2 * (GRAIN / (size + GRAIN)) ** 2)
    return (2.5 * 0.75 * force / (modulus * math.sqrt(reduced))) ** (2 / 3)


def _ball_name(size: float, with_ball: bool) -> str:
    return f"d6_{round(size / GRAIN)}_{'ball' if with_ball else 'alone'}"


def _balls(results: Mapping[str, Result]) -> Mapping[str, float]:
    found = {}
    for k, size in enumerate(BALL):
        ball, alone = (results[_ball_name(size, there)] for there in (True, False))
        overlap = float(ball.observables["overlap"].value.max())
        found[f"D6{'ac'[k]}"] = overlap / sudden_overlap(size)
        found[f"D6{'bd'[k]}"] = float(ball.timing["loop"]) / float(alone.timing["loop"])
    return found


def _ball_checks() -> tuple[Check, ...]:
    found = []
    for k, size in enumerate(BALL):
        ratio = f"1:{round(size / GRAIN)}"
        found += [
            at_most(
                f"D6{'ac'[k]}", f"{ratio}: deepest overlap in that of a sudden load", "1", 1.05, "no pair is missed"
            ),
            at_most(
                f"D6{'bd'[k]}", f"{ratio}: run time beside that without the ball", "1", 3.0, "Ogarko & Luding 2012"
            ),
        ]
    return tuple(found)


# ---- D7: columns


def tower_scene(name: str, counts: Sequence[int], law: Law | None, across: int = 1) -> Scene:
    """Towers of touching unit spheres on the floor; `across` times `across` of them in a snug box where above 1."""
    kind = Kind(1e7, UNIT_DENSITY, 1.0, restitution=0.0 if law else 0.1, friction=0.3)
    rows = lattice((across, across, 1), 2.0)[:, :2] + 1
    bodies = [
        Body("grain", (x + 10 * k, y, z))
        for k, count in enumerate(counts)
        for z in column([kind] * count, G, rigid=law is not None)
        for x, y in rows
    ]
    sides = tuple(side for side in ("x-", "x+", "y-", "y+", "z+") if across == 1 or side == "z+")
    size = (2.0 * across, 2.0 * across, 2.0 * max(counts) + 2)
    box = Box(name="box", material=WALL, lower=(0, 0, 0), upper=size, open_faces=sides)
    dt = TOWER_STEP if law else 0.1 * rayleigh(kind)
    end = TOWER_TIME if law else 12_000 * dt
    return scene_of(
        name,
        {"grain": kind},
        bodies,
        time_step=dt,
        times=every(end / 10, end),
        gravity=(0, 0, -G),
        walls=(box,),
        law=law,
        observables=[WallForce(name="foot", wall="box", interval=end / 10)],
    )


def tower_measure(result: Result) -> tuple[float, float, float]:
    """Speed at the end in g dt, error of the foot force, and smallest distance of neighbours in d [-]."""
    seen, mass = motion(result), float(result.scene.masses().sum())
    foot = -result.observables["foot"].value[-1, 2] / (mass * G)
    nearest = cKDTree(seen.position[-1]).query(seen.position[-1], k=2)[0][:, 1].min() / 2
    speed = speeds(seen)[-1].max() / (G * float(result.scene.time_step or math.nan))
    return float(speed), float(abs(abs(foot) - 1)), float(nearest)


def _tower_experiment(letters: str, name: str, title: str, scene: partial[Scene], *, rigid: bool) -> Experiment:
    ids = [f"D7{letter}" for letter in letters]
    checks = (
        at_most(ids[0], f"{title}: speed at the end in g dt", "1", 1.0, "rest"),
        at_most(ids[1], f"{title}: error of the force at the foot", "1", 0.01, "n m g", scale=1.0),
        at_least(ids[2], f"{title}: smallest spacing in d", "1", 0.99, "touching spheres; 1 % of overlap"),
    )
    settings = {"dt": repr(TOWER_STEP)} if rigid else {}
    return Experiment(
        name,
        title,
        (Trial(name, scene, settings),),
        lambda results: dict(zip(ids, tower_measure(results[name]), strict=True)),
        checks,
        "long",
    )


# ---- D8: loose column and pour


def block_scene(name: str, poured: bool, law: Law | None) -> Scene:
    """Unit spheres (d = 1 m) on a lattice of 1.05 d in a box: at rest, or from 20 d with 10 d/s downwards.

    Their own weight alone makes overlaps of 0.8 % of d at the floor; with E = 1e8 Pa it would be 4 %.
    """
    kind = Kind(1e9, 2500, 0.5, restitution=0.1, friction=0.3)
    height, speed = (20.0, -10.0) if poured else (0.0, 0.0)
    position = lattice(BLOCK, 1.05) + np.array([0.525, 0.525, 0.5 + height])
    size = (1.05 * BLOCK[0], 1.05 * BLOCK[1], 60.0)
    box = Box(name="box", material=WALL, lower=(0, 0, 0), upper=size, open_faces=("z+",))
    dt = 0.01 if law else 0.1 * rayleigh(kind)
    end = 20.0 if law else 12.0
    scene = scene_of(
        name,
        {"grain": kind},
        [Body("grain", p, (0, 0, speed)) for p in position],
        time_step=dt,
        times=every(end / 20, end),
        gravity=(0, 0, -BLOCK_G),
        walls=(box,),
        law=law,
        observables=[Overlap(name="overlap", interval=round(end / 100 / dt) * dt)],
    )
    return within(scene, (-1, -1, -1), (size[0] + 1, size[1] + 1, size[2]))


def _blocks(results: Mapping[str, Result], kind: str, ids: str) -> Mapping[str, float]:
    rest, pour = results[f"d8_{kind}_rest"], results[f"d8_{kind}_pour"]
    nearest = [
        float(cKDTree(motion(result).position[-1]).query(motion(result).position[-1], k=2)[0][:, 1].min())
        for result in (rest, pour)
    ]
    return {
        f"D8{ids[0]}": min(nearest),
        f"D8{ids[1]}": float(pour.observables["overlap"].value.max()),
        f"D8{ids[2]}": max(float(np.abs(motion(result).velocity[-1, :, 2]).max()) for result in (rest, pour)),
    }


def _block_experiment(kind: str, law: Law | None, ids: str) -> Experiment:
    title = f"{kind} spheres, 8 x 8 x 20 instead of 40 x 40 x 60"
    settings = {"dt": "0.01"} if law else {}
    return Experiment(
        f"d8_{kind}",
        f"A loose column and a pour, {title}",
        tuple(
            Trial(f"d8_{kind}_{way}", partial(block_scene, f"d8_{kind}_{way}", way == "pour", law), settings)
            for way in ("rest", "pour")
        ),
        partial(_blocks, kind=kind, ids=ids),
        (
            at_least(f"D8{ids[0]}", f"{title}: nearest neighbours at the end in d", "1", 0.98, "overlaps go to 0"),
            at_most(f"D8{ids[1]}", f"{title}: deepest overlap of the pour in d", "1", 0.15, "peclet 0.5.1: 0.14"),
            at_most(f"D8{ids[2]}", f"{title}: fastest fall or rise at the end", "m/s", 0.2, "rest"),
        ),
        "long",
    )


def experiments() -> tuple[Experiment, ...]:
    """D4 to D8."""
    still = "statics"
    soft_checks = (
        at_most("D4a", "up to 10^4 kg on 1 kg: error of the overlap at the foot", "1", 0.005, "Hertz", scene_law=True),
        at_most("D4b", "10^6 kg on 1 kg: error of the overlap at the foot", "1", 0.005, "Hertz", scene_law=True),
        at_most("D5a", "1 kg between 10^6 kg: way aside in r", "1", 1e-3, still),
    )
    rigid_checks = (
        at_most("D4c", "rigid, up to 10^6 kg on 1 kg: deepest overlap in r", "1", 0.01, still),
        at_most("D4d", "rigid, up to 10^6 kg on 1 kg: speed after 2 s in g dt", "1", 2.0, still),
        at_most("D5b", "rigid, 1 kg between 10^6 kg: way aside in r", "1", 1e-3, still),
    )
    return (
        on_one_scene(
            "d4_soft",
            "Heavy on light, soft spheres, 1e5 steps from rest",
            partial(stack_scene, "d4_soft", None),
            partial(_stacks, rigid=False),
            soft_checks,
            "long",
        ),
        on_one_scene(
            "d4_rigid",
            "Heavy on light, rigid spheres, 2 s",
            partial(stack_scene, "d4_rigid", Rigid()),
            partial(_stacks, rigid=True),
            rigid_checks,
            settings={"dt": repr(RIGID_STEP)},
        ),
        Experiment(
            "d6_sizes",
            "A ball on a layer of small grains, 1:10 and 1:100 (11 000 grains instead of 1e5)",
            tuple(
                Trial(_ball_name(size, there), partial(ball_scene, _ball_name(size, there), size, there))
                for size in BALL
                for there in (True, False)
            ),
            _balls,
            _ball_checks(),
            "long",
        ),
        *(
            _tower_experiment(
                letters,
                f"d7_rigid_{counts[-1]}",
                f"rigid towers of {', '.join(map(str, counts))}",
                partial(tower_scene, f"d7_rigid_{counts[-1]}", counts, Rigid()),
                rigid=True,
            )
            for letters, counts in zip(("abc", "def", "ghi"), TOWERS, strict=True)
        ),
        _tower_experiment(
            "jkl",
            "d7_rigid_5x5",
            "rigid 5 x 5 x 113",
            partial(tower_scene, "d7_rigid_5x5", (113,), Rigid(), 5),
            rigid=True,
        ),
        _tower_experiment(
            "mno",
            "d7_soft",
            "soft towers of 10 to 1000 from rest",
            partial(tower_scene, "d7_soft", (10, 113, 1000), None),
            rigid=False,
        ),
        _block_experiment("rigid", Rigid(), "abc"),
        _block_experiment("soft", None, "def"),
    )
