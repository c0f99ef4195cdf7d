"""Newton's cradle (SR10): a ball hits a row of four that touch, against an integral of the chain's equations.

Simultaneous collisions of soft spheres are no chain of pair collisions: the last ball leaves with 99 % of the speed for
Hertz and with less for linear springs. Source: F. Herrmann & M. Seitz 1982, doi 10.1119/1.12936.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from dembench.results import Result
from dembench.results.schema import SnapshotSeries
from dembench.scene import Scene
from dembench.verification.checks import Check, Experiment, deviation, on_one_scene
from dembench.verification.closed_forms.collisions import Contact
from dembench.verification.scenes import MOTION, Body, Kind, every, scene_of

BALLS = 5
FIRST_GAP = 0.02
"""Gap between the first ball and the row, in radii."""
LINEAR_SPEED = 1.0
ODE = "equations of motion of the chain, integrated to 1e-10"

KINDS = {
    "glass": Kind(4.8e10, 2800, 0.01, 0.20, friction=0.35),
    "limestone": Kind(2.0e10, 2500, 0.01, 0.25, friction=0.35),
}
SPEED, STEP, END = 5.0, 5e-7, 8e-4
APART = 0.05
"""Gap between the balls that meet one by one, in radii: twice the way of a ball in half a contact."""


@dataclass(frozen=True)
class Chain:
    """A row of equal balls, all but the first at rest.

    Attributes:
        mass: Of a ball [kg].
        stiffness, exponent: Force of a contact over overlap^exponent [N/m^exponent], [-].
        radius: Of a ball [m].
        speed: Of the first ball [m/s].
        gap: Gap between the others [radii].
    """

    mass: float
    stiffness: float
    exponent: float
    radius: float
    speed: float
    gap: float = 0.0

    def velocities(self, times: Sequence[float] | np.ndarray) -> np.ndarray:
        """Velocities of the balls at some times [m/s], shape (t, n): m x_i'' = F_(i-1) - F_i, F = k overlap^p."""
        gaps = np.full(BALLS - 1, self.gap * self.radius)
        gaps[0] = FIRST_GAP * self.radius

        def motion(_: float, state: np.ndarray) -> np.ndarray:
            moved, v = state[:BALLS], state[BALLS:]
            force = self.stiffness * np.maximum(-np.diff(moved) - gaps, 0) ** self.exponent
            net = np.append(0, force) - np.append(force, 0)
            return np.concatenate([v, net / self.mass])

        start = np.zeros(2 * BALLS)
        start[BALLS] = self.speed
        scale = (self.mass * self.speed**2 / self.stiffness) ** (1 / (1 + self.exponent)) / self.speed
        limits = {"rtol": 1e-10, "atol": 1e-12 * self.radius, "max_step": 0.1 * scale}
        found = solve_ivp(motion, (0, max(times)), start, method="DOP853", t_eval=np.asarray(times), **limits)
        return np.asarray(found.y[BALLS:].T)


def row(kind: str, radius: float, speed: float, start: Sequence[float], gap: float = 0.0) -> list[Body]:
    """The balls of a chain along x: radius [m], speed of the first [m/s], place of the first [m], gap [radii]."""
    places = radius * np.concatenate([[0], 2 + FIRST_GAP + (2 + gap) * np.arange(BALLS - 1)])
    return [
        Body(kind, (start[0] + float(x), start[1], start[2]), (speed if k == 0 else 0.0, 0, 0))
        for k, x in enumerate(places)
    ]


def values(letters: str, seen: SnapshotSeries, balls: slice, chain: Chain) -> dict[str, float]:
    """Deviation from the chain at all times, speed of the last ball, momentum and energy, as SR10 and a letter each."""
    v = seen.velocity[:, balls, 0]
    exact = chain.velocities(seen.time)
    found = (
        np.abs(v - exact).max() / chain.speed,
        v[-1, -1] / chain.speed,
        abs(v[-1].sum() / chain.speed - 1),
        (v[-1] ** 2).sum() / chain.speed**2,
    )
    return {f"SR10{letter}": float(value) for letter, value in zip(letters, found, strict=True)}


def checks(letters: str, name: str, chain: Chain, end: float) -> tuple[Check, ...]:
    """The checks of one chain with the ids of `values`; `end` [s] is the time of the last snapshot."""
    last = float(chain.velocities([end])[-1, -1] / chain.speed)
    title, ids = f"cradle, {name}", [f"SR10{letter}" for letter in letters]
    return (
        deviation(ids[0], f"{title}: largest deviation of a velocity", 1e-3, ODE, scene_law=True),
        Check(ids[1], f"{title}: speed of the last ball", "1", last, 1e-3, ODE, scene_law=True),
        deviation(ids[2], f"{title}: change of momentum", 1e-6, "momentum"),
        Check(ids[3], f"{title}: kinetic energy at the end", "1", 1.0, 1e-3, "energy of elastic bodies apart"),
    )


ROWS = (("abcd", "glass, touching", "glass", 0.0), ("efgh", "limestone, apart", "limestone", APART))
"""Letters of the ids, title, kind and gap [radii] of each chain."""


def chain_of(kind: str, gap: float) -> Chain:
    """A chain of a kind, with gaps [radii] between the balls at rest."""
    own = KINDS[kind]
    contact = Contact.between(own, own)
    return Chain(own.mass, contact.stiffness, 1.5, own.radius, SPEED, gap)


def scene() -> Scene:
    """The chains beside each other."""
    bodies: list[Body] = []
    for k, (_, _, kind, gap) in enumerate(ROWS):
        bodies += row(kind, KINDS[kind].radius, SPEED, (0, 0.08 * k, 0), gap)
    return scene_of("cradle", KINDS, bodies, time_step=STEP, times=every(20 * STEP, END))


def _measure(result: Result) -> Mapping[str, float]:
    seen = result.snapshots[MOTION]
    found: dict[str, float] = {}
    for k, (letters, _, kind, gap) in enumerate(ROWS):
        found |= values(letters, seen, slice(k * BALLS, (k + 1) * BALLS), chain_of(kind, gap))
    return found


def experiment() -> Experiment:
    """The chains under the law of Hertz."""
    known = [check for letters, name, kind, gap in ROWS for check in checks(letters, name, chain_of(kind, gap), END)]
    settings = {"dt": f"{STEP:g}"}
    return on_one_scene("cradle", "Newton's cradle", scene, _measure, tuple(known), settings=settings)
