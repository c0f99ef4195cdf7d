"""Small problems with closed forms for sweeps: many copies that meet the grid of steps at different phases.

A single collision meets a grid of steps by chance, and its error jumps about from step to step. Root mean squares over
copies that touch at different times fall as the order of the method says.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from dembench.results import Result
from dembench.scene import Bodies, Domain, Material, PairLaw, Plane, Scene, Snapshot, Species
from dembench.verification.checks import Check, Experiment, Suite, on_one_scene
from dembench.verification.laws import damping_ratio

RADIUS, DENSITY, POISSON = 5e-3, 2500.0, 0.3
ROWS, SPEED, YOUNG = 16, 2.0, 1e8
"""Rows of as many head-on pairs, their relative speed [m/s] and Young's modulus [Pa]."""
PAIRS = ROWS**2
RESTITUTION = 0.5
BALLS, FLOOR_YOUNG, FRICTION, GRAVITY = 8, 1e7, 0.3, 9.81
BALL_MASS = DENSITY * 4 / 3 * math.pi * RADIUS**3
SUNK = (BALL_MASS * GRAVITY / (4 / 3 * FLOOR_YOUNG / (2 * (1 - POISSON**2)) * math.sqrt(RADIUS))) ** (2 / 3)
"""Overlap of a ball at rest with the floor [m]."""
SPEEDS = np.linspace(0.15, 0.25, BALLS)
"""Speeds at which the balls begin to slide [m/s]."""
SLIDING = 0.06
"""Duration of the sliding: all balls roll after 2 v/(7 mu g) = 24 ms [s]."""
END = "end"
GOLDEN = 0.5 * (math.sqrt(5) - 1)


@dataclass(frozen=True)
class Collision:
    """A head-on collision under the scene's law, in its relative coordinate.

    Attributes:
        duration: From the first touch to the end of the overlap [s].
        restitution: Speed after over speed before [-].
    """

    duration: float
    restitution: float


def collision(restitution: float) -> Collision:
    """The collision of the pairs, by Hertz (1882) without damping, else integrated to 1e-10.

    m* x'' = -(4/3) E* sqrt(R*) x^(3/2) - 2 sqrt(5/6) b sqrt(S m*) x', S = 2 E* sqrt(R* x), from touch to the end of the
    overlap: the dashpot of Tsuji et al. 1992, for which D. Antypov & J. A. Elliott 2011, EPL 94, 50004 have shown that
    the restitution is that of the pair law.
    """
    mass, radius = 0.5 * DENSITY * 4 / 3 * math.pi * RADIUS**3, 0.5 * RADIUS
    young = YOUNG / (2 * (1 - POISSON**2))
    stiffness = 4 / 3 * young * math.sqrt(radius)
    deepest = (1.25 * mass * SPEED**2 / stiffness) ** 0.4
    elastic = 2 * math.sqrt(math.pi) * math.gamma(1.4) / (math.gamma(0.9)) * deepest / SPEED
    if restitution == 1:
        return Collision(elastic, 1.0)
    damping = float(damping_ratio(restitution))

    def motion(_: float, state: np.ndarray) -> list[float]:
        x, v = max(state[0], 0.0), state[1]
        dashpot = 2 * math.sqrt(5 / 6) * damping * math.sqrt(2 * young * math.sqrt(radius * x) * mass)
        return [v, -(stiffness * x**1.5 + dashpot * v) / mass]

    def parted(t: float, state: np.ndarray) -> float:
        return float(state[0]) if t > 0.1 * elastic else 1.0

    parted.terminal = True  # type: ignore[attr-defined]
    limits = {"rtol": 1e-11, "atol": 1e-16}
    found = solve_ivp(motion, (0, 3 * elastic), [0.0, SPEED], method="DOP853", events=parted, **limits)
    return Collision(float(found.t_events[0][0]), float(-found.y_events[0][0][1] / SPEED))


def gaps() -> np.ndarray:
    """Gaps of the pairs at the start, spread over a contact time without a period in common [m], shape (PAIRS,)."""
    phases = np.mod(GOLDEN * np.arange(PAIRS), 1.0)
    return np.asarray(SPEED * collision(1.0).duration * (0.2 + 0.5 * phases))


def bounce(restitution: float, name: str) -> Scene:
    """Pairs of spheres that meet head-on without gravity, a contact time of the elastic ones over 50 a step."""
    apart, contact = gaps(), collision(1.0).duration
    half = RADIUS + 0.5 * apart
    y, z = 3 * RADIUS * np.stack(np.divmod(np.arange(PAIRS), ROWS))
    position = np.stack([np.stack([side * half, y, z], axis=1) for side in (-1, 1)], axis=1)
    velocity = np.stack([np.tile([-side * 0.5 * SPEED, 0, 0], (PAIRS, 1)) for side in (-1, 1)], axis=1)
    duration = 3 * contact
    return Scene(
        name=name,
        materials=(Material(name="glass", density=DENSITY, young=YOUNG, poisson=POISSON),),
        pair_laws=(PairLaw(a="glass", b="glass", restitution=restitution, friction=0),),
        species=(Species(name="sphere", material="glass", radius=RADIUS),),
        bodies=Bodies(position=position.reshape(-1, 3), velocity=velocity.reshape(-1, 3)),
        domain=Domain(lower=(-0.03, -0.03, -0.03), upper=(0.03, float(y[-1]) + 0.03, float(z[-1]) + 0.03)),
        gravity=(0, 0, 0),
        duration=duration,
        time_step=contact / 50,
        observables=(Snapshot(name=END, times=(0.0, duration)),),
    )


