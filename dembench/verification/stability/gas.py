"""Gas, zero gravity, the speed of a drum, and units: D17 to D20."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
from scipy.optimize import curve_fit

from dembench.results import Result
from dembench.scene import Cylinder, Domain, Motion, Plane, Rigid, Scene
from dembench.scene.materials import Law
from dembench.verification.checks import Check, Experiment, Trial, at_least, at_most, on_one_scene
from dembench.verification.scenes import WALL, Body, Kind, every, scene_of
from dembench.verification.stability.common import (
    changed,
    closed_step,
    contact_time,
    fitted,
    lattice,
    motion,
    rayleigh,
)

EDGE, FRACTION, COOLING_E = 16, 0.05, 0.9
COUNT = EDGE**3
TAUS, SAMPLES = 10.0, 40
HARDNESS = 0.04
"""Contact time of the soft gas at the start [s]; spheres of d = 1 m fly freely for 1.3 s at 1 m/s."""

ALMOST_NONE = 1e-9
"""Gravity that must change nothing [m/s^2]."""

DRUM, GRAIN = 0.1, 2.5e-3
"""Radii of the drum and of its grains [m]."""
FAST, ABOVE, BELOW = 2.0, 1.3, 0.9
"""Speeds of the drum in sqrt(g/R).

Coulomb's law holds a layer at the radius r all the way round where sin(phi) >= g/(w^2 r). At 1.3 with the friction of
the grains, tan(phi) = 0.8, that is only what lies within 1.1 d of the mantle; at 2 three layers need phi = 17 degrees,
and spheres that are free to roll have 20 to 24.
"""
ACROSS, TURNS = 4, 5
PATHS = tuple(DRUM - GRAIN * (1 + 2 * k) for k in range(3))
"""Radii of the rings [m]."""
G = 9.81

LENGTHS = (1.0, 1e-6, 1e-3, 1e3)
"""Diameters of the same bounce [m]; the first is what the others are compared with."""
GRAVITIES = (1e-5 * G, 1.62, 24.8)
"""Gravities of the same bounce with d = 1 m: next to none, Moon, Jupiter [m/s^2]."""
DIMENSIONLESS_YOUNG = 1e5
"""Young's modulus in rho g d."""


# ---- D17: homogeneous cooling


def enskog_time() -> float:
    """tau of T = T0/(1 + t/tau)^2 at T0 = 1 m^2/s^2 and d = 1 m [s]: 6/((1 - e^2) Gamma), Gamma the collision rate.

    Gamma = 24 phi g2 sqrt(T/pi)/d, g2 = (1 - phi/2)/(1 - phi)^3. Source: Haff 1983; Brilliantov & Poeschel 2004.
    """
    g2 = (1 - FRACTION / 2) / (1 - FRACTION) ** 3
    rate = 24 * FRACTION * g2 / math.sqrt(math.pi)
    return 6 / ((1 - COOLING_E**2) * rate)


def cooling_scene(name: str, law: Law | None) -> Scene:
    """Spheres of d = 1 m in a periodic box, without friction and gravity, at a temperature of 1 m^2/s^2."""
    density, radius = 6 / math.pi, 0.5
    speed = 4 / math.sqrt(math.pi)
    # Hertz's contact time 2.868 (m*^2/(R* E*^2 v))^(1/5), solved for E*
    modulus = math.sqrt((2.868 / HARDNESS) ** 5 * 0.25 / (0.25 * speed))
    kind = Kind(2 * modulus * (1 - 0.25**2), density, radius, restitution=COOLING_E)
    edge = (COUNT * math.pi / 6 / FRACTION) ** (1 / 3)
    random = np.random.default_rng(11)
    position = lattice((EDGE,) * 3, edge / EDGE) + 0.5 * edge / EDGE + random.uniform(-0.3, 0.3, (COUNT, 3))
    velocity = random.normal(size=(COUNT, 3))
    velocity -= velocity.mean(axis=0)
    velocity /= math.sqrt((velocity**2).mean())
    interval = TAUS * enskog_time() / SAMPLES
    dt = fitted(0.02 if law else contact_time(kind, speed) / 20, interval)
    scene = scene_of(
        name,
        {"grain": kind},
        [Body("grain", p, v) for p, v in zip(position, velocity, strict=True)],
        time_step=dt,
        times=every(interval, SAMPLES * interval),
        law=law,
    )
    return changed(scene, domain=Domain(lower=(0,) * 3, upper=(edge,) * 3, periodic=(True,) * 3))


