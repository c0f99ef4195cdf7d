"""One impact in continuous time: the ordinary differential equations of a law, which the solver tends to."""

from __future__ import annotations

from typing import Any

import numpy as np
from reference import AllPairs
from scipy.integrate import solve_ivp

from dembench.scene import Scene


class Impact:
    """Impact of grain i on grain j, or on the plane z = 0, in the plane y = 0 and without gravity.

    There the history neither turns out of the contact nor changes its length, so that its variants differ by their
    lever alone. The unknowns: relative position (0, 1) and velocity (2, 3) in x and z, spins about y (4, 5),
    tangential spring (6).

    Attributes:
        velocity: Relative velocity (x, z) [m/s] when they part.
        spins: Spins about y of i and j [rad/s] when they part.
        stuck: Share of the contact time without slip.
    """

    def __init__(self, scene: Scene, i: int, j: int | None = None):
        self.law = law = AllPairs(scene, 0.0)
        self.plane = j is None
        r, m = law.r, law.m
        plane = ([0.0, 0.0], [0.0, 0.0], 0.0, 0.0, np.inf)
        x, v, w, rj, mj = plane if j is None else (law.x[j, ::2], law.v[j, ::2], law.w[j, 1], r[j], m[j])
        self.ri, self.rj, self.mass = r[i], rj, 1 / (1 / m[i] + 1 / mj)
        self.radius = r[i] if j is None else r[i] * rj / (r[i] + rj)
        self.inertia = np.array([0.4 * m[i] * r[i] ** 2, np.inf if j is None else 0.4 * mj * rj**2])
        y = np.array([*(law.x[i, ::2] - x), *(law.v[i, ::2] - v), law.w[i, 1], w, 0.0])
        # free flight until they touch: the smaller root of |x + v t| = reach
        a, b, c = y[2:4] @ y[2:4], y[:2] @ y[2:4], y[:2] @ y[:2] - (self.ri + rj) ** 2
        flight = (self.ri - y[1]) / y[3] if self.plane else (-b - np.sqrt(b * b - a * c)) / a
        y[:2] += flight * y[2:4]
        self.velocity, self.spins, self.stuck = self._solve(y)

    def _contact(self, y: np.ndarray) -> tuple[Any, ...]:
        """Normal, normal force, largest shear spring, its stiffness and dashpot, slip and lever arms."""
        n = np.array([0.0, 1.0]) if self.plane else y[:2] / np.hypot(*y[:2])
        overlap = max(self._overlap(y), 1e-12 * self.radius)
        kn, st, gn, gt = self.law.coefficients(overlap, self.radius, self.mass)
        fn = kn * overlap - gn * float(y[2:4] @ n)
        arms = np.array([self.ri, self.rj])
        if not self.law.rescaled:
            arms = arms - overlap / 2 * np.array([1, not self.plane])
        slip = float(y[2] * n[1] - y[3] * n[0]) - float(arms @ y[4:6])
        return n, fn, self.law.mu * abs(fn) / st, st, gt, slip, arms

    def _hold(self, y: np.ndarray) -> float:
        """Falls to 0 where they part: the overlap, or without tension the normal force, which then stays 0."""
        return float(self._contact(y)[1]) if self.law.no_tension else self._overlap(y)

    def _overlap(self, y: np.ndarray) -> float:
        return float(self.ri - y[1] if self.plane else self.ri + self.rj - np.hypot(*y[:2]))

    def _slope(self, y: np.ndarray, side: int) -> np.ndarray:
        """Rates while sticking (side 0) or while slipping with the spring at its bound on one side (1, -1)."""
        n, fn, bound, st, gt, slip, arms = self._contact(y)
        ft = -st * side * bound if side else -st * y[6] - gt * slip
        pull = (fn * n + ft * np.array([n[1], -n[0]])) / self.mass
        return np.array([*y[2:4], *pull, *(-arms * ft / self.inertia), slip])

    def _excess(self, y: np.ndarray, side: int) -> float:
        """How much faster the spring would grow than its bound."""
        slope = self._slope(y, side)
        h = 1e-6 * self.radius / np.hypot(*slope[:2])
        ahead, behind = (self._contact(y + k * h * slope)[2] for k in (1, -1))
        return float(side * slope[6] - (ahead - behind) / (2 * h))

    def _solve(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        speed = float(np.hypot(*y[2:4]))
        length = 1e-3 * self.radius
        scale = np.array([length, length, speed, speed, speed / self.ri, speed / self.ri, length])
        y[:2] += 1e-6 * length / speed * y[2:4]
        slip, bound = self._contact(y)[5], self._contact(y)[2]
        side = int(np.sign(slip)) if abs(slip) * 1e-6 * length / speed > bound else 0
        spent = {True: 0.0, False: 0.0}
        while True:
            events = [
                lambda _t, y: -self._hold(y),
                (lambda _t, y, s=side: self._excess(y, s)) if side else (lambda _t, y: abs(y[6]) - self._contact(y)[2]),
            ]
            for event, direction in zip(events, (1, -1 if side else 1), strict=True):
                event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
            found = solve_ivp(
                lambda _t, y, s=side: self._slope(y, s),
                (0, 1.0),
                y,
                events=events,
                rtol=1e-8,
                atol=1e-8 * scale,
                max_step=5 * length / speed,
            )
            y = found.y[:, -1]
            spent[side == 0] += float(found.t[-1])
            if len(found.t_events[0]):
                return y[2:4], y[4:6], spent[True] / sum(spent.values())
            y[6] = side * self._contact(y)[2] if side else y[6]
            side = 0 if side else int(np.sign(y[6]))
