"""Statics and sticking: D29, D30 and D33 to D35."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from dembench.results import Result
from dembench.scene import Bodies, Box, Clump, Constraint, Mesh, Motion, Plane, Rigid, Scene, WallForce
from dembench.scene.materials import Law
from dembench.verification.checks import Check, Experiment, Trial, at_most, on_one_scene
from dembench.verification.scenes import WALL, Body, Kind, every, floor, scene_of
from dembench.verification.stability.common import (
    changed,
    fitted,
    lattice,
    motion,
    rayleigh,
    resting_overlap,
    speeds,
    within,
)

G = 9.81
RADIUS = 0.01

CREEP_STEP, CREEP_TIME = 1e-3, 30.0
"""Step of rigid spheres, and time in which the drift is measured [s]."""
SETTLED = {True: 40.0, False: 10.0}
"""When a heap and a pyramid have settled [s]; without rolling friction grains roll about in a heap for long."""
HEAP = (5, 5, 8)
TOUCH = 1e-3
"""Gap below which two spheres touch [r]."""

WEDGES = (45.0, 10.0, 2.0, 0.5)
"""Half angles [degrees]."""
ROUGH = (0.0, 0.5)
CLOSING, CLOSED = 0.05, 0.005
"""Speed of the wall of a closing wedge [m/s] and the way that it closes [m]."""

CARD_ANGLE, CARD_TIME = 70.0, 10.0

SLOPE = 0.5
"""Tangent of the incline."""
SHARES = (0.90, 0.99, 1.01, 1.10)
"""Tangent of the incline in friction coefficients."""
INCLINE_TIME, TAKEN_UP = 10.0, 1.0
"""End of the run, and time after which shear springs have taken up the load [s]."""
ROLLING_TIME = 1.0
TRANSITION = 2 / 7 * SLOPE
"""Friction below which a sphere slips on the incline [-]."""


# ---- D29: creep


def creep_scene(name: str, heap: bool, law: Law | None) -> Scene:
    """A pyramid of four spheres, or a heap of 200 that falls into a box."""
    kind = Kind(1e6, 2500, RADIUS, restitution=0.1, friction=0.8)
    if heap:
        jitter = np.random.default_rng(1).uniform(-0.1, 0.1, (math.prod(HEAP), 3)) * RADIUS
        position = lattice(HEAP, 2.3 * RADIUS) + 1.15 * RADIUS + jitter
    else:
        ring = 2 * RADIUS / math.sqrt(3)
        turn = np.radians([90, 210, 330])
        base = np.stack([ring * np.cos(turn), ring * np.sin(turn), np.full(3, RADIUS)], axis=1)
        position = np.vstack([base, [[0, 0, RADIUS * (1 + 2 * math.sqrt(2 / 3))]]])
    side = 2.3 * RADIUS * HEAP[0] if heap else 20 * RADIUS
    low = 0.0 if heap else -10 * RADIUS
    box = Box(
        name="box", material=WALL, lower=(low, low, 0), upper=(low + side, low + side, 30 * RADIUS), open_faces=("z+",)
    )
    scene = scene_of(
        name,
        {"grain": kind},
        [Body("grain", p) for p in position],
        time_step=CREEP_STEP if law else fitted(0.1 * rayleigh(kind), 5.0),
        times=[0, *(SETTLED[heap] + share * CREEP_TIME for share in (0, 0.5, 1))],
        gravity=(0, 0, -G),
        walls=(box,),
        law=law,
    )
    return within(scene, (low - RADIUS, low - RADIUS, -RADIUS), (low + side + RADIUS,) * 2 + (31 * RADIUS,))


def carrying(scene: Scene, position: np.ndarray) -> np.ndarray:
    """Which spheres are held by three contacts or more, without the help of those that are not, shape (n,).

    A sphere in a vault on the floor carries nothing and rolls there without resistance, as it should.
    """
    reach, held = TOUCH * RADIUS, np.ones(len(position), dtype=bool)
    walls = sum((plane.signed_distance(position) < RADIUS + reach).astype(int) for plane in _faces(scene))
    pairs = cKDTree(position).query_pairs(2 * RADIUS + reach, output_type="ndarray")
    for _ in position:
        both = pairs[held[pairs].all(axis=1)]
        enough = walls + np.bincount(both.ravel(), minlength=len(position)) >= 3
        if (enough >= held).all():
            break
        held &= enough
    return held


def _faces(scene: Scene) -> list[Plane]:
    return [plane for wall in scene.walls if isinstance(wall, Box) for plane in wall.planes()]


def drift(result: Result) -> float:
    """Largest way in 30 s, once the pile has settled, of a sphere that is held at the end [r]."""
    seen = motion(result)
    late = seen.position[1:][:, carrying(result.scene, seen.position[-1])]
    return float(np.linalg.norm(late - late[0], axis=2).max() / RADIUS) if late.size else math.nan


def _creep(id: str, name: str, title: str, heap: bool, law: Law | None) -> Experiment:
    return on_one_scene(
        name,
        f"Creep of {title}, 30 s after it has settled instead of an hour",
        partial(creep_scene, name, heap, law),
        lambda result: {id: drift(result)},
        (
            at_most(
                id,
                f"{title}: drift of 30 s in r of those that are held",
                "1",
                1e-4,
                "statics; peclet 0.5.1: 8e-5 with sleeping",
            ),
        ),
        "long",
        {"dt": repr(CREEP_STEP)} if law else {},
    )


# ---- D30: wedges


def _sheet(name: str, angle: float, side: int, y: float, reach: float, motion: Motion | None = None) -> Mesh:
    """A side of a wedge that stands on the line x = z = 0 and leans by an angle [rad] from the vertical."""
    top = np.array([side * reach * math.sin(angle), 0, reach * math.cos(angle)])
    a, b = np.array([0, y - 4 * RADIUS, 0]), np.array([0, y + 4 * RADIUS, 0])
    quad = [a, b, b + top, a + top]
    if side > 0:
        quad = quad[::-1]
    return Mesh(
        name=name, material=WALL, motion=motion, triangles=[[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
    )


def wedge_scene(name: str, law: Law | None) -> Scene:
    """A sphere at rest in a wedge for every half angle and friction; walls of one wedge do not reach the next."""
    kinds = {f"mu{round(100 * mu)}": Kind(1e9, 2500, RADIUS, restitution=0.1, friction=mu) for mu in ROUGH}
    bodies, walls, forces = [], [], []
    for k, (half, kind) in enumerate((half, kind) for half in WEDGES for kind in kinds):
        angle, y, own = math.radians(half), 12 * RADIUS * k, kinds[kind]
        force = own.mass * G / (2 * math.sin(angle))
        overlap = 0.0 if law else resting_overlap(own, force, wall=True)
        bodies.append(Body(kind, (0, y, (RADIUS - overlap) / math.sin(angle))))
        reach = 2 * RADIUS / math.tan(angle) + 2 * RADIUS
        walls += [_sheet(f"left{k}", angle, -1, y, reach), _sheet(f"right{k}", angle, 1, y, reach)]
        forces.append(WallForce(name=f"force{k}", wall=f"left{k}", interval=0.01))
    dt = 1e-4 if law else 1e-5
    scene = scene_of(
        name,
        kinds,
        bodies,
        time_step=dt,
        times=every(0.01, 0.1),
        gravity=(0, 0, -G),
        walls=walls,
        law=law,
        observables=forces,
    )
    domain = scene.domain.model_copy(update={"lower": (-0.2, -0.1, -0.05), "upper": (0.2, 1.2, 2.6)})
    return changed(scene, domain=domain)


def wedges(result: Result, mass: float) -> tuple[float, float, float]:
    """Errors of height and force, relative, and way to the side in r [-], the worst of all wedges."""
    seen = motion(result)
    angle = np.radians(np.repeat(WEDGES, len(ROUGH)))
    height = np.abs(seen.position[-1, :, 2] * np.sin(angle) / RADIUS - 1).max()
    aside = np.abs(seen.position[:, :, 0]).max() / RADIUS
    # between rough walls a rigid sphere may hold itself: its force is not determined
    known = slice(None, None, len(ROUGH)) if isinstance(result.scene.law, Rigid) else slice(None)
    force = [np.linalg.norm(result.observables[f"force{k}"].value[-1]) for k in range(len(angle))]
    exact = mass * G / (2 * np.sin(angle))
    return float(height), float(aside), float(np.abs(np.array(force) / exact - 1)[known].max())


def _wedge(ids: str, name: str, title: str, law: Law | None) -> Experiment:
    keys = [f"D30{letter}" for letter in ids]
    mass = Kind(1e9, 2500, RADIUS).mass
    where = f"{title} in wedges of 45 to 0.5 degrees"
    return on_one_scene(
        name,
        f"A sphere in wedges, {title}",
        partial(wedge_scene, name, law),
        lambda result: dict(zip(keys, wedges(result, mass), strict=True)),
        (
            at_most(keys[0], f"{where}: error of the height", "1", 0.01, "r/sin a"),
            at_most(keys[1], f"{where}: way aside in r", "1", 1e-3, "symmetry"),
            at_most(keys[2], f"{where}: error of the force", "1", 0.01, "m g/(2 sin a)", scale=1.0),
        ),
        "long",
        {"dt": "1e-4"} if law else {},
    )


def _closing(id: str, name: str, results: Mapping[str, Result]) -> dict[str, float]:
    """Largest speed in that of the wall."""
    return {id: float(speeds(motion(results[name])).max() / CLOSING)}


def closing_scene(name: str, law: Law | None) -> Scene:
    """A sphere in a wedge of 10 degrees whose left side closes by half a radius: friction holds it, and it jams."""
    kind, angle = Kind(1e7, 2500, RADIUS, restitution=0.1, friction=0.5), math.radians(10)
    reach = 3 * RADIUS / math.tan(angle)
    end = CLOSED / CLOSING
    dt = 1e-4 if law else fitted(0.1 * rayleigh(kind), end / 100)
    scene = scene_of(
        name,
        {"grain": kind},
        [Body("grain", (0, 0, RADIUS / math.sin(angle)))],
        time_step=dt,
        times=every(end / 100, end),
        gravity=(0, 0, -G),
        walls=(
            _sheet("left", angle, -1, 0, reach, Motion(velocity=(CLOSING, 0, 0))),
            _sheet("right", angle, 1, 0, reach),
        ),
        law=law,
    )
    return changed(scene, domain=scene.domain.model_copy(update={"lower": (-0.3,) * 3, "upper": (0.3,) * 3}))


# ---- D33: card house


def card_scene() -> Scene:
    """Two cards of eight spheres that lean against each other, 70 degrees above the floor.

    Feet and heads are spheres, which roll; two cards on two feet are rigid all the same: six contacts for six ways.
    """
    rows = [(0.0, y * RADIUS, (2 * k - 3) * RADIUS, RADIUS) for k in range(4) for y in (-1, 1)]
    shape = Clump(spheres=tuple(rows))
    kind = Kind(1e8, 2500, shape.bounding_radius, restitution=0.1, friction=0.5, shape=shape)
    lean, half = math.radians(90 - CARD_ANGLE), 3 * RADIUS
    place = RADIUS + half * math.sin(lean), RADIUS + half * math.cos(lean)
    dt = 2e-5
    scene = scene_of(
        "d33_cards",
        {"card": kind},
        [Body("card", (side * place[0], 0, place[1])) for side in (-1, 1)],
        time_step=dt,
        times=every(1.0, CARD_TIME),
        gravity=(0, 0, -G),
        walls=(floor(),),
    )
    turned = [[0, -side * math.sin(lean / 2), 0, math.cos(lean / 2)] for side in (-1, 1)]
    bodies = Bodies(position=scene.bodies.position, orientation=turned)
    room = 20 * RADIUS
    return within(changed(scene, bodies=bodies), (-room, -room, -RADIUS), (room, room, room))


def _cards(result: Result) -> Mapping[str, float]:
    seen = motion(result)
    return {"D33": float(np.linalg.norm(seen.position - seen.position[0], axis=2).max() / (8 * RADIUS))}


# ---- D34 and D35: the incline


def _tilted() -> tuple[float, float, float]:
    slope = math.atan(SLOPE)
    return (G * math.sin(slope), 0.0, -G * math.cos(slope))


def incline_scene(name: str, frictions: tuple[float, ...], end: float, law: Law | None, locked: bool) -> Scene:
    """Spheres of several frictions at rest on an incline; x points down the slope."""
    kinds = {f"mu{k}": Kind(1e8, 2500, RADIUS, restitution=0.1, friction=mu) for k, mu in enumerate(frictions)}
    first = kinds["mu0"]
    overlap = 0.0 if law else resting_overlap(first, -first.mass * _tilted()[2], wall=True)
    scene = scene_of(
        name,
        kinds,
        [Body(kind, (0, 4 * RADIUS * k, RADIUS - overlap)) for k, kind in enumerate(kinds)],
        time_step=2e-4 if law else fitted(0.1 * rayleigh(first), end / 10),
        times=every(end / 10, end),
        gravity=_tilted(),
        walls=(floor(),),
        law=law,
    )
    scene = within(scene, (-0.1, -0.1, -0.1), (0.5 * G * end**2, 0.3, 0.1))
    held = (Constraint(kind="rotation-locked", bodies=tuple(range(len(kinds)))),)
    return changed(scene, constraints=held) if locked else scene


def held_and_sliding(result: Result) -> tuple[float, float]:
    """Drift of the spheres that hold after the springs have taken up [r]; error of the way of those that slide [-]."""
    seen = motion(result)
    x = seen.position[:, :, 0] - seen.position[0, :, 0]
    holding = np.array(SHARES) < 1
    settled = seen.time >= TAKEN_UP * 0.999
    drifted = np.abs(x[settled][:, holding] - x[settled][0, holding]).max() / RADIUS
    along, down = _tilted()[0], -_tilted()[2]
    exact = 0.5 * (along - SLOPE / np.array(SHARES)[~holding] * down) * seen.time[-1] ** 2
    return float(drifted), float(np.abs(x[-1, ~holding] / exact - 1).max())


def rolling(result: Result) -> tuple[float, float, float]:
    """Error of the acceleration where it rolls; slip in the speed 1 % above and 1 % below the transition [-]."""
    seen = motion(result)
    v, slip = seen.velocity[-1, :, 0], seen.velocity[-1, :, 0] - seen.angular_velocity[-1, :, 1] * RADIUS
    exact = 5 / 7 * _tilted()[0] * seen.time[-1]
    return float(abs(v[0] / exact - 1)), float(abs(slip[1] / v[1])), float(slip[2] / v[2])


def _incline(ids: str, name: str, title: str, law: Law | None) -> Experiment:
    keys = [f"D34{letter}" for letter in ids]
    frictions = tuple(SLOPE / share for share in SHARES)
    return on_one_scene(
        name,
        f"Around the friction angle, {title}",
        partial(incline_scene, name, frictions, INCLINE_TIME, law, True),
        lambda result: dict(zip(keys, held_and_sliding(result), strict=True)),
        (
            at_most(keys[0], f"{title}, slope 0.90 and 0.99 mu: drift of 9 s in r", "1", 1e-4, "Coulomb"),
            at_most(
                keys[1], f"{title}, slope 1.01 and 1.10 mu: error of the way", "1", 0.01, "(g sin - mu g cos) t²/2"
            ),
        ),
        "long",
        {"dt": "2e-4"} if law else {},
    )


def _rolling(ids: str, name: str, title: str, law: Law | None, default: bool) -> Experiment:
    keys = [f"D35{letter}" for letter in ids]
    frictions = (1.0, 1.01 * TRANSITION, 0.99 * TRANSITION)
    # below the transition v = (sin - mu cos) g t and the slip (sin - 7/2 mu cos) g t
    mu = frictions[2]
    slip = (SLOPE - 3.5 * mu) / (SLOPE - mu)
    return on_one_scene(
        name,
        f"Rolling down an incline, {title}",
        partial(incline_scene, name, frictions, ROLLING_TIME, law, False),
        lambda result: dict(zip(keys, rolling(result), strict=True)),
        (
            at_most(keys[0], f"{title}: error of the acceleration", "1", 0.005, "5/7 g sin", scale=1.0),
            at_most(keys[1], f"{title}: slip over speed, 1 % above 2/7 tan", "1", 1e-3, "rolling", scale=1.0),
            Check(keys[2], f"{title}: slip over speed, 1 % below 2/7 tan", "1", slip, 0.1 * slip, "sliding"),
        ),
        "default" if default else "long",
        {"dt": "2e-4"} if law else {},
    )


def experiments() -> tuple[Experiment, ...]:
    """D29, D30 and D33 to D35."""
    rigid = Rigid()
    return (
        _creep("D29a", "d29_pyramid", "a pyramid of soft spheres", False, None),
        _creep("D29b", "d29_pyramid_rigid", "a pyramid of rigid spheres", False, rigid),
        _creep("D29c", "d29_heap", "a heap of 200 soft spheres", True, None),
        _creep("D29d", "d29_heap_rigid", "a heap of 200 rigid spheres", True, rigid),
        _wedge("abc", "d30_soft", "a soft sphere", None),
        _wedge("def", "d30_rigid", "a rigid sphere", rigid),
        *(
            Experiment(
                name,
                f"A wedge that closes on a {title} sphere",
                (Trial(name, partial(closing_scene, name, law)),),
                partial(_closing, id, name),
                (at_most(id, f"{title}: largest speed in that of the wall", "1", 10.0, "finite forces: jam or slip"),),
                "long",
            )
            for id, name, title, law in (
                ("D30g", "d30_closing", "soft", None),
                ("D30h", "d30_closing_rigid", "rigid", rigid),
            )
        ),
        on_one_scene(
            "d33_cards",
            "Two cards of eight spheres",
            card_scene,
            _cards,
            (at_most("D33", "two cards at 70 degrees, 10 s: drift in their length", "1", 1e-3, "statics"),),
            "long",
            {"dt": "2e-5"},
        ),
        _incline("ab", "d34_soft", "a soft sphere that cannot turn", None),
        _incline("cd", "d34_rigid", "a rigid sphere that cannot turn", rigid),
        _rolling("abc", "d35_soft", "a soft sphere", None, True),
        _rolling("def", "d35_rigid", "a rigid sphere", rigid, False),
    )