def cooled(time: np.ndarray, temperature: np.ndarray) -> tuple[float, float]:
    """tau [s] and exponent of T0/(1 + t/tau)^n, each fitted with the other one as Haff's law has it."""
    shape = np.log(temperature / temperature[0])
    tau = curve_fit(lambda t, tau: -2 * np.log1p(t / tau), time, shape, p0=[enskog_time()])[0][0]
    power = curve_fit(
        lambda t, tau, n: -n * np.log1p(t / tau), time, shape, p0=[enskog_time(), 2.0], bounds=([0.1, 0.5], [1e3, 4])
    )[0][1]
    return float(tau), float(-power)


def _cooling(result: Result, ids: str) -> Mapping[str, float]:
    seen = motion(result)
    tau, power = cooled(seen.time, (seen.velocity**2).mean(axis=(1, 2)))
    return {f"D17{ids[0]}": tau, f"D17{ids[1]}": power}


def _haff(ids: str, name: str, title: str, law: Law | None) -> Experiment:
    tau = enskog_time()
    return on_one_scene(
        name,
        f"Cooling of {COUNT} {title}",
        partial(cooling_scene, name, law),
        partial(_cooling, ids=ids),
        (
            Check(f"D17{ids[0]}", f"cooling {title}: time tau", "s", tau, 0.05 * tau, "Haff 1983, rate of Enskog"),
            Check(f"D17{ids[1]}", f"cooling {title}: exponent", "1", -2.0, 0.05, "Haff 1983"),
        ),
        "statistical",
        {"dt": "0.02"} if law else {},
    )


# ---- D18: gravity of almost nothing


def spun_scene(name: str, gravity: float, law: Law | None) -> Scene:
    """Pairs with spin and friction that meet head-on and obliquely, in a gravity that is none or next to none."""
    kind = Kind(1e8, 2500, 1.0, restitution=0.5, friction=0.3)
    bodies = []
    for k, aside in enumerate((0.0, 0.5)):
        for side in (-1, 1):
            place = (side * 1.503, 10 * k + 0.5 * side * aside, 0)
            bodies.append(Body("grain", place, (-side, 0, 0), (1.0, 2.0 * side, 10.0)))
    dt = 1e-3 if law else fitted(contact_time(kind, 2.0) / 50, 0.1)
    return scene_of(name, {"grain": kind}, bodies, time_step=dt, times=[0, 1.0], gravity=(0, 0, -gravity), law=law)


def _continuity(results: Mapping[str, Result], name: str, id: str) -> Mapping[str, float]:
    none, little = (motion(results[f"{name}_{way}"]) for way in ("none", "little"))
    away = np.abs(none.velocity[-1] - little.velocity[-1]).max()
    spin = np.abs(none.angular_velocity[-1] - little.angular_velocity[-1]).max() / 10
    return {id: float(max(away, spin))}


def _zero_gravity(id: str, name: str, title: str, law: Law | None, default: bool) -> Experiment:
    dt = closed_step(partial(spun_scene, name, 0.0, law))
    return Experiment(
        name,
        f"Collisions with spin without gravity and with 1e-9 m/s², {title}",
        tuple(
            Trial(f"{name}_{way}", partial(spun_scene, f"{name}_{way}", gravity, law), dt)
            for way, gravity in (("none", 0.0), ("little", ALMOST_NONE))
        ),
        partial(_continuity, name=name, id=id),
        (at_most(id, f"{title}: change by a gravity of 1e-9 m/s², relative", "1", 1e-6, "continuity in g"),),
        "default" if default else "long",
    )


