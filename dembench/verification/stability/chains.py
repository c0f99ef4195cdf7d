"""Chains: D31 and D37."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp

from dembench.results import Result
from dembench.scene import Domain, Plane, Rigid, Scene
from dembench.scene.materials import Law
from dembench.verification.checks import Check, Experiment, at_most, on_one_scene
from dembench.verification.scenes import WALL, Body, Kind, every, scene_of
from dembench.verification.stability.common import (
    changed,
    closed_step,
    contact_time,
    fitted,
    motion,
    rayleigh,
)

RADIUS = 0.01

BALLS, GAPS, SENT = 5, (0.0, 1e-3), (1, 2, 3)
"""Balls of a cradle, gaps in diameters, and how many balls come in."""
CRADLE_SPEED = 1.0

CHAIN, SQUEEZE = 100, 2e-3
"""Spheres of the chain and its overlap in radii."""
PULSE, PULSE_WIDTH = 1e-4, 6.0
"""Speed in that of the wave, and width in diameters."""

# ---- D31: cradle


def cradle_scene(name: str, law: Law | None) -> Scene:
    """Six cradles beside each other: touching and with gaps; one, two and three balls come in."""
    kind = Kind(1e9, 2500, RADIUS)
    bodies = []
    for k, (gap, sent) in enumerate((gap, sent) for gap in GAPS for sent in SENT):
        pitch, away = 2 * RADIUS * (1 + gap), 0.2 * RADIUS
        for j in range(BALLS):
            coming = j < sent
            bodies.append(Body("grain", (pitch * j - away * coming, 5 * RADIUS * k, 0), (CRADLE_SPEED * coming, 0, 0)))
    dt = 1e-5 if law else fitted(contact_time(kind, CRADLE_SPEED) / 100, 1e-3)
    return scene_of(name, {"grain": kind}, bodies, time_step=dt, times=[0, 0.02], law=law)


def chain_velocities(position: np.ndarray, velocity: np.ndarray, kind: Kind, time: np.ndarray) -> np.ndarray:
    """Velocities of a chain of elastic spheres at some times [m/s], from its equations of motion, shape (t, n)."""
    k = 4 / 3 * kind.modulus / 2 * math.sqrt(kind.radius / 2) / kind.mass
    n = len(position)

    def rate(_t: float, y: np.ndarray) -> np.ndarray:
        push = k * np.maximum(0.0, 2 * kind.radius - np.diff(y[:n])) ** 1.5
        return np.concatenate([y[n:], np.append(0.0, push) - np.append(push, 0.0)])

    start = np.concatenate([position, velocity])
    end = float(time[-1])
    found = solve_ivp(rate, (0, end), start, t_eval=time, method="DOP853", rtol=1e-9, atol=1e-12, max_step=end / 500)
    return np.asarray(found.y[n:].T)


def _cradles(result: Result) -> tuple[np.ndarray, float, float]:
    """Velocities of all cradles at the end [m/s], shape (6, 5); errors of momentum and energy, relative."""
    seen, groups = motion(result), len(GAPS) * len(SENT)
    v0, v = (seen.velocity[k, :, 0].reshape(groups, BALLS) for k in (0, -1))
    momentum = np.abs(v.sum(axis=1) / v0.sum(axis=1) - 1).max()
    energy = np.abs((v**2).sum(axis=1) / (v0**2).sum(axis=1) - 1).max()
    return v, float(momentum), float(energy)


def _soft_cradle(result: Result) -> Mapping[str, float]:
    v, momentum, energy = _cradles(result)
    seen, kind = motion(result), Kind(1e9, 2500, RADIUS)
    groups = len(v)
    x0, v0 = (field[0, :, 0].reshape(groups, BALLS) for field in (seen.position, seen.velocity))
    exact = np.array([chain_velocities(x0[k], v0[k], kind, seen.time)[-1] for k in range(groups)])
    return {"D31a": float(np.abs(v - exact).max() / CRADLE_SPEED), "D31b": momentum, "D31c": energy}


def _rigid_cradle(result: Result) -> Mapping[str, float]:
    v, momentum, energy = _cradles(result)
    exact = np.array([[float(j >= BALLS - sent) for j in range(BALLS)] for _ in GAPS for sent in SENT])
    return {"D31d": float(np.abs(v / CRADLE_SPEED - exact).max()), "D31e": momentum, "D31f": energy}


# ---- D37: waves in a chain


def _chain_kind() -> Kind:
    return Kind(1e9, 2500, RADIUS)


def wave_speed() -> float:
    """Speed of long waves in the squeezed chain [m/s]: d sqrt(k/m), k = 2 E* sqrt(R* a)."""
    kind = _chain_kind()
    stiffness = kind.modulus * math.sqrt(kind.radius / 2 * SQUEEZE * kind.radius)
    return kind.radius * (2 - SQUEEZE) * math.sqrt(stiffness / kind.mass)


def chain_scene(name: str, squeezed: bool) -> Scene:
    """A chain between two walls with a pulse in it, or a free one whose first sphere is struck."""
    kind, count = _chain_kind(), CHAIN
    pitch = kind.radius * (2 - (SQUEEZE if squeezed else 0.0))
    place = pitch * np.arange(count)
    walls: tuple[Plane, ...] = ()
    if squeezed:
        c = wave_speed()
        velocity = PULSE * c * np.exp(-0.5 * ((np.arange(count) - 30) / PULSE_WIDTH) ** 2)
        # the walls press as hard as a sphere does: their contact is stiffer by sqrt(8), so its overlap is half as deep
        wall = kind.radius * (1 - 0.5 * SQUEEZE)
        walls = (
            Plane(name="left", material=WALL, point=(-wall, 0, 0), normal=(1, 0, 0)),
            Plane(name="right", material=WALL, point=(float(place[-1]) + wall, 0, 0), normal=(-1, 0, 0)),
        )
        end = 50 * pitch / c
    else:
        velocity = np.zeros(count)
        velocity[0] = 1.0
        end = 0.01
    dt = fitted(0.05 * rayleigh(kind), end / 200)
    scene = scene_of(
        name,
        {"grain": kind},
        [Body("grain", (x, 0, 0), (v, 0, 0)) for x, v in zip(place, velocity, strict=True)],
        time_step=dt,
        times=every(end / 200, end),
        walls=walls,
    )
    room = Domain(lower=(-0.1, -0.1, -0.1), upper=(float(place[-1]) + 1, 0.1, 0.1))
    return changed(scene, domain=room)


def arrival(time: np.ndarray, signal: np.ndarray) -> float:
    """Time of the first peak above half of the largest value [s], by a parabola through three samples."""
    k = int(np.argmax(signal))
    if not 0 < k < len(signal) - 1:
        return math.nan
    a, b, c = signal[k - 1 : k + 2]
    return float(time[k] + 0.5 * (a - c) / (a - 2 * b + c) * (time[1] - time[0]))


def _pulse_speed(time: np.ndarray, velocity: np.ndarray, first: int, last: int, pitch: float) -> float:
    return (last - first) * pitch / (arrival(time, velocity[:, last]) - arrival(time, velocity[:, first]))


def _wave(result: Result) -> Mapping[str, float]:
    seen = motion(result)
    pitch = RADIUS * (2 - SQUEEZE)
    speed = _pulse_speed(seen.time, seen.velocity[:, :, 0], 45, 70, pitch)
    return {"D37a": speed / wave_speed()}


def _solitary(result: Result) -> Mapping[str, float]:
    seen = motion(result)
    start = seen.position[0, :, 0], seen.velocity[0, :, 0]
    exact = chain_velocities(*start, _chain_kind(), seen.time)
    pitch = 2 * RADIUS
    own = _pulse_speed(seen.time, seen.velocity[:, :, 0], 20, 60, pitch)
    return {"D37b": own / _pulse_speed(seen.time, exact, 20, 60, pitch)}


def experiments() -> tuple[Experiment, ...]:
    """D31 and D37."""
    rigid = Rigid()
    return (
        on_one_scene(
            "d31_soft",
            "Cradles of five soft balls",
            partial(cradle_scene, "d31_soft", None),
            _soft_cradle,
            (
                at_most(
                    "D31a", "soft cradles: error of a velocity", "1", 1e-3, "equations of the chain", scene_law=True
                ),
                at_most("D31b", "soft cradles: error of the momentum", "1", 1e-6, "momentum"),
                at_most("D31c", "soft cradles: error of the energy", "1", 1e-3, "energy", scale=1.0),
            ),
            "long",
            closed_step(partial(cradle_scene, "d31_soft", None)),
        ),
        on_one_scene(
            "d31_rigid",
            "Cradles of five rigid balls",
            partial(cradle_scene, "d31_rigid", rigid),
            _rigid_cradle,
            (
                at_most("D31d", "rigid cradles: deviation from n out for n in", "1", 1e-3, "successive impacts"),
                at_most("D31e", "rigid cradles: error of the momentum", "1", 1e-6, "momentum"),
                at_most("D31f", "rigid cradles: error of the energy", "1", 1e-3, "energy", scale=1.0),
            ),
            "long",
            {"dt": "1e-5"},
        ),
        on_one_scene(
            "d37_wave",
            "A pulse in a squeezed chain of 100",
            partial(chain_scene, "d37_wave", True),
            _wave,
            (Check("D37a", "speed of a pulse in d sqrt(k/m)", "1", 1.0, 0.01, "long waves", scene_law=True),),
            "long",
            closed_step(partial(chain_scene, "d37_wave", True)),
        ),
        on_one_scene(
            "d37_solitary",
            "A solitary wave in a free chain of 100",
            partial(chain_scene, "d37_solitary", False),
            _solitary,
            (
                Check(
                    "D37b",
                    "speed of a solitary wave in that of the ODE",
                    "1",
                    1.0,
                    0.01,
                    "the chain",
                    scene_law=True,
                ),
            ),
            "long",
            closed_step(partial(chain_scene, "d37_solitary", False)),
        ),
    )
