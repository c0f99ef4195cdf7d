"""The laws and all pairs, written out in plain numpy: slow, without lists, units and single precision.

Formulas and signs follow LIGGGHTS (`gran model hertz tangential history`), which shares no code with the solver.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dembench.scene import LinearSpring, Plane, Scene


class AllPairs:
    """Spheres of one material and planes: velocity Verlet, forces at the half-step velocities, all pairs in every step.

    Attributes:
        x, v, w: Positions [m], velocities [m/s], spins [rad/s], shape (n, 3).
        touching: Pairs (i, j) that touch, i < j, shape (k, 2).
    """

    def __init__(self, scene: Scene, dt: float):
        self.dt, self.gravity = dt, np.array(scene.gravity)
        self.x, self.v = scene.bodies.position.copy(), scene.bodies.velocity.copy()
        self.w = scene.bodies.angular_velocity.copy()
        self.r, self.m = scene.radii(), scene.masses()
        self.inertia = 0.4 * self.m * self.r**2
        variant = getattr(scene.law, "variant", "")
        self.rescaled, self.no_tension = variant == "rescaled", variant == "no-tension"
        self.linear = scene.law if isinstance(scene.law, LinearSpring) else None
        material, law = scene.materials[0], scene.pair_laws[0]
        shear = material.young / (2 * (1 + material.poisson))
        self.young = 1 / (2 * (1 - material.poisson**2) / material.young)
        self.shear = 1 / (2 * (2 - material.poisson) / shear)
        self.beta = np.log(law.restitution) / np.sqrt(np.log(law.restitution) ** 2 + np.pi**2)
        self.mu = law.friction
        n = len(self.x)
        self.i, self.j = np.triu_indices(n, 1)
        self.planes = [(np.array(p.point), np.array(p.normal)) for p in scene.walls if isinstance(p, Plane)]
        self.xi = np.zeros((len(self.i), 3))
        self.xi_plane = np.zeros((len(self.planes), n, 3))
        self.touching = np.empty((0, 2), int)
        self.force, self.torque = self._loads(0.0)

    def step(self, n: int = 1) -> None:
        """Makes n steps."""
        for _ in range(n):
            self._kick()
            self.x += self.dt * self.v
            self.force, self.torque = self._loads(self.dt)
            self._kick()

    def _kick(self) -> None:
        self.v += 0.5 * self.dt * (self.force / self.m[:, None] + self.gravity)
        self.w += 0.5 * self.dt * self.torque / self.inertia[:, None]

    def _loads(self, dt: float) -> tuple[np.ndarray, np.ndarray]:
        force, torque = np.zeros_like(self.x), np.zeros_like(self.x)
        d = self.x[self.i] - self.x[self.j]
        length = np.linalg.norm(d, axis=1)
        overlap = self.r[self.i] + self.r[self.j] - length
        hit = overlap > 0
        self.xi[~hit] = 0
        i, j, overlap = self.i[hit], self.j[hit], overlap[hit]
        self.touching = np.stack([i, j], axis=1)
        n = d[hit] / length[hit, None]
        reduced = self.r[i] * self.r[j] / (self.r[i] + self.r[j])
        mass = self.m[i] * self.m[j] / (self.m[i] + self.m[j])
        li, lj = self._lever(self.r[i], overlap), self._lever(self.r[j], overlap)
        s = li[:, None] * self.w[i] + lj[:, None] * self.w[j]
        f, ft, self.xi[hit] = self._law(n, overlap, self.v[i] - self.v[j], s, self.xi[hit], reduced, mass, dt)
        turn = np.cross(n, ft)
        np.add.at(force, i, f)
        np.add.at(force, j, -f)
        np.add.at(torque, i, -li[:, None] * turn)
        np.add.at(torque, j, -lj[:, None] * turn)
        for k, (point, normal) in enumerate(self.planes):
            overlap = self.r - (self.x - point) @ normal
            hit = overlap > 0
            self.xi_plane[k][~hit] = 0
            n = np.broadcast_to(normal, (int(hit.sum()), 3))
            lever = self._lever(self.r[hit], overlap[hit])[:, None]
            f, ft, self.xi_plane[k][hit] = self._law(
                n, overlap[hit], self.v[hit], lever * self.w[hit], self.xi_plane[k][hit], self.r[hit], self.m[hit], dt
            )
            force[hit] += f
            torque[hit] -= lever * np.cross(n, ft)
        return force, torque

    def _lever(self, radius: np.ndarray, overlap: np.ndarray) -> np.ndarray:
        return radius if self.rescaled else radius - overlap / 2

    def _law(
        self, n: Any, overlap: Any, v: Any, s: Any, xi: Any, radius: Any, mass: Any, dt: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        kn, st, gn, gt = self.coefficients(overlap, radius, mass)
        vn = (v * n).sum(axis=1)
        vt = v - vn[:, None] * n - np.cross(s, n)
        fn = kn * overlap - gn * vn
        fn = np.maximum(fn, 0) if self.no_tension else fn
        if self.rescaled:
            flat = xi - (xi * n).sum(axis=1)[:, None] * n
            old, new = np.linalg.norm(xi, axis=1), np.linalg.norm(flat, axis=1)
            xi = flat * np.divide(old, new, out=np.ones_like(old), where=new > 0)[:, None] + vt * dt
        else:
            xi = xi + vt * dt
            xi = xi - (xi * n).sum(axis=1)[:, None] * n
        spring = st * np.linalg.norm(xi, axis=1)
        bound = self.mu * np.abs(fn)
        slides = spring > bound
        xi = xi * np.where(slides, bound / np.where(slides, spring, 1), 1)[:, None]
        ft = -st[:, None] * xi - np.where(slides, 0, gt)[:, None] * vt
        return fn[:, None] * n + ft, ft, xi

    def coefficients(self, overlap: Any, radius: Any, mass: Any) -> tuple[Any, Any, Any, Any]:
        """Normal and tangential force per displacement and dashpots at an overlap; reduced radius and mass."""
        if self.linear:
            kn, st = (k + 0 * overlap for k in (self.linear.normal_stiffness, self.linear.tangential_stiffness))
            return kn, st, -2 * self.beta * np.sqrt(kn * mass), -2 * self.beta * np.sqrt(st * mass)
        a = np.sqrt(radius * overlap)
        sn, st = 2 * self.young * a, 8 * self.shear * a
        c = -2 * np.sqrt(5 / 6) * self.beta
        return 2 / 3 * sn, st, c * np.sqrt(sn * mass), c * np.sqrt(st * mass)
