"""Corners, next to nothing in a scene, places far away, slow motion, and very many steps: D22 and D24 to D28."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from dembench.results import Result
from dembench.scene import Box, Clump, Cylinder, Domain, Mesh, Plane, Rigid, Scene
from dembench.scene.materials import Law
from dembench.verification.checks import Experiment, Trial, at_least, at_most, on_one_scene
from dembench.verification.scenes import WALL, Body, Kind, every, floor, scene_of
from dembench.verification.stability.common import changed, closed_step, lattice, motion, rayleigh

RADIUS = 1e-3
G = 9.81

SLIDE = 2.0
"""Speed along the floor into walls [m/s]."""
SOFT_E = 0.06
"""Restitution of the soft spheres that stand for e = 0; some engines know no smaller one [-]."""
ROOM = 20 * RADIUS
VERTEX_DROP = 0.5 * RADIUS

FREE_SPEED = 0.5
FREE_TIME = 0.05

FAR = (1e2, 1e4, 1e6)
"""Shifts of the whole scene in diameters."""
TOWER = 10

SLOW = ((1e-3, 0.1), (1e-3, 10.0), (1e-2, 0.1), (1e-2, 10.0))
"""Speeds [m/s] and places [m] of grains that drift."""
SLOW_STEP, SLOW_STEPS = 8e-7, 10000

BOWL, BOWL_STEPS = 20 * RADIUS, 1_000_000
BOWL_ANGLE = 0.5
ROTOR_STEP, ROTOR_TIME = 2e-5, 5.0

BEDS = {"d25_small": (10, 10, 10), "d25_large": (50, 50, 40)}
BED_STEPS = 300


# ---- D22: corners, edges and vertices


def corner_scene(name: str, law: Law | None, restitution: float) -> Scene:
    """Grains that slide on the floor of a box at 2 m/s: into a wall, and into the corner of three."""
    kind = Kind(1e8, 2500, RADIUS, restitution=restitution)
    v, low = SLIDE / math.sqrt(2), RADIUS
    bodies = [
        Body("grain", (ROOM - 3 * RADIUS, 8 * RADIUS, low), (SLIDE, 0, 0)),
        Body("grain", (ROOM - 3 * RADIUS, ROOM - 3 * RADIUS, low), (v, v, 0)),
    ]
    dt, end = 0.1 * rayleigh(kind), 4 * RADIUS / SLIDE
    box = Box(name="box", material=WALL, lower=(0, 0, 0), upper=(ROOM,) * 3, open_faces=("x-", "y-", "z+"))
    scene = scene_of(
        name,
        {"grain": kind},
        bodies,
        time_step=dt,
        times=every(10 * dt, end),
        gravity=(0, 0, -G),
        walls=(box,),
        law=law,
    )
    return changed(scene, domain=Domain(lower=(-ROOM,) * 3, upper=(2 * ROOM,) * 3))


def corners(result: Result) -> Mapping[str, float]:
    """Fastest hop, and fastest rebound at the end, in the speed of the slide [-]."""
    seen = motion(result)
    hop = np.abs(seen.velocity[:, :, 2]).max() / SLIDE
    rebound = -seen.velocity[-1, :, :2].min() / SLIDE
    return {"hop": float(hop), "rebound": float(rebound)}


def ledge_scene() -> Scene:
    """A grain dropped on the vertex where four faces of a pyramid meet, and one on the ridge of a roof; e = 0."""
    kind = Kind(1e8, 2500, RADIUS, restitution=0.0)
    half, place = 4 * RADIUS, 12 * RADIUS
    base = np.array([[-half, -half, -half], [half, -half, -half], [half, half, -half], [-half, half, -half]])
    top = np.zeros(3)
    pyramid = np.array([[base[k], base[(k + 1) % 4], top] for k in range(4)])
    a, b = np.array([-half, 0, 0]), np.array([half, 0, 0])
    roof = np.array([[base[0], base[1], b], [base[0], b, a], [base[2], base[3], a], [base[2], a, b]])
    mesh = Mesh(name="ledges", material=WALL, triangles=np.concatenate([pyramid, roof + np.array([place, 0, 0])]))
    drop = RADIUS + VERTEX_DROP
    dt = 1e-5
    scene = scene_of(
        "d22_vertex",
        {"grain": kind},
        [Body("grain", (0, 0, drop)), Body("grain", (place, 0, drop))],
        time_step=dt,
        times=every(1e-3, 0.1),
        gravity=(0, 0, -G),
        walls=(mesh,),
        law=Rigid(),
    )
    return changed(scene, domain=Domain(lower=(-0.05,) * 3, upper=(0.05,) * 3))


def _ledge(result: Result) -> Mapping[str, float]:
    seen = motion(result)
    settled = seen.position[seen.time > 0.05] - seen.position[0]
    sideways = np.abs(settled[:, :, :2]).max() / RADIUS
    height = np.abs(settled[:, :, 2] + VERTEX_DROP).max() / RADIUS
    return {"D22e": float(max(sideways, height))}


# ---- D24: next to nothing


def few_scene(count: int) -> Scene:
    """No, one or two grains far apart in free fall, with spin, without walls."""
    kind = Kind(1e7, 2500, RADIUS, restitution=0.5, friction=0.5)
    bodies = [Body("grain", (k, 0, 0), (FREE_SPEED, 0.1, FREE_SPEED), (1, 2, 3)) for k in range(max(count, 1))]
    scene = scene_of(
        f"d24_{count}",
        {"grain": kind},
        bodies,
        time_step=1e-5,
        times=every(FREE_TIME / 5, FREE_TIME),
        gravity=(0, 0, -G),
    )
    return scene if count else changed(scene, bodies={"position": []})


def _flight(result: Result) -> float:
    """Largest deviation from free flight in the way that was flown, and of the spin in itself [-]."""
    seen = motion(result)
    t = seen.time[:, None, None]
    exact = seen.position[:1] + seen.velocity[:1] * t + 0.5 * np.array(result.scene.gravity) * t**2
    way = np.linalg.norm(exact[-1] - exact[0], axis=1).min()
    spin = np.abs(seen.angular_velocity / seen.angular_velocity[:1] - 1).max()
    return max(float(np.abs(seen.position - exact).max() / way), float(spin))


# ---- D25: many particles


def bed_scene(name: str) -> Scene:
    """Grains on a lattice above the floor of a box, a little apart."""
    kind = Kind(1e7, 2500, RADIUS, restitution=0.5, friction=0.5)
    counts, spacing = BEDS[name], 2.02 * RADIUS
    position = lattice(counts, spacing) + 0.5 * spacing
    size = spacing * np.array(counts)
    box = Box(name="box", material=WALL, lower=(0, 0, 0), upper=tuple(size), open_faces=("z+",))
    dt = 0.1 * rayleigh(kind)
    scene = scene_of(
        name,
        {"grain": kind},
        [Body("grain", p) for p in position],
        time_step=dt,
        times=[0, BED_STEPS * dt],
        gravity=(0, 0, -G),
        walls=(box,),
    )
    return changed(scene, domain=Domain(lower=(-RADIUS,) * 3, upper=tuple(size + RADIUS)))


def _memory(results: Mapping[str, Result]) -> Mapping[str, float]:
    few, many = (results[name] for name in BEDS)
    more = float(many.resources["peak_memory"]) - float(few.resources["peak_memory"])
    return {"D25": more / (len(many.scene.bodies) - len(few.scene.bodies))}


# ---- D26: far from the origin


def far_scene(shift: float) -> Scene:
    """An oblique collision and a tower of ten on the floor, `shift` diameters from the origin along each axis."""
    kind = Kind(1e7, 2500, RADIUS, restitution=0.5, friction=0.3)
    bodies = [
        Body("grain", (0, 0, 0.05), (0.5, 0, 0)),
        Body("grain", (3 * RADIUS, RADIUS, 0.05), (-0.5, 0, 0), (0, 0, 100)),
        *[Body("grain", (0.03, 0, RADIUS * (2 * k + 1))) for k in range(TOWER)],
    ]
    dt = 0.1 * rayleigh(kind)
    by = 2 * RADIUS * shift
    scene = scene_of(
        f"d26_{shift:g}".replace("+", ""),
        {"grain": kind},
        bodies,
        time_step=dt,
        times=every(100 * dt, 2000 * dt),
        gravity=(0, 0, -G),
        walls=(floor(),),
    )
    moved = scene.bodies.model_copy(update={"position": scene.bodies.position + by})
    room = Domain(lower=(by - 0.1, by - 0.1, by - 0.01), upper=(by + 0.1, by + 0.1, by + 0.1))
    plane = Plane(name="floor", material=WALL, point=(0, 0, by), normal=(0, 0, 1))
    return changed(scene, bodies=moved, walls=(plane,), domain=room)


def _far(results: Mapping[str, Result]) -> Mapping[str, float]:
    own = motion(results["d26_0"])
    found = {}
    for k, shift in enumerate(FAR):
        there = motion(results[f"d26_{shift:g}".replace("+", "")])
        away = (there.position - there.position[0]) - (own.position - own.position[0])
        found[f"D26{'abc'[k]}"] = float(np.abs(away).max() / (2 * RADIUS))
    return found


# ---- D27: slow motion


def slow_scene() -> Scene:
    """Grains that drift slowly, near the origin and 10 m away."""
    kind = Kind(1e7, 2500, RADIUS)
    bodies = [Body("grain", (x, 0.1 * k, 0), (v, 0, 0)) for k, (v, x) in enumerate(SLOW)]
    return scene_of("d27_slow", {"grain": kind}, bodies, time_step=SLOW_STEP, times=[0, SLOW_STEP * SLOW_STEPS])


def _slow(result: Result) -> Mapping[str, float]:
    seen = motion(result)
    way = seen.position[-1, :, 0] - result.scene.bodies.position[:, 0]
    exact = result.scene.bodies.velocity[:, 0] * seen.time[-1]
    return {"D27": float(np.abs(way / exact - 1).max())}


# ---- D28: very many steps


def bowl_scene() -> Scene:
    """A grain without friction that swings in a lying cylinder."""
    kind = Kind(1e7, 2500, RADIUS)
    arm = BOWL - RADIUS
    bowl = Cylinder(
        name="bowl", material=WALL, start=(0, 0, -4 * RADIUS), end=(0, 0, 4 * RADIUS), radius=BOWL,
        closed_start=True, closed_end=True,
    )  # fmt: skip
    dt = 0.1 * rayleigh(kind)
    rest = (0.75 * kind.mass * G / (kind.modulus * math.sqrt(RADIUS))) ** (2 / 3)
    place = (arm + rest * math.cos(BOWL_ANGLE)) * np.array([math.sin(BOWL_ANGLE), -math.cos(BOWL_ANGLE), 0])
    scene = scene_of(
        "d28_bowl",
        {"grain": kind},
        [Body("grain", tuple(place))],
        time_step=dt,
        times=every(BOWL_STEPS // 1000 * dt, BOWL_STEPS * dt),
        gravity=(0, -G, 0),
        walls=(bowl,),
    )
    return changed(scene, domain=Domain(lower=(-2 * BOWL,) * 3, upper=(2 * BOWL,) * 3))


def _bowl(result: Result) -> Mapping[str, float]:
    """Change of the amplitude between the first and the last tenth, from the energy of the swing [-]."""
    seen = motion(result)
    height = seen.position[:, 0, 1] + BOWL - RADIUS
    energy = 0.5 * (seen.velocity[:, 0] ** 2).sum(axis=1) + G * height
    part = len(energy) // 10
    return {"D28a": float(abs(math.sqrt(energy[-part:].mean() / energy[:part].mean()) - 1))}


def rotor_scene() -> Scene:
    """A dumbbell that turns freely about an axis which is none of its own."""
    shape = Clump.dumbbell(RADIUS, 2 * RADIUS)
    kind = Kind(1e7, 2500, shape.bounding_radius, shape=shape)
    spin = (30.0, 0.0, 40.0)
    return scene_of(
        "d28_rotor",
        {"rotor": kind},
        [Body("rotor", (0, 0, 0), (0, 0, 0), spin)],
        time_step=ROTOR_STEP,
        times=every(ROTOR_TIME / 200, ROTOR_TIME),
    )


def _rotor(result: Result) -> Mapping[str, float]:
    """Change of the spin of a body with two equal moments [-]: it is constant where angular momentum and energy are."""
    spin = np.linalg.norm(motion(result).angular_velocity[:, 0], axis=1)
    return {"D28b": float(np.abs(spin / spin[0] - 1).max())}


def experiments() -> tuple[Experiment, ...]:
    """D22 and D24 to D28."""
    rest = "e = 0: nothing comes back"
    rigid = partial(corner_scene, "d22_rigid", Rigid(), 0.0)
    soft = partial(corner_scene, "d22_soft", None, SOFT_E)
    return (
        on_one_scene(
            "d22_rigid",
            "Into walls and corners, e = 0",
            rigid,
            lambda result: {"D22a": corners(result)["hop"], "D22b": corners(result)["rebound"]},
            (
                at_most("D22a", "into a wall and a corner: hop over speed", "1", 1e-3, "one normal for each wall"),
                at_most("D22b", "into a wall and a corner: rebound over speed", "1", 1e-3, rest),
            ),
        ),
        on_one_scene(
            "d22_soft",
            f"Into walls and corners, e = {SOFT_E:g}",
            soft,
            lambda result: {"D22c": corners(result)["hop"], "D22d": corners(result)["rebound"] - SOFT_E},
            (
                at_most("D22c", "into a wall and a corner: hop over speed", "1", 1e-3, "one normal for each wall"),
                at_most("D22d", f"rebound over speed beyond e = {SOFT_E:g}", "1", 1e-3, "restitution", scene_law=True),
            ),
            "long",
            closed_step(soft),
        ),
        on_one_scene(
            "d22_vertex",
            "On a vertex and a ridge, e = 0",
            ledge_scene,
            _ledge,
            (at_most("D22e", "at rest on a vertex and a ridge: largest motion in r", "1", 1e-4, "unique normal"),),
            "long",
        ),
        Experiment(
            "d24_none",
            "No particles",
            (Trial("d24_0", partial(few_scene, 0)),),
            lambda results: {"D24a": float("d24_0" in results)},
            (at_least("D24a", "no particles: the run comes to its end (1 = so)", "1", 1.0, "nothing to do"),),
            deaths_count=True,
        ),
        on_one_scene(
            "d24_1",
            "One particle",
            partial(few_scene, 1),
            lambda result: {"D24b": _flight(result)},
            (at_most("D24b", "one particle: error of free flight", "1", 1e-6, "g t²/2"),),
        ),
        on_one_scene(
            "d24_2",
            "Two particles far apart",
            partial(few_scene, 2),
            lambda result: {"D24c": _flight(result)},
            (at_most("D24c", "two particles: error of free flight", "1", 1e-6, "g t²/2"),),
            "long",
        ),
        Experiment(
            "d25_memory",
            "A settling bed of 1e5 spheres (instead of 1e6)",
            tuple(Trial(name, partial(bed_scene, name)) for name in BEDS),
            _memory,
            (at_most("D25", "memory of a particle, of 1e5 beside 1e3", "byte", 1000.0, "PhasicFlow: 700"),),
            "statistical",
        ),
        Experiment(
            "d26_far",
            "Far from the origin: a collision and a tower of 10 (instead of 60)",
            tuple(Trial(f"d26_{shift:g}".replace("+", ""), partial(far_scene, shift)) for shift in (0, *FAR)),
            _far,
            tuple(
                at_most(
                    f"D26{'abc'[k]}", f"{shift:g} d from the origin: largest difference in d", "1", 1e-3, "invariance"
                )
                for k, shift in enumerate(FAR)
            ),
            "long",
        ),
        on_one_scene(
            "d27_slow",
            "Slow motion in small steps",
            slow_scene,
            _slow,
            (at_most("D27", "1 mm/s and 1 cm/s at 0.1 m and 10 m: error of the way", "1", 1e-3, "v t"),),
        ),
        on_one_scene(
            "d28_bowl",
            "A swing of 1e6 steps (instead of 1e7)",
            bowl_scene,
            _bowl,
            (at_most("D28a", "change of the amplitude", "1", 1e-3, "energy", scale=1.0),),
            "long",
        ),
        on_one_scene(
            "d28_rotor",
            "A free rotor, 2.5e5 steps (instead of 1e7)",
            rotor_scene,
            _rotor,
            (at_most("D28b", "change of the spin of a free dumbbell", "1", 1e-4, "energy and angular momentum"),),
            "long",
            {"dt": repr(ROTOR_STEP)},
        ),
    )