# ---- D19: drum


def drum_scene(name: str, froude: float) -> Scene:
    """Rings of grains on the mantle of a drum, which turn with it from the start.

    Grains of a single ring would roll on the mantle, whatever the friction; those of several hold each other. They are
    moved at random: slices that are equal to the bit would stay so, and roll as cylinders do.
    """
    kind = Kind(1e6, 2500, 0.98 * GRAIN, restitution=0.5, friction=0.8)
    w, length = froude * math.sqrt(G / DRUM), 2 * GRAIN * ACROSS
    rings = [(path, math.floor(math.pi / math.asin(GRAIN / path))) for path in PATHS]
    ring = [(path, 2 * math.pi * k / n) for path, n in rings for k in range(n)]
    centres = np.array(
        [(path * math.cos(a), path * math.sin(a), GRAIN * (2 * j + 1)) for j in range(ACROSS) for path, a in ring]
    )
    centres += 0.01 * GRAIN * np.random.default_rng(0).uniform(-1, 1, centres.shape)
    bodies = [Body("grain", (x, y, z), (-w * y, w * x, 0), (0, 0, w)) for x, y, z in centres]
    turning = Motion(angular_velocity=(0, 0, w))
    wall = Cylinder(
        name="drum",
        material=WALL,
        start=(0, 0, 0),
        end=(0, 0, length),
        radius=DRUM,
        closed_start=True,
        closed_end=True,
        motion=turning,
    )
    end = TURNS * 2 * math.pi / w
    dt = fitted(0.1 * rayleigh(kind), end / 50)
    scene = scene_of(
        name, {"grain": kind}, bodies, time_step=dt, times=every(end / 50, end), gravity=(0, -G, 0), walls=(wall,)
    )
    room = (-1.2 * DRUM, -1.2 * DRUM, -GRAIN), (1.2 * DRUM, 1.2 * DRUM, length + GRAIN)
    return changed(scene, domain=Domain(lower=room[0], upper=room[1]))


def ring(result: Result, froude: float, layers: int) -> tuple[float, float]:
    """Smallest distance from the axis at the end in that of a ring of three layers, and co-rotation [-].

    Of the grains of so many layers from the mantle at the start. Co-rotation is the mean over the last turn: where
    grains fall on the ring, that of an instant scatters by 0.5 %.
    """
    seen = motion(result)
    start = seen.position[0]
    own = np.hypot(start[:, 0], start[:, 1]) > DRUM - 2 * GRAIN * layers
    late = seen.time > (1 - 1 / TURNS) * seen.time[-1]
    x, v = seen.position[late][:, own], seen.velocity[late][:, own]
    distance = np.hypot(x[..., 0], x[..., 1])
    turning = (x[..., 0] * v[..., 1] - x[..., 1] * v[..., 0]) / distance**2
    w = froude * math.sqrt(G / DRUM)
    return float(distance[-1].min() / (DRUM - 6 * GRAIN)), float(turning.mean() / w)


def _drums(results: Mapping[str, Result]) -> Mapping[str, float]:
    outer, turning = ring(results["d19_above"], ABOVE, 1)
    below, _ = ring(results["d19_below"], BELOW, 3)
    whole, rigid = ring(results["d19_fast"], FAST, 3)
    return {"D19a": outer, "D19b": turning, "D19c": below, "D19d": whole, "D19e": rigid}


# ---- D20: units


