"""Starts deep inside each other: half overlapping, D11, and on one point, D21."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from scipy.spatial.distance import pdist

from dembench.results import Result
from dembench.scene import Box, Domain, ElasticEnergy, Rigid, Scene
from dembench.scene.materials import Law
from dembench.scene.walls import WallShape
from dembench.verification.checks import Check, Experiment, Trial, at_least, at_most, on_one_scene
from dembench.verification.scenes import WALL, Body, Kind, every, scene_of
from dembench.verification.stability.common import changed, kinetic_energy, lattice, motion, rayleigh, speeds

RADIUS = 1e-3
G = 9.81
"""These scenes have no gravity; it makes the bound of the speed with which rigid spheres part [m/s^2]."""
RIGID_STEP, SHARE = 1e-4, 0.02
"""Step of rigid spheres [s]; of soft ones in Rayleigh times, since contacts as deep as these are stiff [-]."""
SAMPLES = 50
ELASTIC, GRAIN = Kind(1e7, 2500, RADIUS), Kind(1e7, 2500, RADIUS, restitution=0.5, friction=0.3)

PAIR_STEPS, PAIR_ROOM = {"rigid": 50, "soft": 150}, 20.0
"""Steps, and how far the domain reaches from the origin [r]: no farther than it takes to hold what flies apart."""
BLOCK_STEPS, BLOCK_ROOM = {"rigid": 2000, "soft": 3000}, 12.5
EDGE, JITTER = 10, 0.02
"""Spheres along an edge of the block; by how much each is out of its place [r]."""
CROWD, CROWD_STEPS, CROWD_ROOM = 100, {"rigid": 500, "soft": 600}, 300.0
"""Spheres on one point; they fly apart along a line where their engine has one direction for all of them."""
TOUCHING = 1e-3
"""Part of a diameter by which two that touch may overlap [-]."""


def started(
    name: str,
    law: Law | None,
    kind: Kind,
    points: Sequence[Sequence[float]] | np.ndarray,
    steps: Mapping[str, int],
    reach: float,
    walls: Sequence[WallShape] = (),
) -> Scene:
    """Spheres at rest at some points [r], without gravity, in a domain that reaches so far [r] from the origin."""
    dt, count = (RIGID_STEP, steps["rigid"]) if law else (SHARE * rayleigh(kind), steps["soft"])
    interval = count // SAMPLES * dt
    scene = scene_of(
        name,
        {"grain": kind},
        [Body("grain", tuple(RADIUS * np.asarray(point))) for point in points],
        time_step=dt,
        times=every(interval, count * dt),
        walls=walls,
        law=law,
        observables=() if law else [ElasticEnergy(name="elastic", interval=interval)],
    )
    return changed(scene, domain=Domain(lower=(-reach * RADIUS,) * 3, upper=(reach * RADIUS,) * 3))


def smallest_distance(result: Result) -> float:
    """Of two centres at the end [d]."""
    return float(pdist(motion(result).position[-1]).min() / (2 * RADIUS))


def gain(result: Result) -> float:
    """Largest energy, kinetic and of the overlaps, over that of the start [-]."""
    energy = kinetic_energy(result) + result.observables["elastic"].value
    return float(energy.max() / energy[0])


def _fastest(result: Result) -> float:
    """Largest speed that was recorded in that of a fall of one step [-]."""
    return float(speeds(motion(result)).max() / (G * RIGID_STEP))


# ---- D11: half overlapping


def pair_scene(name: str, law: Law | None) -> Scene:
    """Two elastic spheres whose centres are a radius apart."""
    return started(name, law, ELASTIC, [(-0.5, 0, 0), (0.5, 0, 0)], PAIR_STEPS, PAIR_ROOM)


def release_speed() -> float:
    """Speed of two elastic spheres let go a radius apart [m/s]: m v^2 = (2/5) (4/3) E* sqrt(R*) r^(5/2)."""
    stiffness = 4 / 3 * ELASTIC.modulus / 2 * math.sqrt(RADIUS / 2)
    return math.sqrt(0.4 * stiffness * RADIUS**2.5 / ELASTIC.mass)


def block_scene(name: str, law: Law | None) -> Scene:
    """A thousand spheres, neighbours a radius apart, in the middle of a closed box with room for all."""
    random = np.random.default_rng(11)
    points = lattice((EDGE,) * 3) - 0.5 * (EDGE - 1) + random.uniform(-JITTER, JITTER, (EDGE**3, 3))
    half = BLOCK_ROOM * RADIUS
    box = Box(name="box", material=WALL, lower=(-half,) * 3, upper=(half,) * 3)
    return started(name, law, GRAIN, points, BLOCK_STEPS, 2 * BLOCK_ROOM, (box,))


def outside(result: Result) -> float:
    """Bodies whose centres were ever outside the box [-]."""
    return float((np.abs(motion(result).position) > BLOCK_ROOM * RADIUS).any(axis=(0, 2)).sum())


def _rigid_block(result: Result) -> Mapping[str, float]:
    return {"D11c": _fastest(result), "D11d": smallest_distance(result), "D11e": outside(result)}


def _soft_block(result: Result) -> Mapping[str, float]:
    return {"D11g": gain(result), "D11h": outside(result)}


# ---- D21: on one point


def point_scene(name: str, law: Law | None, count: int) -> Scene:
    """Two or many spheres on one point."""
    steps, room = (PAIR_STEPS, PAIR_ROOM) if count == 2 else (CROWD_STEPS, CROWD_ROOM)
    return started(name, law, GRAIN, np.zeros((count, 3)), steps, room)


def again(results: Mapping[str, Result], name: str, ids: str) -> Mapping[str, float]:
    """Distance of two from one point at the end [d], and the difference of two runs [r]."""
    one, other = results[name], results[f"{name}_again"]
    same = np.abs(motion(one).position - motion(other).position).max() / RADIUS
    return {f"D21{ids[0]}": smallest_distance(one), f"D21{ids[1]}": float(same)}


def _pairs(name: str, ids: str, title: str, law: Law | None) -> Experiment:
    settings = {"dt": repr(RIGID_STEP)} if law else {}
    return Experiment(
        name,
        f"Two {title} spheres on one point, twice",
        tuple(Trial(own, partial(point_scene, own, law, 2), settings) for own in (name, f"{name}_again")),
        partial(again, name=name, ids=ids),
        (
            _apart(f"D21{ids[0]}", f"{title}, two on one point: distance at the end in d"),
            at_most(
                f"D21{ids[1]}", f"{title}, two on one point: difference of two runs in r", "1", 0.0, "the same run"
            ),
        ),
        "long",
    )


def _apart(id: str, title: str) -> Check:
    return at_least(id, title, "1", 1.0, "they part", tolerance=TOUCHING)


def _no_gain(id: str, title: str) -> Check:
    return at_most(id, title, "1", 1.0, "no energy from nowhere", tolerance=1e-3)


def experiments() -> tuple[Experiment, ...]:
    """D11 and D21."""
    rigid, step = Rigid(), {"dt": repr(RIGID_STEP)}
    slow = "overlap is no energy"
    return (
        on_one_scene(
            "d11_rigid",
            "Two rigid spheres half overlapping",
            partial(pair_scene, "d11_rigid", rigid),
            lambda result: {"D11a": _fastest(result), "D11b": smallest_distance(result)},
            (
                at_most("D11a", "rigid pair: largest speed over g dt", "1", 2.0, slow),
                _apart("D11b", "rigid pair: distance at the end in d"),
            ),
            settings=step,
        ),
        on_one_scene(
            "d11_rigid_block",
            "A thousand rigid spheres half overlapping",
            partial(block_scene, "d11_rigid_block", rigid),
            _rigid_block,
            (
                at_most("D11c", "rigid block: largest speed over g dt", "1", 2.0, slow),
                _apart("D11d", "rigid block: smallest distance at the end in d"),
                at_most("D11e", "rigid block: bodies that left the box", "1", 0.0, "walls"),
            ),
            "long",
            step,
        ),
        on_one_scene(
            "d11_soft",
            "Two soft spheres half overlapping",
            partial(pair_scene, "d11_soft", None),
            lambda result: {"D11f": float(speeds(motion(result))[-1].max())},
            (
                Check(
                    "D11f",
                    "soft pair: speed of parting",
                    "m/s",
                    release_speed(),
                    0.01 * release_speed(),
                    "energy of the overlap",
                    scene_law=True,
                ),
            ),
        ),
        on_one_scene(
            "d11_soft_block",
            "A thousand soft spheres half overlapping",
            partial(block_scene, "d11_soft_block", None),
            _soft_block,
            (
                _no_gain("D11g", "soft block: largest energy over that of the start"),
                at_most("D11h", "soft block: bodies that left the box", "1", 0.0, "walls"),
            ),
            "long",
        ),
        _pairs("d21_rigid", "ab", "rigid", rigid),
        on_one_scene(
            "d21_rigid_crowd",
            "A hundred rigid spheres on one point",
            partial(point_scene, "d21_rigid_crowd", rigid, CROWD),
            lambda result: {"D21c": smallest_distance(result)},
            (_apart("D21c", "rigid, 100 on one point: smallest distance at the end in d"),),
            "long",
            step,
        ),
        _pairs("d21_soft", "de", "soft", None),
        on_one_scene(
            "d21_soft_crowd",
            "A hundred soft spheres on one point",
            partial(point_scene, "d21_soft_crowd", None, CROWD),
            lambda result: {"D21f": smallest_distance(result), "D21g": gain(result)},
            (
                _apart("D21f", "soft, 100 on one point: smallest distance at the end in d"),
                _no_gain("D21g", "soft, 100 on one point: largest energy over that of the start"),
            ),
            "long",
        ),
    )
