"""The limits of restitution and friction, none of it and enormous ones: D12 to D16."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from dembench.results import Result
from dembench.scene import Box, Constraint, Domain, ElasticEnergy, Motion, Plane, Rigid, Scene
from dembench.scene.materials import Law
from dembench.verification.checks import Check, Experiment, at_most, on_one_scene
from dembench.verification.scenes import WALL, Body, Kind, every, floor, scene_of
from dembench.verification.stability.common import (
    changed,
    fitted,
    kinetic_energy,
    lattice,
    motion,
    rayleigh,
    speeds,
    within,
)

G = 9.81

DROP, DROP_STEP = 0.5, 1e-3

GAS, FRACTION, GAS_SPEED = 1000, 0.2, 1.0
GAS_COLLISIONS = 1e5
GAS_SAMPLES = 20

SPIN = 1.0
SLOPE = math.radians(60)
STICKY = (1e3, 1e9)
PLATE, PRESSED = 1.0, 5e-3
"""Speed of the plate [m/s], and how deep it is pressed into the sphere at the start [r]."""


def drop_scene(name: str, law: Law | None) -> Scene:
    """Unit spheres without restitution that fall on a plane, and on a fixed sphere."""
    kind = Kind(1e8, 2500, 1.0, restitution=0.0)
    bodies = [
        Body("grain", (0, 0, 1 + DROP)),
        Body("grain", (10, 0, 3 + DROP)),
        Body("grain", (10, 0, 1)),
    ]
    scene = scene_of(
        name,
        {"grain": kind},
        bodies,
        time_step=DROP_STEP,
        times=every(DROP_STEP, 1.0),
        gravity=(0, 0, -G),
        walls=(floor(),),
        law=law,
    )
    return changed(scene, constraints=(Constraint(kind="fixed", bodies=(2,)),))


def _no_bounce(result: Result) -> float:
    """Largest speed upwards of a sphere that touches nothing, in that of the impact [-].

    While it touches it may recoil: a critically damped contact does, and never lets go.
    """
    seen = motion(result)
    free = seen.position[:, :2, 2] > seen.position[0, :2, 2] - DROP
    return float(np.where(free, seen.velocity[:, :2, 2], 0.0).max() / math.sqrt(2 * G * DROP))


def gas_scene(name: str, law: Law | None) -> Scene:
    """A thousand elastic spheres without friction in a periodic box, a fifth of which they fill."""
    radius = 0.5
    contact = 0.01
    # tc = 2.868 (m*^2/(R* E*^2 v))^(1/5) with v the mean relative speed, solved for E
    density = 6 / math.pi
    reduced = 0.5
    speed = GAS_SPEED * 4 / math.sqrt(math.pi)
    modulus = math.sqrt((2.868 / contact) ** 5 * reduced**2 / (radius / 2 * speed))
    kind = Kind(2 * modulus * (1 - 0.25**2), density, radius)
    edge = (GAS * math.pi / 6 / FRACTION) ** (1 / 3)
    random = np.random.default_rng(7)
    position = lattice((10, 10, 10), edge / 10) + 0.5 * edge / 10 + random.uniform(-0.1, 0.1, (GAS, 3))
    velocity = GAS_SPEED * random.normal(size=(GAS, 3))
    velocity -= velocity.mean(axis=0)
    # collisions of a sphere in a time: 24 phi g2 sqrt(T/pi)/d; two take part in each
    g2 = (1 - FRACTION / 2) / (1 - FRACTION) ** 3
    rate = 24 * FRACTION * g2 * GAS_SPEED / math.sqrt(math.pi) * GAS / 2
    dt = 5e-3 if law else contact / 30
    steps = math.ceil(GAS_COLLISIONS / rate / dt / GAS_SAMPLES) * GAS_SAMPLES
    scene = scene_of(
        name,
        {"grain": kind},
        [Body("grain", p, v) for p, v in zip(position, velocity, strict=True)],
        time_step=dt,
        times=every(steps // GAS_SAMPLES * dt, steps * dt),
        law=law,
        observables=() if law else [ElasticEnergy(name="elastic", interval=steps // GAS_SAMPLES * dt)],
    )
    return changed(scene, domain=Domain(lower=(0,) * 3, upper=(edge,) * 3, periodic=(True,) * 3))


def _gas(result: Result, ids: str) -> Mapping[str, float]:
    energy, seen, mass = kinetic_energy(result), motion(result), result.scene.masses()
    if "elastic" in result.observables:
        energy = energy + result.observables["elastic"].value
    momentum = np.linalg.norm((mass[:, None] * seen.velocity).sum(axis=1), axis=1).max()
    scale = (mass * speeds(seen)[0]).sum()
    return {f"D13{ids[0]}": float(np.abs(energy / energy[0] - 1).max()), f"D13{ids[1]}": float(momentum / scale)}


def smooth_scene() -> Scene:
    """A bed without friction that slides down a tilted floor; its grains spin and go on spinning."""
    kind = Kind(1e7, 2500, 1e-3, restitution=0.5)
    counts, pitch = (6, 6, 4), 2e-3
    dt = fitted(0.1 * rayleigh(kind), 1e-3)
    position = lattice(counts, pitch) + 1e-3
    size = pitch * np.array(counts)
    tilt = math.radians(30)
    scene = scene_of(
        "d14_smooth",
        {"grain": kind},
        [Body("grain", p, spin=(SPIN, -SPIN, SPIN)) for p in position],
        time_step=dt,
        times=every(0.01, 0.1),
        gravity=(G * math.sin(tilt), 0, -G * math.cos(tilt)),
        walls=(
            Box(
                name="box",
                material=WALL,
                lower=(-1, 0, 0),
                upper=(1, float(size[1]), 0.1),
                open_faces=("x-", "x+", "z+"),
            ),
        ),
    )
    return changed(scene, domain=Domain(lower=(-0.1, -0.01, -0.01), upper=(0.5, 0.03, 0.1)))


def _smooth(result: Result) -> Mapping[str, float]:
    seen = motion(result)
    spin = np.abs(seen.angular_velocity - seen.angular_velocity[0]).max() / SPIN
    speed = seen.velocity[-1, :, 0].mean() / (result.scene.gravity[0] * seen.time[-1])
    return {"D14a": float(spin), "D14b": float(speed)}


def sticky_scene(name: str, law: Law | None) -> Scene:
    """Spheres with enormous friction: from rest on a slope of 60 degrees, and with spin into it."""
    kinds = {f"mu{k}": Kind(1e8, 2500, 0.01, restitution=0.5, friction=mu) for k, mu in enumerate(STICKY)}
    bodies = []
    for k, name_of in enumerate(kinds):
        bodies.append(Body(name_of, (0, 0.1 * k, 0.01)))
        bodies.append(Body(name_of, (0, 0.1 * k + 0.05, 0.02), spin=(0, 100.0, 0)))
    dt = 2e-4 if law else fitted(0.1 * rayleigh(kinds["mu0"]), 0.01)
    scene = scene_of(
        name,
        kinds,
        bodies,
        time_step=dt,
        times=every(0.01, 1.0),
        gravity=(G * math.sin(SLOPE), 0, -G * math.cos(SLOPE)),
        walls=(floor(),),
        law=law,
    )
    return within(scene, (-0.1, -0.1, -0.1), (6.0, 0.3, 0.5))


def sticking(result: Result) -> tuple[float, float, float]:
    """Error of the acceleration; slip over speed of those that roll; gain of energy of those that bounced [-]."""
    seen, g = motion(result), np.array(result.scene.gravity)
    r = result.scene.radii()
    rolls = seen.velocity[-1, ::2, 0]
    slip = np.abs(rolls - seen.angular_velocity[-1, ::2, 1] * r[::2]) / rolls
    error = np.abs(rolls / (5 / 7 * g[0] * seen.time[-1]) - 1)
    spinning = 0.2 * r**2 * (seen.angular_velocity**2).sum(axis=2)
    energy = 0.5 * (seen.velocity**2).sum(axis=2) + spinning - seen.position @ g
    free = energy[0, 1::2] + (seen.position[0, 1::2] @ g)
    scale = free + r[1::2] * abs(g[2])
    gain = ((energy[:, 1::2] - energy[0, 1::2]) / scale).max()
    return float(error.max()), float(slip.max()), float(gain)


def _sticky(ids: str, name: str, title: str, law: Law | None) -> Experiment:
    keys = [f"D15{letter}" for letter in ids]
    return on_one_scene(
        name,
        f"Friction of 1e3 and 1e9, {title}",
        partial(sticky_scene, name, law),
        lambda result: dict(zip(keys, sticking(result), strict=True)),
        (
            at_most(keys[0], f"{title}: error of the acceleration at 60 degrees", "1", 0.005, "5/7 g sin", scale=1.0),
            at_most(keys[1], f"{title}: slip over speed", "1", 1e-3, "rolling", scale=1.0),
            at_most(keys[2], f"{title}: gain of energy in a bounce with spin", "1", 1e-3, "no energy from nowhere"),
        ),
        "long",
        {"dt": "2e-4"} if law else {},
    )


def wedged_scene(name: str, law: Law | None) -> Scene:
    """A sphere between a fixed sphere and a plate that drags it on with a friction of 2."""
    kind = Kind(1e7, 2500, 0.01, restitution=0.5, friction=2.0)
    lean = math.radians(70)
    place = (0.02 * math.sin(lean), 0, 0.02 * math.cos(lean))
    plate = Plane(
        name="plate",
        material=WALL,
        point=(0, 0, place[2] + 0.01 * (1 - PRESSED)),
        normal=(0, 0, -1),
        motion=Motion(velocity=(-PLATE, 0, 0)),
    )
    dt = 1e-4 if law else fitted(0.1 * rayleigh(kind), 1e-3)
    scene = scene_of(
        name,
        {"grain": kind},
        [Body("grain", (0, 0, 0)), Body("grain", place)],
        time_step=dt,
        times=every(1e-3, 0.2),
        walls=(plate,),
        law=law,
    )
    room = Domain(lower=(-1, -1, -1), upper=(1, 1, place[2] + 0.02))
    return changed(scene, domain=room, constraints=(Constraint(kind="fixed", bodies=(0,)),))


def _wedged(id: str, name: str, title: str, law: Law | None) -> Experiment:
    return on_one_scene(
        name,
        f"A sphere dragged between a fixed one and a plate, {title}",
        partial(wedged_scene, name, law),
        lambda result: {id: float(speeds(motion(result)).max() / PLATE)},
        (
            at_most(
                id,
                f"{title}, friction 2: largest speed in that of the plate",
                "1",
                1e3,
                "bounded; Stewart 2000",
            ),
        ),
        "long",
        {"dt": "1e-4"} if law else {},
    )


def _elastic_gas(ids: str, name: str, title: str, law: Law | None, bound: float) -> Experiment:
    return on_one_scene(
        name,
        f"Elastic gas of 1000 {title}, 1e5 collisions instead of 1e6",
        partial(gas_scene, name, law),
        partial(_gas, ids=ids),
        (
            at_most(f"D13{ids[0]}", f"elastic {title}: change of energy", "1", bound, "energy", scale=1.0),
            at_most(f"D13{ids[1]}", f"elastic {title}: momentum over sum of |m v|", "1", 1e-5, "momentum"),
        ),
        "long",
        {"dt": "0.005"} if law else {"dt": repr(0.01 / 30)},
    )


def experiments() -> tuple[Experiment, ...]:
    """D12 to D16."""
    rigid = Rigid()
    return (
        on_one_scene(
            "d12_rigid",
            "No restitution, rigid spheres",
            partial(drop_scene, "d12_rigid", rigid),
            lambda result: {"D12a": _no_bounce(result)},
            (at_most("D12a", "rigid, e = 0: rebound over speed", "1", 1e-3, "e = 0"),),
            "long",
            {"dt": repr(DROP_STEP)},
        ),
        on_one_scene(
            "d12_soft",
            "No restitution, soft spheres",
            partial(drop_scene, "d12_soft", None),
            lambda result: {"D12b": _no_bounce(result)},
            (at_most("D12b", "soft, e = 0: rebound over speed", "1", 1e-3, "e = 0", scene_law=True),),
            settings={"dt": repr(DROP_STEP)},
        ),
        _elastic_gas("ab", "d13_rigid", "rigid spheres", rigid, 1e-4),
        _elastic_gas("cd", "d13_soft", "soft spheres at tc/30", None, 1e-3),
        on_one_scene(
            "d14_smooth",
            "No friction on a tilted floor",
            smooth_scene,
            _smooth,
            (
                at_most("D14a", "change of spin in its own", "1", 1e-6, "no friction, no torque"),
                Check("D14b", "mean speed over g sin t", "1", 1.0, 0.005, "the bed slides freely"),
            ),
            "long",
        ),
        _sticky("abc", "d15_soft", "soft", None),
        _sticky("def", "d15_rigid", "rigid", rigid),
        _wedged("D16a", "d16_soft", "soft", None),
        _wedged("D16b", "d16_rigid", "rigid", rigid),
    )
