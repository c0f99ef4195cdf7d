"""Walls that move and walls on grids: D39 and D40."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from dembench.results import Result
from dembench.scene import Cylinder, Domain, Motion, Plane, Rigid, Scene, Sdf
from dembench.scene.materials import Law
from dembench.verification.checks import Experiment, Trial, at_most, on_one_scene
from dembench.verification.scenes import WALL, Body, Kind, every, scene_of
from dembench.verification.stability.common import (
    changed,
    fitted,
    motion,
    rayleigh,
)

G = 9.81

GAMMA, PLATE_E, FREQUENCY = 1.3, 0.5, 20.0
"""Acceleration of the plate in g, restitution of the ball on it, and its frequency [Hz]."""
PERIODS = 20

PIPE = 0.1
CELLS = (16, 32, 64)
ROLL_ANGLE = 1.0

# ---- D39: plate that shakes


def landing_phase() -> float:
    """Phase of the plate at which the ball of a period-one orbit lands [rad]: cos p = pi (1 - e)/(Gamma (1 + e)).

    Source: Luck & Mehta 1993; the ball flies for one period, so it lands at -g T/2 and leaves at g T/2.
    """
    return math.acos(math.pi * (1 - PLATE_E) / (GAMMA * (1 + PLATE_E)))


def plate_scene(name: str, law: Law | None) -> Scene:
    """A ball on a plate that oscillates; it starts in the middle of the flight of a period-one orbit."""
    kind = Kind(1e9, 2500, 1e-3, restitution=PLATE_E)
    period = 1 / FREQUENCY
    omega = 2 * math.pi * FREQUENCY
    amplitude, phase = GAMMA * G / omega**2, landing_phase()
    # at t = 0 the plate passes the middle upwards; the ball lands when omega t = phase
    landing = phase / omega
    height, speed = amplitude * math.sin(phase), -0.5 * G * period
    start_speed = speed + G * landing
    start = height - (start_speed * landing - 0.5 * G * landing**2)
    dt = fitted(1e-4 if law else 0.1 * rayleigh(kind), period / 100)
    plate = Plane(
        name="plate",
        material=WALL,
        point=(0, 0, 0),
        normal=(0, 0, 1),
        motion=Motion(amplitude=(0, 0, amplitude), frequency=FREQUENCY),
    )
    return scene_of(
        name,
        {"grain": kind},
        [Body("grain", (0, 0, kind.radius + start), (0, 0, start_speed))],
        time_step=dt,
        times=every(period / 100, PERIODS * period),
        gravity=(0, 0, -G),
        walls=(plate,),
        law=law,
    )


def _phases(id: str, result: Result) -> dict[str, float]:
    return {id: _phase(result)}


def _phase(result: Result) -> float:
    """Largest error of the landing phase in the second half of the run, as a share of a period."""
    seen = motion(result)
    omega = 2 * math.pi * FREQUENCY
    z, v = seen.position[:, 0, 2] - 1e-3, seen.velocity[:, 0, 2]
    amplitude, errors = GAMMA * G / omega**2, []
    for k in np.flatnonzero(np.diff(v) > 0.25 * G / FREQUENCY):
        if seen.time[k] < 0.5 * seen.time[-1]:
            continue
        # the ball falls from sample k until it meets the plate
        fine = seen.time[k] + np.linspace(0, 0.01 / FREQUENCY, 2001)
        fall = z[k] + v[k] * (fine - seen.time[k]) - 0.5 * G * (fine - seen.time[k]) ** 2
        below = np.flatnonzero(fall <= amplitude * np.sin(omega * fine))
        landing = fine[below[0]] if len(below) else fine[-1]
        away = (omega * landing - landing_phase() + math.pi) % (2 * math.pi) - math.pi
        errors.append(abs(away) / (2 * math.pi))
    return max(errors) if len(errors) >= PERIODS // 2 - 1 else math.nan


# ---- D40: grids of distances


def pipe_scene(name: str, cells: int) -> Scene:
    """Spheres that roll and slide in a lying pipe: a cylinder (0 cells), or a grid with so many cells per radius."""
    kind = Kind(1e8, 2500, 0.1 * PIPE, restitution=0.5, friction=1.0)
    smooth = replace(kind, friction=0.0)
    half = 6 * kind.radius
    if cells:
        reach, spacing = 1.1 * PIPE, PIPE / cells
        wall: Cylinder | Sdf = Sdf.from_function(
            name="pipe",
            material=WALL,
            function=lambda points: PIPE - np.hypot(points[:, 0], points[:, 2]),
            lower=(-reach, -spacing, -reach),
            upper=(reach, spacing, reach),
            spacing=spacing,
        )
    else:
        wall = Cylinder(name="pipe", material=WALL, start=(0, -half, 0), end=(0, half, 0), radius=PIPE)
    arm = PIPE - kind.radius
    place = (-arm * math.sin(ROLL_ANGLE), 0, -arm * math.cos(ROLL_ANGLE))
    dt = fitted(0.1 * rayleigh(kind), 1e-3)
    scene = scene_of(
        name,
        {"rough": kind, "smooth": smooth},
        [Body("rough", place), Body("smooth", (place[0], 4 * kind.radius, place[2]))],
        time_step=dt,
        times=every(1e-3, 0.4),
        gravity=(0, 0, -G),
        walls=(wall,),
    )
    return changed(scene, domain=Domain(lower=(-2 * PIPE, -half, -2 * PIPE), upper=(2 * PIPE, half, 2 * PIPE)))


def bottom_time(result: Result) -> float:
    """Time at which the sphere passes the lowest point [s]."""
    seen = motion(result)
    x = seen.position[:, 0, 0]
    k = int(np.argmax(x >= 0))
    return float(seen.time[k - 1] - x[k - 1] * (seen.time[k] - seen.time[k - 1]) / (x[k] - x[k - 1]))


def _pipes(results: Mapping[str, Result]) -> Mapping[str, float]:
    exact = bottom_time(results["d40_0"])
    errors = {cells: abs(bottom_time(results[f"d40_{cells}"]) / exact - 1) for cells in CELLS}
    return {"D40a": errors[CELLS[-1]], "D40b": normal_error(results[f"d40_{CELLS[-1]}"])}


def normal_error(result: Result) -> float:
    """Largest angle between the force on the sphere without friction and the direction to the axis [degrees].

    The force is m (dv/dt - g) between two samples; its direction is the normal of the wall. Where it is below a tenth
    of the weight there is no contact to speak of.
    """
    seen = motion(result)
    x, v = seen.position[:, 1][:, [0, 2]], seen.velocity[:, 1][:, [0, 2]]
    force = np.diff(v, axis=0) / np.diff(seen.time)[:, None] + [0, G]
    size, middle = np.linalg.norm(force, axis=1), 0.5 * (x[1:] + x[:-1])
    inward = -middle / np.linalg.norm(middle, axis=1)[:, None]
    across = (force[:, 0] * inward[:, 1] - force[:, 1] * inward[:, 0]) / np.maximum(size, 1e-300)
    touching = (size > 0.1 * G) & (seen.time[1:] > 0.02)
    return math.degrees(float(np.arcsin(np.abs(across[touching]).max())))


def experiments() -> tuple[Experiment, ...]:
    """D39 and D40."""
    rigid = Rigid()
    return (
        *(
            on_one_scene(
                name,
                f"A ball on a plate that shakes with 1.3 g, {title} (at 4 g no period-one orbit is stable)",
                partial(plate_scene, name, law),
                partial(_phases, id),
                (at_most(id, f"{title} ball: error of the landing phase in periods", "1", 0.01, "Luck & Mehta 1993"),),
                "long",
                {"dt": "1e-4"} if law else {},
            )
            for id, name, title, law in (("D39a", "d39_soft", "soft", None), ("D39b", "d39_rigid", "rigid", rigid))
        ),
        Experiment(
            "d40_grids",
            "Rolling in a pipe on grids of 16, 32 and 64 cells per radius",
            tuple(Trial(f"d40_{cells}", partial(pipe_scene, f"d40_{cells}", cells)) for cells in (0, *CELLS)),
            _pipes,
            (
                at_most("D40a", "64 cells: error of the time to the bottom", "1", 0.01, "the cylinder", scale=1.0),
                at_most("D40b", "64 cells: error of the normal in degrees", "1", 0.5, "a smooth wall"),
            ),
            "long",
        ),
    )