def bounce_scene(name: str, diameter: float, gravity: float) -> Scene:
    """A sphere thrown along a floor with friction; everything in units of its diameter, density and sqrt(d/g).

    It lands within a step: on the edge of two, rounding would choose the step in which the contact begins.
    """
    time = math.sqrt(diameter / gravity)
    kind = Kind(DIMENSIONLESS_YOUNG * 2500 * gravity * diameter, 2500, diameter / 2, restitution=0.6, friction=0.3)
    dt = time / 2000
    body = Body("grain", (0, 0, 2.5137 * diameter), (diameter / time, 0, 0), (0, 2 / time, 1 / time))
    scene = scene_of(
        name,
        {"grain": kind},
        [body],
        time_step=dt,
        times=[k * 500 * dt for k in range(41)],
        gravity=(0, 0, -gravity),
        walls=(Plane(name="floor", material=WALL, point=(0, 0, 0), normal=(0, 0, 1)),),
    )
    room = 20 * diameter
    # a wall that yields as the sphere does scales with it
    materials = tuple(m.model_copy(update={"young": kind.young}) for m in scene.materials)
    domain = Domain(lower=(-room, -room, -diameter), upper=(room, room, room))
    return changed(scene, domain=domain, materials=materials)


def _units(results: Mapping[str, Result]) -> Mapping[str, float]:
    def scaled(k: int, diameter: float) -> np.ndarray:
        return np.asarray(motion(results[f"d20_{k}"]).position[:, 0] / diameter)

    own = scaled(0, LENGTHS[0])
    lengths = [np.abs(scaled(k, d) - own).max() for k, d in enumerate(LENGTHS) if k]
    gravities = [np.abs(scaled(k + len(LENGTHS), 1.0) - own).max() for k in range(len(GRAVITIES))]
    return {"D20a": float(max(lengths)), "D20b": float(max(gravities))}


def _unit_trials() -> tuple[Trial, ...]:
    sizes = [(d, G) for d in LENGTHS] + [(1.0, g) for g in GRAVITIES]
    found = []
    for k, (diameter, gravity) in enumerate(sizes):
        scene = partial(bounce_scene, f"d20_{k}", diameter, gravity)
        found.append(Trial(f"d20_{k}", scene, closed_step(scene)))
    return tuple(found)


def experiments() -> tuple[Experiment, ...]:
    """D17 to D20."""
    least, held = "least distance from the axis in R - 3 d after 5 turns", "Coulomb: sin(phi) >= g/(w² r)"
    return (
        _haff("ab", "d17_soft", "soft spheres", None),
        _haff("cd", "d17_rigid", "rigid spheres", Rigid()),
        _zero_gravity("D18a", "d18_soft", "soft spheres", None, True),
        _zero_gravity("D18b", "d18_rigid", "rigid spheres", Rigid(), False),
        Experiment(
            "d19_drum",
            "Three layers in a drum above and below the critical speed (1388 grains instead of 5000)",
            (
                Trial("d19_above", partial(drum_scene, "d19_above", ABOVE)),
                Trial("d19_below", partial(drum_scene, "d19_below", BELOW)),
                Trial("d19_fast", partial(drum_scene, "d19_fast", FAST)),
            ),
            _drums,
            (
                at_least("D19a", f"1.3 sqrt(g/R), the layer at the mantle: {least}", "1", 1.0, held),
                Check(
                    "D19b", "1.3 sqrt(g/R), the layer at the mantle: turning in that of the drum", "1", 1.0, 0.01, held
                ),
                at_most("D19c", f"0.9 sqrt(g/R): {least}", "1", 1.0, "grains fall"),
                at_least("D19d", f"2 sqrt(g/R), all three layers: {least}", "1", 1.0, held),
                Check("D19e", "2 sqrt(g/R), all three layers: turning in that of the drum", "1", 1.0, 0.01, held),
            ),
            "long",
        ),
        Experiment(
            "d20_units",
            "The same bounce in other units",
            _unit_trials(),
            _units,
            (
                at_most("D20a", "d of 1e-6 to 1e3 m: largest difference in d", "1", 1e-4, "dimensional analysis"),
                at_most("D20b", "1e-5 g, Moon, Jupiter: largest difference in d", "1", 1e-4, "dimensional analysis"),
            ),
            "long",
        ),
    )
