"""Tests of the MFiX verification manual (Garg et al. 2012): falls on a spring, bounces, and oblique collisions."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.optimize import brentq

from dembench.results import Result
from dembench.scene import LinearSpring, Scene
from dembench.verification.checks import Check, Experiment, deviation, on_one_scene
from dembench.verification.closed_forms import chains
from dembench.verification.closed_forms.oblique import COULOMB, about_contact, from_coulomb
from dembench.verification.closed_forms.volleys import Volley, angles
from dembench.verification.laws import damping_ratio
from dembench.verification.scenes import MOTION, Body, Kind, every, floor, scene_of

SOURCE = "MFiX verification manual; Garg et al. 2012"
GRAVITY = 9.81
RADIUS, DENSITY, HEIGHT = 0.1, 2600.0, 0.5
"""Balls of MF01 and MF02 [m], [kg/m^3], and the height of their centres above the floor at the start [m]."""
FALL_TIME = math.sqrt(2 * (HEIGHT - RADIUS) / GRAVITY)
FALL_SPEED = GRAVITY * FALL_TIME

# ---- MF01: a ball falls on a linear spring

STIFFNESS = 1e4
SPRINGS, DAMPED = (1e4, 2.5e4, 5e4), (1.0, 0.8)
"""Stiffnesses of MFiX [N/m]; the scene has one, and lighter balls: only stiffness over mass counts."""
SPRING_STEP, SPRING_END = 2e-4, 0.42
LINEAR_LETTERS = "ijkl"
"""Letters of the checks of the chain on linear springs."""


def _falling_kinds() -> dict[str, Kind]:
    return {
        f"k{round(k)}_{round(100 * e)}": Kind(1e7, DENSITY * STIFFNESS / k, RADIUS, restitution=e, friction=0.3)
        for k in SPRINGS
        for e in DAMPED
    }


def spring_fall(stiffness: float, restitution: float) -> tuple[float, float]:
    """Time [s] and speed [m/s] at which a ball parts from the spring that it fell on.

    y'' = -g - 2 b w y' - w^2 (y - r) from the first touch on, w^2 = k/m, b = -ln e/sqrt(pi^2 + ln^2 e), solved in
    closed form; the ball parts where y = r again.
    """
    mass = DENSITY * 4 / 3 * math.pi * RADIUS**3
    w = math.sqrt(stiffness / mass)
    b = float(damping_ratio(restitution))
    damped, sunk = w * math.sqrt(1 - b * b), GRAVITY / w**2
    beta = (b * w * sunk - FALL_SPEED) / damped

    def above(t: float) -> float:
        return math.exp(-b * w * t) * (sunk * math.cos(damped * t) + beta * math.sin(damped * t)) - sunk

    t = float(brentq(above, 0.5 * math.pi / damped, 1.5 * math.pi / damped, xtol=1e-14))
    cos, sin = math.cos(damped * t), math.sin(damped * t)
    slope = (beta * damped - b * w * sunk) * cos - (sunk * damped + b * w * beta) * sin
    return FALL_TIME + t, math.exp(-b * w * t) * slope


def springs() -> Scene:
    """Balls above the floor; a horizontal chain of the heaviest ones falls freely, far above."""
    kinds = _falling_kinds()
    balls = [Body(kind, (0, 6 * RADIUS * k, HEIGHT)) for k, kind in enumerate(kinds)]
    row = chains.row(next(iter(kinds)), RADIUS, chains.LINEAR_SPEED, (0, -6 * RADIUS, 3.0))
    return scene_of(
        "fall_on_spring",
        kinds,
        [*balls, *row],
        time_step=SPRING_STEP,
        times=every(0.01, SPRING_END),
        gravity=(0, 0, -GRAVITY),
        walls=(floor(),),
        law=LinearSpring(normal_stiffness=STIFFNESS, tangential_stiffness=STIFFNESS),
    )


def _springs(result: Result) -> Mapping[str, float]:
    seen = result.snapshots[MOTION]
    n = len(SPRINGS) * len(DAMPED)
    z, v = seen.position[-1, :n, 2], seen.velocity[-1, :n, 2]
    parted = np.sqrt(v**2 + 2 * GRAVITY * (z - RADIUS))
    time = seen.time[-1] - (parted - v) / GRAVITY
    found = {}
    for k in range(n):
        found[f"MF01{'abcdef'[k]}t"], found[f"MF01{'abcdef'[k]}v"] = float(time[k]), float(parted[k])
    mass = result.scene.masses()[n]
    return {**found, **chains.values(LINEAR_LETTERS, seen, slice(n, n + chains.BALLS), linear_chain(mass))}


def linear_chain(mass: float) -> chains.Chain:
    """The chain of the scene: five balls of a mass [kg] on linear springs."""
    return chains.Chain(mass, STIFFNESS, 1.0, RADIUS, chains.LINEAR_SPEED)


def _spring_checks() -> tuple[Check, ...]:
    found: list[Check] = []
    for letter, (k, e) in zip("abcdef", [(k, e) for k in SPRINGS for e in DAMPED], strict=True):
        time, speed = spring_fall(k, e)
        what, source = f"k = {k:g} N/m, e = {e:g}", f"damped oscillator; {SOURCE}"
        found += [
            Check(f"MF01{letter}t", f"{what}: time of parting", "s", time, 1e-3 * time, source, scene_law=True),
            Check(f"MF01{letter}v", f"{what}: speed of parting", "m/s", speed, 5e-3 * speed, source, scene_law=True),
        ]
    mass = DENSITY * 4 / 3 * math.pi * RADIUS**3
    return (*found, *chains.checks(LINEAR_LETTERS, "linear springs", linear_chain(mass), SPRING_END))


# ---- MF02: bounces, with a projectile beside them

YOUNG = 1e9
BOUNCES = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
BOUNCE_STEP, BOUNCE_END = 4e-5, 1.2
APEX = 2
"""The bounce whose height is measured."""
PROJECTILE = (2.0, 0.0, 3.0)
"""Velocity of the projectile [m/s]."""


def bounces() -> Scene:
    """Balls of several restitutions, and one that flies without touching anything."""
    kinds = {f"e{round(100 * e)}": Kind(YOUNG, DENSITY, RADIUS, restitution=e, friction=0.3) for e in BOUNCES}
    balls = [Body(kind, (0, 6 * RADIUS * k, HEIGHT)) for k, kind in enumerate(kinds)]
    flying = Body("e50", (0, -6 * RADIUS, 5.0), PROJECTILE)
    return scene_of(
        "bounces",
        kinds,
        [*balls, flying],
        time_step=BOUNCE_STEP,
        times=every(0.01, BOUNCE_END),
        gravity=(0, 0, -GRAVITY),
        walls=(floor(),),
    )


def apex(z: np.ndarray, v: np.ndarray, count: int) -> float:
    """Height above the floor that a ball reaches after so many bounces, over that of its fall [-].

    It follows from the sample of the flight nearest to the apex, z + v^2/(2 g).
    """
    rising = np.flatnonzero((v[:-1] < 0) & (v[1:] > 0)) + 1
    if len(rising) < count:
        return math.nan
    end = rising[count] if len(rising) > count else len(z)
    flight = slice(rising[count - 1], end)
    k = int(np.argmax(z[flight]))
    return float((z[flight][k] + v[flight][k] ** 2 / (2 * GRAVITY) - RADIUS) / (HEIGHT - RADIUS))


def _bounces(result: Result) -> Mapping[str, float]:
    seen = result.snapshots[MOTION]
    z, v = seen.position[:, :, 2], seen.velocity[:, :, 2]
    found = {f"MF02{'abcdef'[k]}": apex(z[:, k], v[:, k], APEX) for k in range(len(BOUNCES))}
    t, start = seen.time[:, None], seen.position[0, -1]
    exact = start + t * PROJECTILE + 0.5 * t**2 * np.array([0, 0, -GRAVITY])
    return {**found, "SR8": float(np.abs(seen.position[:, -1] - exact).max() / start[2])}


def _bounce_checks() -> tuple[Check, ...]:
    source = f"e^(2k) of the height of the fall; {SOURCE}"
    return (
        *(
            Check(f"MF02{letter}", f"e = {e:g}: height of bounce {APEX}", "1", e**4, 0.05 * e**4, source)
            for letter, e in zip("abcdef", BOUNCES, strict=True)
        ),
        deviation("SR8", "projectile: largest distance from the parabola, over its height", 1e-9, "x0 + v t + g t²/2"),
    )


# ---- MF05: oblique collisions with linear springs

OBLIQUE_STIFFNESS, RATIO = 1.72e7, 1.48 / 1.72
GRAIN = Kind(3.8e11, 4000, 0.0025, 0.23, restitution=1.0, friction=0.092)
OBLIQUE_ANGLES = (5.0, 15.0, 25.0, 45.0, 55.0, 65.0, 75.0)
"""Angles to the normal [degrees]; the last four slide through the whole contact."""
OBLIQUE = Volley(
    name="oblique_linear",
    kinds={"alumina": GRAIN, "spare": GRAIN},
    shots=(*angles("alumina", 3.9, OBLIQUE_ANGLES), *angles("spare", 3.9, OBLIQUE_ANGLES[-1:])),
    time_step=1.2e-7,
    duration=1.56e-5,
    law=LinearSpring(normal_stiffness=OBLIQUE_STIFFNESS, tangential_stiffness=RATIO * OBLIQUE_STIFFNESS),
)


def _oblique(result: Result) -> Mapping[str, float]:
    seen = OBLIQUE.seen(result)
    return {
        "MF05a": from_coulomb(seen[3:], OBLIQUE.kinds, "velocity"),
        "MF05b": from_coulomb(seen[3:], OBLIQUE.kinds, "spin"),
        "MF05c": about_contact(seen, OBLIQUE.kinds),
    }


def _oblique_checks() -> tuple[Check, ...]:
    source = f"{COULOMB}; {SOURCE}"
    return (
        deviation("MF05a", "45° to 75°: largest deviation of the change of velocity", 0.01, source),
        deviation("MF05b", "45° to 75°: largest deviation of the spin", 0.01, source),
        deviation("MF05c", "all angles: largest change of the angular momentum about the contact", 0.01, SOURCE),
    )


def experiments() -> tuple[Experiment, ...]:
    """The experiments."""
    return (
        on_one_scene(
            "fall_on_spring",
            "Balls on linear springs, and a chain of them",
            springs,
            _springs,
            _spring_checks(),
            settings={"dt": f"{SPRING_STEP:g}"},
        ),
        on_one_scene(
            "bounces",
            "Balls that bounce, and one that flies",
            bounces,
            _bounces,
            _bounce_checks(),
            settings={"dt": f"{BOUNCE_STEP:g}"},
        ),
        on_one_scene(
            OBLIQUE.name,
            "Oblique collisions with linear springs",
            OBLIQUE.scene,
            _oblique,
            _oblique_checks(),
            settings={"dt": f"{OBLIQUE.time_step:g}"},
        ),
    )