def rebounds(result: Result) -> tuple[np.ndarray, np.ndarray]:
    """Restitution [-] and contact time [s] of every pair, from the state at the end, shape (PAIRS,)."""
    seen = result.snapshots[END]
    x, v = seen.position[-1, :, 0].reshape(-1, 2), seen.velocity[-1, :, 0].reshape(-1, 2)
    speed, apart = v[:, 1] - v[:, 0], x[:, 1] - x[:, 0] - 2 * RADIUS
    return speed / SPEED, result.scene.duration - gaps() / SPEED - apart / speed


def _bounced(restitution: float, prefix: str) -> Callable[[Result], Mapping[str, float]]:
    exact = collision(restitution)

    def measure(result: Result) -> Mapping[str, float]:
        found, duration = rebounds(result)
        return {
            f"{prefix}_restitution": _rms(found / exact.restitution - 1),
            f"{prefix}_duration": _rms(duration / exact.duration - 1),
        }

    return measure


def slide() -> Scene:
    """Balls that start to slide on a plane, at rest on it but for their speed along x.

    Without dashpots: that of the reference law is not bounded by friction before the shear spring has grown to the
    bound, and takes 0.5 % of the speed within the first 10 us.
    """
    position = [[0, 3 * RADIUS * k, RADIUS - SUNK] for k in range(BALLS)]
    return Scene(
        name="sliding_ball",
        materials=(Material(name="glass", density=DENSITY, young=FLOOR_YOUNG, poisson=POISSON),),
        pair_laws=(PairLaw(a="glass", b="glass", restitution=1, friction=FRICTION),),
        species=(Species(name="ball", material="glass", radius=RADIUS),),
        walls=(Plane(name="floor", material="glass", point=(0, 0, 0), normal=(0, 0, 1)),),
        bodies=Bodies(position=position, velocity=[[v, 0, 0] for v in SPEEDS]),
        domain=Domain(lower=(-0.02, -0.02, -0.01), upper=(0.04, 3 * RADIUS * BALLS + 0.02, 0.03)),
        gravity=(0, 0, -GRAVITY),
        duration=SLIDING,
        time_step=2e-5,
        observables=(Snapshot(name=END, times=(0.0, 0.5 * SLIDING, SLIDING)),),
    )


def rolled() -> tuple[np.ndarray, np.ndarray]:
    """Speeds while rolling [m/s] and ways to the end [m] of the balls by Coulomb's law, shape (BALLS,).

    Friction acts at the lever l = R - overlap/2 of the law: slip ends after v/(mu g (1 + q)), q = m l^2/I,
    at the speed q/(1 + q) v; 5/7 of it for a rigid ball.
    """
    q = 2.5 * (1 - 0.5 * SUNK / RADIUS) ** 2
    slipping = SPEEDS / (FRICTION * GRAVITY * (1 + q))
    speed = q / (1 + q) * SPEEDS
    return speed, (SPEEDS - 0.5 * FRICTION * GRAVITY * slipping) * slipping + speed * (SLIDING - slipping)


def _slid(result: Result) -> Mapping[str, float]:
    seen = result.snapshots[END]
    speed, way = rolled()
    half, end = seen.position[-2:, :, 0]
    return {
        "slide_speed": _rms((end - half) / (0.5 * SLIDING) / speed - 1),
        "slide_way": _rms(end / way - 1),
    }


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _deviation(name: str, title: str, tolerance: float, source: str) -> Check:
    return Check(name, title, "1", 0.0, tolerance, source, scene_law=True, scale=1.0)


def suite() -> Suite:
    """The problems, as experiments that a sweep takes by name."""
    hertz = "Hertz 1882: v after = v before, t = 2.943 d/v with the largest overlap d"
    dashpot = "pair law; Antypov & Elliott 2011, EPL 94, 50004; duration integrated to 1e-10"
    rolling = "Coulomb friction at the lever of the law: rolling at 5/7 of the speed after 2 v/(7 mu g), nearly"

    def pairs(name: str, title: str, e: float, source: str) -> Experiment:
        checks = (
            _deviation(f"{name}_restitution", "Restitution, rms deviation of 256 pairs", 0.01, source),
            _deviation(f"{name}_duration", "Contact time, rms deviation of 256 pairs", 0.01, source),
        )
        return on_one_scene(name, title, lambda: bounce(e, name), _bounced(e, name), checks, "long")

    balls = (
        _deviation("slide_speed", "Mean speed while rolling, rms deviation of 8 balls", 0.01, rolling),
        _deviation("slide_way", "Way to the end, rms deviation of 8 balls", 0.01, rolling),
    )
    return Suite(
        name="precision",
        title="Problems for sweeps",
        text="Copies of one problem that meet the grid of steps at different phases.",
        source="closed forms",
        experiments=(
            pairs("hertz_bounce", "Elastic Hertz collision", 1.0, hertz),
            pairs("damped_bounce", "Damped Hertz collision, e = 0.5", RESTITUTION, dashpot),
            on_one_scene("sliding_ball", "A ball slides, then rolls", slide, _slid, balls, "long"),
        ),
    )
